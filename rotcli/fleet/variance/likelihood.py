"""Restricted likelihood (REML) of the variance components, its slope and its minimum.

Source of the criterion: Harville, J. Am. Stat. Assoc. 72 (1977) 320; -2 ln REML is defined here
without its constant, as `L + Q - B^2/A + ln A`.
"""

import math
from collections.abc import Sequence

import numpy as np

from rotcli.fleet.variance.nested import NestedRows, Sums, collapse, unit_sums
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from scipy import optimize

STARTS = ((0.5, 0.2, 0.1), (0.9, 0.01, 0.01), (0.1, 0.3, 0.5))  # of var(y), for vU, vD, vR
_TOLERANCE = 1e-11  # of -2 ln REML; an estimate is then within 1e-5 of its sigma
# Below this share of var(y) a component is zero: L-BFGS-B reaches the bound exactly, or not at all.
_ZERO_SHARE = 1e-9


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

    starts = [np.array(s)[index] for s in STARTS] if start is None else [start[index] / scale]
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
