"""Variance components of a fleet by restricted maximum likelihood (REML).

Every value enters with its known sigma. `sigma_turn_on = sqrt(vR)` is the turn-on repeatability,
`sqrt(vR + vD)` the day-to-day repeatability and `sqrt(vU)` the spread of the units.
Source of the criterion: Harville, J. Am. Stat. Assoc. 72 (1977) 320; -2 ln REML is defined here
without its constant, as `L + Q - B^2/A + ln A`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rotcli.fleet.nested import COMPONENTS, NestedRows, Sums, collapse, unit_sums
from rotcli.lazy import lazily

with lazily():
    from scipy import optimize

    from rotcli.fleet import profile as profiles


FloatArray = NDArray[np.float64]

_STARTS = ((0.5, 0.2, 0.1), (0.9, 0.01, 0.01), (0.1, 0.3, 0.5))  # of var(y), for vU, vD, vR
_TOLERANCE = 1e-11  # of -2 ln REML; an estimate is then within 1e-5 of its sigma
_ONE_START_ROWS = 5000  # above it the likelihood has one minimum, and one start suffices
# Below this share of var(y) a component is zero: L-BFGS-B reaches the bound exactly, or not at all.
_ZERO_SHARE = 1e-9


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


def minus_two_log_reml(rows: NestedRows, variances: Sequence[float] | FloatArray) -> float:
    """Return -2 ln REML at variances (vU, vD, vR), up to a constant."""
    total = total_sums(rows, np.asarray(variances, dtype=float), slopes=False)
    return _criterion(total)


def total_sums(rows: NestedRows, variances: FloatArray, *, slopes: bool) -> Sums:
    """Return the sums over the fleet with all effects integrated out."""
    v_unit, v_day, v_turn = (float(v) for v in variances)
    units = unit_sums(rows, v_day, v_turn, slopes=slopes)
    return collapse(units, v_unit).add(np.zeros(1, dtype=np.int64))


def _criterion(total: Sums) -> float:
    A, B, Q, L = total.a[0], total.b[0], total.q[0], total.l[0]
    return float(L + Q - B**2 / A + math.log(A))


def value_and_slope(rows: NestedRows, variances: FloatArray) -> tuple[float, FloatArray]:
    """Return -2 ln REML and its derivatives (3,) by the variances."""
    total = total_sums(rows, variances, slopes=True)
    assert total.slopes is not None
    A, B = total.a[0], total.b[0]
    dA, dB, dQ, dL = (d[:, 0] for d in total.slopes)
    slope: FloatArray = dL + dQ - 2.0 * B * dB / A + B**2 * dA / A**2 + dA / A
    return _criterion(total), slope


def fit(rows: NestedRows, *, intervals: bool = True, near: FloatArray | None = None) -> Components:
    """Estimate the variance components; with `intervals` also their 95 % limits and zero tests.

    near: variances of nearly the same rows, from which a large fleet starts. Components that the
    design cannot separate are 0 and named in the notes.
    """
    estimable, notes = separable(rows)
    large = len(rows.y) > _ONE_START_ROWS
    first = np.array(_STARTS[0]) * scale_of(rows) if near is None else near
    variances, minimum = minimise(rows, estimable, start=first if large else None)
    total = total_sums(rows, variances, slopes=False)
    limits: list[tuple[float, float] | None] = [None] * 3
    zero: list[float | None] = [None] * 3
    if intervals:
        profile = profiles.Profile(rows, estimable, variances, minimum)
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


def minimise(
    rows: NestedRows,
    free: tuple[bool, bool, bool],
    fixed: FloatArray | None = None,
    start: FloatArray | None = None,
) -> tuple[FloatArray, float]:
    """Minimise -2 ln REML over the free variances; the others keep `fixed` (default 0)."""
    base = np.zeros(3) if fixed is None else fixed
    index = np.flatnonzero(free)
    if len(index) == 0:
        return base, minus_two_log_reml(rows, base)
    scale = scale_of(rows)

    starts = [np.array(s)[index] for s in _STARTS] if start is None else [start[index] / scale]
    reference = [0.0]

    def function(x: FloatArray) -> tuple[float, FloatArray]:
        variances = base.copy()
        variances[index] = x * scale
        value, slope = value_and_slope(rows, variances)
        return value - reference[0], slope[index] * scale

    reference[0] = function(starts[0])[0]  # so that the tolerance is absolute, in -2 ln REML
    results = [
        optimize.minimize(
            function,
            x0,
            jac=True,
            method="L-BFGS-B",
            bounds=[(0.0, None)] * len(index),
            options={"ftol": _TOLERANCE, "gtol": 1e-7, "maxiter": 500},
        )
        for x0 in starts
    ]
    best = min(results, key=lambda result: float(result.fun))
    variances = base.copy()
    x = np.where(best.x < _ZERO_SHARE, 0.0, best.x)
    variances[index] = x * scale
    return variances, minus_two_log_reml(rows, variances)


def scale_of(rows: NestedRows) -> float:
    """Return var(y), or the mean s^2 where all values agree."""
    spread = float(np.var(rows.y))
    return spread if spread > 0.0 else float(np.mean(rows.s2))


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
