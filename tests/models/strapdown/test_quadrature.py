"""Quadrature of sampled signals against closed forms."""

import numpy as np
import pytest

from rotcli.models.strapdown import quadrature
from rotcli.models.strapdown.cells import Arena

ARENA = Arena()


def instants(means):
    """Return the values (k, m-5) at the sample times of means (k, m)."""
    out = np.empty((len(means), means.shape[1] - 5, 1))
    quadrature.instants(means[:, :, None], out, ARENA)
    return out[:, :, 0]


def step_integrals(y):
    """Return the integrals (k, m-5) of values (k, m) over steps of unit interval."""
    out = np.empty((len(y), y.shape[1] - 5, 1))
    quadrature.step_integrals(y[:, :, None], out, ARENA)
    return out[:, :, 0]


def continued(y, before, after):
    """Return samples (k, m) with more of them at both ends."""
    head, tail = quadrature.extrapolate(y.T, before, after)
    return np.concatenate([head, y.T, tail]).T


def test_values_from_means_are_of_sixth_order_up_to_the_ends():
    t = 0.01 * np.arange(200)
    k = 2 * np.pi * 0.3
    means = (np.cos(k * (t - 0.01)) - np.cos(k * t))[None] / (0.01 * k)
    # (k h)^6 / 140 = 3e-13 in the middle, up to 30 times that at the ends, and rounding.
    values = instants(continued(means, 2, 3))
    np.testing.assert_allclose(values[0], np.sin(k * t), atol=5e-11)


def test_step_integrals_are_exact_for_a_quintic():
    t = np.arange(12.0)
    powers = np.arange(6)
    y = t ** powers[:, None]
    integral = t ** (powers[:, None] + 1) / (powers[:, None] + 1)
    # Terms up to 11^6 / 6 = 3e5 cancel to the last digits.
    expected = np.diff(integral, axis=1)
    np.testing.assert_allclose(step_integrals(continued(y, 2, 2)), expected, rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize("power", range(6))
def test_motion_weights_integrate_a_quintic_acceleration_three_times(power):
    times = np.arange(-2.0, 19.0)
    v, d, integral = quadrature.motion_weights(16)
    t = np.arange(17.0)
    factor = 1.0
    for k, weights in enumerate((v, d, integral), start=1):
        factor /= power + k
        expected = factor * t ** (power + k)
        # Up to 16^8 / 336 = 1e7 from products of 18^5 with weights of alternating sign.
        np.testing.assert_allclose(weights @ times**power, expected, rtol=1e-10, atol=1e-9)


def test_continuing_a_quintic_is_exact_and_fewer_samples_continue_a_lower_degree():
    t = np.arange(-3.0, 14.0)
    y = np.stack([t**5 - 4 * t**2, 3 * t + 1])
    # 13^5 = 4e5 cancels to the last digits.
    np.testing.assert_allclose(continued(y[:, 2:-3], 2, 3), y, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(continued(y[1:, 5:7], 1, 1), y[1:, 4:8], atol=1e-12)
