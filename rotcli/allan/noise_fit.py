"""The noise coefficients of one axis, fitted to its overlapping Allan variance.

Everything is SI here: for a gyro Q in rad, N in rad/s/sqrt(Hz), B in rad/s, K in rad/s/sqrt(s),
R in rad/s^2; the model stands in `noise_model`.

Q, N, B, K: weighted non-negative least squares on the variance. The weights are the degrees of
freedom over the squared model, so the solution is that of the chi-squared likelihood. Points at
neighbouring cluster times share their samples; the covariance of the coefficients therefore
comes from the covariance of the whole curve, which the fitted spectrum predicts.
R: the record's linear regression, which knows a ramp far better than the last points of the
curve do (there a ramp is a constant under a chi-squared of one or two degrees of freedom).
"""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rotcli.allan.deviation import degrees_of_freedom, mean_second_difference, overlapping_variance
from rotcli.allan.goodness import Goodness, goodness_of_fit
from rotcli.allan.noise_model import (
    Factors,
    columns,
    curve_covariance,
    noise_type,
    slope_variance,
    slopes,
    terms,
)
from rotcli.allan.spectrum import MIN_WHITE_SHARE, Spectrum

Array = NDArray[np.float64]
Columns = NDArray[np.bool_]

TERMS = ("quantization", "random_walk", "bias_instability", "rate_random_walk")
SHORTEST = 5  # samples; below it the sensor's filter shapes the curve, not its noise
_CAP = 2000.0  # degrees of freedom: no point counts for more than 3 % of its own variance
_KEPT = 1.5  # a term stays in the curve when its square stands this many sigma above zero
_SUPPORT = 3.0  # a coefficient is given when its square stands this many sigma above zero
_RIVAL = 2.0  # the same beside a rival term
_RAMP = 4.0  # the same for the ramp, whose sigma hangs on a K that few points know
MIN_CLUSTERS = 5  # cluster times that a fit of four terms needs
# Of the noise's variance that a line may have at a cluster time: its phase is known to a tenth.
MAX_LINE_SHARE = 0.3


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
    white_share (k,): of the white noise's variance that a low-pass filter passes; variance is
    without spectral lines.
    """

    factors: Factors
    variance: Array
    bend: Array
    trend: float
    n: int
    interval: float
    white_share: Array

    def with_share(self, matrix: Array) -> Array:
        """Return the columns of the terms with the filter's share on the random walk."""
        result = matrix.copy()
        result[:, 1] *= self.white_share
        return result


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """The fitted noise of one axis: coefficients by name, trend, and the model's curve.

    squares: Q^2, N^2, B^2, K^2 of the curve and, with a markov_time (s), the variance of the
        Gauss-Markov term; a weak term that helps the curve stays in it even where its
        coefficient is not significant. ramp: R^2, zero where not significant.
    trend, trend_sigma: slope of the record (unit of the rate per second), significant or not.
    """

    coefficients: dict[str, Coefficient]
    squares: Array
    ramp: float
    trend: float
    trend_sigma: float
    markov_time: float | None = None
    goodness: Goodness | None = None

    def variance(self, tau: Array) -> Array:
        """Return the model's Allan variance at the cluster times tau (s)."""
        return np.asarray(terms(tau, self.markov_time) @ self.squares + 0.5 * self.ramp * tau**2)

    def slope(self, tau: Array) -> Array:
        """Return d ln variance / d ln tau of the model: -2 for Q to 2 for R."""
        noise = terms(tau, self.markov_time) @ self.squares
        trend = 0.5 * self.ramp * tau**2
        own = slopes(tau, self.squares, self.markov_time)
        return np.asarray((noise * own + 2.0 * trend) / (noise + trend))

    def freedom(self, factors: Factors, interval: float, n: int, estimator: str) -> Array:
        """Return the degrees of freedom (k,) of a curve of n phase points, by noise type.

        A ramp is no noise: it makes the variance larger and its relative error smaller, down to
        the error of the ramp itself.
        """
        tau = np.asarray(factors * interval, dtype=float)
        noise = terms(tau, self.markov_time) @ self.squares
        types = noise_type(slopes(tau, self.squares, self.markov_time))
        error = 2.0 * noise**2 / _freedom(factors, types, n, estimator)
        error += self.ramp * (tau**2 * self.trend_sigma) ** 2
        return np.asarray(2.0 * self.variance(tau) ** 2 / error)


