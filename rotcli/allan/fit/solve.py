"""Weighted non-negative least squares of an Allan variance, and the significance of its terms.

The weights are the degrees of freedom over the squared model, so the solution is that of the
chi-squared likelihood. Points at neighbouring cluster times share their samples; the covariance
of the coefficients therefore comes from the covariance of the complete curve, which the fitted
spectrum predicts.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.allan.fit.model import curve_covariance, noise_type, slopes
from rotcli.allan.fit.summary import Summary
from rotcli.allan.pooled import pooled_freedom
from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

Columns = NDArray[np.bool_]

_MAX_FREEDOM = 2000.0  # degrees of freedom: no point counts for more than 3 % of its variance
_MIN_KEPT = 1.5  # a term stays in the curve when its square is this many sigma above zero
_MIN_SIGNIFICANT = 3.0  # sigma of its square from which a coefficient is significant
_MIN_WITH_RIVAL = 2.0  # the same next to a rival term
_UPPER_95 = 1.645  # sigma: one-sided 95 % limit of a normal variable
_REWEIGHTINGS = 8  # of the weights by the fitted model; the sixth changes nothing


@dataclass(frozen=True, eq=False)
class Solution:
    """Squared coefficients of the model's curve.

    squares (p,). significant (p,): of which the record shows that they are not zero.
    sigma (p,): of the squares, other weak terms left open. every, upper (p,): the non-negative
    fit with all terms, and its 95 % limits. weight (k,): of the points.
    """

    squares: FloatArray
    significant: Columns
    sigma: FloatArray
    every: FloatArray
    every_sigma: FloatArray
    upper: FloatArray
    weight: FloatArray


def freedom_of(
    factors: NDArray[np.int64], types: NDArray[np.int64], lengths: tuple[int, ...], estimator: str
) -> FloatArray:
    """Return the degrees of freedom (k,) of a curve by cluster length and noise type."""
    pairs = zip(types.tolist(), factors.tolist(), strict=True)
    return np.array([pooled_freedom(estimator, a, m, lengths) for a, m in pairs])


def non_negative(matrix: FloatArray, target: FloatArray, allowed: Columns) -> FloatArray:
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
    # All sets at once: an unknown that is not chosen has the equation x = 0.
    both = chosen[:, :, None] & chosen[:, None, :]
    system = np.where(both, normal, np.eye(len(right)) * ~chosen[:, :, None])
    wanted = np.where(chosen, right, 0.0)
    solutions = (np.linalg.pinv(system, rcond=1e-12, hermitian=True) @ wanted[:, :, None])[:, :, 0]
    # A least-squares solution lowers the cost by solution . right.
    lowered = np.einsum("ij,ij->i", solutions, wanted)
    lowered[~np.all((solutions > 0.0) | ~chosen, axis=1)] = 0.0
    if not lowered.size or lowered.max() <= 0.0:
        return np.zeros(len(right))
    best = int(np.argmax(lowered))
    result: FloatArray = np.where(chosen[best], solutions[best], 0.0) / scale
    return result


@dataclass(frozen=True, eq=False)
class _Problem:
    """Variance (k,) and unit terms (k, p) of a record, with the correlation time of the last."""

    variance: FloatArray
    matrix: FloatArray
    record: Summary
    markov_time: float | None

    def sigmas(
        self, squares: FloatArray, weight: FloatArray, freedom: FloatArray, active: Columns
    ) -> FloatArray:
        """Return the sigma (p,) of the active squares if the truth is `squares`."""
        spread = (self.matrix @ squares) * np.sqrt(2.0 / freedom)
        factors, interval = self.record.factors, self.record.interval
        curve = curve_covariance(factors, interval, squares, spread, self.markov_time)
        return np.sqrt(np.diag(_sandwich(self.matrix, weight, curve, active)))

    def reweighted(self, allowed: Columns) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Iterate the fit with weights from its model; return squares, weights, freedom."""
        record, model = self.record, self.variance
        tau = np.asarray(record.factors * record.interval, dtype=float)
        types = np.zeros(len(tau), dtype=np.int64)
        for _ in range(_REWEIGHTINGS):
            freedom = freedom_of(record.factors, types, record.lengths, "oadev")
            weight = np.minimum(freedom, _MAX_FREEDOM) / model**2
            root = np.sqrt(weight)
            squares = non_negative(self.matrix * root[:, None], self.variance * root, allowed)
            model = self.matrix @ squares
            types = noise_type(slopes(tau, squares, self.markov_time))
        return squares, weight, freedom


