"""The lever arm of the ZUPT filter: its velocity with its sign, and an oblique axis."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.models.rotation import attitude_matrix, axis_rotation
from rotcli.observe.zupt.filter import run
from rotcli.observe.zupt.model import Settings, _lever_arm_variance, build_update_model
from rotcli.units import DEG

from .zupt_truth import DT, GRAVITY, LATITUDE, perfect, sensors, staircase

ARM = np.array([0.05, 0.06, 0.08])
OBLIQUE = np.array([2.0, -3.0, 6.0]) / 7.0
C_NB = attitude_matrix(20.0 * DEG, -10.0 * DEG, 40.0 * DEG)
AXES = {"x": np.array([1.0, 0.0, 0.0]), "z": np.array([0.0, 0.0, 1.0]), "oblique": OBLIQUE}


def oblique(axis=OBLIQUE, **more):
    return Settings(LATITUDE, GRAVITY, C_NB, axis, **more)


@pytest.mark.parametrize("axis", AXES)
def test_the_velocity_of_a_lever_arm_is_the_derivative_of_its_position(axis):
    u = AXES[axis]
    theta, rate, _ = staircase((0, 2), (-70, 5))
    model = build_update_model(theta, DT, oblique(u, lever_arm=tuple(ARM)))
    position = C_NB @ axis_rotation(u, theta) @ ARM
    velocity = np.gradient(position, DT, axis=0)[::10]
    # The rate is a mean over an update of 0.1 s: in the ramp, and half of one at the ends, it is
    # off by up to 2 deg/s.
    constant = np.abs(np.gradient(rate, DT)[::10]) < 1e-9
    constant[[0, -1]] = False
    np.testing.assert_allclose(model.lever_arm_velocity[constant], velocity[constant], atol=1e-4)
    assert np.abs(velocity).max() > 0.03


@pytest.mark.parametrize("axis", AXES)
def test_the_velocity_of_a_known_lever_arm_leaves_no_velocity_and_no_bias(axis):
    u = AXES[axis]
    theta, rate, acceleration = staircase((60, 40))  # turning from the first sample on
    log = perfect(C_NB, u, theta, rate, ARM, acceleration)
    s = oblique(u, lever_arm=tuple(ARM))
    known = run(build_update_model(theta, DT, s), *log)
    # The trapezoid of a centripetal acceleration is exact: only Earth rate in the readings remains.
    assert np.abs(known.values[:, :3]).max() < 2e-5
    assert np.abs(known.values[-1, 6:9]).max() < 1e-4
    reversed_arm = run(build_update_model(theta, DT, replace(s, lever_arm=tuple(-ARM))), *log)
    assert np.abs(reversed_arm.values[-1, 6:9]).max() > 0.01


def test_a_lever_arm_perpendicular_to_an_oblique_axis_is_estimated():
    theta, rate, acceleration = staircase((20, 60), (70, 60))
    s = oblique(estimate_lever_arm=True)
    axes = s.lever_axes
    np.testing.assert_allclose(axes.T @ axes, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(axes.T @ OBLIQUE, 0.0, atol=1e-15)
    log = perfect(C_NB, OBLIQUE, theta, rate, ARM, acceleration)
    gyro, accel, _, _ = sensors(np.random.default_rng(3), log)
    result = run(build_update_model(theta, DT, s), gyro, accel)
    found, sigma = result.values[-1, 12:14], result.sigma[-1, 12:14]
    assert np.abs(axes.T @ ARM).min() > 0.02
    assert (np.abs(found - axes.T @ ARM) < 4.0 * sigma).all()
    assert (sigma < 1e-3).all()
    # The axis does not move, although the IMU does.
    assert (np.abs(result.values[-1, :3]) < 4.0 * result.sigma[-1, :3]).all()


def test_the_velocity_of_a_lever_arm_is_uncertain_by_half_the_second_difference_of_the_rate():
    # An angle of c t^3/6 turns at c t^2/2: its mean rates over T have the second difference c T^2.
    jerk, samples = 0.3, 20
    theta = jerk * (DT * np.arange(401.0)) ** 3 / 6.0
    found = _lever_arm_variance(
        theta, DT, slice(0, 401), oblique(lever_arm=tuple(ARM), samples=samples)
    )
    arm = np.linalg.norm(np.cross(OBLIQUE, ARM))
    half = DT * (samples // 2)
    np.testing.assert_allclose(found, (0.5 * arm * jerk * half**2) ** 2, rtol=1e-6)
    assert len(found) == 400 // samples
