"""Errors of simulated sensors over rate, temperature and time since power-on."""

import numpy as np
import pytest

from rotcli.models.laboratory.environment import Environment, RateNonlinearity

DEG = np.pi / 180
DPH = DEG / 3600


def test_nonlinearity_is_the_sum_of_its_terms():
    curve = RateNonlinearity(100 * DEG, 30 * DPH, -60 * DPH, 72 * DPH, 60 * DPH, 15 * DEG)
    got = curve.error(np.array([-50, 0, 100]) * DEG) / DPH
    expected = [
        30 * 0.25 + 60 * 0.125 + 36 + 60 * np.tanh(-50 / 15),
        0,
        30 - 60 + 72 + 60 * np.tanh(100 / 15),
    ]
    np.testing.assert_allclose(got, expected)


def test_gyros_have_bias_and_scale_factor_over_temperature_and_warm_up():
    around = Environment(
        temperature=np.array([[0.0, 20.0], [10.0, 30.0]]),
        reference=20.0,
        gyro_bias=np.array([[1.0, 0.1], [0, 0], [2.0, 0.0]]),
        gyro_scale=np.array([[0.0], [1e-3], [0.0]]),
        accel_bias=np.array([[0.5], [0], [0]]),
        warm_up=7.0,
        warm_up_time=5.0,
    )
    time, rate = np.array([0.0, 5.0]), np.array([[1.0, 2, 3], [4, 5, 6]])
    decay = 7 * np.exp(-1)
    expected = [[7, 7, 7], [5 + 2.5 + decay, 5e-3 * 5 + decay, 10 + decay]]
    np.testing.assert_allclose(around.gyro_errors(time, rate), expected)
    np.testing.assert_allclose(around.accel_errors(time), [[0, 0, 0], [2.5, 0, 0]])


def test_the_thermometer_follows_with_lag_and_steps():
    points = np.array([[0.0, 20.0], [1000.0, 70.0]])
    around = Environment(temperature=points, thermometer_lag=100.0, thermometer_step=0.5)
    time = np.arange(0.0, 1000.0, 1.0)
    got = around.thermometer(time, 1.0)
    assert np.all(got % 0.5 == 0)
    assert got[900] == pytest.approx(20 + (900 - 100) * 0.05, abs=0.3)


def test_without_a_profile_there_is_no_thermometer_and_no_thermal_error():
    around = Environment(gyro_bias=np.ones((3, 1)))
    assert around.thermometer(np.zeros(2), 1.0) is None
    assert not np.any(around.gyro_errors(np.zeros(2), np.zeros((2, 3))))
    assert not np.any(around.accel_errors(np.zeros(2)))