def non_negative(matrix: Array, target: Array, allowed: Columns) -> Array:
    """Solve least squares with non-negative unknowns, those not allowed being zero.

    matrix (k, n) with few columns, target (k,). Exact: every set of positive unknowns is tried.
    """
    scale = np.linalg.norm(matrix, axis=0)
    normal = (matrix / scale).T @ (matrix / scale)
    right = (matrix / scale).T @ target
    places = np.flatnonzero(allowed)
    codes = np.arange(1, 2 ** len(places))
    chosen = np.zeros((len(codes), len(right)), dtype=bool)
    chosen[:, places] = codes[:, None] >> np.arange(len(places)) & 1
    # All sets at once: what is not chosen has an equation of its own, x = 0.
    both = chosen[:, :, None] & chosen[:, None, :]
    own = np.where(both, normal, np.eye(len(right)) * ~chosen[:, :, None])
    wanted = np.where(chosen, right, 0.0)
    solutions = (np.linalg.pinv(own, rcond=1e-12, hermitian=True) @ wanted[:, :, None])[:, :, 0]
    # A least-squares solution lowers the cost by solution . right.
    lowered = np.einsum("ij,ij->i", solutions, wanted)
    lowered[~np.all((solutions > 0.0) | ~chosen, axis=1)] = 0.0
    if not lowered.size or lowered.max() <= 0.0:
        return np.zeros(len(right))
    best = int(np.argmax(lowered))
    result: Array = np.where(chosen[best], solutions[best], 0.0) / scale
    return result


def _freedom(factors: Factors, types: NDArray[np.int64], n: int, estimator: str) -> Array:
    pairs = zip(types.tolist(), factors.tolist(), strict=True)
    # Below one the chi-squared formulas no longer hold; such a point carries no weight anyway.
    return np.array([max(degrees_of_freedom(estimator, a, m, n), 1.0) for a, m in pairs])


@dataclass(frozen=True, eq=False)
class _Solution:
    """Squared coefficients of the model's curve.

    squares (p,). significant (p,): of which the record shows that they are not zero.
    sigma (p,): of the squares, other weak terms left open. every, upper (p,): the non-negative
    fit with all terms, and its 95 % limits.
    """

    squares: Array
    significant: Columns
    sigma: Array
    every: Array
    every_sigma: Array
    upper: Array


def _solve(
    variance: Array,
    matrix: Array,
    record: Summary,
    markov_time: float | None,
    steps: int = 4,
) -> _Solution:
    """Fit the terms; drop the weakest until all stand _KEPT sigma above zero.

    Flicker and random walk look alike over a short rise, so a term of _SUPPORT sigma is
    significant only if it stands (_RIVAL sigma) beside each dropped term that would be positive
    too; the largest shift such a rival causes is part of the sigma. `steps` refine the limits.
    """

    def sigmas(squares: Array, weight: Array, freedom: Array, active: Columns) -> Array:
        spread = (matrix @ squares) * np.sqrt(2.0 / freedom)
        curve = curve_covariance(record.factors, record.interval, squares, spread, markov_time)
        return np.sqrt(np.diag(_sandwich(matrix, weight, curve, active)))

    everything = np.ones(matrix.shape[1], dtype=bool)
    every, weight, freedom = _reweighted(variance, matrix, record, markov_time, everything)
    every_sigma = sigmas(every, weight, freedom, everything)
    squares = every
    while True:
        active = squares > 0.0
        sigma = sigmas(squares, weight, freedom, active)
        strength = np.where(active, squares / np.where(active, sigma, 1.0), np.inf)
        weakest = int(np.argmin(strength))
        if strength[weakest] >= _KEPT or active.sum() == 1:
            break
        active[weakest] = False
        squares, weight, freedom = _reweighted(variance, matrix, record, markov_time, active)
    significant, shift = active & (strength >= _SUPPORT), np.zeros(len(squares))
    for rival in np.flatnonzero(~active):
        both = active.copy()
        both[rival] = True
        value = _unbounded(variance, matrix, weight, both)
        if value[rival] <= 0.0:
            continue
        significant &= value >= _RIVAL * sigmas(squares, weight, freedom, both)
        shift = np.maximum(shift, np.where(active, np.abs(value - squares), 0.0))
    sigma = np.hypot(sigma, shift)
    upper = every + 1.645 * every_sigma
    for j in np.flatnonzero(~significant):
        # A limit is a value the record would contradict: its own share widens the spread.
        for _ in range(steps):
            trial = every.copy()
            trial[j] = upper[j]
            upper[j] = every[j] + 1.645 * sigmas(trial, weight, freedom, everything)[j]
    return _Solution(squares, significant, sigma, every, every_sigma, upper)


