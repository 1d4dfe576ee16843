"""Estimate the lag and the rate difference between gyro and table clocks.

The gyro rate along the axis over tenths of a second is `scale * rate(t - lag - drift * t) + bias`.
A cross-correlation over all shifts finds the lag to a block, and shows a reversed direction;
Gauss-Newton refines it and adds the drift where two changes of the rate, far apart, show one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.logs.record import ImuSource, TableLog
from rotcli.rig.rig import Rig
from rotcli.run.evidence.direction import sense_advice
from rotcli.run.findings import Finding
from rotcli.run.motion import crop_table, encoder_noise
from rotcli.units import DEG, PPM

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Spectrum = NDArray[np.complex128]

_RATE_BLOCK = 0.1  # s, over which rates are compared
_MIN_BLOCKS = 10  # blocks of common time
_MIN_CHANGE = 0.1  # of the largest change of rate: smaller ones are the resolution of the encoder
# times sigma of an angle over the squared block: a slope is the difference of four angles over two
# blocks, of sigma 1; 1e5 blocks exceed 5 of it with a chance of 0.05
_SLOPE_SIGMAS = 5.0
_MIN_TURNING_RATE = 1.0 * DEG  # rad/s: a slower table shows no lag
_MIN_RATE_CHANGE = 0.02  # of the rate: a table at constant rate shows no lag
_MIN_EXPLAINED = 0.9  # of the variance of the gyro rate: with less it is another motion
_LARGE_LAG = 2.0  # samples: the ramps then reach into the segments
_SIGMAS = 4.0  # of the lag: 1e-4 by chance
_SMALL_LAG = 1.0 / 3.0  # of a sample: half a sample is the lag of means read as instants
_MAX_LAG_DURATION = 7200.0  # s of a log that show its lag; of longer ones the liveliest part
_NEAR_CHANGE = 10.0  # s around changes of the rate: a step of the bias elsewhere does not matter
_MAX_BIASES = 8  # changes of the rate with a bias each; an oscillation has one for all
_BETTER = 0.8  # of the residual variance: a second solution must be clearly better
_TIE = 2e-3  # of correlation: of shifts within it (an oscillation) the smallest is taken
_MIN_OVERLAP = 1.0 / 3.0  # of the log, that both series share at a shift
_MIN_DRIFT_SPAN = 20.0  # s between changes of the rate: closer ones show no drift
_LARGEST_DRIFT = 0.02  # two percent: a clock that differs by more has another unit
_MIN_DRIFT = 50.0 * PPM  # crystals differ by 30 ppm


@dataclass(frozen=True)
class Lag:
    """Lag of the gyros behind the table, s, at the time `centre` (s); drift: s per s.

    scale: of the gyro rate to the table rate. residual_variance: (rad/s)^2. explained: share of
    the variance that the table rate explains. first, last: s, of the changes of rate.
    """

    lag: float
    sigma: float
    scale: float
    residual_variance: float
    explained: float
    drift: float = 0.0
    drift_sigma: float = np.inf
    centre: float = 0.0
    first: float = 0.0
    last: float = 0.0

    @property
    def drifts(self) -> bool:
        """Whether the clocks differ in rate, significantly and by more than crystals do."""
        return abs(self.drift) > max(_SIGMAS * self.drift_sigma, _MIN_DRIFT)

    @property
    def largest(self) -> float:
        """Largest lag (s), with its sign, at the changes of rate."""
        if not self.drifts:
            return self.lag
        ends = [self.lag + self.drift * (t - self.centre) for t in (self.first, self.last)]
        return max(ends, key=abs)


@dataclass(frozen=True, eq=False)
class _Series:
    """Gyro rates (n,), rad/s, between edges (n + 1,), s, and the table log they belong to."""

    table: TableLog
    edges: Array
    measured: Array
    angle_sigma: float = 0.0

    @property
    def slope_noise(self) -> float:
        """Slope of the table rate (rad/s^2) that the noise of the encoder does not exceed."""
        return _SLOPE_SIGMAS * self.angle_sigma / self.width**2

    @property
    def width(self) -> float:
        return float(self.edges[1] - self.edges[0])

    def rates(self, shift: Array | float) -> Array:
        """Return the table rates (n,), rad/s, between the edges less a shift (s)."""
        angle = np.interp(self.edges - shift, self.table.time, self.table.angle)
        return np.asarray(np.diff(angle) / self.width)


def _series(imu: ImuSource, table: TableLog, axis: Array) -> _Series | None:
    """Return the rates that both logs share; None where the table does not change its rate."""
    block = max(2, round(_RATE_BLOCK / imu.interval))
    width = block * imu.interval
    start, end = float(imu.time[0]), float(imu.time[-1])
    if end - start > _MAX_LAG_DURATION:
        start, end = _liveliest_part(table, start, end, width)
        table = crop_table(table, start - _MAX_LAG_DURATION, end + _MAX_LAG_DURATION)
    inside = imu.within(start, end)
    count = (inside.stop - inside.start) // block
    if count < _MIN_BLOCKS:
        return None
    first = float(imu.times(slice(inside.start, inside.start + 1))[0])
    log = imu.crop(first, first + imu.interval * (count * block - 1))
    measured = (log.gyro @ axis).reshape(count, block).mean(axis=1)
    # A sample represents half an interval to either side, a mean for the interval before it.
    lead = 1.0 if imu.sampling == "average" else 0.5
    edges = first + imu.interval * (block * np.arange(count + 1.0) - lead)
    series = _Series(table, edges, measured, encoder_noise(table).sigma)
    rate = series.rates(0.0)
    size = float(np.max(np.abs(rate)))
    if size < _MIN_TURNING_RATE or np.all(np.abs(np.diff(rate)) < _MIN_RATE_CHANGE * size):
        return None
    return series


def _liveliest_part(table: TableLog, start: float, end: float, width: float) -> tuple[float, float]:
    """Return the part (s) between start and end around the largest change of the table rate."""
    largest, at = -1.0, start
    for first in np.arange(start, end, _MAX_LAG_DURATION):
        edges = np.arange(first, min(first + _MAX_LAG_DURATION + 2.0 * width, end), width)
        if len(edges) > 2:
            part = crop_table(table, edges[0] - 1.0, edges[-1] + 1.0)
            if not len(part.time):
                continue
            change = np.abs(np.diff(np.interp(edges, part.time, part.angle), 2))
            if change.max() > largest:
                largest, at = float(change.max()), float(edges[int(np.argmax(change))])
    start = min(max(start, at - 0.5 * _MAX_LAG_DURATION), end - _MAX_LAG_DURATION)
    return start, start + _MAX_LAG_DURATION


def find_lag(imu: ImuSource, table: TableLog, axis: Array) -> Lag | None:
    """Return the lag of the gyros' mean rates along the axis (3,) behind the encoder's.

    Gauss-Newton from no lag, and from the shift that correlates best where that fits clearly
    better. None where the table does not change its rate.
    """
    series = _series(imu, table, axis)
    return None if series is None else _find(series, _correlate(series)[0])


def _find(series: _Series, shift: float) -> Lag | None:
    found = _refine(series, 0.0)
    if abs(shift) > 0.5 * series.width:
        other = _refine(series, shift)
        clear = other is not None and (
            found is None or other.residual_variance < _BETTER * found.residual_variance
        )
        found = other if clear else found
    return None if found is None else _with_drift(series, found)


def _correlate(series: _Series) -> tuple[float, float]:
    """Return the lag (s), in full blocks, at which both rates agree best, and the correlation.

    A negative correlation means the opposite sense. Sums over the shared blocks of all shifts are
    correlations by the FFT.
    """
    table, width = series.table, series.width
    covered = (series.edges[:-1] >= table.time[0]) & (series.edges[1:] <= table.time[-1])
    if np.count_nonzero(covered) < _MIN_BLOCKS:
        return 0.0, 0.0
    rate, y = series.rates(0.0), series.measured
    weight = covered.astype(float)
    x = (rate - rate[covered].mean()) * weight
    y = y - y.mean()
    ones = np.ones_like(y)

    size = 1 << int(2 * len(y) - 1).bit_length()
    of_ones, of_weight, of_x, of_y, of_xx, of_yy = (
        np.fft.rfft(values, size) for values in (ones, weight, x, y, x**2, y**2)
    )

    def lags(a: Spectrum, b: Spectrum) -> Array:
        """Return the sums of a_(k + shift) b_k for shifts from -(n - 1) to n - 1."""
        circular = np.fft.irfft(a * b.conj(), size)
        return np.concatenate([circular[size - len(y) + 1 :], circular[: len(y)]])

    n = np.maximum(lags(of_ones, of_weight), 1.0)
    sy, sx, sxy = lags(of_y, of_weight), lags(of_ones, of_x), lags(of_y, of_x)
    vx = np.maximum(lags(of_ones, of_xx) - sx**2 / n, 0.0)
    vy = np.maximum(lags(of_yy, of_weight) - sy**2 / n, 0.0)
    norm = np.sqrt(vx * vy)
    usable = (n >= _MIN_OVERLAP * len(y)) & (norm > 1e-6 * norm.max())
    correlation = np.where(usable, (sxy - sx * sy / n) / np.maximum(norm, 1e-300), 0.0)
    shifts = np.arange(-(len(y) - 1), len(y))
    best = float(np.abs(correlation).max())
    ties = np.flatnonzero(np.abs(correlation) >= best - _TIE)
    chosen = int(ties[int(np.argmin(np.abs(shifts[ties])))])
    return float(shifts[chosen] * width), float(correlation[chosen])


def _refine(series: _Series, lag: float, drift: float | None = None) -> Lag | None:
    """Fit lag, scale, bias and, if not None, drift by Gauss-Newton; None where it fails."""
    edges, width, table = series.edges, series.width, series.table
    middle = 0.5 * (edges[:-1] + edges[1:])
    centre = float(middle.mean())
    change = np.zeros(2)
    for _ in range(12):
        shift = lag + (drift or 0.0) * (edges - centre)
        ends = edges - shift
        inside = (ends[:-1] - width >= table.time[0]) & (ends[1:] + width <= table.time[-1])
        if np.count_nonzero(inside) < _MIN_BLOCKS:
            return None
        # Full blocks to either side: their noise has nothing in common with the block's own.
        rate, later, sooner = (series.rates(shift + d) for d in (0.0, -width, width))
        slope = (later - sooner) / (2.0 * width)
        least = max(_MIN_CHANGE * float(np.abs(slope[inside]).max()), series.slope_noise)
        slope[np.abs(slope) < least] = 0.0
        if not np.any(slope[inside]):
            return None
        inside &= _near(slope != 0.0, round(_NEAR_CHANGE / width))
        columns = [-slope, rate]
        if drift is not None:
            columns.append(-slope * (middle - centre))
        design = np.column_stack([*columns, *_biases(inside)])[inside]
        y = series.measured[inside]
        normal = design.T @ design
        try:
            inverse = np.linalg.inv(normal)
        except np.linalg.LinAlgError:
            return None
        solution = inverse @ (design.T @ y)
        scale = float(solution[1])
        if scale <= 0.0 or not np.all(np.isfinite(inverse)):
            return None
        change = solution[[0, 2]] / scale if drift is not None else solution[[0]] / scale
        lag += float(np.clip(change[0], -2.0 * width, 2.0 * width))
        if drift is not None:
            drift = float(np.clip(drift + change[1], -_LARGEST_DRIFT, _LARGEST_DRIFT))
        if abs(float(change[0])) < 1e-6:
            break
    if abs(float(change[0])) > 1e-3:
        return None
    rest = y - design @ solution
    variance = float(rest @ rest) / max(1, len(rest) - design.shape[1])
    # Where the rate changes the residuals may be larger than elsewhere; the larger one counts.
    influence = (design @ inverse) * rest[:, None]
    sigmas = np.sqrt(np.maximum(np.diag(inverse) * variance, (influence**2).sum(axis=0))) / scale
    at = np.flatnonzero((slope != 0.0) & inside)
    first, last = (float(middle[k]) for k in (at[0], at[-1])) if len(at) else (0.0, 0.0)
    explained = 1.0 - variance / max(float(np.var(y)), 1e-300)
    return Lag(
        lag,
        float(sigmas[0]),
        scale,
        variance,
        explained,
        drift or 0.0,
        np.inf if drift is None else float(sigmas[2]),
        centre,
        first,
        last,
    )


def _biases(inside: Flags) -> list[Array]:
    """Return a column (n,) for the bias around each change of the rate; one for many changes.

    A step of the bias between two ramps is then no lag.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    runs = edges.reshape(-1, 2)
    if not 1 < len(runs) <= _MAX_BIASES:
        return [np.ones(len(inside))]
    columns = []
    for first, last in runs:
        column = np.zeros(len(inside))
        column[first:last] = 1.0
        columns.append(column)
    return columns


