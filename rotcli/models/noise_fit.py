"""The noise coefficients of one axis, fitted to its overlapping Allan variance.

    sigma^2(tau) = 3 Q^2/tau^2 + N^2/tau + (2 ln2/pi) B^2 + K^2 tau/3 + R^2 tau^2/2

(IEEE Std 952; B on the two-sided density, so the flat floor is 0.664 B.) Everything is SI here:
for a gyro Q in rad, N in rad/s/sqrt(Hz), B in rad/s, K in rad/s/sqrt(s), R in rad/s^2.

Q, N, B, K: weighted non-negative least squares on the variance. The weights are the degrees of
freedom over the squared model, so the solution is that of the chi-squared likelihood. Points at
neighbouring cluster times share their samples; the covariance of the coefficients therefore
comes from the covariance of the whole curve, which the fitted spectrum predicts.
R: the record's linear regression, which knows a ramp far better than the last points of the
curve do (there a ramp is a constant under a chi-squared of one or two degrees of freedom).
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rotcli.models.allan_variance import (
    Factors,
    degrees_of_freedom,
    mean_second_difference,
    overlapping_variance,
)

Array = NDArray[np.float64]
Columns = NDArray[np.bool_]

TERMS = ("quantization", "random_walk", "bias_instability", "rate_random_walk")
FLICKER_FLOOR = 2.0 * math.log(2.0) / math.pi  # of B^2
_SLOPES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # d ln variance / d ln tau of the five terms
SHORTEST = 5  # samples; below it the sensor's filter shapes the curve, not its noise
_CAP = 2000.0  # degrees of freedom: no point counts for more than 3 % of its own variance
_KEPT = 1.5  # a term stays in the curve when its square stands this many sigma above zero
_SUPPORT = 3.0  # a coefficient is given when its square stands this many sigma above zero
_RIVAL = 2.0  # the same beside a rival term
_RAMP = 4.0  # the same for the ramp, whose sigma hangs on a K that few points know


@dataclass(frozen=True)
class Coefficient:
    """One noise coefficient (SI), or why the record does not give it.

    value, sigma: None when unsupported; then `reason` says why and `upper` (95 %) bounds it.
    """

    value: float | None
    sigma: float | None
    upper: float | None = None
    reason: str | None = None


@dataclass(frozen=True, eq=False)
class Summary:
    """What the fit needs of a record of n phase points.

    factors (k,): cluster lengths, samples. variance (k,): the overlapping Allan variance there.
    bend (k,): the mean second difference of the phase. trend: the regression slope of the rate.
    """

    factors: Factors
    variance: Array
    bend: Array
    trend: float
    n: int
    interval: float


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """The fitted noise of one axis: coefficients by name, trend, and the model's curve.

    squares: (5,) Q^2, N^2, B^2, K^2, R^2 of the curve; a weak term that helps the curve stays in
        it even where its coefficient is not told.
    trend, trend_sigma: slope of the record (unit of the rate per second), supported or not.
    """

    coefficients: dict[str, Coefficient]
    squares: Array
    trend: float
    trend_sigma: float

    def variance(self, tau: Array) -> Array:
        """Return the model's Allan variance at the cluster times tau (s)."""
        return np.asarray(_model(tau) @ self.squares)

    def slope(self, tau: Array) -> Array:
        """Return d ln variance / d ln tau of the model: -2 for Q to 2 for R."""
        shares = _model(tau) * self.squares
        return np.asarray((shares @ _SLOPES) / shares.sum(axis=1))

    def freedom(self, factors: Factors, interval: float, n: int, estimator: str) -> Array:
        """Return the degrees of freedom (k,) of a curve of n phase points, by noise type.

        A ramp is no noise: it makes the variance larger and its relative error smaller, down to
        the error of the ramp itself.
        """
        tau = np.asarray(factors * interval, dtype=float)
        noise = _model(tau)[:, :4] * self.squares[:4]
        types = noise_type((noise @ _SLOPES[:4]) / noise.sum(axis=1))
        freedom = _freedom(factors, n, types, estimator)
        error = 2.0 * noise.sum(axis=1) ** 2 / freedom
        error += self.squares[4] * (tau**2 * self.trend_sigma) ** 2
        return np.asarray(2.0 * self.variance(tau) ** 2 / error)