def solve(
    variance: FloatArray,
    matrix: FloatArray,
    record: Summary,
    markov_time: float | None,
    steps: int = 4,
) -> Solution:
    """Fit the terms; drop the weakest until all are _MIN_KEPT sigma above zero.

    Flicker and random walk look alike over a short rise, so a term of _MIN_SIGNIFICANT sigma is
    significant only if it remains (_MIN_WITH_RIVAL sigma) next to each dropped term that would be
    positive too; the largest shift such a rival causes is part of the sigma. `steps` refine the
    limits.
    """
    problem = _Problem(variance, matrix, record, markov_time)
    everything = np.ones(matrix.shape[1], dtype=bool)
    every, weight, freedom = problem.reweighted(everything)
    every_sigma = problem.sigmas(every, weight, freedom, everything)
    upper = every + _UPPER_95 * every_sigma
    squares, active, sigma, weight, kept_freedom, strength = _drop_weak(
        problem, every, weight, freedom
    )
    significant, shift = _against_rivals(problem, squares, active, weight, kept_freedom, strength)
    for j in np.flatnonzero(~significant):
        # A limit is a value the record would contradict: its share widens the spread.
        for _ in range(steps):
            trial = every.copy()
            trial[j] = upper[j]
            spread = problem.sigmas(trial, weight, kept_freedom, everything)[j]
            upper[j] = every[j] + _UPPER_95 * spread
    sigma = np.hypot(sigma, shift)
    return Solution(squares, significant, sigma, every, every_sigma, upper, weight)


def _drop_weak(
    problem: _Problem, every: FloatArray, weight: FloatArray, freedom: FloatArray
) -> tuple[FloatArray, Columns, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return squares, active terms, their sigmas, weights, freedom and strength in sigmas."""
    squares = every
    while True:
        active = squares > 0.0
        sigma = problem.sigmas(squares, weight, freedom, active)
        strength = np.where(active, squares / np.where(active, sigma, 1.0), np.inf)
        weakest = int(np.argmin(strength))
        if strength[weakest] >= _MIN_KEPT or active.sum() == 1:
            return squares, active, sigma, weight, freedom, strength
        active[weakest] = False
        squares, weight, freedom = problem.reweighted(active)


def _against_rivals(
    problem: _Problem,
    squares: FloatArray,
    active: Columns,
    weight: FloatArray,
    freedom: FloatArray,
    strength: FloatArray,
) -> tuple[Columns, FloatArray]:
    """Return which terms remain significant next to each dropped one, and the largest shifts."""
    significant, shift = active & (strength >= _MIN_SIGNIFICANT), np.zeros(len(squares))
    for rival in np.flatnonzero(~active):
        both = active.copy()
        both[rival] = True
        value = _unbounded(problem.variance, problem.matrix, weight, both)
        if value[rival] <= 0.0:
            continue
        significant &= value >= _MIN_WITH_RIVAL * problem.sigmas(squares, weight, freedom, both)
        shift = np.maximum(shift, np.where(active, np.abs(value - squares), 0.0))
    return significant, shift


def _unbounded(
    variance: FloatArray, matrix: FloatArray, weight: FloatArray, active: Columns
) -> FloatArray:
    """Return the weighted least-squares squares (p,) of the active terms, of either sign."""
    root = np.sqrt(weight)
    scaled = matrix[:, active] * root[:, None]
    norm = np.linalg.norm(scaled, axis=0)
    result = np.zeros(matrix.shape[1])
    result[active] = np.linalg.lstsq(scaled / norm, variance * root, rcond=1e-12)[0] / norm
    return result


def _sandwich(
    matrix: FloatArray, weight: FloatArray, curve: FloatArray, active: Columns
) -> FloatArray:
    """Return the covariance (p, p) of weighted least squares under the true curve covariance."""
    scale = 1.0 / np.linalg.norm(matrix * np.sqrt(weight)[:, None], axis=0)
    a = (matrix * scale)[:, active]
    bread = np.linalg.pinv((a.T * weight) @ a, rcond=1e-12, hermitian=True)
    gain = bread @ (a.T * weight)
    full = np.zeros((len(scale), len(scale)))
    full[np.ix_(active, active)] = gain @ curve @ gain.T
    return full * np.outer(scale, scale)


def tau_range(
    matrix: FloatArray, weight: FloatArray, active: Columns, term: int
) -> tuple[int, int]:
    """Return the first and last point that contribute the middle 80 % of a term's information.

    The information of a point is the square of the term's weighted column after the projection
    onto the other active terms' columns.
    """
    scaled = matrix * np.sqrt(weight)[:, None]
    column = scaled[:, term]
    others = scaled[:, active & (np.arange(matrix.shape[1]) != term)]
    if others.shape[1]:
        others = others / np.linalg.norm(others, axis=0)
        column = column - others @ np.linalg.lstsq(others, column, rcond=1e-12)[0]
    share = np.cumsum(column**2) / np.sum(column**2)
    return int(np.searchsorted(share, 0.1)), int(np.searchsorted(share, 0.9))
