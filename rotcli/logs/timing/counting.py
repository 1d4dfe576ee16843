"""Clocks that count records: stamps of arrival, and logs whose rig says that nothing was lost."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rotcli.logs.timing.line import SampleClock, fit_line
from rotcli.units import FloatArray

_MIN_COUNTED = 50  # records that show whether stamps come back to a line
_COUNT_BLOCK = 100  # records whose median is free of delays and bursts
_MAX_BLOCKS = 1000
_JUMP = 60.0  # s; bursts of arrival are shorter
_MAX_DISORDER = 10.0  # samples by which records out of order go back; a restart goes back further
_MIN_APART = 0.75  # of the usual step: stamps of one even clock, put in order, are not closer
_COUNT_DRIFT = 0.4  # of a sample; one missing sample amid a log moves its middle by half a sample


class RecordCounter:
    """The clock of a log without stamps that comes piece by piece; start, interval: s."""

    def __init__(self, start: float, interval: float) -> None:
        self._start, self._interval, self._records = start, interval, 0

    def times(self, count: int) -> FloatArray:
        """Return the times (count,), s, of the records that follow."""
        first, self._records = self._records, self._records + count
        return self._start + self._interval * np.arange(first, self._records, dtype=float)

    def line(self) -> SampleClock:
        """Return the clock; slots: of the first and the last record."""
        slots = np.array([0, self._records - 1])
        return SampleClock(self._start, self._interval, slots, 0.0, 0.0)


def count_clock(time: FloatArray, interval: float | None = None) -> SampleClock | None:
    """Return the clock that counts records with stamps (n,), s, or None where some were lost.

    Stamps of arrival scatter by delays and bursts, but come back to one line: the means of blocks
    stay on it closer than the stamps. Where records are missing, the stamps leave the line for
    good, by one sample each. interval: s, known beforehand; then nothing is tested.
    """
    n = len(time)
    index = np.arange(n)
    if interval is not None:
        deviation = time - time[0] - interval * index
        rms = float(np.sqrt(deviation @ deviation / n))
        largest = float(np.abs(deviation).max())
        return SampleClock(float(time[0]), interval, index, largest, rms, counted=True)
    if n < _MIN_COUNTED or time[-1] <= time[0]:
        return None
    x = time - time[0]
    line = replace(fit_line(time[0], x, index, 0.0, float(x[-1]) / (n - 1)), counted=True)
    rest = time - line.start - line.interval * index
    size = max(_COUNT_BLOCK, n // _MAX_BLOCKS)
    blocks = rest[: n // size * size].reshape(-1, size)
    means = np.median(blocks, axis=1)
    scatter = float(np.sqrt(np.mean((blocks - means[:, None]) ** 2)))
    limit = max(_COUNT_DRIFT * line.interval, scatter)
    return line if float(np.abs(means).max()) < limit else None


def count_records(time: FloatArray, rate: float | None = None) -> SampleClock:
    """Return the clock that counts records whatever their stamps (n,), s, are.

    rate: Hz; without it the interval is that of the line through the stamps, from which jumps
    back (a clock that restarts) and far ahead (a clock that is set) are taken out; stamps that are
    only out of order are sorted. Record k is at the first stamp + k intervals.
    """
    n = len(time)
    index = np.arange(n)
    smooth = _in_order(_without_single_jumps(_in_order(time)))
    steps = np.diff(smooth)
    if rate is not None:
        interval = 1.0 / rate
    elif (jumps := _jumps(steps)).any():
        usual = float(np.median(steps[steps > 0.0]))
        x = np.concatenate([[0.0], np.cumsum(np.where(jumps, usual, steps))])
        interval = fit_line(0.0, x, index, 0.0, float(x[-1]) / (n - 1)).interval
    else:
        x = smooth - smooth[0]
        interval = fit_line(smooth[0], x, index, 0.0, float(x[-1]) / (n - 1)).interval
    found = count_clock(time, interval)
    assert found is not None
    return found


def _jumps(steps: FloatArray) -> NDArray[np.bool_]:
    """Return which steps (n,), s, are those of a clock that is set: back, or far ahead."""
    positive = steps[steps > 0.0]
    usual = float(np.median(positive)) if positive.size else 0.0
    return np.asarray((steps < 0.0) | (steps > max(_JUMP, 1000.0 * usual)))


def _in_order(time: FloatArray) -> FloatArray:
    """Return stamps (n,), s, in ascending order where only their order is wrong, else as they are.

    Those of a clock that starts again come in the time of others, and are then too close to them.
    """
    steps = np.diff(time)
    back = int(np.count_nonzero(steps < 0.0))
    if not back:
        return time
    ascending = np.sort(time)
    apart = np.diff(ascending)
    usual = float(np.median(apart))
    close = int(np.count_nonzero(apart < _MIN_APART * usual))
    return ascending if -steps.min() < _MAX_DISORDER * usual and close < back else time


def _without_single_jumps(time: FloatArray) -> FloatArray:
    """Return stamps (n,), s; one that jumps there and back is the mean of its neighbours."""
    steps = np.diff(time)
    across = np.abs(time[2:] - time[:-2])
    single = (steps[:-1] * steps[1:] < 0.0) & (across < 0.5 * np.abs(steps[:-1]))
    if not single.any():
        return time
    repaired = time.copy()
    at = np.flatnonzero(single) + 1
    repaired[at] = 0.5 * (time[at - 1] + time[at + 1])
    return repaired
