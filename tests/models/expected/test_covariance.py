"""Covariance between coarse steps against products with the dense covariance of all blocks."""

import numpy as np
import pytest

from rotcli.models.expected.covariance import sensor_covariance
from rotcli.models.expected.sources import AxisSource, slow_covariances
from tests.models.expected.runs import PROFILES, contrast


@pytest.mark.parametrize("fine", [1, 2, 6, 7, 12])
@pytest.mark.parametrize("sensors", [1, 3])
def test_steps_of_any_number_of_blocks_have_the_covariance_of_the_dense_product(fine, sensors):
    steps, n = 5, 5 * fine
    profile = PROFILES["NAV440"]
    W = np.random.default_rng(4).standard_normal((n, 9, 3))
    axes = [
        AxisSource(white, profile["slow"], contrast("full", 0.5))
        for white in np.linspace(1.0, 2.0, sensors) * profile["white"]
    ]
    covariances = slow_covariances(121.0, 2.0, np.full(n, 0.5), axes)
    expected = np.zeros((steps, 9, steps, 9))
    for k in range(3):
        E = covariances[k % sensors].dense()
        weighted = np.einsum("ia,ij,jb->iajb", W[..., k], E, W[..., k])
        expected += weighted.reshape(steps, fine, 9, steps, fine, 9).sum(axis=(1, 4))
    found = sensor_covariance(W, covariances, steps, fine)
    # Six nodes leave 3e-5 of the variation within a step; up to six blocks are exact.
    error = 1e-12 if fine <= 6 else 3e-5
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=error * np.abs(expected).max())
