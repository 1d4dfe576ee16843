"""Estimate the lag between gyro and table clocks."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.logs.record import ImuSource, TableLog
from rotcli.run.findings import Finding
from rotcli.units import DEG

Array = NDArray[np.float64]

_BLOCK = 0.1  # s, over which rates are compared
_FARTHEST = 5.0  # s, the largest lag looked for
_CLEAR = 0.1  # of the largest change of rate: smaller ones are the encoder's grain
_TURNING = 1.0 * DEG  # rad/s: a slower table tells no lag
_EXPLAINED = 0.9  # of the variance that the gyros feel: with less it is another motion
_GRAVE = 2.0  # samples; a larger lag spoils a calibration
_SIGMAS = 4.0
_ENOUGH = 3600.0  # s of a log that tell its lag
_ROUNDING = 1e-20  # relative, of products of two variances from sums


@dataclass(frozen=True)
class Lag:
    """By how much the gyros lag behind the table, s, and how well the table explains them.

    scale: of the gyro rate to the table rate. residual_variance: (rad/s)^2. explained: share of
    the variance that the table rate explains.
    """

    lag: float
    sigma: float
    scale: float
    residual_variance: float
    explained: float


def find_lag(imu: ImuSource, table: TableLog, axis: Array) -> Lag | None:
    """Find the lag of the gyros' mean rates along the axis (3,) behind the encoder's.

    Over tenths of a second the gyros feel `scale * rate(t - lag) + bias`, fitted by Gauss-Newton
    from no lag, and from the shift that correlates best where that fits clearly better. None
    where the table does not change its rate. Of a long log the hour about the greatest change is
    looked at.
    """
    block = max(2, round(_BLOCK / imu.interval))
    width = block * imu.interval
    start, end = float(table.time[0]) + width, float(table.time[-1]) - width
    start, end = max(start, float(imu.time[0])), min(end, float(imu.time[-1]))
    if end - start > _ENOUGH:
        start, end = _hour_of_largest_change(table, start, end, width)
        near = np.searchsorted(table.time, [start - 2.0 * _FARTHEST, end + 2.0 * _FARTHEST])
        table = replace(table, time=table.time[slice(*near)], angle=table.angle[slice(*near)])
    inside = imu.within(start, end)
    count = (inside.stop - inside.start) // block
    if count < 10:
        return None
    first = float(imu.times(slice(inside.start, inside.start + 1))[0])
    held = imu.crop(first, first + imu.interval * (count * block - 1))
    felt = (held.gyro @ axis).reshape(count, block).mean(axis=1)
    # The span that the samples of a block speak of: half a sample to either side of an instant.
    lead = 1.0 if imu.sampling == "average" else 0.5
    edges = first + imu.interval * (block * np.arange(count + 1.0) - lead)
    rate = _rates(table, edges, width)
    change = np.abs(np.diff(rate))
    if np.max(np.abs(rate)) < _TURNING or np.all(change < 0.02 * np.max(np.abs(rate))):
        return None
    found = _refine(table, edges, felt, 0.0)
    shift = _correlate(table, edges, felt)
    if abs(shift) > 0.5 * width:
        other = _refine(table, edges, felt, shift)
        if found is None or (
            other is not None and other.residual_variance < 0.8 * found.residual_variance
        ):
            return other
    return found


def _hour_of_largest_change(
    table: TableLog, start: float, end: float, block: float
) -> tuple[float, float]:
    """Return the hour (s) between start and end about the greatest change of the table's rate."""
    greatest, at = -1.0, start
    for first in np.arange(start, end, _ENOUGH):
        edges = np.arange(first, min(first + _ENOUGH + 2.0 * block, end), block)
        if len(edges) > 2:
            near = slice(*np.searchsorted(table.time, [edges[0] - 1.0, edges[-1] + 1.0]))
            change = np.abs(np.diff(np.interp(edges, table.time[near], table.angle[near]), 2))
            if change.max() > greatest:
                greatest, at = float(change.max()), float(edges[int(np.argmax(change))])
    start = min(max(start, at - 0.5 * _ENOUGH), end - _ENOUGH)
    return start, start + _ENOUGH


def _rates(table: TableLog, edges: Array, width: float) -> Array:
    return np.asarray(np.diff(np.interp(edges, table.time, table.angle)) / width)