def _unbounded(variance: Array, matrix: Array, weight: Array, active: Columns) -> Array:
    """Return the weighted least-squares squares (p,) of the active terms, of either sign."""
    root = np.sqrt(weight)
    scaled = matrix[:, active] * root[:, None]
    norm = np.linalg.norm(scaled, axis=0)
    result = np.zeros(matrix.shape[1])
    result[active] = np.linalg.lstsq(scaled / norm, variance * root, rcond=1e-12)[0] / norm
    return result


def _reweighted(
    variance: Array, matrix: Array, record: Summary, markov_time: float | None, allowed: Columns
) -> tuple[Array, Array, Array]:
    """Iterate the fit with weights from its own model; return squares, weights, freedom."""
    model = variance
    tau = np.asarray(record.factors * record.interval, dtype=float)
    types = np.zeros(len(tau), dtype=np.int64)
    for _ in range(8):
        freedom = _freedom(record.factors, types, record.n, "oadev")
        weight = np.minimum(freedom, _CAP) / model**2
        root = np.sqrt(weight)
        squares = non_negative(matrix * root[:, None], variance * root, allowed)
        model = matrix @ squares
        types = noise_type(slopes(tau, squares, markov_time))
    return squares, weight, freedom


def _sandwich(matrix: Array, weight: Array, curve: Array, active: Columns) -> Array:
    """Return the covariance (p, p) of weighted least squares under the true curve covariance."""
    scale = 1.0 / np.linalg.norm(matrix * np.sqrt(weight)[:, None], axis=0)
    a = (matrix * scale)[:, active]
    bread = np.linalg.pinv((a.T * weight) @ a, rcond=1e-12, hermitian=True)
    gain = bread @ (a.T * weight)
    full = np.zeros((len(scale), len(scale)))
    full[np.ix_(active, active)] = gain @ curve @ gain.T
    return full * np.outer(scale, scale)


def summarize(
    phase: Array,
    factors: Factors,
    interval: float,
    variance: Array | None = None,
    spectrum: Spectrum | None = None,
) -> Summary:
    """Take from the mean-free phase (N,) of a record what the fit needs.

    factors: cluster lengths, ascending; those under five samples are left out where enough
    longer ones remain. variance: the overlapping Allan variance there, where known already.
    spectrum: cluster times that its filter or its lines shape are left out, and the rest of the
    lines' variance is subtracted.
    """
    longer = factors >= SHORTEST
    used = longer if np.sum(longer) >= 8 else np.ones(len(factors), dtype=bool)
    if variance is None:
        variance = overlapping_variance(phase, factors, interval)
    share, tau = np.ones(len(factors)), np.asarray(factors * interval, dtype=float)
    if spectrum is not None:
        share = spectrum.white_share(factors, interval)
        used &= share >= MIN_WHITE_SHARE
        lines = np.sum([line.variance(tau) for line in spectrum.lines], axis=0)
        envelope = np.sum([line.envelope(tau) for line in spectrum.lines], axis=0)
        variance = np.maximum(variance - lines, 0.1 * variance)
        used &= envelope <= MAX_LINE_SHARE * variance
    factors = factors[used]
    n = len(phase) - 1
    return Summary(
        factors=factors,
        variance=variance[used],
        white_share=share[used],
        bend=mean_second_difference(phase, factors),
        # sum i y_i = -sum of the running sums, as the last running sum is zero.
        trend=float(-phase.sum() / (n * (n * n - 1.0) / 12.0) / interval**2),
        n=n + 1,
        interval=interval,
    )