def noise_type(slope: Array) -> NDArray[np.int64]:
    """Return the noise type alpha (2, 0, -1, -2) at each point from the slope of the variance."""
    return np.select([slope < -1.5, slope < -0.5, slope < 0.5], [2, 0, -1], -2)


def _model(tau: Array) -> Array:
    """Return the five terms of the model (k, 5) for unit squared coefficients."""
    return np.stack(
        [3.0 / tau**2, 1.0 / tau, np.full_like(tau, FLICKER_FLOOR), tau / 3.0, tau**2 / 2.0],
        axis=-1,
    )


def _columns(factors: Factors, interval: float, sampling: str, detrended: float | None) -> Array:
    """Return the expected variance (k, 4) of unit Q^2, N^2, B^2, K^2 as this record shows it.

    Samples of the rate at an instant alias what averages smooth: a random walk then gives
    K^2 tau/3 (1 + 1/(2 m^2)) exactly, flicker about 1 + 0.7/m^2 (0.5 band-limited, 0.86 for the
    fractional-difference model). A removed regression line over `detrended` seconds takes
    tau^2/2 times the variance of its slope away.
    """
    m = factors.astype(float)
    tau = m * interval
    columns = _model(tau)[:, :4]
    if sampling == "instant":
        columns[:, 2] *= 1.0 + 0.7 / m**2
        columns[:, 3] *= 1.0 + 0.5 / m**2
    if detrended is not None:
        columns -= 0.5 * tau[:, None] ** 2 * _slope_variance(detrended)
    return columns


def _slope_variance(duration: float) -> Array:
    """Return the variance of a regression slope under unit Q^2, N^2, B^2, K^2 (4,).

    The slope's weights have the spectrum |W|^2 = 36 j1(pi f T)^2 / T^2 (j1: spherical Bessel);
    its integrals with 1, 1/f and 1/f^2 are closed. Q: white angle noise met at both ends.
    """
    t = duration
    return np.array([72.0 / t**4, 12.0 / t**3, 9.0 / (math.pi * t**2), 6.0 / (5.0 * t)])


@lru_cache(maxsize=8)
def _spectral_products(factors: tuple[int, ...], interval: float) -> Array:
    """Return the integrals (4, 4, k, k) of T_i T_j H_a H_b over frequency.

    T: the spectra of unit Q^2, N^2, B^2, K^2; H: the Allan filter
    2 sin^4(pi f tau) / (m sin(pi f interval))^2. Where a filter oscillates faster than the
    logarithmic grid, the grid takes its mean.
    """
    m = np.array(factors, dtype=float)[:, None]
    f = np.geomspace(0.02 / (m[-1, 0] * interval), 0.5 / interval, 1500)
    sine = np.sin(math.pi * f * interval)
    angular = 2.0 * math.pi * f
    terms = [4.0 * sine**2 / interval, np.ones_like(f), 1.0 / angular, 1.0 / angular**2]
    filters = np.sin(math.pi * f * m * interval) ** 4 / (m * sine) ** 2 * np.sqrt(f)
    products = np.empty((4, 4, len(factors), len(factors)))
    for i in range(4):
        for j in range(i, 4):
            products[i, j] = products[j, i] = (filters * (terms[i] * terms[j])) @ filters.T
    return products


def _curve_covariance(factors: Factors, interval: float, squares: Array, spread: Array) -> Array:
    """Return the covariance (k, k) of the variances at the given clusters.

    For a Gaussian record cov(a, b) is proportional to the integral of S^2 H_a H_b, S the
    spectrum of the model; this gives the correlation, `spread` (k,) the sigma of each point.
    """
    products = _spectral_products(tuple(factors.tolist()), interval)
    full = np.einsum("i,j,ijkl->kl", squares, squares, products, optimize=True)
    scale = spread / np.sqrt(np.diag(full))
    return np.asarray(full * np.outer(scale, scale))


def non_negative(matrix: Array, target: Array, allowed: Columns) -> Array:
    """Solve least squares with non-negative unknowns, those not allowed being zero.

    matrix (k, n) with few columns, target (k,). Exact: every set of positive unknowns is tried.
    """
    scale = np.linalg.norm(matrix, axis=0)
    normal = (matrix / scale).T @ (matrix / scale)
    right = (matrix / scale).T @ target
    places = np.flatnonzero(allowed)
    best, gain = np.zeros(matrix.shape[1]), 0.0
    for code in range(1, 2 ** len(places)):
        chosen = places[[bool(code >> bit & 1) for bit in range(len(places))]]
        solution = np.linalg.lstsq(normal[np.ix_(chosen, chosen)], right[chosen], rcond=1e-12)[0]
        # A least-squares solution lowers the cost by solution . right.
        if np.all(solution > 0.0) and (lowered := float(solution @ right[chosen])) > gain:
            best, gain = np.zeros(matrix.shape[1]), lowered
            best[chosen] = solution / scale[chosen]
    return best


