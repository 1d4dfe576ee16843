"""Conversions between the frames of table and accelerometers."""

import numpy as np
import pytest

from rotcli.models.triad import parameters as p
from rotcli.models.triad.conventions import convert, factor
from tests.triad import bench


@pytest.mark.parametrize("convention", ["accelerometer", "z-accelerometer", "symmetric"])
def test_a_conversion_keeps_every_reading(convention):
    x = bench.spot_parameters()
    new = convert(x, convention)
    I_N, I_M = (np.eye(3) + x[g].reshape(3, 3) for g in (p.N, p.M))
    J_N, J_M = (np.eye(3) + new.x[g].reshape(3, 3) for g in (p.N, p.M))
    w = np.array([0.3, -1.2, 0.8])
    np.testing.assert_allclose(J_N @ new.Q @ w, I_N @ w, atol=1e-15)
    np.testing.assert_allclose(J_M @ new.Q @ w, I_M @ w, atol=1e-15)
    np.testing.assert_allclose(new.Q @ new.Q.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(new.Q) == pytest.approx(1.0)


@pytest.mark.parametrize("convention", ["accelerometer", "z-accelerometer", "symmetric"])
def test_the_derivative_of_a_conversion_agrees_with_differences(convention):
    x = bench.spot_parameters() * 30.0  # 3 % errors: the derivative must hold there, too
    D = convert(x, convention).derivative
    for k in range(p.count()):
        up, down = x.copy(), x.copy()
        step = 1e-3 * p.typical_sizes()[k]
        up[k] += step
        down[k] -= step
        slope = (convert(up, convention).x - convert(down, convention).x) / (2.0 * step)
        np.testing.assert_allclose(D[:, k], slope, atol=1e-8 * max(1.0, np.abs(slope).max()))


def test_forms_are_triangular_or_symmetric():
    I_M = np.eye(3) + bench.spot_parameters()[p.M].reshape(3, 3) * 50
    lower, _ = factor(I_M, "accelerometer")
    upper, _ = factor(I_M, "z-accelerometer")
    symmetric, _ = factor(I_M, "symmetric")
    assert np.allclose(np.triu(lower, 1), 0.0, atol=1e-15)
    assert np.allclose(np.tril(upper, -1), 0.0, atol=1e-15)
    assert np.allclose(symmetric, symmetric.T, atol=1e-15)
    for T in (lower, upper, symmetric):
        assert np.all(np.diag(T) > 0.9)


def test_first_order_formulas_of_the_accelerometer_convention_hold():
    x = bench.spot_parameters() * 1e-3
    M = x[p.M].reshape(3, 3)
    new = convert(x, "accelerometer").x[p.M].reshape(3, 3)
    np.testing.assert_allclose(
        [new[1, 0], new[2, 0], new[2, 1]],
        [M[1, 0] + M[0, 1], M[2, 0] + M[0, 2], M[2, 1] + M[1, 2]],
        rtol=1e-4,
    )
