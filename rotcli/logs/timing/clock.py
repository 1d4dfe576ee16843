"""Time stamps to an even clock.

Real loggers stamp with jitter while the sensor samples evenly. `fit_sample_clock` finds the even
clock behind stamps that stay within half a sample of it, lost samples and all. Stamps of arrival
scatter more: `count_clock` recognises that none was lost, and counts the records. Times are s; an
interval is known only from the data.
"""

from dataclasses import replace

import numpy as np

from rotcli.logs.record import CHUNK_SAMPLES
from rotcli.logs.timing.counting import count_clock
from rotcli.logs.timing.line import SampleClock, decimal, fit_line
from rotcli.logs.timing.mixed import RecordSpacing
from rotcli.units import FloatArray

_MAX_LAG = 1024  # samples over which the first guess of the interval is averaged
# Share of missing samples above which a line without any, within half a sample, is preferred:
# losses at random leave the line by their square root, a coarse tick of the stamps does not.
MAX_MISSING_SHARE = 0.05
_MIN_MISSING = 10  # samples; so many losses at random leave the line by more than half a sample


def fit_sample_clock(time: FloatArray) -> SampleClock | None:
    """Return the even clock from which no stamp (n,) deviates by half a sample, or None.

    When every spacing is between half and one and a half of the mean, no sample is missing and
    the records count themselves. Otherwise the line is found from the phase of the stamps
    within the interval, which lost samples do not disturb; the longer the blocks whose phase is
    taken the more jitter it bears, the shorter the less the interval need be known before.
    """
    n = len(time)
    x = time - time[0]
    steps = np.diff(x)
    mean = x[-1] / (n - 1)
    shortest, longest = float(steps.min()), float(steps.max())
    if shortest <= 0.0:  # repeated stamps, or a first one so far off that others lose digits
        repeated = mean > 0.0 and np.diff(time).min() == 0.0
        return count_clock(time) if repeated else None
    if shortest > 0.5 * mean and longest < 1.5 * mean:
        return _if_even(fit_line(time[0], x, None, 0.0, mean))
    found = _fit_with_gaps(time[0], x)
    counted = fit_line(time[0], x, None, 0.0, mean)
    even = _if_even(counted) is not None
    if found is not None:
        missing = found.count - n
        many = missing > max(MAX_MISSING_SHARE * n, _MIN_MISSING)
        if not many:
            return found
        return counted if even else count_clock(time) or found
    return counted if even else count_clock(time)


def is_even(time: FloatArray, jitter: float) -> bool:
    """Return whether stamps (n,), s, certainly stay within `jitter` intervals of an even clock.

    They do if a third of it is as far as they are from the line through the first and the last:
    least squares through an even grid at most adds five thirds of that (the largest sum of the
    weights of an end's fit).
    """
    n, start = len(time), float(time[0])
    interval = (float(time[-1]) - start) / max(n - 1, 1)
    for first in range(0, n, CHUNK_SAMPLES):
        rest = time[first : first + CHUNK_SAMPLES] - start
        rest -= interval * np.arange(first, first + len(rest))
        if not max(rest.max(), -rest.min()) < jitter / 3.0 * interval:
            return False
    return True


