"""Two recordings mixed into one log, as sorting the rows does after a clock that started again.

Where the recordings overlap, two records come in the time of one. A log whose rate was changed
looks the same. Neither has one even clock.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.units import FloatArray, format_span

_BLOCK = 32  # records; jitter and single lost samples change its mean spacing by a few percent
_TOLERANCE = 0.08  # of the mean spacing of a block
_MIN_BLOCKS = 3  # of each spacing: 1 s at 100 Hz
_NUMBERS = {2: "two", 3: "three", 4: "four"}
_MOST_MIXED = max(_NUMBERS)  # recordings
_MAX_CHANGES = 6  # of the spacing; the records of a sensor that sends groups change it all the time
_MAX_OTHER = (
    0.05  # share of blocks with another spacing (gaps); those at the changes are allowed too
)


class RecordSpacing:
    """The mean spacing of the records of a log, block by block."""

    def __init__(self, time: FloatArray | None = None) -> None:
        self._start: list[FloatArray] = []
        self._spacing: list[FloatArray] = []
        self._end = 0.0
        if time is not None:
            self.add(time)

    def add(self, time: FloatArray) -> None:
        """Take the stamps (n,), s, that follow."""
        edges = time[::_BLOCK]
        if len(edges) > 1:
            self._start.append(edges[:-1].copy())
            self._spacing.append(np.diff(edges) / _BLOCK)
            self._end = float(edges[-1])

    def finding(self) -> str:
        """Return what is mixed and what to do, or "" for a log of one recording at one rate."""
        spacing = np.concatenate([*self._spacing, np.zeros(0)])
        usual = float(np.median(spacing)) if len(spacing) else 0.0
        if usual <= 0.0 or spacing.max() < (2.0 - 2.0 * _TOLERANCE) * spacing.min():
            return ""
        edges = np.append(np.concatenate(self._start), self._end)
        for times in range(1, _MOST_MIXED + 1):
            count = _recordings(spacing, times * usual)
            if count is not None:
                interval = float(np.median(spacing[count == 1]))
                return _describe(count, interval, edges)
        return ""


def _recordings(spacing: FloatArray, interval: float) -> NDArray[np.int64] | None:
    """Return how many recordings of an interval are in each block (n,), 0 unclear, or None."""
    ratio = interval / np.maximum(spacing, 1e-3 * interval)
    count = np.rint(ratio).astype(np.int64)
    known = (np.abs(ratio - count) < _TOLERANCE * count) & (count >= 1) & (count <= _MOST_MIXED)
    if (
        np.count_nonzero(known & (count == 1)) < _MIN_BLOCKS
        or np.count_nonzero(known & (count > 1)) < _MIN_BLOCKS
        or np.count_nonzero(np.diff(count[known])) > _MAX_CHANGES
        or np.count_nonzero(~known) > _MAX_OTHER * len(known) + _MAX_CHANGES
    ):
        return None
    return np.where(known, count, 0)


def _describe(count: NDArray[np.int64], interval: float, edges: FloatArray) -> str:
    """Return the finding of blocks with count (n,) recordings between edges (n + 1,), s."""
    mixed, alone = _parts(count > 1, edges), _parts(count == 1, edges)
    if not mixed or not alone:
        return ""
    places = ", ".join(format_span(*part) for part in mixed)
    longest = max(alone, key=lambda part: part[1] - part[0])
    most = int(count.max())
    return (
        f"{most} records every {interval:.6g} s in {places}, one elsewhere: {_NUMBERS[most]} "
        "recordings are mixed (the clock started again, and the rows are in the order of time), or "
        "the rate was changed; split the log there, in the order in which it was recorded. Of this "
        f"file only a part like {format_span(*longest)} can be used alone"
    )


def _parts(which: NDArray[np.bool_], edges: FloatArray) -> list[tuple[float, float]]:
    """Return the parts (start, end), s, of the blocks (n,) that are true, without single blocks."""
    padded = np.concatenate([[False], which, [False]])
    first = np.flatnonzero(~padded[:-1] & padded[1:])
    last = np.flatnonzero(padded[:-1] & ~padded[1:])
    return [
        (float(edges[a]), float(edges[b])) for a, b in zip(first, last, strict=True) if b > a + 1
    ]
