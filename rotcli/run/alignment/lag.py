"""Estimate the lag and the rate difference between gyro and table clocks.

The gyro rate along the axis over tenths of a second is `scale * rate(t - lag - drift * t) + bias`.
A cross-correlation over all shifts finds the lag to a block, and shows a reversed direction;
Gauss-Newton refines it and adds the drift where two changes of the rate, far apart, show one.
A bias that steps while the rate changes looks like a lag; both are fitted and compared.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.logs.record import ImuSource, TableLog
from rotcli.run.alignment.correlation import correlate
from rotcli.run.alignment.series import MIN_BLOCKS, Series, rate_series
from rotcli.units import PPM, FloatArray

Flags = NDArray[np.bool_]

_MIN_CHANGE = 0.1  # of the largest change of rate: smaller ones are the resolution of the encoder
_SIGMAS = 4.0  # of the lag: 1e-4 by chance
_NEAR_CHANGE = 10.0  # s around changes of the rate: a step of the bias elsewhere does not matter
_MAX_BIASES = 8  # changes of the rate with a bias each; an oscillation has one for all
_BETTER = 0.8  # of the residual variance: a second solution must be clearly better
_MIN_DRIFT_SPAN = 20.0  # s between changes of the rate: closer ones show no drift
_LARGEST_DRIFT = 0.02  # two percent: a clock that differs by more has another unit
MIN_DRIFT = 50.0 * PPM  # crystals differ by 30 ppm
# blocks tried at either end of a change: its slope shows a block before and after it
_STEP_BLOCKS = 3
_MAX_ITERATIONS = 12  # of Gauss-Newton; four suffice
_CONVERGED, _FAILED = 1e-6, 1e-3  # s, last correction of the lag


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
        """Whether the clocks differ in rate significantly."""
        return abs(self.drift) > _SIGMAS * self.drift_sigma

    @property
    def crystals(self) -> bool:
        """Whether the clocks differ in rate, but by no more than good crystals do."""
        return self.drifts and abs(self.drift) <= MIN_DRIFT

    @property
    def ends(self) -> tuple[float, float]:
        """Lags (s) at the first and the last change of rate."""
        if not self.drifts:
            return self.lag, self.lag
        first, last = (self.lag + self.drift * (t - self.centre) for t in (self.first, self.last))
        return first, last

    @property
    def largest(self) -> float:
        """Largest lag (s), with its sign, at the changes of rate."""
        return max(self.ends, key=abs)

    @property
    def smallest(self) -> float:
        """Smallest lag (s), with its sign, between the first and the last change of rate."""
        first, last = self.ends
        return 0.0 if first * last < 0.0 else min(first, last, key=abs)


@dataclass(frozen=True)
class BiasStep:
    """A step of the gyro bias (rad/s) at a change of the rate: time (s), change of rate (rad/s).

    residual_variance: (rad/s)^2, of the fit without a lag.
    """

    size: float
    time: float
    rate_change: float
    residual_variance: float


@dataclass(frozen=True, eq=False)
class _Design:
    """The linear model about a lag: columns (n, k), flags of the blocks used, slope (n,).

    The columns are -slope, rate, -slope times the time from the centre (with a drift), biases.
    """

    columns: FloatArray
    inside: Flags
    slope: FloatArray


def _design(series: Series, lag: float, drift: float | None) -> _Design | None:
    """Return the model about a lag and a drift; None where no change of the rate is left."""
    edges, width, table = series.edges, series.width, series.table
    middle = 0.5 * (edges[:-1] + edges[1:])
    centre = float(middle.mean())
    shift = lag + (drift or 0.0) * (edges - centre)
    ends = edges - shift
    inside = (ends[:-1] - width >= table.time[0]) & (ends[1:] + width <= table.time[-1])
    if np.count_nonzero(inside) < MIN_BLOCKS:
        return None
    rate, slope = series.rates_and_slopes(shift)
    least = max(_MIN_CHANGE * float(np.abs(slope[inside]).max()), series.slope_noise)
    slope[np.abs(slope) < least] = 0.0
    if not np.any(slope[inside]):
        return None
    inside &= _near(slope != 0.0, round(_NEAR_CHANGE / width))
    columns = [-slope, rate]
    if drift is not None:
        columns.append(-slope * (middle - centre))
    return _Design(np.column_stack([*columns, *_biases(inside)]), inside, slope)


@dataclass(frozen=True, eq=False)
class _Solution:
    """Least squares: coefficients (k,), their sigmas (k,), residual variance, explained share."""

    coefficients: FloatArray
    sigma: FloatArray
    variance: float
    explained: float


def _solve(design: FloatArray, y: FloatArray) -> _Solution | None:
    """Solve for y (n,) by columns (n, k); None where they do not determine the coefficients."""
    normal = design.T @ design
    try:
        inverse = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite(inverse)):
        return None
    x = inverse @ (design.T @ y)
    rest = y - design @ x
    variance = float(rest @ rest) / max(1, len(rest) - design.shape[1])
    # Where the rate changes the residuals may be larger than elsewhere; the larger one counts.
    influence = (design @ inverse) * rest[:, None]
    square = np.maximum(np.diag(inverse) * variance, (influence**2).sum(axis=0))
    explained = 1.0 - variance / max(float(np.var(y)), 1e-300)
    return _Solution(x, np.sqrt(square), variance, explained)


def _fit(series: Series, lag: float, drift: float | None) -> tuple[_Design, _Solution] | None:
    """Return the model about a lag and a drift, solved; None where the scale is not positive."""
    model = _design(series, lag, drift)
    if model is None:
        return None
    solution = _solve(model.columns[model.inside], series.measured[model.inside])
    if solution is None or solution.coefficients[1] <= 0.0:
        return None
    return model, solution


def _refine(series: Series, lag: float, drift: float | None = None) -> Lag | None:
    """Fit lag, scale, bias and, if not None, drift by Gauss-Newton; None where it fails."""
    width = series.width
    middle = 0.5 * (series.edges[:-1] + series.edges[1:])
    change, fitted = 0.0, None
    for _ in range(_MAX_ITERATIONS):
        fitted = _fit(series, lag, drift)
        if fitted is None:
            return None
        x = fitted[1].coefficients
        change = float(x[0] / x[1])
        lag += float(np.clip(change, -2.0 * width, 2.0 * width))
        if drift is not None:
            drift = float(np.clip(drift + x[2] / x[1], -_LARGEST_DRIFT, _LARGEST_DRIFT))
        if abs(change) < _CONVERGED:
            break
    if fitted is None or abs(change) > _FAILED:
        return None
    model, solution = fitted
    scale = float(solution.coefficients[1])
    at = np.flatnonzero((model.slope != 0.0) & model.inside)
    first, last = (float(middle[k]) for k in (at[0], at[-1])) if len(at) else (0.0, 0.0)
    return Lag(
        lag,
        float(solution.sigma[0]) / scale,
        scale,
        solution.variance,
        solution.explained,
        drift or 0.0,
        np.inf if drift is None else float(solution.sigma[2]) / scale,
        float(middle.mean()),
        first,
        last,
    )


def _biases(inside: Flags) -> list[FloatArray]:
    """Return a column (n,) for the bias around each change of the rate; one for many changes.

    A step of the bias between two ramps is then no lag.
    """
    runs = _runs(inside)
    if not 1 < len(runs) <= _MAX_BIASES:
        return [np.ones(len(inside))]
    columns = []
    for first, last in runs:
        column = np.zeros(len(inside))
        column[first:last] = 1.0
        columns.append(column)
    return columns


def _runs(flags: Flags) -> list[tuple[int, int]]:
    """Return start and stop of the runs of flagged blocks."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _near(flags: Flags, reach: int) -> Flags:
    """Return the blocks within `reach` of a flagged one."""
    at = np.flatnonzero(flags)
    edges = np.zeros(len(flags) + 1)
    np.add.at(edges, np.maximum(at - reach, 0), 1.0)
    np.add.at(edges, np.minimum(at + reach + 1, len(flags)), -1.0)
    return np.asarray(np.cumsum(edges)[:-1] > 0.0)


