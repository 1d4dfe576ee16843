"""The velocity noise of a still table, and what the table angle explains."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotcli.observe.zupt.velocity_noise import (
    DEFAULT_SIGMA,
    MIN_SHARE,
    MIN_UPDATES,
    _without_table_angle,
    velocity_sigma,
)

TAU = 0.1
TIME = TAU * np.arange(1201)


def test_increments_that_follow_the_table_angle_and_its_rate_leave_nothing():
    theta = 0.4 * TIME + 0.3 * np.sin(0.2 * TIME)  # at rates from 0.34 to 0.46 rad/s
    angle, rate = 0.5 * (theta[1:] + theta[:-1]), np.diff(theta) / TAU
    once = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ [[3e-3, -1e-3, 2e-3], [1e-3, 2e-3, 0]]
    twice = np.outer(np.cos(2.0 * angle), [1e-3, 2e-3, 3e-3]) + np.outer(
        np.sin(2.0 * angle), [2e-3, 0.0, -1e-3]
    )
    lever = np.outer(rate**2, [0.0, 0.0, 2e-3]) + np.outer(rate**2 * np.cos(angle), [5e-3, 0, 0])
    lever += np.outer(rate**2 * np.sin(angle), [0.0, 7e-3, 1e-3])
    left = _without_table_angle(once + twice + lever + 4e-3, theta, TAU)
    np.testing.assert_allclose(left, 0.0, atol=1e-8)


@pytest.mark.parametrize(("walk", "expected"), [(0.05, MIN_SHARE * 0.05 * TAU**0.5), (0.0, 1e-5)])
def test_the_sigma_is_at_least_a_share_of_the_accelerometers_noise(walk, expected):
    settings = SimpleNamespace(noise=SimpleNamespace(velocity_random_walk=walk))
    still = np.zeros(len(TIME))
    found = velocity_sigma(np.zeros((len(TIME) - 1, 3)), still, settings, TAU)
    assert found == pytest.approx(expected, rel=1e-12)
    few = MIN_UPDATES - 1
    assert velocity_sigma(np.zeros((few, 3)), still[: few + 1], settings, TAU) == DEFAULT_SIGMA


def test_the_sigma_is_that_of_vibration():
    rng = np.random.default_rng(8)
    n = len(TIME) - 1
    # A vibrating table: differences of the velocity, which alternate, on top of white noise.
    velocity = 2e-3 * rng.standard_normal((n + 1, 3))
    dv = np.diff(velocity, axis=0) + 1e-4 * rng.standard_normal((n, 3))
    settings = SimpleNamespace(noise=SimpleNamespace(velocity_random_walk=1e-4))
    found = velocity_sigma(dv, 0.4 * TIME, settings, TAU)
    # Two sigmas of the estimate are subtracted from its square: about 0.3 of it for 1200 updates.
    assert found == pytest.approx(np.sqrt(0.7) * 2e-3, rel=0.15)