def _freedom(factors: Factors, n: int, types: NDArray[np.int64], estimator: str) -> Array:
    pairs = zip(types.tolist(), factors.tolist(), strict=True)
    # Below one the chi-squared formulas no longer hold; such a point carries no weight anyway.
    return np.array([max(degrees_of_freedom(estimator, a, m, n), 1.0) for a, m in pairs])


@dataclass(frozen=True, eq=False)
class _Solution:
    """squares (4,): those of the model's curve. told (4,): which of them the record supports.

    sigma (4,): of the squares, other weak terms left open. every, upper (4,): the non-negative
    fit with all four, and its 95 % limits.
    """

    squares: Array
    told: Columns
    sigma: Array
    every: Array
    every_sigma: Array
    upper: Array


def _solve(variance: Array, columns: Array, factors: Factors, interval: float, n: int) -> _Solution:
    """Fit the terms; drop the weakest until all stand _KEPT sigma above zero.

    Flicker and random walk look alike over a short rise, so a term of _SUPPORT sigma is still
    not told unless it stands (_RIVAL sigma) beside each dropped term that would be positive too;
    the largest shift such a rival causes is part of the sigma.
    """

    def sigmas(squares: Array, weight: Array, freedom: Array, active: Columns) -> Array:
        spread = (columns @ squares) * np.sqrt(2.0 / freedom)
        curve = _curve_covariance(factors, interval, squares, spread)
        return np.sqrt(np.diag(_sandwich(columns, weight, curve, active)))

    active = np.ones(4, dtype=bool)
    every, weight, freedom = _reweighted(variance, columns, factors, n, active)
    every_sigma = sigmas(every, weight, freedom, active)
    squares = every
    while True:
        active = squares > 0.0
        sigma = sigmas(squares, weight, freedom, active)
        strength = np.where(active, squares / np.where(active, sigma, 1.0), np.inf)
        weakest = int(np.argmin(strength))
        if strength[weakest] >= _KEPT or active.sum() == 1:
            break
        active[weakest] = False
        squares, weight, freedom = _reweighted(variance, columns, factors, n, active)
    told, shift = active & (strength >= _SUPPORT), np.zeros(4)
    for rival in np.flatnonzero(~active):
        both = active.copy()
        both[rival] = True
        value = _unbounded(variance, columns, weight, both)
        if value[rival] <= 0.0:
            continue
        told &= value >= _RIVAL * sigmas(squares, weight, freedom, both)
        shift = np.maximum(shift, np.where(active, np.abs(value - squares), 0.0))
    sigma = np.hypot(sigma, shift)
    upper = every + 1.645 * every_sigma
    for j in np.flatnonzero(~told):
        # A limit is a value the record would contradict: its own share widens the spread.
        for _ in range(4):
            trial = every.copy()
            trial[j] = upper[j]
            all_four = np.ones(4, dtype=bool)
            upper[j] = every[j] + 1.645 * sigmas(trial, weight, freedom, all_four)[j]
    return _Solution(squares, told, sigma, every, every_sigma, upper)


def _unbounded(variance: Array, columns: Array, weight: Array, active: Columns) -> Array:
    """Return the weighted least-squares squares (4,) of the active terms, of either sign."""
    root = np.sqrt(weight)
    scaled = columns[:, active] * root[:, None]
    norm = np.linalg.norm(scaled, axis=0)
    result = np.zeros(columns.shape[1])
    result[active] = np.linalg.lstsq(scaled / norm, variance * root, rcond=1e-12)[0] / norm
    return result