def _near(flags: Flags, reach: int) -> Flags:
    """Return the blocks within `reach` of a flagged one."""
    at = np.flatnonzero(flags)
    edges = np.zeros(len(flags) + 1)
    np.add.at(edges, np.maximum(at - reach, 0), 1.0)
    np.add.at(edges, np.minimum(at + reach + 1, len(flags)), -1.0)
    return np.asarray(np.cumsum(edges)[:-1] > 0.0)


def _with_drift(series: _Series, found: Lag) -> Lag:
    """Return the lag with a drift, where changes of rate far apart show a significant one."""
    if found.last - found.first < _MIN_DRIFT_SPAN:
        return found
    other = _refine(series, found.lag, 0.0)
    at_limit = other is not None and abs(other.drift) > 0.99 * _LARGEST_DRIFT
    if other is None or not other.drifts or at_limit:
        return found
    return other


def check_alignment(imu: ImuSource, table: TableLog, rig: Rig) -> tuple[Finding, ...]:
    """Compare the clocks of the logs, and the sense of the rotation, over the complete logs.

    Codes: `rotation-sense`, `clock-rate` (and `clock-lag` otherwise), `clock-lag-large` where a
    lag of more than two samples reaches a change of the rate.
    """
    series = _series(imu, table, rig.table.axis)
    if series is None:
        return ()
    shifted = _correlate(series)
    found, correlation = _find(series, shifted[0]), shifted[1]
    if correlation < -_MIN_EXPLAINED and (found is None or found.explained < _MIN_EXPLAINED):
        advice = sense_advice(next(imu.pieces(slice(0, imu.samples))), rig)
        text = (
            f"{table.path}: the gyro rate is opposite to the table rate (correlation "
            f"{correlation:.3f}): {advice}"
        )
        return (Finding("rotation-sense", text, "warning", "", correlation),)
    return _lag_findings(imu, found, rig.table.time_offset)


