"""Observability of a system with the states dv, eps, gamma, d: matrix, degrees, combinations.

All computations use natural units (gT, 1, g, 1/T with T = 1/rate): raw singular values depend
on the units chosen, and with them the rank.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rotcli.observe.errors_ins import STATES_IN_N
from rotcli.units import FloatArray

RANK_TOLERANCE = 1e-12  # of the largest singular value: rounding of Q in natural units
ROW_TOLERANCE = 1e-7  # of a nullspace row: rounding, amplified by the weakest cases met
WEAK = 1e-2  # of the largest singular value: an axis within some 3 deg of an unobservable one


def natural_units(gravity: float, rate: float) -> tuple[FloatArray, float]:
    """Return the natural unit of each state (12,) in SI, and the unit of time T (s).

    T = 1/|rate|, 1 s when still; dv in gT, eps in 1, gamma in g, d in 1/T. In these units F has
    entries of order one, so that singular values can be compared.
    """
    T = 1.0 / abs(rate) if rate else 1.0
    return np.repeat([gravity * T, 1.0, gravity, 1.0 / T], 3), T


def scaled_observability_matrix(
    F: FloatArray, H: FloatArray, units: FloatArray, T: float
) -> FloatArray:
    """Return [H; HF; ...; HF^(n-1)] (n m, n) of the system in the units given.

    units: (n,) SI value of each state's unit; T: s, unit of time. The measurements are the first
    states, in the same units.
    """
    F = F * units[None, :] / units[:, None] * T
    rows = [H * units[None, :] / units[: len(H), None]]
    for _ in range(len(F) - 1):
        rows.append(rows[-1] @ F)
    return np.concatenate(rows)


def observability_degrees(relative: FloatArray, Vt: FloatArray) -> FloatArray:
    """Return each state's degree of observability (12,): 1 - posterior sigma / prior sigma.

    The prior sigma of each state is its natural unit; the measurement noise is WEAK of the
    largest singular value. relative: (12,) singular values, of the largest; Vt: (12, 12).
    """
    variance = (Vt**2 / (1.0 + (relative[:, None] / WEAK) ** 2)).sum(axis=0)
    result: FloatArray = 1.0 - np.sqrt(np.clip(variance, 0.0, 1.0))
    return result


# Pairs that come first: a tilt and the accelerometer bias with the same effect, then the two
# biases of one axis.
_PREFERRED = [
    (STATES_IN_N.index(first), STATES_IN_N.index(second))
    for first, second in (
        ("eps_E", "gamma_N"),
        ("eps_N", "gamma_E"),
        ("gamma_E", "d_E"),
        ("gamma_N", "d_N"),
        ("gamma_U", "d_U"),
    )
]


def smallest_combinations(nullspace: FloatArray, members: NDArray[np.intp]) -> list[FloatArray]:
    """Return independent vectors (12,) of smallest support, orthogonal to the nullspace.

    nullspace: (12, q), natural units. members: the states to combine. Each vector is a sum of
    states that is observable although its terms are not.
    """
    if not len(members):
        return []
    count = len(members) - int(np.linalg.matrix_rank(nullspace[members], tol=ROW_TOLERANCE))
    vectors: list[FloatArray] = []
    for size in range(2, len(members) + 1):
        subsets = list(combinations(members.tolist(), size))
        if size == 2:
            subsets.sort(key=lambda pair: pair not in _PREFERRED)
        for subset in subsets:
            if len(vectors) == count:
                return vectors
            U, singular, _ = np.linalg.svd(nullspace[list(subset)])
            if (singular > ROW_TOLERANCE).sum() != size - 1:
                continue
            if np.abs(U[:, -1]).min() < ROW_TOLERANCE:
                continue  # contains a smaller combination
            vector = np.zeros(len(STATES_IN_N))
            vector[list(subset)] = U[:, -1]
            if np.linalg.matrix_rank(np.array([*vectors, vector]), tol=ROW_TOLERANCE) > len(
                vectors
            ):
                vectors.append(vector)
    return vectors
