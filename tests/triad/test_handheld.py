"""Hand-stored calibration: a recorded log with its factory certificate, and a simulated one."""

import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from statsmodels.api import OLS

from rotcli.models.triad import parameters as p
from rotcli.models.triad.motion import MotionBuilder
from rotcli.models.triad.sensor import readings
from rotcli.triad.handheld.estimate import (
    GyroModel,
    direction_spread,
    fit_accelerometers,
    fit_gyros,
    still_sensitivity,
)
from rotcli.triad.handheld.poses import Poses, find_poses
from rotcli.units import DEG, DEG_PER_HOUR, STANDARD_GRAVITY
from tests.triad import bench

_SHARED = Path(os.environ.get("ROTCLI_SHARED", Path(__file__).parents[3] / "shared"))
_LOG = _SHARED / "data" / "xsens_mti_multiposition.csv"
recorded = pytest.mark.skipif(not _LOG.exists(), reason=f"recorded log {_LOG} is absent")

_GRAVITY_OF_FILE, _GRAVITY_OF_PADOVA = 9.81744, 9.8066
_VERTICAL_EARTH = 7.292115e-5 * np.sin(45.4 * DEG)
# Factory certificate: gyro gains are row norms of its gains with its alignment, counts/(rad/s).
_GYRO_GAINS, _GYRO_COUNT = (4779.2, 4761.8, 4766.5), 6258.0
_ACCEL_GAINS, _ACCEL_COUNT = (415.0, 413.0, 415.0), 1.0 / 2.4189e-3


@cache
def _recording():
    data = np.loadtxt(_LOG, delimiter=",", skiprows=1)
    gyro, accel = data[:, 1:4] * DEG, data[:, 4:]
    return gyro, accel, find_poses(gyro, accel, float(np.mean(np.diff(data[:, 0]))))


@cache
def _gyros(model):
    gyro, accel, poses = _recording()
    triad = fit_accelerometers(poses, _GRAVITY_OF_FILE)
    return fit_gyros(
        gyro,
        accel,
        poses,
        triad,
        gravity=_GRAVITY_OF_FILE,
        vertical_earth=_VERTICAL_EARTH,
        model=model,
    )


@recorded
def test_the_recording_has_38_poses_and_short_moves():
    _, _, poses = _recording()
    assert len(poses) == 38
    assert ((poses.first[1:] - poses.end[:-1]) * poses.interval).max() < 8.0
    np.testing.assert_allclose(poses.gyro_noise / DEG, [0.244, 0.252, 0.255], atol=0.005)


@recorded
def test_accelerometer_gains_agree_with_the_factory_certificate():
    _, _, poses = _recording()
    fit = fit_accelerometers(poses, _GRAVITY_OF_PADOVA)
    gains = np.diag(np.eye(3) + fit.matrix) * _ACCEL_COUNT
    np.testing.assert_allclose(gains, _ACCEL_GAINS, rtol=0.0015)


@recorded
def test_accelerometers_agree_with_another_program_on_the_same_poses():
    _, _, poses = _recording()
    fit = fit_accelerometers(poses, _GRAVITY_OF_FILE)
    # Prototype; its poses differ by a few samples: within half of its sigmas.
    np.testing.assert_allclose(np.diag(fit.matrix), [0.00246, -0.00312, 0.00257], atol=4e-5)
    lower = fit.matrix[[1, 2, 2], [0, 0, 1]]
    np.testing.assert_allclose(lower, [0.00360, 0.00945, 0.02137], atol=8e-5)
    np.testing.assert_allclose(fit.bias, [0.00445, -0.00681, -0.01606], atol=2e-4)
    assert fit.rms == pytest.approx(1.09e-3, rel=0.02)
    sigma = np.sqrt(np.diag(fit.covariance)) * 1e6
    np.testing.assert_allclose(sigma[:6], [79, 145, 35, 578, 123, 37], rtol=0.05)


@recorded
def test_the_recording_shows_no_second_order_terms():
    _, _, poses = _recording()
    fit = fit_accelerometers(poses, _GRAVITY_OF_FILE, second_order=True)
    sigma = np.sqrt(np.diag(fit.covariance))[9:]
    assert np.all(np.abs(fit.K2) < 2.0 * sigma)
    np.testing.assert_allclose(sigma * STANDARD_GRAVITY * 1e6, [211, 266, 154], rtol=0.05)


@recorded
def test_gyro_gains_agree_with_the_factory_certificate():
    gains = np.linalg.norm(np.eye(3) + _gyros(GyroModel()).matrix, axis=1) * _GYRO_COUNT
    np.testing.assert_allclose(gains, _GYRO_GAINS, rtol=0.002)


@recorded
def test_gravity_is_carried_through_an_excluded_move_within_0_2_deg():
    ours = _gyros(GyroModel())
    published = _gyros(GyroModel(g_sensitivity=False, bias="first"))
    assert ours.excluded_rms < 0.2 * DEG
    assert ours.excluded_rms < 0.660 * DEG / 3.0
    assert ours.excluded_rms < published.excluded_rms / 3.0
    assert published.excluded_rms > 0.6 * DEG


