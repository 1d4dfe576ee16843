"""Solution of triangular systems, without the start-up time of scipy for small ones."""

from typing import Literal

import numpy as np

from rotcli.units import FloatArray

# Order up to which numpy's general solution takes less time (1 ms) than importing scipy.linalg.
_SMALL = 200


def solve_triangular(
    factor: FloatArray, right: FloatArray, *, lower: bool = False, trans: Literal["N", "T"] = "N"
) -> FloatArray:
    """Return x of `factor x = right`, or of its transpose; factor (n, n) is triangular.

    lower: whether it is the lower triangle; the other one must be zero.

    >>> solve_triangular(np.array([[2.0, 0.0], [1.0, 4.0]]), np.array([2.0, 5.0]), lower=True)
    array([1., 1.])
    """
    if len(factor) <= _SMALL:
        return np.asarray(np.linalg.solve(factor.T if trans == "T" else factor, right))
    from scipy.linalg import solve_triangular as solve

    result: FloatArray = solve(factor, right, lower=lower, trans=trans)
    return result