def check_lag(
    imu: ImuSource, table: TableLog, axis: Array, *, time_offset: float = 0.0
) -> tuple[Finding, ...]:
    """Compare the times at which the gyros and the encoder show a change of the table rate.

    axis: (3,) in the body frame. time_offset: s, the rig's, which the table's times contain. A
    finding where the lag is above a third of a sample and four of its sigma: means read as
    instants lag by half a sample, other clocks by anything.
    """
    return _lag_findings(imu, find_lag(imu, table, axis), time_offset)


def _lag_findings(imu: ImuSource, found: Lag | None, time_offset: float) -> tuple[Finding, ...]:
    if found is None or not 0.5 < found.scale < 2.0 or found.explained < _MIN_EXPLAINED:
        return ()
    size = abs(found.largest)
    limit = max(_SMALL_LAG * imu.interval, _SIGMAS * found.sigma)
    if size < limit:
        return ()
    large = size > _LARGE_LAG * imu.interval
    if found.drifts:
        code = "clock-lag-large" if large else "clock-rate"
        text = f"{imu.path}: {_drift_in_words(found, time_offset)}"
        return (Finding(code, text, "warning", "", found.drift / PPM, _MIN_DRIFT / PPM, "ppm"),)
    text = f"{imu.path}: {_lag_in_words(found, imu, time_offset)}"
    code = "clock-lag-large" if large else "clock-lag"
    return (Finding(code, text, "warning", "", found.lag * 1e3, limit * 1e3, "ms"),)


