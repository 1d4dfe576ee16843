"""Trend of each unit in time, and of the fleet.

`y = alpha + beta (t - mean t)` by generalised least squares; the turn-ons of one day share the
day's deviation. Significance over many units by Benjamini and Hochberg (J. R. Stat. Soc. B 57
(1995) 289) at a false discovery rate of 5 %.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.fleet.variance.components import Components, fit
from rotcli.fleet.variance.nested import NestedRows, nest
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from scipy import special


BoolArray = NDArray[np.bool_]

FALSE_DISCOVERY_RATE = 0.05
MIN_DAYS = 3  # two days fit a line exactly
MIN_SPAN = 30.0  # days
DAYS_PER_YEAR = 365.25


@dataclass(frozen=True, eq=False)
class Trends:
    """Slope per year (u,) with sigma and p value; NaN where days or span are insufficient.

    fleet: components of the slopes over the units, or None below three usable units.
    """

    slope: FloatArray
    sigma: FloatArray
    p_value: FloatArray
    significant: BoolArray
    fleet: Components | None


def trends(rows: NestedRows, time: FloatArray, result: Components) -> Trends:
    """Return the trends of the units; time (n,) in days, in the sorted order of the rows."""
    _, v_day, v_turn = (float(v) for v in result.variances)
    unit = rows.unit_of_day()[rows.day_of_row()]
    first = rows.day_start[rows.unit_start]
    centre = np.add.reduceat(time, first) / rows.rows_per_unit
    t = (time - centre[unit]) / DAYS_PER_YEAR
    w = 1.0 / (rows.s2 + v_turn)

    def per_day(values: FloatArray) -> FloatArray:
        sums: FloatArray = np.add.reduceat(values, rows.day_start)
        return sums

    a, at, att = per_day(w), per_day(w * t), per_day(w * t * t)
    b, bt = per_day(w * rows.y), per_day(w * t * rows.y)
    c = v_day / (1.0 + v_day * a)

    def per_unit(values: FloatArray) -> FloatArray:
        sums: FloatArray = np.add.reduceat(values, rows.unit_start)
        return sums

    A11, A12, A22 = per_unit(a - c * a * a), per_unit(at - c * a * at), per_unit(att - c * at * at)
    r1, r2 = per_unit(b - c * a * b), per_unit(bt - c * at * b)
    span = np.maximum.reduceat(time, first) - np.minimum.reduceat(time, first)
    usable = (rows.days_per_unit >= MIN_DAYS) & (span >= MIN_SPAN)
    determinant = np.where(usable, A11 * A22 - A12 * A12, np.nan)
    slope = (A11 * r2 - A12 * r1) / determinant
    sigma = np.sqrt(A11 / determinant)
    return _judge(slope, sigma, usable)


def _judge(slope: FloatArray, sigma: FloatArray, usable: BoolArray) -> Trends:
    p = np.full(len(slope), np.nan)
    p[usable] = special.erfc(np.abs(slope[usable] / sigma[usable]) / np.sqrt(2.0))
    significant = np.zeros(len(slope), dtype=bool)
    significant[usable] = benjamini_hochberg(p[usable])
    fleet = None
    if usable.sum() >= MIN_DAYS:
        index = np.flatnonzero(usable)
        fleet = fit(nest(slope[usable], sigma[usable], index, np.zeros(len(index))))
    return Trends(slope, sigma, p, significant, fleet)


def benjamini_hochberg(p: FloatArray, rate: float = FALSE_DISCOVERY_RATE) -> BoolArray:
    """Return which hypotheses (m,) are rejected at a false discovery rate.

    Check: with one hypothesis it is p <= rate.
    """
    m = len(p)
    if m == 0:
        return np.zeros(0, dtype=bool)
    order = np.argsort(p, kind="stable")
    below = np.flatnonzero(p[order] <= rate * np.arange(1, m + 1) / m)
    rejected = np.zeros(m, dtype=bool)
    if len(below):
        rejected[order[: below[-1] + 1]] = True
    return rejected
