"""The noise coefficients of one axis, fitted to its overlapping Allan variance.

Everything is SI here: for a gyro Q in rad, N in rad/s/sqrt(Hz), B in rad/s, K in rad/s/sqrt(s),
R in rad/s^2; `rotcli.allan.fit.model` has the model.

Q, N, B, K: weighted non-negative least squares on the variance (`rotcli.allan.fit.solve`).
R: the record's linear regression, which knows a ramp far better than the last points of the
curve do (there a ramp is a constant under a chi-squared of one or two degrees of freedom).
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from rotcli.allan.fit.goodness import Goodness, goodness_of_fit
from rotcli.allan.fit.model import Factors, columns, mixed_freedom, noise_type, slopes, terms
from rotcli.allan.fit.solve import Solution, freedom_of, solve, tau_range
from rotcli.allan.fit.summary import Summary
from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

TERMS = ("quantization", "random_walk", "bias_instability", "rate_random_walk")
_RAMP_SIGMAS = 4.0  # of the ramp, whose sigma depends on a K that few points know
MIN_CLUSTERS = 5  # cluster times that a fit of four terms needs


@dataclass(frozen=True)
class Coefficient:
    """One noise coefficient (SI), or why the record does not give it.

    value, sigma: None when not significant; then `reason` says why and `upper` (95 %) bounds it.
    tau: first and last cluster time (s) that the value rests on.
    """

    value: float | None
    sigma: float | None
    upper: float | None = None
    reason: str | None = None
    tau: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """The fitted noise of one axis: coefficients by name, trend, and the model's curve.

    squares: Q^2, N^2, B^2, K^2 of the curve and, with a markov_time (s), the variance of the
        Gauss-Markov term; a weak term that helps the curve stays in it even where its
        coefficient is not significant. ramp: R^2, zero where not significant.
    trend, trend_sigma: slope of the record (unit of the rate per second), significant or not.
    """

    coefficients: dict[str, Coefficient]
    squares: FloatArray
    ramp: float
    trend: float
    trend_sigma: float
    markov_time: float | None = None
    goodness: Goodness | None = None

    def variance(self, tau: FloatArray) -> FloatArray:
        """Return the model's Allan variance at the cluster times tau (s)."""
        return np.asarray(terms(tau, self.markov_time) @ self.squares + 0.5 * self.ramp * tau**2)

    def slope(self, tau: FloatArray) -> FloatArray:
        """Return d ln variance / d ln tau of the model: -2 for Q to 2 for R."""
        noise = terms(tau, self.markov_time) @ self.squares
        trend = 0.5 * self.ramp * tau**2
        slope = slopes(tau, self.squares, self.markov_time)
        return np.asarray((noise * slope + 2.0 * trend) / (noise + trend))

    def freedom(
        self, factors: Factors, interval: float, lengths: tuple[int, ...], estimator: str
    ) -> FloatArray:
        """Return the degrees of freedom (k,) of a curve, by the fitted noises.

        lengths: phase points of the segments. Without a fitted term the noise counts as white.
        A ramp is no noise: it makes the variance larger and its relative error smaller, down to
        the error of the ramp itself.
        """
        tau = np.asarray(factors * interval, dtype=float)
        each = terms(tau, self.markov_time)
        types = [noise_type(slopes(tau, unit, self.markov_time)) for unit in np.eye(each.shape[1])]
        if not np.any(self.squares):
            return freedom_of(factors, types[1], lengths, estimator)
        freedoms = np.stack(
            [freedom_of(factors, kinds, lengths, estimator) for kinds in types], axis=1
        )
        variances = each * self.squares
        noise = variances.sum(axis=1)
        mixed = mixed_freedom(factors, interval, variances, freedoms, self.markov_time)
        error = 2.0 * noise**2 / np.maximum(mixed, 1.0)
        error += self.ramp * (tau**2 * self.trend_sigma) ** 2
        return np.asarray(2.0 * self.variance(tau) ** 2 / error)


