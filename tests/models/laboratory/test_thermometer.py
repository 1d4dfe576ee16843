"""Temperature profiles, the lag and the steps of thermometers, the filter of a log."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rotcli.models.laboratory.thermometer import lagged, profile_temperature, smooth, stepped

POINTS = np.array([[0.0, 20.0], [100.0, 60.0], [200.0, 20.0]])


def test_a_profile_is_straight_between_its_points_and_constant_outside():
    got = profile_temperature(POINTS, np.array([-5.0, 0, 25, 100, 150, 300]))
    np.testing.assert_allclose(got, [20, 20, 30, 60, 40, 20])


def test_a_lag_solves_its_differential_equation():
    time = np.arange(0, 200, 2.0)
    got = lagged(profile_temperature(POINTS, time), 2.0, 30.0)
    exact = solve_ivp(
        lambda t, T: (profile_temperature(POINTS, np.array([t])) - T) / 30.0,
        (0, 198),
        [20.0],
        t_eval=time,
        rtol=1e-9,
        atol=1e-9,
        max_step=1.0,
    )
    np.testing.assert_allclose(got, exact.y[0], atol=2e-5)
    assert lagged(got, 2.0, 0.0) is got


def test_a_ramp_behind_a_lag_is_late_by_the_lag():
    time = np.arange(0, 600, 0.5)
    got = lagged(20 + time / 60, 0.5, 40.0)
    np.testing.assert_allclose(got[-100:], (20 + (time - 40) / 60)[-100:], atol=1e-4)


def test_steps_are_multiples_of_the_resolution():
    np.testing.assert_allclose(stepped(np.array([20.2, 20.26, -0.3]), 0.5), [20.0, 20.5, -0.5])
    values = np.array([1.23])
    assert stepped(values, 0.0) is values


def test_the_filter_keeps_constants_and_ramps_and_delays_nothing():
    time = np.arange(0, 300, 1.0)
    np.testing.assert_allclose(smooth(time, np.full(300, 25.0), 10.0), 25.0)
    ramp = 20 + time / 60
    np.testing.assert_allclose(smooth(time, ramp, 10.0), ramp, atol=1e-6)


def test_the_filter_averages_noise_like_a_mean_over_its_time():
    rng = np.random.default_rng(10)
    noise = smooth(np.arange(20_000.0), rng.standard_normal(20_000), 10.0)
    # The mean over 10 of 10 readings has a standard deviation of 1/sqrt(10).
    assert noise.std() == pytest.approx(1 / np.sqrt(10), rel=0.1)


def test_short_logs_pass_unfiltered():
    time, values = np.array([0.0, 1.0]), np.array([20.0, 30.0])
    assert smooth(time, values, 10.0) is values
    three = smooth(np.array([0.0, 1, 2]), np.array([20.0, 20, 20]), 10.0)
    np.testing.assert_allclose(three, 20.0)


def test_a_filter_time_longer_than_the_log_still_passes_a_ramp():
    # Mirrored at both ends as far as the log reaches: a ramp comes out as a ramp in the middle.
    time = np.arange(0.0, 60.0, 1.0)
    ramp = 20.0 + 0.1 * time
    filtered = smooth(time, ramp, 40.0)
    assert len(filtered) == 60
    assert np.isfinite(filtered).all()
    assert filtered[30] == pytest.approx(ramp[30], abs=0.1)


def test_the_filter_is_that_of_a_mirrored_record():
    # The same two passes over a record that is mirrored about its ends by hand.
    time = np.arange(0.0, 100.0, 1.0)
    values = np.random.default_rng(2).standard_normal(100)
    tau, count = 10.0, 40
    before = 2.0 * values[0] - values[1 : count + 1][::-1]
    after = 2.0 * values[-1] - values[-count - 1 : -1][::-1]
    forward = lagged(np.concatenate([before, values, after]), 1.0, tau / 4.0)
    expected = lagged(forward[::-1], 1.0, tau / 4.0)[::-1][count:-count]
    np.testing.assert_allclose(smooth(time, values, tau), expected, rtol=1e-12)
