"""Samples that no sensor measured: interpolated, frozen, all zero, or clipped.

Six readings of a sensor with noise never lie on a straight line over several samples. Rows of
zeros count from one, rows on a line from five in succession.
"""

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.logs.record import ImuLog
from rotcli.run.findings import Finding
from rotcli.units import FloatArray, format_span, show_time

Flags = NDArray[np.bool_]

MAX_SAMPLES = 1_000_000  # of a part of a log that are searched: 0.2 s
# Rows in succession. The second difference of the first two contains rows before the line.
MIN_RUN = 5
_MIN_RUN_FEW = 7  # where only some channels have noise
# A line between two readings has second differences of rounding; noise has this much more.
_LINE_SHARE = 1e-3
_MAX_SHOWN = 4
_MIN_NOISY = 3  # channels with noise, that a search makes sense
_MIN_NOISE_RATIO = 0.3  # of third to second differences
_RANGE_TOLERANCE = 1.0 - 1e-7  # of the range: single precision stores seven digits
_FIRST_ROWS = 2000  # that show whether a channel has noise
_MIN_SIGN_CHANGES = 0.3  # of neighbouring steps: 2/3 in white noise, 0 in a smooth curve


@dataclass
class SampleScan:
    """Collects the samples of a part of a log, chunk by chunk, and names those not measured.

    gyro_range: rad/s, at which readings are clipped. rows, zeros: samples seen, and those of six
    zeros. clipped: (3,) samples of each gyro at its range.
    """

    gyro_range: float | None = None
    rows: int = 0
    zeros: int = 0
    clipped: FloatArray = field(default_factory=lambda: np.zeros(3))
    _time: list[FloatArray] = field(default_factory=list)
    _line: list[Flags] = field(default_factory=list)
    _zero: list[Flags] = field(default_factory=list)
    _before: FloatArray = field(default_factory=lambda: np.empty((0, 6)))
    _typical: FloatArray | None = None

    def add(self, chunk: ImuLog) -> None:
        """Take the chunk that follows."""
        self.rows += chunk.samples
        if self.gyro_range is not None:
            limit = self.gyro_range * _RANGE_TOLERANCE
            if max(float(chunk.gyro.max()), -float(chunk.gyro.min())) >= limit:
                self.clipped = self.clipped + np.count_nonzero(np.abs(chunk.gyro) >= limit, axis=0)
        if self.rows > MAX_SAMPLES:
            return
        zero = rows_of_zeros(chunk.gyro, chunk.accel)
        self.zeros += int(np.count_nonzero(zero))
        self._time.append(chunk.time)
        self._zero.append(zero)
        self._line.append(self._straight(chunk) & ~zero)

    def _straight(self, chunk: ImuLog) -> Flags:
        """Return the rows (n,) that lie on a line with the two before them."""
        n, start = chunk.samples, len(self._before)
        if self._typical is None:
            values = np.concatenate([chunk.gyro[:_FIRST_ROWS], chunk.accel[:_FIRST_ROWS]], axis=1)
            self._typical = _typical_noise(np.abs(np.diff(values, 2, axis=0)))
        noisy_channels = np.flatnonzero(self._typical)
        result = np.zeros(n, dtype=bool)
        last = [np.concatenate([chunk.gyro[-2:], chunk.accel[-2:]], axis=1)]
        if len(noisy_channels) >= _MIN_NOISY and n + start > 2:
            result[max(0, 2 - start) :] = True
            for k in noisy_channels:
                column = (chunk.gyro if k < 3 else chunk.accel)[:, k % 3]
                column = np.concatenate([self._before[:, k], column])
                second = np.abs(column[2:] - 2.0 * column[1:-1] + column[:-2])
                result[max(0, 2 - start) :] &= second <= _LINE_SHARE * self._typical[k]
                if not result.any():
                    break
        self._before = np.concatenate([self._before, *last])[-2:] if n < 2 else last[0]
        if chunk.missing is not None:  # interpolated by the reader: a gap, which is reported there
            result &= ~chunk.missing
        return result

    def findings(self, path: str, where: str = "") -> list[Finding]:
        """Return what was not measured, with its times; where: the part of the log in words."""
        if not self._time:
            return []
        time, zero = np.concatenate(self._time), np.concatenate(self._zero)
        found = []
        if zero.any():
            spans = _spans(zero, time, 1)
            found.append(_finding(path, where, "zero in all channels", spans))
        channels = 0 if self._typical is None else int(np.count_nonzero(self._typical))
        least = (MIN_RUN if channels == 6 else _MIN_RUN_FEW) - 2
        spans = _spans(np.concatenate(self._line), time, least)
        if spans:
            what = "on a straight line in all channels (frozen or interpolated)"
            found.append(_finding(path, where, what, spans))
        return found


def noisy(gyro: FloatArray) -> bool:
    """Return whether the steps of a gyro (n, 3) change sign as those of noise do."""
    for column in gyro[:_FIRST_ROWS].T:
        steps = np.diff(column)
        steps = steps[steps != 0.0]
        if len(steps) > MIN_RUN and np.mean(steps[1:] * steps[:-1] < 0.0) > _MIN_SIGN_CHANGES:
            return True
    return False


def rows_of_zeros(gyro: FloatArray, accel: FloatArray) -> Flags:
    """Return the rows (n,) whose six readings (n, 3), (n, 3) are zero."""
    result: Flags = gyro[:, 0] == 0.0
    for column in (*gyro.T[1:], *accel.T):
        if not result.any():  # as in most logs
            break
        result &= column == 0.0
    return result


def _typical_noise(second: FloatArray) -> FloatArray:
    """Return the median second difference (6,) of channels with noise, 0 of those without.

    Of white noise the differences of second differences are 1.8 times as large, of a smooth
    signal without noise far smaller.
    """
    if len(second) < 2 * MIN_RUN:
        return np.zeros(6)
    typical = np.median(second, axis=0)
    third = np.median(np.abs(np.diff(second, axis=0)), axis=0)
    return np.where(third > _MIN_NOISE_RATIO * typical, typical, 0.0)


def _spans(flags: Flags, time: FloatArray, least: int) -> list[tuple[int, str]]:
    """Return length and times of the runs of at least `least` flagged samples."""
    if not flags.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [
        (int(stop - start), _span(time[start], time[stop - 1]))
        for start, stop in zip(edges[::2], edges[1::2], strict=True)
        if stop - start >= least
    ]


def _span(start: float, end: float) -> str:
    return f"{show_time(start)} s" if start == end else format_span(start, end)


def _finding(path: str, where: str, what: str, spans: list[tuple[int, str]]) -> Finding:
    """Return the finding of samples that were not measured."""
    count = sum(size for size, _ in spans)
    shown = ", ".join(text for _, text in spans[:_MAX_SHOWN])
    shown += ", ..." if len(spans) > _MAX_SHOWN else ""
    noun = "sample is" if count == 1 else "samples are"
    if what.startswith("on a"):
        noun = "sample lies" if count == 1 else "samples lie"
    place = f"{path}: segment {where}" if where else path
    text = (
        f"{place}: {count} {noun} {what}: {shown}. They were not measured; check the logger or "
        "exclude this part"
    )
    return Finding(
        "samples-not-measured", text, where=where or "imu", value=float(count), limit=0.0
    )
