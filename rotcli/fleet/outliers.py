"""Outlying units and outlying single values.

A unit is compared with the fleet without it, a single value with the rest of its day and unit.
The limit is the t quantile at a false-alarm rate of 1 % for the fleet (units) or for the unit
(values), divided by the number of comparisons (Bonferroni).
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.fleet.variance.components import Components, fit
from rotcli.fleet.variance.nested import NestedRows, collapse, day_sums, unit_sums
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from scipy import special


BoolArray = NDArray[np.bool_]

FALSE_ALARM_RATE = 0.01  # per fleet for units, per unit for single values
_MAX_REFITS = 10
_SUSPICIOUS = 3.0  # robust sigmas; only a start, the t quantile decides
_MAD_TO_SIGMA = 1.4826  # of a normal distribution


@dataclass(frozen=True, eq=False)
class Outliers:
    """Standardised deviations and flags: units (u,), values (n,) in the sorted order of the rows.

    unit_limit: |z| above it is flagged; components: those of the fleet without flagged units.
    """

    unit_z: FloatArray
    unit_flagged: BoolArray
    unit_limit: float
    value_z: FloatArray
    value_flagged: BoolArray
    components: Components


def find_outliers(rows: NestedRows, first: Components) -> Outliers:
    """Flag units, refit without them, and repeat until the flags stay; then flag single values.

    One outlier of any size among n units has |z| < sqrt(n) while it is part of the unit variance,
    which no fleet below 18 units could flag. So the first fit excludes units that are suspicious
    by median and median absolute deviation; each unit then faces a variance without it.
    """
    n = len(rows.unit_start)
    flagged = np.zeros(n, dtype=bool)
    result, z, limit = first, np.zeros(n), np.inf
    if n > 3:  # the t quantile needs at least one degree of freedom, and two would decide nothing
        limit = _limit(n)
        flagged = suspicious_units(rows, first)
        if flagged.any():
            result = fit(rows.without(flagged), intervals=False, near=first.variances)
        for _ in range(_MAX_REFITS):
            z = unit_deviations(rows, result, flagged)
            found = np.abs(z) > limit
            if (found == flagged).all() or found.sum() > n - 3:
                break
            flagged = found
            result = fit(rows.without(flagged), intervals=False, near=result.variances)
    value_z = value_deviations(rows, result)
    return Outliers(z, flagged, limit, value_z, _flag_values(rows, value_z), result)


def suspicious_units(rows: NestedRows, result: Components) -> BoolArray:
    """Return units (u,) far from the median in robust sigmas, at most a quarter of the fleet."""
    _, v_day, v_turn = (float(v) for v in result.variances)
    sums = unit_sums(rows, v_day, v_turn)
    deviation = np.abs(sums.b / sums.a - np.median(sums.b / sums.a))
    spread = _MAD_TO_SIGMA * float(np.median(deviation))
    z = deviation / np.sqrt(spread**2 + 1.0 / sums.a)
    most = np.sort(z)[::-1][len(z) // 4]
    suspicious: BoolArray = (z > _SUSPICIOUS) & (z > most)
    return suspicious


def _limit(n: int) -> float:

    return -float(special.stdtrit(n - 2, FALSE_ALARM_RATE / (2.0 * n)))


def unit_deviations(rows: NestedRows, result: Components, excluded: BoolArray) -> FloatArray:
    """Return z (u,): raw mean minus the mean of the other units, over its sigma.

    excluded: (u,) units that do not enter the mean of the others.
    """
    v_unit, v_day, v_turn = (float(v) for v in result.variances)
    sums = unit_sums(rows, v_day, v_turn)
    weights = collapse(sums, v_unit)
    used = ~excluded
    A, B = np.sum(weights.a[used]), np.sum(weights.b[used])
    A_others = A - np.where(used, weights.a, 0.0)
    B_others = B - np.where(used, weights.b, 0.0)
    deviation = sums.b / sums.a - B_others / A_others
    z: FloatArray = deviation / np.sqrt(v_unit + 1.0 / sums.a + 1.0 / A_others)
    return z


def value_deviations(rows: NestedRows, result: Components) -> FloatArray:
    """Return z (n,): each value minus its prediction from all others of its day and unit.

    The prediction of a day from the other days of the unit has variance 1/(a_o + 1/vU) + vD; the
    other values of the day improve it. NaN where the unit has no other value.
    """
    v_unit, v_day, v_turn = (float(v) for v in result.variances)
    days = day_sums(rows, v_turn)
    collapsed = collapse(days, v_day)
    unit, day = rows.unit_of_day(), rows.day_of_row()
    per_unit = collapsed.add(rows.unit_start)
    a_others, b_others = per_unit.a[unit] - collapsed.a, per_unit.b[unit] - collapsed.b
    fleet = result.mean - rows.centre
    precision = 1.0 / v_unit if v_unit > 0.0 else 1.0 / max(result.mean_sigma**2, 1e-300)
    mean = (b_others + precision * fleet) / (a_others + precision)
    day_precision = 1.0 / (1.0 / (a_others + precision) + v_day)
    w = 1.0 / (rows.s2 + v_turn)
    a_rest, b_rest = days.a[day] - w, days.b[day] - w * rows.y
    total = np.maximum(a_rest, 0.0) + day_precision[day]
    predicted = (b_rest + day_precision[day] * mean[day]) / total
    z = (rows.y - predicted) / np.sqrt(1.0 / w + 1.0 / total)
    alone = rows.rows_per_unit[unit][day] < 2
    return np.where(alone, np.nan, z)


def _flag_values(rows: NestedRows, z: FloatArray) -> BoolArray:
    count = rows.rows_per_unit
    dof = np.maximum(count - 2, 1)
    limit = -special.stdtrit(dof, FALSE_ALARM_RATE / (2.0 * count))
    per_row = np.where(count > 3, limit, np.inf)[rows.unit_of_day()][rows.day_of_row()]
    flagged: BoolArray = np.abs(np.nan_to_num(z)) > per_row
    return flagged
