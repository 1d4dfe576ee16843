"""Control charts of one unit in time: Shewhart and EWMA, with the error of the baseline.

The baseline (phase I) is the mean of the first points. Its error is common to all later points:
without it 31 % of sound units alarm within 35 points. Where days have several turn-ons, the
points are day means, because the turn-ons of one day share the day's deviation.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.fleet.variance.components import Components
from rotcli.fleet.variance.nested import NestedRows, day_sums
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from scipy import optimize


SHEWHART_LIMIT = 3.0  # sigma; one false alarm in 370 points
RUN_LENGTH = 370.398  # points between false alarms of the Shewhart chart, also set for the EWMA
LAMBDA = 0.2  # weight of the newest point: soonest for shifts near 1 sigma
BASELINE_POINTS = 5
_NODES = 81  # Gauss-Legendre nodes of the run-length equation; 41 give the same four digits


@dataclass(frozen=True, eq=False)
class Chart:
    """Points of one unit in time, (p,) each; the first `baseline` of them make the mean.

    x: standardised for Shewhart; ewma and ewma_limit: E and its limit (standardised units).
    day: index of each point's day in the rows. Phase I points have no flags.
    """

    value: FloatArray
    sigma: FloatArray
    day: NDArray[np.int64]
    mean: float
    mean_sigma: float
    baseline: int
    x: FloatArray
    ewma: FloatArray
    ewma_limit: FloatArray
    shewhart_flagged: NDArray[np.bool_]
    ewma_flagged: NDArray[np.bool_]


def chart(
    value: FloatArray,
    variance: FloatArray,
    day: NDArray[np.int64],
    *,
    baseline: int = BASELINE_POINTS,
    weight: float = LAMBDA,
) -> Chart | None:
    """Return the chart of points (p,) of variances (p,), or None with no point after phase I."""
    if len(value) <= baseline:
        return None
    w = 1.0 / variance[:baseline]
    mean, mean_variance = float(np.sum(w * value[:baseline]) / np.sum(w)), float(1.0 / np.sum(w))
    deviation = value - mean
    x = deviation / np.sqrt(variance + mean_variance)
    E, c, u = (np.zeros(len(value)) for _ in range(3))
    e_last = c_last = u_last = 0.0
    for k in range(baseline, len(value)):
        sd = math.sqrt(variance[k])
        e_last = weight * deviation[k] / sd + (1.0 - weight) * e_last
        c_last = weight / sd + (1.0 - weight) * c_last
        u_last = weight**2 + (1.0 - weight) ** 2 * u_last
        E[k], c[k], u[k] = e_last, c_last, u_last
    limit = ewma_factor(weight) * np.sqrt(u + mean_variance * c**2)
    later = np.arange(len(value)) >= baseline
    return Chart(
        value=value,
        sigma=np.sqrt(variance),
        day=day,
        mean=mean,
        mean_sigma=math.sqrt(mean_variance),
        baseline=baseline,
        x=x,
        ewma=E,
        ewma_limit=limit,
        shewhart_flagged=later & (np.abs(x) > SHEWHART_LIMIT),
        ewma_flagged=later & (np.abs(E) > limit),
    )


@dataclass(frozen=True, eq=False)
class Points:
    """Chart points of all units: value, variance and day (p,), and the first point of each unit.

    by_day: whether a point is the mean of a day or a single turn-on.
    """

    value: FloatArray
    variance: FloatArray
    day: NDArray[np.int64]
    start: NDArray[np.int64]
    by_day: bool


def points(rows: NestedRows, result: Components) -> Points:
    """Return the chart points: day means, or turn-ons where every unit has one day only."""
    _, v_day, v_turn = (float(v) for v in result.variances)
    if (rows.days_per_unit > 1).any():
        days = day_sums(rows, v_turn)
        index = np.arange(len(rows.day_start), dtype=np.int64)
        return Points(
            days.b / days.a + rows.centre, v_day + 1.0 / days.a, index, rows.unit_start, True
        )
    start = rows.day_start[rows.unit_start]
    day = rows.day_of_row().astype(np.int64)
    return Points(rows.y + rows.centre, rows.s2 + v_turn, day, start, False)


@lru_cache(maxsize=32)
def ewma_factor(weight: float, run_length: float = RUN_LENGTH) -> float:
    """Return L: limits +-L sigma_E give this mean run length in control."""
    return float(
        optimize.brentq(lambda L: ewma_run_length(weight, L) - run_length, 1.5, 4.0, xtol=1e-7)
    )


def ewma_run_length(weight: float, factor: float, shift: float = 0.0) -> float:
    """Return the mean run length of an EWMA chart with constant limits, for a shift in sigma.

    Integral equation of Crowder, Technometrics 29 (1987) 401, by Gauss-Legendre quadrature:
    `ARL(u) = 1 + 1/lambda int ARL(x) phi((x - (1 - lambda) u)/lambda - shift) dx` from zero.
    """
    h = factor * math.sqrt(weight / (2.0 - weight))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    x = h * nodes
    argument = (x[None, :] - (1.0 - weight) * x[:, None]) / weight - shift
    kernel = np.exp(-0.5 * argument**2) / math.sqrt(2.0 * math.pi) * (h * weights / weight)
    run = np.linalg.solve(np.eye(_NODES) - kernel, np.ones(_NODES))
    at_zero = np.exp(-0.5 * (x / weight - shift) ** 2) / math.sqrt(2.0 * math.pi)
    return float(1.0 + (at_zero * h * weights / weight) @ run)


def shewhart_alarm_probability() -> float:
    """Return the probability of a false alarm of one point beyond 3 sigma (0.0027)."""
    return math.erfc(SHEWHART_LIMIT / math.sqrt(2.0))
