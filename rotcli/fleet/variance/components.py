"""Variance components of a fleet by restricted maximum likelihood (REML).

Every value enters with its known sigma. `sigma_turn_on = sqrt(vR)` is the turn-on repeatability,
`sqrt(vR + vD)` the day-to-day repeatability and `sqrt(vU)` the spread of the units.
"""

import math
from dataclasses import field

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.fleet.variance.likelihood import STARTS, minimise, scale_of, total_sums
from rotcli.fleet.variance.nested import COMPONENTS, NestedRows, unit_sums
from rotcli.fleet.variance.profile import Profile
from rotcli.units import FloatArray

_ONE_START_ROWS = 5000  # above it the likelihood has one minimum, and one start suffices


@dataclass(frozen=True, eq=False)
class Components:
    """Variances (3,) of unit, day and turn-on, with the mean and its sigma.

    estimable: (3,) False where the data cannot separate the component (its variance is 0).
    minimum: -2 ln REML at the estimate. mean: in the unit of y, not centred.
    """

    variances: FloatArray
    estimable: tuple[bool, bool, bool]
    minimum: float
    mean: float
    mean_sigma: float
    intervals: tuple[tuple[float, float] | None, ...] = (None, None, None)
    zero_probability: tuple[float | None, ...] = (None, None, None)
    notes: tuple[str, ...] = field(default=())


def fit(rows: NestedRows, *, intervals: bool = True, near: FloatArray | None = None) -> Components:
    """Estimate the variance components; with `intervals` also their 95 % limits and zero tests.

    near: variances of nearly the same rows, from which a large fleet starts. Components that the
    design cannot separate are 0 and named in the notes.
    """
    estimable, notes = separable(rows)
    large = len(rows.y) > _ONE_START_ROWS
    first = np.array(STARTS[0]) * scale_of(rows) if near is None else near
    variances, minimum = minimise(rows, estimable, start=first if large else None)
    total = total_sums(rows, variances, slopes=False)
    limits: list[tuple[float, float] | None] = [None] * 3
    zero: list[float | None] = [None] * 3
    if intervals:
        profile = Profile(rows, estimable, variances, minimum)
        for k in (k for k in range(3) if estimable[k]):
            gain = profile.gain_at_zero(k)
            zero[k] = zero_probability(gain)
            limits[k] = profile.interval(k, gain)
    return Components(
        variances=variances,
        estimable=estimable,
        minimum=minimum,
        mean=rows.centre + float(total.b[0] / total.a[0]),
        mean_sigma=float(1.0 / math.sqrt(total.a[0])),
        intervals=tuple(limits),
        zero_probability=tuple(zero),
        notes=notes,
    )


def separable(rows: NestedRows) -> tuple[tuple[bool, bool, bool], tuple[str, ...]]:
    """Return which of unit, day, turn-on the design can separate, and the reasons where not."""
    units = len(rows.unit_start) > 1
    days = bool((rows.days_per_unit > 1).any())
    turns = bool((rows.rows_per_day > 1).any())
    notes = []
    if not units:
        notes.append("one unit: the unit variance cannot be estimated")
    if not days and not turns:
        notes.append("one result per unit: the unit variance contains day and turn-on variance")
    elif not days:
        notes.append("one day per unit: the unit variance contains the day variance")
    elif not turns:
        notes.append("one turn-on per day: the day variance contains the turn-on variance")
    return (units, days, turns), tuple(notes)


def zero_probability(gain: float) -> float:
    """Return half of the chi-squared tail: under the hypothesis the estimate is 0 half the time."""
    return 0.5 * math.erfc(math.sqrt(max(gain, 0.0) / 2.0))


@dataclass(frozen=True, eq=False)
class UnitMeans:
    """Mean of each unit (u,): raw GLS mean with sigma, and the shrunk mean (BLUP) with sigma."""

    raw: FloatArray
    raw_sigma: FloatArray
    shrunk: FloatArray
    shrunk_sigma: FloatArray


def unit_means(rows: NestedRows, result: Components) -> UnitMeans:
    """Return the means of the units; the BLUP moves each towards the fleet mean.

    `m = mu + g (raw - mu)`, g = vU a/(1 + vU a), variance vU/(1 + vU a) + (1 - g)^2/A.
    """
    v_unit, v_day, v_turn = result.variances
    sums = unit_sums(rows, float(v_day), float(v_turn))
    raw = sums.b / sums.a + rows.centre
    g = v_unit * sums.a / (1.0 + v_unit * sums.a)
    variance = v_unit / (1.0 + v_unit * sums.a) + ((1.0 - g) * result.mean_sigma) ** 2
    return UnitMeans(
        raw=raw,
        raw_sigma=1.0 / np.sqrt(sums.a),
        shrunk=result.mean + g * (raw - result.mean),
        shrunk_sigma=np.sqrt(variance),
    )


def component_names() -> tuple[str, str, str]:
    """Return the names of the components in the order of the variances."""
    return COMPONENTS