def _drift_in_words(found: Lag, time_offset: float) -> str:
    """Return the text of clocks that differ in rate, with the offset and the rate to set."""
    offset = time_offset + found.lag - found.drift * found.centre
    lags = [
        f"{1e3 * (found.lag + found.drift * (t - found.centre)):.1f} ms at {t:.0f} s"
        for t in (found.first, found.last)
    ]
    return (
        f"the clocks differ by {found.drift / PPM:.0f} ppm (sigma "
        f"{found.drift_sigma / PPM:.0f} ppm): the gyro log lags the table log by "
        f"{' and by '.join(lags)}. time_offset alone cannot correct it; record both logs on one "
        f"clock, or multiply the table's times by 1 + clock_rate, clock_rate = {found.drift:.6f}, "
        f"and set [table] time_offset = {offset:.4f}"
    )


def _lag_in_words(found: Lag, imu: ImuSource, time_offset: float) -> str:
    how = "lags" if found.lag > 0.0 else "leads"
    digits = int(np.clip(np.ceil(-np.log10(max(found.sigma, 1e-9))), 3, 5))
    offset = float(round(time_offset + found.lag, digits)) + 0.0  # no -0.0
    clock = f"set [table] time_offset = {offset!r}"
    text = (
        f"the gyro log {how} the table log by {abs(found.lag) * 1e3:.2f} ms (sigma "
        f"{found.sigma * 1e3:.2f} ms, one sample is {imu.interval * 1e3:g} ms); "
    )
    # The other meaning of a sample moves it by half of one.
    half = found.lag / imu.interval * (1.0 if imu.sampling == "instant" else -1.0)
    if not 0.3 < half < 0.7:
        return text + clock
    other = "average" if imu.sampling == "instant" else "instant"
    kind = "means" if imu.sampling == "instant" else "instants"
    return text + (
        f"the lag is half a sample, so the samples are probably {kind}; set [imu] sampling = "
        f'"{other}", else {clock}'
    )