def _correlate(table: TableLog, edges: Array, felt: Array) -> float:
    """Return the lag (s), in whole blocks, at which rates felt (n,) and the table's agree best."""
    width = float(edges[1] - edges[0])
    n, most = len(felt), round(_FARTHEST / width)
    wide = edges[0] + width * np.arange(-most, n + most + 1)
    rate = _rates(table, wide, width)
    covered = np.flatnonzero((wide[:-1] >= table.time[0]) & (wide[1:] <= table.time[-1]))
    # Sums over any range of blocks by differences of running sums; centred for their digits.
    rate, felt = rate - rate[covered].mean(), felt - felt.mean()
    sums_x, sums_y = _running_sums(rate), _running_sums(felt)
    best, found = 0.0, 0
    for shift in sorted(range(-most, most + 1), key=abs):
        first = max(0, int(covered[0]) - most + shift)
        last = min(n, int(covered[-1]) + 1 - most + shift)
        if last - first < max(10, n // 2):
            continue
        move = most - shift
        x, x_x = sums_x[:, last + move] - sums_x[:, first + move]
        y, y_y = sums_y[:, last] - sums_y[:, first]
        x_y = float(rate[first + move : last + move] @ felt[first:last])
        count = last - first
        spread = max(x_x - x * x / count, 0.0) * max(y_y - y * y / count, 0.0)
        if spread <= _ROUNDING * x_x * y_y:  # one of them is constant
            continue
        alike = (x_y - x * y / count) / float(np.sqrt(spread))
        if alike > best:
            best, found = alike, shift
    return found * width


def _running_sums(x: Array) -> Array:
    """Return the sums (2, n + 1) of the first 0, 1, ... numbers x (n,) and of their squares."""
    sums = np.zeros((2, len(x) + 1))
    np.cumsum(x, out=sums[0, 1:])
    np.cumsum(x * x, out=sums[1, 1:])
    return sums


def _refine(table: TableLog, edges: Array, felt: Array, lag: float) -> Lag | None:
    """Fit lag, scale and bias by Gauss-Newton from a first lag (s); None where it fails."""
    width = float(edges[1] - edges[0])
    change = 0.0
    for _ in range(8):
        ends = edges - lag
        inside = (ends[:-1] - width >= table.time[0]) & (ends[1:] + width <= table.time[-1])
        if np.count_nonzero(inside) < 10:
            return None
        # Whole blocks to either side: their grain has nothing in common with the block's own.
        rate, later, sooner = (_rates(table, ends - d, width) for d in (0.0, width, -width))
        slope = (later - sooner) / (2.0 * width)
        slope[np.abs(slope) < _CLEAR * np.abs(slope[inside]).max()] = 0.0
        design = np.column_stack([slope, rate, np.ones(len(felt))])[inside]
        normal = design.T @ design
        try:
            inverse = np.linalg.inv(normal)
        except np.linalg.LinAlgError:
            return None
        solution = inverse @ (design.T @ felt[inside])
        scale = float(solution[1])
        if scale <= 0.0:
            return None
        change = float(np.clip(solution[0] / scale, -2.0 * width, 2.0 * width))
        lag += change
        if abs(change) < 1e-6:
            break
    if abs(change) > 1e-3 or abs(lag) > 1.1 * _FARTHEST:
        return None
    rest = felt[inside] - design @ solution
    left = float(rest @ rest) / max(1, len(rest) - 3)
    # Where the rate changes more may be left than elsewhere; the larger is believed.
    influence = (design @ inverse[0]) * rest
    sigma = float(np.sqrt(max(inverse[0, 0] * left, influence @ influence))) / scale
    return Lag(lag, sigma, scale, left, 1.0 - left / max(float(np.var(felt[inside])), 1e-300))


def check_lag(
    imu: ImuSource, table: TableLog, axis: Array, *, time_offset: float = 0.0
) -> tuple[Finding, ...]:
    """Compare the times at which the gyros and the encoder show a change of the table rate.

    axis: (3,) in the body frame. time_offset: s, the rig's, which the table's times contain. A
    finding where the lag is above a third of a sample and four of its sigma: means read as
    instants lag by half a sample, other clocks by anything. Above two samples its code is
    `clock-lag-large`.
    """
    found = find_lag(imu, table, axis)
    if found is None or not 0.5 < found.scale < 2.0 or found.explained < _EXPLAINED:
        return ()
    size = abs(found.lag)
    limit = max(imu.interval / 3.0, _SIGMAS * found.sigma)
    if size < limit:
        return ()
    text = f"{imu.path}: {_lag_in_words(found, imu, table, time_offset)}"
    code = "clock-lag-large" if size > _GRAVE * imu.interval else "clock-lag"
    return (Finding(code, text, "warning", "", found.lag * 1e3, limit * 1e3, "ms"),)


def _lag_in_words(found: Lag, imu: ImuSource, table: TableLog, time_offset: float) -> str:
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