def _with_drift(series: Series, found: Lag) -> Lag:
    """Return the lag with a drift, where changes of rate far apart show a significant one."""
    if found.last - found.first < _MIN_DRIFT_SPAN:
        return found
    other = _refine(series, found.lag, 0.0)
    at_limit = other is not None and abs(other.drift) > 0.99 * _LARGEST_DRIFT
    if other is None or not other.drifts or at_limit:
        return found
    return other


def find_lag(imu: ImuSource, table: TableLog, axis: FloatArray) -> Lag | None:
    """Return the lag of the gyros' mean rates along the axis (3,) behind the encoder's.

    Gauss-Newton from no lag, and from the shift that correlates best where that fits clearly
    better. None where the table does not change its rate.
    """
    series = rate_series(imu, table, axis)
    return None if series is None else find_in_series(series, correlate(series)[0])


def find_in_series(series: Series, shift: float) -> Lag | None:
    """Return the lag of a series; shift: s, at which both rates correlate best."""
    found = _refine(series, 0.0)
    if abs(shift) > 0.5 * series.width:
        other = _refine(series, shift)
        clear = other is not None and (
            found is None or other.residual_variance < _BETTER * found.residual_variance
        )
        found = other if clear else found
    return None if found is None else _with_drift(series, found)


def bias_step(series: Series) -> BiasStep | None:
    """Return the largest step of the bias at the changes of the rate, fitted without a lag.

    The step is at the start or at the end of each change, whichever fits better. None without a
    change of the rate, or with more than a few.
    """
    model = _design(series, 0.0, None)
    if model is None:
        return None
    changing = (model.slope != 0.0) & model.inside
    runs = [(a, b) for a, b in _runs(model.inside) if changing[a:b].any()]
    if not 1 <= len(runs) <= _MAX_BIASES:
        return None
    middle = 0.5 * (series.edges[:-1] + series.edges[1:])
    rate, best = series.rates(0.0), None
    for at_end, blocks in product((False, True), range(_STEP_BLOCKS)):
        steps, where = [], []
        for first, last in runs:
            at = first + np.flatnonzero(changing[first:last])
            begin = int(at[-1] + 1 - blocks if at_end else at[0] + blocks)
            column = np.zeros(len(model.inside))
            column[begin:last] = 1.0
            steps.append(column)
            where.append((begin, float(rate[last - 1] - rate[first])))
        design = np.column_stack([model.columns[:, 1:], *steps])[model.inside]
        solution = _solve(design, series.measured[model.inside])
        if solution is None or (best is not None and solution.variance > best.residual_variance):
            continue
        sizes = solution.coefficients[-len(runs) :]
        k = int(np.argmax(np.abs(sizes)))
        begin, change = where[k]
        time = float(middle[min(begin, len(middle) - 1)])
        best = BiasStep(float(sizes[k]), time, change, solution.variance)
    return best