def fit_noise(record: Summary, sampling: str, markov_time: float | None = None) -> NoiseFit:
    """Fit the five coefficients to the curve of a record.

    sampling: `instant` or `average`, what a sample means. markov_time (s): the correlation time
    of a Gauss-Markov process in the record, which then has a term of its own. White noise gives
    `random_walk` alone; the others come back as None with a reason and a 95 % upper limit.
    """
    interval, factors = record.interval, record.factors
    duration = (record.n - 1) * interval
    if len(factors) < MIN_CLUSTERS:
        return _unfitted(record, duration)
    tau = factors * interval
    bend = record.trend * tau**2
    straight = record.variance + (bend**2 - 2.0 * bend * record.bend) / (2.0 * tau**2)
    # The last points of a straightened curve hold next to nothing but the regression's own error.
    keep = tau <= 0.25 * duration
    if keep.sum() < 5:
        keep[:] = True
    flat = record.with_share(columns(factors, interval, sampling, duration, markov_time))
    kept = replace(record, factors=factors[keep], white_share=record.white_share[keep])
    without = _solve(straight[keep], flat[keep], kept, markov_time, steps=0)
    slope = slope_variance(duration, markov_time)
    trend_sigma = math.sqrt(without.every @ slope)
    # A random walk makes trends; one that is only just hidden must not pass for a ramp.
    ramp = abs(record.trend) > _RAMP * math.sqrt((without.every + without.every_sigma) @ slope)
    if ramp:
        solution = _solve(straight[keep], flat[keep], kept, markov_time)
    else:
        plain = record.with_share(columns(factors, interval, sampling, None, markov_time))
        solution = _solve(record.variance, plain, record, markov_time)
    named = dict(zip(TERMS, _coefficients(solution, duration), strict=True))
    named["rate_ramp"] = _ramp(record.trend, trend_sigma, ramp)
    return NoiseFit(
        coefficients=named,
        squares=solution.squares,
        ramp=record.trend**2 if ramp else 0.0,
        trend=record.trend,
        trend_sigma=trend_sigma,
        markov_time=markov_time,
        goodness=goodness_of_fit(
            record.factors[keep] if ramp else record.factors,
            interval,
            straight[keep] if ramp else record.variance,
            flat[keep] if ramp else plain,
            solution.squares,
            partial(_freedom, n=record.n, estimator="oadev"),
            markov_time,
        ),
    )


def _unfitted(record: Summary, duration: float) -> NoiseFit:
    """Return a fit without coefficients: too few cluster times show the noise alone."""
    reason = (
        f"a filter or a spectral line shapes all but {len(record.factors)} cluster times of a "
        f"record of {duration:.4g} s; record for longer"
    )
    missing = Coefficient(None, None, None, reason)
    names = (*TERMS, "rate_ramp")
    return NoiseFit(dict.fromkeys(names, missing), np.zeros(4), 0.0, record.trend, math.inf)


def _ramp(trend: float, sigma: float, significant: bool) -> Coefficient:
    if significant:
        return Coefficient(abs(trend), sigma)
    reason = "the record's linear trend lies within four sigma of its noise"
    return Coefficient(None, None, abs(trend) + 1.645 * sigma, reason)


def _coefficients(solution: _Solution, duration: float) -> list[Coefficient]:
    """Turn squares into coefficients: sigma(c) = sigma(c^2) / (2 c)."""
    result = []
    for square, significant, sigma, upper in zip(
        solution.squares[:4],
        solution.significant[:4],
        solution.sigma[:4],
        solution.upper[:4],
        strict=True,
    ):
        if significant:
            value = math.sqrt(square)
            result.append(Coefficient(value, float(sigma) / (2.0 * value)))
        else:
            reason = f"not significant in a record of {duration:.4g} s"
            result.append(Coefficient(None, None, math.sqrt(upper), reason))
    return result
