"""Triangular systems by blocks against scipy, below, at and above the order of a block."""

import numpy as np
import pytest
from scipy import linalg

from rotcli.models.numerics.triangular import _BLOCK, solve_triangular


@pytest.mark.parametrize("n", [1, 5, _BLOCK, _BLOCK + 1, 2 * _BLOCK + 7])
@pytest.mark.parametrize("lower", [True, False])
@pytest.mark.parametrize("trans", ["N", "T"])
@pytest.mark.parametrize("columns", [None, 3])
def test_solutions_are_those_of_scipy(n, lower, trans, columns):
    rng = np.random.default_rng(n)
    # Off the diagonal small: a random triangular matrix of order 100 is singular to rounding.
    full = rng.standard_normal((n, n)) / n + 2.0 * np.eye(n)
    factor = np.tril(full) if lower else np.triu(full)
    right = rng.standard_normal(n if columns is None else (n, columns))
    expected = linalg.solve_triangular(factor, right, lower=lower, trans=trans)
    np.testing.assert_allclose(
        solve_triangular(factor, right, lower=lower, trans=trans), expected, rtol=1e-12, atol=1e-13
    )


def test_a_singular_factor_is_an_error():
    factor = np.eye(2 * _BLOCK)
    factor[_BLOCK + 3, _BLOCK + 3] = 0.0
    with pytest.raises(np.linalg.LinAlgError):
        solve_triangular(factor, np.ones(2 * _BLOCK))
