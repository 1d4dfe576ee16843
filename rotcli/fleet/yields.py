"""Yield against limits, and percentiles of the fleet, with and without measurement noise.

Raw counting of noisy values is biased: 95.5 % where the true share is 97.7 %. The true yield
`Phi((max - mu)/sigma_U) - Phi((min - mu)/sigma_U)` uses the estimated distribution of the units.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.fleet.variance.components import Components, UnitMeans
from rotcli.fleet.variance.likelihood import scale_of
from rotcli.fleet.variance.nested import NestedRows, Sums, collapse, unit_sums
from rotcli.lazy import lazily
from rotcli.models.conformity import Limits, verdict
from rotcli.units import FloatArray

with lazily():
    from scipy import special


DRAWS = 1000  # of (mu, vU), for the interval of the true yield
_SEED = 1  # the interval must be the same for the same input
_GRID = 200  # values of sigma_U between its outermost plausible ones
_NEGLIGIBLE = 30.0  # of -2 ln REML: a likelihood ratio of 3e-7
CONFIDENCE = 0.95
PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)


@dataclass(frozen=True)
class Share:
    """A share with its 95 % limits."""

    value: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Yield:
    """Verdicts of the units, the raw share inside the limits, and the share free of noise."""

    passed: int
    failed: int
    undecided: int
    raw: Share
    true: Share


def clopper_pearson(count: int, total: int) -> Share:
    """Return a share with its exact binomial limits (Clopper and Pearson, Biometrika 26 (1934)).

    Check: 0 of n has the lower limit 0 and the upper limit 1 - 0.025^(1/n).
    """
    tail = 0.5 * (1.0 - CONFIDENCE)
    lower = 0.0 if count == 0 else float(special.betaincinv(count, total - count + 1, tail))
    upper = (
        1.0 if count == total else float(special.betaincinv(count + 1, total - count, 1.0 - tail))
    )
    return Share(count / total, lower, upper)


def estimate_yield(
    used: NestedRows,
    result: Components,
    means: UnitMeans,
    flagged: NDArray[np.bool_],
    limits: Limits,
) -> Yield:
    """Return the yield of all units against limits in the unit of the rows.

    used: rows of the units that are not flagged, of which `result` are the components. Outlying
    units have no part in the distribution; they count by their measured means.
    """
    low = -math.inf if limits.low is None else limits.low
    high = math.inf if limits.high is None else limits.high
    pairs = zip(means.raw.tolist(), means.raw_sigma.tolist(), strict=True)
    verdicts = [verdict(value, sigma, limits) for value, sigma in pairs]
    inside = (means.raw >= low) & (means.raw <= high)
    n = len(means.raw)

    def of_all(share: float) -> float:
        return float((share * np.sum(~flagged) + np.sum(inside & flagged)) / n)

    mu, sigma_u = result.mean, math.sqrt(float(result.variances[0]))
    drawn = true_share(*draw(used, result), low, high)
    tail = 50.0 * (1.0 - CONFIDENCE)
    lower, upper = np.percentile(drawn, [tail, 100.0 - tail])
    value = float(true_share(np.array([mu]), np.array([sigma_u]), low, high)[0])
    return Yield(
        passed=verdicts.count("pass"),
        failed=verdicts.count("fail"),
        undecided=verdicts.count("undecided"),
        raw=clopper_pearson(int(np.sum(inside)), n),
        true=Share(of_all(value), of_all(float(lower)), of_all(float(upper))),
    )


def true_share(mu: FloatArray, sigma: FloatArray, low: float, high: float) -> FloatArray:
    """Return the share (k,) of N(mu, sigma^2) between the limits; sigma 0 is a step."""
    scale = np.maximum(sigma, 1e-300)
    share: FloatArray = special.ndtr((high - mu) / scale) - special.ndtr((low - mu) / scale)
    return share


def draw(rows: NestedRows, result: Components) -> tuple[FloatArray, FloatArray]:
    """Return draws (DRAWS,) of mu and sigma_U from the likelihood, flat in sigma_U.

    Day and turn-on variance stay at their estimates: they hardly correlate with vU.
    """
    _, v_day, v_turn = (float(v) for v in result.variances)
    sums = unit_sums(rows, v_day, v_turn)
    grid = _sigma_grid(sums, math.sqrt(float(result.variances[0])), 0.1 * scale_of(rows) ** 0.5)
    level, mean, precision = np.array([_at(sums, s) for s in grid]).T
    density = np.exp(-0.5 * (level - level.min()))
    cumulative = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    rng = np.random.default_rng(_SEED)
    sigma = np.interp(rng.random(DRAWS) * cumulative[-1], cumulative, grid)
    normal = rng.standard_normal(DRAWS)
    mu = np.interp(sigma, grid, mean) + np.interp(sigma, grid, precision**-0.5) * normal
    return rows.centre + mu, sigma


def _at(sums: Sums, sigma: float) -> tuple[float, float, float]:
    """Return -2 ln REML, mean and its precision at a standard deviation of the units."""
    total = collapse(sums, sigma**2).add(np.zeros(1, dtype=np.int64))
    A, B = float(total.a[0]), float(total.b[0])
    return float(total.l[0] + total.q[0]) - B * B / A + math.log(A), B / A, A


def _sigma_grid(sums: Sums, centre: float, least: float) -> FloatArray:
    """Return values of sigma_U that cover the likelihood."""
    best = _at(sums, centre)[0]
    first = 0.05 * max(centre, least)
    low = high = centre
    step = first
    while low > 0.0 and _at(sums, low)[0] - best < _NEGLIGIBLE:
        low = max(low - step, 0.0)
        step *= 1.5
    step = first
    while _at(sums, high)[0] - best < _NEGLIGIBLE:
        high += step
        step *= 1.5
    return np.linspace(low, high, _GRID)


@dataclass(frozen=True)
class Percentile:
    """A percentile of the units free of noise, with limits from the order statistics."""

    percent: float
    value: float
    lower: float | None
    upper: float | None


def percentiles(result: Components, shrunk_means: FloatArray) -> list[Percentile]:
    """Return percentiles of shrunk means (u,), rescaled to the estimated unit variance.

    shrunk_means: of the units that are not outlying.
    """
    shrunk = shrunk_means - result.mean
    spread = float(np.std(shrunk, ddof=1)) if len(shrunk) > 1 else 0.0
    factor = math.sqrt(float(result.variances[0])) / spread if spread > 0.0 else 0.0
    ordered = np.sort(result.mean + factor * shrunk)
    n, tail = len(ordered), 0.5 * (1.0 - CONFIDENCE)
    rows = []
    for percent in PERCENTILES:
        share = percent / 100.0
        below = special.bdtr(np.arange(n + 1), n, share)  # probability of at most k units below
        low, high = (int(np.searchsorted(below, p)) for p in (tail, 1.0 - tail))
        rows.append(
            Percentile(
                percent,
                float(np.quantile(ordered, share)),
                float(ordered[low - 1]) if low >= 1 else None,
                float(ordered[high]) if high < n else None,
            )
        )
    return rows
