"""Turn-on repeatability of the scale factor from several logs, each with its sigma.

One random effect with known measurement variances: `K_m = mu + R_m + eps_m`. The variance v of R
by restricted maximum likelihood (REML), the interval by its profile.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from scipy import optimize


_CHI2_95 = 3.841458820694124  # 95 % quantile of chi-squared on one degree of freedom
_GRID = 200  # points of the search in the standard deviation, before refinement


@dataclass(frozen=True)
class Repeatability:
    """Mean over turn-ons with sigma; standard deviation between turn-ons with 95 % interval.

    In a balanced set of M values the interval contains the truth in 95 % or more.
    """

    mean: float
    mean_sigma: float
    sigma: float
    low: float
    high: float
    count: int


def minus_two_log_reml(variance: FloatArray, y: FloatArray, s: FloatArray) -> FloatArray:
    """Return -2 ln REML (g,) at variances (g,) of values y (m,) with sigmas s (m,).

    `sum ln v + sum (y - mu)^2/v + ln sum 1/v` with `v = s^2 + variance`.
    """
    v = s[None, :] ** 2 + np.atleast_1d(variance)[:, None]
    weight = np.sum(1.0 / v, axis=1)
    mu = np.sum(y / v, axis=1) / weight
    result: FloatArray = (
        np.sum(np.log(v), axis=1) + np.sum((y - mu[:, None]) ** 2 / v, axis=1) + np.log(weight)
    )
    return result


def repeatability(y: FloatArray, s: FloatArray) -> Repeatability:
    """Return the repeatability of values y (m,) with sigmas s (m,); two values at least."""
    if len(y) < 2:
        raise ValueError("repeatability needs two turn-ons at least")
    scale = float(np.std(y) + np.max(s))
    centred = (y - np.mean(y)) / scale
    relative = s / scale

    def objective(sigma: float) -> float:
        return float(minus_two_log_reml(np.array([sigma**2]), centred, relative)[0])

    grid = np.linspace(0.0, 3.0, _GRID)
    values = minus_two_log_reml(grid**2, centred, relative)
    best = int(np.argmin(values))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)]
    found = optimize.minimize_scalar(objective, bounds=(low, high), method="bounded")
    sigma = 0.0 if values[0] <= found.fun else float(found.x)
    target = min(float(values[0]), float(found.fun)) + _CHI2_95
    top = 3.0
    while objective(top) < target:
        top *= 2.0
    upper = optimize.brentq(lambda x: objective(x) - target, sigma, top)
    lower = 0.0
    if sigma > 0.0 and values[0] > target:
        lower = optimize.brentq(lambda x: objective(x) - target, 0.0, sigma)
    v = s**2 + (sigma * scale) ** 2
    weight = float(np.sum(1.0 / v))
    mean = float(np.sum(y / v)) / weight
    return Repeatability(
        mean, weight**-0.5, sigma * scale, float(lower) * scale, float(upper) * scale, len(y)
    )
