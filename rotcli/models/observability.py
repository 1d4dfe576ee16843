"""Observability of a system with the states dv, eps, gamma, d: matrix, degrees, combinations.

Everything is done in natural units (gT, 1, g, 1/T with T = 1/rate): raw singular values depend
on the units chosen, and with them the rank.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RANK_TOLERANCE = 1e-12  # of the largest singular value: rounding of Q in natural units
ROW_TOLERANCE = 1e-7  # of a nullspace row: rounding, amplified by the weakest cases met
WEAK = 1e-2  # of the largest singular value: a rotation axis within some 3 deg of a bad one


def natural_units(gravity: float, rate: float) -> tuple[Array, float]:
    """Return the natural unit of each state (12,) in SI, and the unit of time T (s).

    T = 1/|rate|, 1 s when still; dv in gT, eps in 1, gamma in g, d in 1/T. In these units F has
    entries of order one, so that singular values can be compared.
    """
    T = 1.0 / abs(rate) if rate else 1.0
    return np.repeat([gravity * T, 1.0, gravity, 1.0 / T], 3), T


def observability_matrix(F: Array, H: Array, units: Array, T: float) -> Array:
    """Return [H; HF; ...; HF^(n-1)] (n m, n) of the system in the units given.

    units: (n,) SI value of each state's unit; T: s, unit of time. The measurements are the first
    states, in the same units.
    """
    F = F * units[None, :] / units[:, None] * T
    rows = [H * units[None, :] / units[: len(H), None]]
    for _ in range(len(F) - 1):
        rows.append(rows[-1] @ F)
    return np.concatenate(rows)


def degrees(relative: Array, Vt: Array) -> Array:
    """Return each state's degree (12,): 1 - sigma after / sigma before.

    Before, every state is known to its natural unit; after, also through a measurement whose
    noise is WEAK of the largest singular value.
    """
    variance = (Vt**2 / (1.0 + (relative[:, None] / WEAK) ** 2)).sum(axis=0)
    result: Array = 1.0 - np.sqrt(np.clip(variance, 0.0, 1.0))
    return result


# Pairs a reader expects first: tilt against the accelerometer bias it looks like, then the two
# biases of one axis.
_E, _N = 3, 4
_PREFERRED = [(_E, 7), (_N, 6), (6, 9), (7, 10), (8, 11)]


def smallest_combinations(nullspace: Array, members: NDArray[np.intp]) -> list[Array]:
    """Return independent vectors (12,) of smallest support, orthogonal to the nullspace.

    nullspace: (12, q), natural units. members: the states whose combinations are wanted. Each
    vector is a sum of states that a measurement tells although its terms stay hidden.
    """
    if not len(members):
        return []
    wanted = len(members) - int(np.linalg.matrix_rank(nullspace[members], tol=ROW_TOLERANCE))
    found: list[Array] = []
    for size in range(2, len(members) + 1):
        subsets = list(combinations(members.tolist(), size))
        if size == 2:
            subsets.sort(key=lambda pair: pair not in _PREFERRED)
        for subset in subsets:
            if len(found) == wanted:
                return found
            U, singular, _ = np.linalg.svd(nullspace[list(subset)])
            if (singular > ROW_TOLERANCE).sum() != size - 1:
                continue
            if np.abs(U[:, -1]).min() < ROW_TOLERANCE:
                continue  # holds a smaller combination
            vector = np.zeros(12)
            vector[list(subset)] = U[:, -1]
            if np.linalg.matrix_rank(np.array([*found, vector]), tol=ROW_TOLERANCE) > len(found):
                found.append(vector)
    return found
