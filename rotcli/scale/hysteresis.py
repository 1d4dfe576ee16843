"""Hysteresis of the error curve: readings reached from a lower rate minus from a higher rate.

A single sweep cannot separate it from drift better than the noise allows; repeat the sweep.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import fit_gls, predict
from rotcli.scale.curves import TABLE
from rotcli.scale.figures import Figure
from rotcli.scale.fit import CurveProblem
from rotcli.units import FloatArray

SIGNIFICANT = 3.0  # sigmas


@dataclass(frozen=True, eq=False)
class Hysteresis:
    """Up minus down, rad/s: constant over rate, and per rate that was reached from both sides.

    limit: upper limit |h| + 2 sigma where h is not significant (3 sigma), else None.
    """

    difference: Figure
    limit: float | None
    rates: FloatArray
    per_rate: FloatArray
    per_rate_sigma: FloatArray


def directions(problem: CurveProblem) -> FloatArray:
    """Return +1 (k,) for blocks reached from a lower rate, -1 from a higher, 0 for the first.

    A repeated rate begins the next sweep and has its direction: 50 100 100 50 are first, up,
    down, down.
    """
    _, group = problem.groups
    direction = np.zeros(len(group))
    following = 0.0
    for k in range(len(group) - 1, 0, -1):
        if problem.log_number[k] != problem.log_number[k - 1]:
            following = 0.0
            continue
        step = float(np.sign(group[k] - group[k - 1]))
        direction[k] = step or following
        following = direction[k]
    return direction


def hysteresis(problem: CurveProblem) -> Hysteresis | None:
    """Return the hysteresis; None unless some rate was reached from both sides."""
    rates, group = problem.groups
    direction = directions(problem)
    both = [
        r
        for r in range(len(rates))
        if np.any(direction[group == r] > 0) and np.any(direction[group == r] < 0)
    ]
    if not both:
        return None
    A = problem.design(TABLE)
    try:
        fit = fit_gls(np.column_stack([A, 0.5 * direction]), problem.z, problem.covariance)
    except ValueError:
        return None
    difference = Figure(float(fit.estimate[-1]), float(fit.sigma[-1]))
    significant = abs(difference.value) > SIGNIFICANT * difference.sigma
    limit = None if significant else abs(difference.value) + 2.0 * difference.sigma
    # A rate that also contains the first block, of no direction, has a column but no difference.
    split = [r for r in range(len(rates)) if len(np.unique(direction[group == r])) > 1]
    columns = [0.5 * direction * (group == r) for r in split]
    detailed = fit_gls(np.column_stack([A, *columns]), problem.z, problem.covariance)
    position = A.shape[1] + np.array([split.index(r) for r in both])
    P = np.zeros((len(both), detailed.covariance.shape[0]))
    P[np.arange(len(both)), position] = 1.0
    per_rate = predict(detailed, P, np.zeros(len(both)))
    return Hysteresis(difference, limit, rates[both], per_rate.value, per_rate.sigma)
