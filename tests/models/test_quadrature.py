"""Quadrature of sampled signals against closed forms and an adaptive Runge-Kutta of order 8."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rotcli.models import quadrature, rotation

DEG = np.pi / 180


def test_instants_come_back_from_averages_to_the_sixth_order():
    t = 0.01 * np.arange(200)
    k = 2 * np.pi * 0.3
    averages = (np.cos(k * (t - 0.01)) - np.cos(k * t))[None] / (0.01 * k)
    # (k h)^6 / 140 = 3e-13 in the middle, up to 30 times that at the ends, and rounding.
    np.testing.assert_allclose(quadrature.instants(averages)[0], np.sin(k * t), atol=5e-11)


def test_integrals_between_samples_are_exact_for_a_quintic_and_run_from_any_sample():
    t = np.arange(12.0)
    powers = np.arange(6)
    y = t ** powers[:, None]
    whole = t ** (powers[:, None] + 1) / (powers[:, None] + 1)
    # Terms up to 11^6 / 6 = 3e5 cancel to the last digits.
    np.testing.assert_allclose(
        quadrature.interval_integrals(y, 1.0), np.diff(whole, axis=1), rtol=1e-10, atol=1e-9
    )
    start = np.arange(6.0)
    run = quadrature.running_integral(y, start, 1.0, 2)
    np.testing.assert_allclose(run - start[:, None], whole - whole[:, [2]], rtol=1e-9, atol=1e-8)


class Coning:
    """Oscillation about three axes at incommensurate frequencies, plus a constant rate."""

    constant = np.array([[20.0], [-30.0], [50.0]]) * DEG
    amplitude = np.array([[100.0], [80.0], [60.0]]) * DEG
    frequency = 2 * np.pi * np.array([[1.0], [1.37], [0.71]])
    phase = np.array([[0.0], [1.1], [2.3]])

    @classmethod
    def rate(cls, t):
        """Return the rate (3, n), rad/s."""
        return cls.constant + cls.amplitude * np.sin(cls.frequency * t + cls.phase)

    @classmethod
    def angle(cls, t):
        """Return the integral of the rate (3, n), rad."""
        swept = cls.amplitude / cls.frequency * np.cos(cls.frequency * t + cls.phase)
        return cls.constant * t - swept

    @classmethod
    def attitude(cls, seconds):
        """Return the quaternion (4,) after some seconds by DOP853, good to 1e-12 rad."""

        def derivative(t, q):
            return 0.5 * rotation.multiply(q, np.array([0.0, *cls.rate(t)[:, 0]]))

        start = [1.0, 0.0, 0.0, 0.0]
        q = solve_ivp(derivative, (0, seconds), start, method="DOP853", rtol=1e-13, atol=1e-14).y
        return q[:, -1] / np.linalg.norm(q[:, -1])


@pytest.fixture(scope="module")
def after_30_s():
    return Coning.attitude(30.0)


def coning_error(expected, interval, averages):
    t = interval * np.arange(round(30.0 / interval) + 1)
    if averages:
        w = np.diff(Coning.angle(np.concatenate([[-interval], t]))) / interval
        angle, w = w[:, 1:] * interval, quadrature.instants(w)
    else:
        w = Coning.rate(t)
        angle = quadrature.interval_integrals(w, interval)
    steps = rotation.quaternion_from_vector(quadrature.rotation_vectors(w, angle, interval))
    found = rotation.cumulative_product(steps)[:, -1]
    return 2 * np.linalg.norm(rotation.multiply(rotation.conjugate(expected), found)[1:]) / DEG


@pytest.mark.parametrize("averages", [False, True])
def test_three_axis_coning_is_of_sixth_order(after_30_s, averages):
    # Errors found: 5e-8 deg of instants, whose integral is the larger part, 4e-9 deg of means.
    # Without the third-order terms of the series it would be 7.5e-6 deg, at any sampling.
    errors = [coning_error(after_30_s, interval, averages) for interval in (0.02, 0.01, 0.005)]
    assert errors[1] < (1e-7 if not averages else 1e-8)
    # 2^6 a halving; the finest of them meets the reference's 1e-10 deg.
    assert errors[0] / errors[1] > 50.0
    assert errors[1] / errors[2] > 30.0


def test_continuing_a_quintic_is_exact_and_fewer_samples_continue_a_lower_degree():
    t = np.arange(-3.0, 14.0)
    y = np.stack([t**5 - 4 * t**2, 3 * t + 1])
    continued = quadrature.extrapolate(y[:, 2:-3], 2, 3)
    # 13^5 = 4e5 cancels to the last digits.
    np.testing.assert_allclose(continued, y, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(quadrature.extrapolate(y[1:, 5:7], 1, 1), y[1:, 4:8], atol=1e-12)