def fit_noise(record: Summary, sampling: str, markov_time: float | None = None) -> NoiseFit:
    """Fit the five coefficients to the curve of a record.

    sampling: `instant` or `average`, what a sample means. markov_time (s): the correlation time
    of a Gauss-Markov process in the record, which then has a term of its own. White noise gives
    `random_walk` alone; the others come back as None with a reason and a 95 % upper limit.
    """
    if len(record.factors) < MIN_CLUSTERS:
        return _unfitted(record)
    straight, detrended = _detrended(record, sampling, markov_time)
    without = solve(straight.variance, detrended, straight, markov_time, steps=0)
    slope = record.slope_variance(markov_time)
    trend_sigma = math.sqrt(without.every @ slope)
    # A random walk makes trends; one that is only just hidden must not pass for a ramp.
    limit = _RAMP_SIGMAS * math.sqrt((without.every + without.every_sigma) @ slope)
    ramp = abs(record.trend) > limit
    if ramp:
        fitted, matrix = straight, detrended
    else:
        fitted = record
        matrix = record.with_share(
            columns(record.factors, record.interval, sampling, None, markov_time)
        )
    solution = solve(fitted.variance, matrix, fitted, markov_time)
    named = dict(zip(TERMS, _coefficients(solution, matrix, fitted), strict=True))
    named["rate_ramp"] = _ramp(record, trend_sigma, significant=ramp)
    return NoiseFit(
        coefficients=named,
        squares=solution.squares,
        ramp=record.trend**2 if ramp else 0.0,
        trend=record.trend,
        trend_sigma=trend_sigma,
        markov_time=markov_time,
        goodness=goodness_of_fit(
            fitted.factors,
            record.interval,
            fitted.variance,
            matrix,
            solution.squares,
            partial(freedom_of, lengths=record.lengths, estimator="oadev"),
            markov_time,
        ),
    )


def _detrended(
    record: Summary, sampling: str, markov_time: float | None
) -> tuple[Summary, FloatArray]:
    """Return the curve of the record without its regression line, and the unit terms of it.

    The last points of a straightened curve contain next to nothing but the regression's error.
    """
    tau = record.factors * record.interval
    bend = record.trend * tau**2
    straight = record.variance + (bend**2 - 2.0 * bend * record.bend) / (2.0 * tau**2)
    keep = tau <= 0.25 * record.duration
    if keep.sum() < MIN_CLUSTERS:
        keep[:] = True
    lost = record.slope_variance(markov_time)
    matrix = record.with_share(
        columns(record.factors, record.interval, sampling, lost, markov_time)
    )
    kept = replace(
        record,
        factors=record.factors[keep],
        variance=straight[keep],
        bend=record.bend[keep],
        white_share=record.white_share[keep],
    )
    return kept, matrix[keep]


def without_coefficients(fit: NoiseFit, reason: str) -> NoiseFit:
    """Return a fit whose coefficients are null for one reason."""
    missing = Coefficient(None, None, None, reason)
    return replace(fit, coefficients=dict.fromkeys(fit.coefficients, missing))


def _unfitted(record: Summary) -> NoiseFit:
    """Return a fit without coefficients: too few cluster times show the noise alone."""
    reason = (
        f"a filter or a spectral line shapes all but {len(record.factors)} cluster times of a "
        f"record of {record.duration:.4g} s; record for longer"
    )
    missing = Coefficient(None, None, None, reason)
    names = (*TERMS, "rate_ramp")
    return NoiseFit(dict.fromkeys(names, missing), np.zeros(4), 0.0, record.trend, math.inf)


def _ramp(record: Summary, sigma: float, *, significant: bool) -> Coefficient:
    if significant:
        return Coefficient(abs(record.trend), sigma, tau=(record.duration, record.duration))
    reason = "the record's linear trend lies within four sigma of its noise"
    return Coefficient(None, None, abs(record.trend) + 1.645 * sigma, reason)


def _coefficients(solution: Solution, matrix: FloatArray, record: Summary) -> list[Coefficient]:
    """Turn squares into coefficients: sigma(c) = sigma(c^2) / (2 c)."""
    result = []
    for term in range(len(TERMS)):
        if solution.significant[term]:
            value = math.sqrt(solution.squares[term])
            first, last = tau_range(matrix, solution.weight, solution.squares > 0.0, term)
            tau = tuple(float(record.factors[k] * record.interval) for k in (first, last))
            sigma = float(solution.sigma[term]) / (2.0 * value)
            result.append(Coefficient(value, sigma, tau=(tau[0], tau[1])))
        else:
            reason = f"not significant in a record of {record.duration:.4g} s"
            upper = math.sqrt(solution.upper[term])
            result.append(Coefficient(None, None, upper, reason))
    return result