def _fit_with_gaps(zero: float, x: FloatArray) -> SampleClock | None:
    """Return the line through stamps x (n,), s after `zero`, some of them missing, or None."""
    first, lag = _first_interval(x)
    for size in (max(lag // 2, 16), 2 * lag):
        line = _with_gaps(zero, x, *_by_phase(x, first, lag, size))
        if line is not None:
            return line
    return None


def _if_even(line: SampleClock) -> SampleClock | None:
    return line if line.max_deviation < 0.5 * line.interval else None


def _with_gaps(zero: float, x: FloatArray, offset: float, interval: float) -> SampleClock | None:
    """Give each stamp x (n,), s after `zero`, the slot nearest to it on a line, or None.

    None where two stamps fall in one slot, or slots are skipped though no sample is missing:
    then the clock drifts off any line.
    """
    for _ in range(3):
        index = np.rint((x - offset) / interval).astype(np.int64)
        slots = np.diff(index)
        if (slots < 1).any():
            return None
        line = fit_line(zero, x, index, offset, interval)
        offset, interval = line.start - zero, line.interval
    jumps = slots > 1
    unreal = jumps & (np.diff(x) < (slots - 0.5) * interval)
    if 2 * np.count_nonzero(unreal) > np.count_nonzero(jumps):
        return None
    return _if_even(line)


class StreamingClockFit:
    """The even clock of stamps that come piece by piece: the line through the pieces' own lines.

    Slots are counted from the first stamp; one line through all is fitted by least squares,
    its sums merged piece by piece (Chan, Golub, LeVeque, Am. Statistician 37 (1983) 242). The
    stamps are taken literally where asked for, or where no line is found.
    """

    def __init__(self, *, literal: bool = False) -> None:
        self.records = 0
        self.gaps: list[tuple[int, int]] = []  # record after which samples are lost, how many
        self.guess = 0.0  # s, the interval of the first piece
        self.spacing = RecordSpacing()  # empty where the stamps are taken literally
        self._literal = literal
        self._even_chunks = True
        self._counted = False
        self._own: list[
            tuple[int, SampleClock]
        ] = []  # slot of the first stamp of a piece, its line
        self._ends: list[tuple[int, float]] = []  # slot and time of the first and of last stamps
        self._even = np.zeros(2)  # sum and count of the steps outside gaps
        self._mean = np.zeros(2)  # of slot and of what is left of the first piece's line
        self._moments = np.zeros((2, 2))

    def add(self, time: FloatArray) -> list[tuple[int, int]]:
        """Take the stamps (n,), s, that follow; returns the gaps up to the last of them."""
        known = len(self.gaps)
        if not self._literal:
            self.spacing.add(time)
        line = fit_sample_clock(time) if len(time) > 1 else self._single(time)
        if line is None:
            self._even_chunks = False
            line = clock_from_stamps(time)
        self._counted |= line.counted
        self.guess = self.guess or line.interval
        first = 0
        if self._own:
            slot, end = self._ends[-1]
            between = max(round((float(time[0]) - end) / line.interval), 1)
            between = 1 if line.counted else between
            if between > 1:
                self.gaps.append((self.records - 1, between - 1))
            else:
                self._even += float(time[0]) - end, 1.0
            first = slot + between
        else:
            self._ends.append((0, float(time[0])))
        n, last = len(time), int(line.slots[-1])
        if last == n - 1:
            self._even += float(time[-1]) - float(time[0]), last
        else:
            steps, slots = np.diff(time), np.diff(line.slots)
            after = np.flatnonzero(slots > 1)
            self.gaps += [(self.records + int(i), int(slots[i]) - 1) for i in after]
            self._even += steps[slots == 1].sum(), np.count_nonzero(slots == 1)
        self._own.append((first, replace(line, slots=line.slots[[0, -1]])))
        self._ends.append((first + last, float(time[-1])))
        mean, moments = _moments(time, line, first, self._own[0][1])
        step = mean - self._mean
        self._moments += moments
        self._moments += np.outer(step, step) * self.records * n / (self.records + n)
        self._mean += step * n / (self.records + n)
        self.records += n
        return self.gaps[known:]

    def _single(self, time: FloatArray) -> SampleClock:
        """Return the line of a piece of one stamp: that of the piece before."""
        return SampleClock(
            float(time[0]), self._own[-1][1].interval, np.zeros(1, dtype=np.int64), 0.0, 0.0
        )

    @property
    def chunk_end_times(self) -> FloatArray:
        """The stamps at the pieces' ends (s), to show where a literal clock deviates."""
        return np.array([time for _, time in self._ends])

    def line(self) -> tuple[SampleClock, bool]:
        """Return the line, and whether the stamps must be taken literally.

        slots: of the first stamp and of the pieces' last ones. max_deviation is a bound: how far
        a piece's stamps deviate from its line, and that line from this one.
        """
        reference = self._own[0][1]
        index = np.array([slot for slot, _ in self._ends], dtype=np.int64)
        (kk, kr), (_, rr) = self._moments
        slope = kr / kk
        offset = self._mean[1] - slope * self._mean[0]
        start, interval = decimal(
            reference.start, offset, reference.interval + slope, int(index[-1])
        )
        max_deviation = 0.0
        for first, own in self._own:
            ends = np.array([0.0, float(own.slots[-1])])
            apart = own.start + own.interval * ends - start - interval * (first + ends)
            max_deviation = max(max_deviation, own.max_deviation + float(np.abs(apart).max()))
        rms = float(np.sqrt(max(rr - slope * kr, 0.0) / self.records))
        line = SampleClock(start, interval, index, max_deviation, rms)
        stamps = self.chunk_end_times
        if self._even_chunks and (self._counted or _if_even(line) is not None):
            line = replace(line, counted=self._counted)
            return (replace(line, start=float(stamps[0])), True) if self._literal else (line, False)
        interval = float(self._even[0] / self._even[1])
        deviation = float(np.abs(stamps - stamps[0] - interval * index).max())
        return SampleClock(float(stamps[0]), interval, index, deviation, rms), True


def _moments(
    time: FloatArray, line: SampleClock, first: int, reference: SampleClock
) -> tuple[FloatArray, FloatArray]:
    """Return the mean (2,) and the sums of squares and products (2, 2) about it of a piece.

    They are those of the slots of its stamps (n,), s, and of what is left of the reference line.
    line: of the piece; first: its first slot. What a line of least squares leaves has no mean and
    no slope, so that the sums are those of the line and of its RMS.
    """
    n, slots = len(time), line.slots
    if line.fitted is not None:
        start, interval = line.fitted
        counted = slots[-1] == n - 1
        mean = 0.5 * (n - 1) if counted else float(slots.mean())
        kk = n * (n * n - 1) / 12.0 if counted else n * float(slots.var())
        slope = interval - reference.interval
        rest = start - reference.start - reference.interval * first + slope * mean
        kr = slope * kk
        rr = slope * kr + n * line.rms**2
        return np.array([first + mean, rest]), np.array([[kk, kr], [kr, rr]])
    pair = np.empty((2, n))
    np.add(slots, first, out=pair[0])
    np.subtract(time, reference.start, out=pair[1])
    pair[1] -= reference.interval * pair[0]
    means = pair.mean(axis=1)
    pair -= means[:, None]
    return means, pair @ pair.T


def _first_interval(x: FloatArray) -> tuple[float, int]:
    """Return the interval from the median spacing at growing lags, and the lag reached."""
    n = len(x)
    stride = max(1, n // 100_000)
    interval, lag = float(np.median(np.diff(x)[::stride])), 1
    while 2 * lag <= min(n // 4, _MAX_LAG):
        wide = float(np.median((x[2 * lag :] - x[: -2 * lag])[::stride]))
        # Beyond this many spans contain a gap; at lag 1 full milliseconds may be as coarse.
        if abs(wide - 2 * lag * interval) > (0.7 if lag == 1 else 0.3) * interval:
            break
        lag *= 2
        interval = wide / lag
    return interval, lag


def _by_phase(x: FloatArray, interval: float, lag: int, size: int) -> tuple[float, float]:
    """Return offset and interval of the line whose phase the stamps x (n,) keep best.

    Starts from an interval known from spans of `lag` samples, and blocks of `size` samples.

    The sum of exp(2 pi i x f) over a block has the phase of the block's offset whatever is
    missing. Its drift from block to block corrects f; then neighbours merge, the nearest first,
    so that f is known well enough by the time a long gap has to be crossed.
    """
    f = 1.0 / interval
    long_gaps = np.flatnonzero(np.diff(x) > 5.0 * interval) + 1
    starts = np.union1d(np.arange(0, max(len(x) - size + 1, 1), size), long_gaps)
    weight = np.diff(np.append(starts, len(x))).astype(float)
    phase = x * f
    phase -= np.floor(phase)
    sums = np.add.reduceat(np.exp(2j * np.pi * phase), starts)
    centre = np.add.reduceat(x, starts) / weight
    lever = 0.25 * lag * interval * np.sqrt(len(x))
    while len(sums) > 1:
        span = np.diff(centre)
        near = span <= 2.0 * span.min()
        rotations = (sums[1:] * sums[:-1].conj())[near]
        pair_weight = (weight[1:] * weight[:-1] / (weight[1:] + weight[:-1]))[near]
        mean_span = float(np.average(span[near], weights=pair_weight))
        if mean_span * np.sqrt(pair_weight.sum()) > lever:  # else f is known better than they show
            lever = mean_span * np.sqrt(pair_weight.sum())
            change = -float(np.angle(rotations.sum())) / (2.0 * np.pi * mean_span)
            f += change
            sums *= np.exp(2j * np.pi * change * centre)
        # In each row of near neighbours every second one joins the one before it.
        order = np.arange(len(near))
        row_start = np.maximum.accumulate(np.where(near, 0, order + 1))
        joins = np.append(False, near & ((order - row_start) % 2 == 0))
        heads = np.flatnonzero(~joins)
        sums = np.add.reduceat(sums, heads)
        total = np.add.reduceat(weight, heads)
        centre = np.add.reduceat(centre * weight, heads) / total
        weight = total
    return float(np.angle(sums[0])) / (2.0 * np.pi * f), 1.0 / f


def clock_from_stamps(time: FloatArray) -> SampleClock:
    """Return an even grid over stamps taken literally; index contains the slots between records.

    The grid starts at the first stamp; its interval is the mean spacing outside gaps.
    """
    steps = np.diff(time)
    slots = np.maximum(np.rint(steps / np.median(steps)), 1.0)
    interval = float(steps[slots == 1].mean())
    index = np.concatenate([[0], np.cumsum(slots)]).astype(np.int64)
    deviation = time - time[0] - interval * index
    rms = float(np.sqrt(deviation @ deviation / len(deviation)))
    return SampleClock(float(time[0]), interval, index, float(np.abs(deviation).max()), rms)