@recorded
def test_g_sensitivity_of_the_recording_is_that_of_the_prototype():
    fit = _gyros(GyroModel())
    including_earth = fit.G / p.G_UNIT + np.eye(3) * 11.0
    expected = [[25, 101, 203], [-412, 22, 267], [-235, -257, 77]]
    np.testing.assert_allclose(including_earth, expected, atol=15)  # its sigmas: 12 to 17


def _simulated(seed):
    rng = np.random.default_rng(seed)
    nominal = bench.three_axes()
    b = MotionBuilder(3, acceleration=60 * DEG)
    b.hold(6.0)
    for _ in range(30):
        b.go(rng.uniform(-np.pi, np.pi, 3) * [0.5, 0.5, 1.0], 90 * DEG)
        b.hold(4.0)
    motion = b.motion()
    x = np.zeros(p.count())
    x[p.N] = rng.standard_normal(9) * 3e-3
    x[p.M] = (np.tril(rng.standard_normal((3, 3))) * 3e-3).ravel()
    x[p.G] = rng.standard_normal(9) * 50 * p.G_UNIT
    x[p.GYRO_BIAS] = rng.standard_normal(3) * 500 * DEG_PER_HOUR
    x[p.ACCEL_BIAS] = rng.standard_normal(3) * 0.05
    t = np.arange(0.0, motion.duration, 0.01)
    y = readings(nominal, x, *motion.at(t))
    y += rng.standard_normal(y.shape) * np.repeat([0.05 * DEG, 0.005], 3)[:, None]
    return x, y[:3].T, y[3:].T


def test_a_simulated_log_gives_its_parameters_within_their_sigmas():
    gyro_errors, accel_errors = [], []
    for seed in (1,):
        x, gyro, accel = _simulated(seed)
        poses = find_poses(gyro, accel, 0.01)
        assert len(poses) == 31
        triad = fit_accelerometers(poses, bench.GRAVITY)
        fit = fit_gyros(
            gyro,
            accel,
            poses,
            triad,
            gravity=bench.GRAVITY,
            vertical_earth=7.292115e-5 * np.sin(bench.LATITUDE),
        )
        lower = np.tril_indices(3)
        truth = np.concatenate([x[p.M].reshape(3, 3)[lower], x[p.ACCEL_BIAS]])
        found = np.concatenate([triad.matrix[lower], triad.bias])
        accel_errors.append((found - truth) / np.sqrt(np.diag(triad.covariance)))
        gyro_errors.append((fit.matrix.ravel() - x[p.N]) / np.sqrt(np.diag(fit.covariance)))
        assert np.abs((fit.G - x[p.G].reshape(3, 3)) / fit.G_sigma).max() < 4.5
        assert fit.chi2 / fit.dof < 3.0
    # 9 values each: the rms of error over sigma lies within 0.4 to 1.7 in 99.9 % of runs.
    assert 0.4 < np.sqrt(np.mean(np.square(accel_errors))) < 1.7
    assert 0.4 < np.sqrt(np.mean(np.square(gyro_errors))) < 1.7


def test_g_sensitivity_of_still_poses_is_that_of_ordinary_least_squares():
    rng = np.random.default_rng(3)
    force = (
        bench.GRAVITY
        * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]] * 4)
        * rng.uniform(-1, 1, 12)[:, None]
    )
    gyro = 1e-3 * rng.standard_normal((12, 3))
    first = 1000 * np.arange(12)
    poses = Poses(first, first + 401, 0.01, force, gyro, np.ones(3), np.ones(3))
    np.testing.assert_allclose(poses.time, 10.0 * np.arange(12) + 2.0)
    np.testing.assert_array_equal(poses.count, 401)
    G, G_sigma, bias, bias_sigma = still_sensitivity(
        poses, force, vertical_earth=_VERTICAL_EARTH, gravity=bench.GRAVITY
    )
    drift = (poses.time - poses.time.mean())[:, None]
    for k in range(3):
        fit = OLS(gyro[:, k], np.hstack([np.ones((12, 1)), drift, force])).fit()
        earth = np.eye(3)[k] * _VERTICAL_EARTH / bench.GRAVITY
        np.testing.assert_allclose(G[k], fit.params[2:] - earth, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(G_sigma[k], fit.bse[2:], rtol=1e-9)
        assert (bias[k], bias_sigma[k]) == pytest.approx((fit.params[0], fit.bse[0]), rel=1e-9)


def test_the_spread_of_directions_shows_poses_about_one_axis():
    one_axis = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.arange(12.0)])
    every = np.vstack([np.eye(3), -np.eye(3)])
    assert direction_spread(one_axis) < 1e-12
    assert direction_spread(every) == pytest.approx(1 / 3)


def test_a_log_without_any_still_part_has_few_poses():
    rng = np.random.default_rng(0)
    t = np.arange(0, 60, 0.01)[:, None]
    swing = np.sin(2 * np.pi * 0.5 * t + np.arange(3))
    poses = find_poses(swing + 0.01 * rng.standard_normal(swing.shape), 9.8 * swing, 0.01)
    assert len(poses) < 12