def _reweighted(
    variance: Array, columns: Array, factors: Factors, n: int, allowed: Columns
) -> tuple[Array, Array, Array]:
    """Iterate the fit with weights from its own model; return squares, weights, freedom."""
    model = variance
    tau_slope = np.full(len(factors), -1.0)
    for _ in range(8):
        freedom = _freedom(factors, n, noise_type(tau_slope), "oadev")
        weight = np.minimum(freedom, _CAP) / model**2
        root = np.sqrt(weight)
        squares = non_negative(columns * root[:, None], variance * root, allowed)
        model = columns @ squares
        shares = columns * squares
        tau_slope = (shares @ _SLOPES[:4]) / shares.sum(axis=1)
    return squares, weight, freedom


def _sandwich(columns: Array, weight: Array, curve: Array, active: Columns) -> Array:
    """Return the covariance (4, 4) of weighted least squares under the true curve covariance."""
    scale = 1.0 / np.linalg.norm(columns * np.sqrt(weight)[:, None], axis=0)
    a = (columns * scale)[:, active]
    bread = np.linalg.pinv((a.T * weight) @ a, rcond=1e-12, hermitian=True)
    gain = bread @ (a.T * weight)
    full = np.zeros((4, 4))
    full[np.ix_(active, active)] = gain @ curve @ gain.T
    return full * np.outer(scale, scale)


def summarize(
    phase: Array, factors: Factors, interval: float, variance: Array | None = None
) -> Summary:
    """Take from the mean-free phase (N,) of a record what the fit needs.

    factors: cluster lengths, ascending; those under five samples are left out where enough
    longer ones remain. variance: the overlapping Allan variance there, where known already.
    """
    longer = factors >= SHORTEST
    used = longer if np.sum(longer) >= 8 else np.ones(len(factors), dtype=bool)
    factors = factors[used]
    n = len(phase) - 1
    return Summary(
        factors=factors,
        variance=overlapping_variance(phase, factors, interval)
        if variance is None
        else variance[used],
        bend=mean_second_difference(phase, factors),
        # sum i y_i = -sum of the running sums, as the last running sum is zero.
        trend=float(-phase.sum() / (n * (n * n - 1.0) / 12.0) / interval**2),
        n=n + 1,
        interval=interval,
    )


def fit_noise(record: Summary, sampling: str) -> NoiseFit:
    """Fit the five coefficients to the curve of a record.

    sampling: `instant` or `average`, what a sample means. White noise gives `random_walk` alone;
    the others come back as None with a reason and a 95 % upper limit.
    """
    n, interval, factors = record.n, record.interval, record.factors
    duration = (n - 1) * interval
    tau = factors * interval
    bend = record.trend * tau**2
    straight = record.variance + (bend**2 - 2.0 * bend * record.bend) / (2.0 * tau**2)
    # The last points of a straightened curve hold next to nothing but the regression's own error.
    keep = tau <= 0.25 * duration
    if keep.sum() < 5:
        keep[:] = True
    flat = _columns(factors, interval, sampling, duration)
    without = _solve(straight[keep], flat[keep], factors[keep], interval, n)
    trend_sigma = math.sqrt(without.every @ _slope_variance(duration))
    # A random walk makes trends; one that is only just hidden must not pass for a ramp.
    hidden = without.every + without.every_sigma
    ramp = abs(record.trend) > _RAMP * math.sqrt(hidden @ _slope_variance(duration))
    plain = _columns(factors, interval, sampling, None)
    solution = without if ramp else _solve(record.variance, plain, factors, interval, n)
    named = dict(zip(TERMS, _coefficients(solution, duration), strict=True))
    size = abs(record.trend)
    named["rate_ramp"] = (
        Coefficient(size, trend_sigma)
        if ramp
        else Coefficient(
            None,
            None,
            size + 1.645 * trend_sigma,
            "the record's linear trend lies within four sigma of its noise",
        )
    )
    squares = np.append(solution.squares, record.trend**2 if ramp else 0.0)
    return NoiseFit(named, squares, record.trend, trend_sigma)


def _coefficients(solution: _Solution, duration: float) -> list[Coefficient]:
    """Turn squares into coefficients: sigma(c) = sigma(c^2) / (2 c)."""
    result = []
    for square, told, sigma, upper in zip(
        solution.squares, solution.told, solution.sigma, solution.upper, strict=True
    ):
        if told:
            value = math.sqrt(square)
            result.append(Coefficient(value, float(sigma) / (2.0 * value)))
        else:
            reason = f"not told from zero by a record of {duration:.4g} s"
            result.append(Coefficient(None, None, math.sqrt(upper), reason))
    return result
