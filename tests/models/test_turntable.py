"""The exact motion, differentiated numerically, is what the sensors are said to read."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from rotcli.models import earth, rotation
from rotcli.models.turntable import Schedule, ScheduleStep, Turntable

DEG = np.pi / 180
LATITUDE, HEIGHT = 51.08 * DEG, 1100.0
SCHEDULE = Schedule(
    (
        ScheduleStep(10.0),
        ScheduleStep(2.0, slope=20 * DEG),
        ScheduleStep(20.0, rate=40 * DEG, sweep=100 * DEG, period=10.0),
        ScheduleStep(5.0, rate=40 * DEG),
    )
)


def _turntable(axis="z", lever_arm=(0.0, 0.0, 0.0), schedule=SCHEDULE):
    return Turntable(
        latitude=LATITUDE,
        height=HEIGHT,
        C_nb=rotation.attitude_matrix(30 * DEG, -10 * DEG, 70 * DEG),
        axis=np.array(rotation.UNIT_VECTORS[axis]),
        schedule=schedule,
        lever_arm=np.array(lever_arm),
    )


def _C_is(table, t):
    """Sensor attitude against axes that coincide with East-North-Up at time 0 (by scipy)."""
    w = earth.earth_rate_n(LATITUDE)
    angle = SCHEDULE.motion(np.array([t]))[0][0]
    turned = Rotation.from_rotvec(w * t) * Rotation.from_matrix(table.C_nb)
    return (turned * Rotation.from_rotvec(table.axis * angle)).as_matrix()


def test_the_angle_is_the_integral_of_the_rate():
    for t in (9.0, 11.5, 14.2, 31.9, 36.0):
        rate = lambda x: SCHEDULE.motion(np.array([x]))[1][0]  # noqa: E731
        integral = quad(rate, 0.0, t, points=[10.0, 12.0, 32.0], limit=200)[0]
        assert SCHEDULE.motion(np.array([t]))[0][0] == pytest.approx(integral, abs=1e-9)


def test_the_rate_is_continuous_where_the_steps_meet():
    edges = np.array([10.0, 12.0, 32.0])
    before, after = SCHEDULE.motion(edges - 1e-9)[1], SCHEDULE.motion(edges + 1e-9)[1]
    np.testing.assert_allclose(before, after, atol=1e-8)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_the_angular_rate_is_the_derivative_of_the_attitude(axis):
    table = _turntable(axis)
    for t in (5.0, 11.0, 17.3, 35.0):
        h = 1e-4
        step = _C_is(table, t - h).T @ _C_is(table, t + h)
        expected = Rotation.from_matrix(step).as_rotvec() / (2 * h)
        w, _ = table.sense(np.array([t]))
        # Central difference: h^2/6 of the rate's second derivative, 0.7 rad/s^3, and rounding.
        np.testing.assert_allclose(w[0], expected, atol=1e-8)


def test_sensors_on_a_still_level_table_measure_gravity_and_earth_rate():
    table = Turntable(
        LATITUDE, HEIGHT, np.eye(3), np.array([0.0, 0, 1]), Schedule((ScheduleStep(1.0),))
    )
    w, f = table.sense(np.array([0.5]))
    np.testing.assert_allclose(w[0], earth.earth_rate_n(LATITUDE), atol=1e-18)
    np.testing.assert_allclose(f[0], [0, 0, earth.normal_gravity(LATITUDE, HEIGHT)], atol=1e-15)


def test_on_the_axis_the_force_is_gravity_rotated_into_the_sensor():
    table = _turntable("x")
    t = 17.3
    _, f = table.sense(np.array([t]))
    angle = SCHEDULE.motion(np.array([t]))[0][0]
    g = float(earth.normal_gravity(LATITUDE, HEIGHT))
    expected = Rotation.from_rotvec(table.axis * -angle).apply(table.C_nb.T @ [0, 0, g])
    np.testing.assert_allclose(f[0], expected, atol=1e-14)


@pytest.mark.parametrize("axis", ["x", "z"])
def test_a_lever_arm_adds_the_acceleration_of_its_end(axis):
    arm = np.array([0.05, -0.03, 0.02])
    t, h = 17.3, 1e-3
    end = [_C_is(_turntable(axis), t + k * h) @ arm for k in (-2, -1, 0, 1, 2)]
    acceleration = (-end[0] + 16 * end[1] - 30 * end[2] + 16 * end[3] - end[4]) / (12 * h * h)
    _, with_arm = _turntable(axis, arm).sense(np.array([t]))
    _, without = _turntable(axis).sense(np.array([t]))
    extra = _C_is(_turntable(axis), t).T @ acceleration
    # Gravity differs over 6 cm by 3e-6 1/s^2 * 0.06 m = 2e-7 m/s^2, left out here.
    np.testing.assert_allclose((with_arm - without)[0], extra, atol=3e-7)


def test_the_textbook_size_of_the_lever_arm_effect():
    # 5 cm at 100 deg/s: 0.05 * 1.745^2 = 0.15 m/s^2 towards the axis.
    schedule = Schedule((ScheduleStep(1.0, rate=100 * DEG),))
    table = _turntable("z", (0.05, 0.0, 0.0), schedule)
    still = _turntable("z", (0.0, 0.0, 0.0), schedule)
    extra = table.sense(np.array([0.5]))[1] - still.sense(np.array([0.5]))[1]
    np.testing.assert_allclose(extra[0], [-0.05 * (100 * DEG) ** 2, 0, 0], atol=1e-4)


def test_averages_are_the_integrals_over_the_interval():
    table = _turntable("x", (0.05, 0.0, 0.01))
    w, f = table.average(np.array([20.0]), 0.01)
    for k in range(3):
        rate = quad(lambda t, k=k: table.sense(np.array([t]))[0][0, k], 19.99, 20.0)[0]
        force = quad(lambda t, k=k: table.sense(np.array([t]))[1][0, k], 19.99, 20.0)[0]
        assert w[0, k] == pytest.approx(rate / 0.01, abs=1e-11)
        assert f[0, k] == pytest.approx(force / 0.01, abs=1e-11)


def test_the_final_rate_of_a_step_adds_its_ramp_and_its_sweep():
    step = ScheduleStep(2.0, rate=5.0, slope=20.0, sweep=3.0, period=8.0)
    assert step.final_rate == pytest.approx(5.0 + 2.0 * 20.0 + 3.0)


def test_a_still_sensor_above_the_axis_measures_the_gravity_of_its_height():
    up = np.array([0.0, 0.0, 200.0])
    still = Schedule((ScheduleStep(1.0),))
    C_nb = _turntable().C_nb
    _, f = _turntable("z", C_nb.T @ up, still).sense(np.array([0.5]))
    expected = C_nb.T @ [0, 0, earth.normal_gravity(LATITUDE, HEIGHT + 200.0)]
    np.testing.assert_allclose(f[0], expected, atol=1e-11)
