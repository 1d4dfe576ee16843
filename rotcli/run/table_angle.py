"""Table angle between the records of a table log."""

from collections import deque
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.record import TableLog
from rotcli.units import FloatArray, format_span

_PADDING_RECORDS = 8  # records on either side of the requested ones: more than six points need
# times the median spacing: a longer step between records is a gap, which is interpolated linearly
_GAP_FACTOR = 2.5
_FEW = 100  # records for each of a few times, of which most are left out
_POINTS = 6
# Records of a table log whose differences are kept for the next call: an hour and a half at 50 Hz.
_MAX_KEPT_RECORDS = 300_000
# A navigation asks for the angles of its window twice, and for those of a still segment between:
# the last two of so many samples are kept.
_MIN_KEPT = 4096
_kept: deque[tuple[TableLog, FloatArray, FloatArray]] = deque(maxlen=2)


def angle_at(table: TableLog, time: FloatArray) -> FloatArray:
    """Return the table angle (n,), rad, at times (n,), s.

    Six-point Lagrange interpolation between the logged angles, fewer where the log has fewer;
    straight lines across gaps; beyond the log's ends, by one table interval at most, the cubic
    through the last four records.

    Raises LogError when the times reach farther.
    """
    if len(time) < _MIN_KEPT:
        return _angle_at(table, time)
    for kept, at, angle in _kept:
        if kept is table and np.array_equal(at, time):
            return angle.copy()
    angle = _angle_at(table, time)
    _kept.append((table, time.copy(), angle.copy()))
    return angle


def _angle_at(table: TableLog, time: FloatArray) -> FloatArray:
    """Return what `angle_at` does."""
    t = table.time
    low, high = float(time[0]), float(time[-1])
    if low < t[0] - table.interval or high > t[-1] + table.interval:
        message = (
            f"the table log covers {format_span(t[0], t[-1])}, but its angle is needed from "
            f"{format_span(low, high)}; check [table] time_offset, or use a shorter window"
        )
        raise LogError(table.path, message)
    if len(t) <= _MAX_KEPT_RECORDS:
        return _records(table).at(time)
    near = slice(
        max(int(np.searchsorted(t, low)) - _PADDING_RECORDS, 0),
        int(np.searchsorted(t, high)) + _PADDING_RECORDS,
    )
    t, angle = t[near], table.angle[near]
    if len(time) * _FEW < len(t):
        t, angle = _around(t, angle, time)
    return _Records(t, angle, table.interval).at(time)


@lru_cache(maxsize=1)  # a run asks for the angles of one table log, at its samples and elsewhere
def _records(table: TableLog) -> "_Records":
    return _Records(table.time, table.angle, table.interval)


def _around(t: FloatArray, angle: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the records that matter at a few times (n,), s, with _PADDING_RECORDS on each side."""
    nearest = np.searchsorted(t, time)[:, None] + np.arange(-_PADDING_RECORDS, _PADDING_RECORDS)
    used = np.zeros(len(t), dtype=bool)
    used[np.clip(nearest, 0, len(t) - 1)] = True
    return t[used], angle[used]


class _Records:
    """Records of a table log, to interpolate between: times (m,), s, angles (m,), rad."""

    def __init__(self, t: FloatArray, angle: FloatArray, interval: float) -> None:
        self._t, self._angle = t, angle
        self._turns = bool(angle.min() < angle.max())
        # Newton's divided differences, once per record: no digits are lost after many turns.
        self._divided = [angle]
        for k in range(1, min(_POINTS, len(t)) if self._turns else 1):
            self._divided.append(np.diff(self._divided[-1]) / (t[k:] - t[:-k]))
        # Whether a gap ends at a record; nothing ends at the first one and after the last one.
        self._gap_ends = np.concatenate([[False], np.diff(t) > _GAP_FACTOR * interval, [False]])
        self._has_gaps = bool(self._gap_ends.any())

    def at(self, time: FloatArray) -> FloatArray:
        """Return the angle (n,), rad, at times (n,), s."""
        t = self._t
        if not self._turns:
            return np.full(len(time), self._angle[0])
        after = np.searchsorted(t, time)
        result = self._through(time, after, _POINTS)
        if self._has_gaps:
            dropped = self._gap_ends[after]
            result[dropped] = np.interp(time[dropped], t, self._angle)
        if time[0] < t[0] or time[-1] > t[-1]:
            # Six points would amplify the encoder's resolution ninefold.
            outside = (time < t[0]) | (time > t[-1])
            result[outside] = self._through(time[outside], after[outside], 4)
        return result

    def _through(self, time: FloatArray, after: NDArray[np.intp], count: int) -> FloatArray:
        """Interpolate by the polynomial through the `count` records nearest to each time.

        after: for each time, the first record that is not before it.
        """
        t = self._t
        count = min(count, len(t))
        first = np.minimum(np.maximum(after - count // 2, 0), len(t) - count)
        result = np.zeros(len(time))
        for k in reversed(range(1, count)):
            result += self._divided[k][first]
            result *= time - t[first + (k - 1)]
        result += self._angle[first]
        return result
