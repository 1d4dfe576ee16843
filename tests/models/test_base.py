import numpy as np
import pytest

from rotcli.models.base import FixedBase, level
from rotcli.models.earth import EARTH_RATE, gravity_at, normal_gravity
from rotcli.models.rotation import attitude_matrix

DEG = np.pi / 180
Z = np.array([0.0, 0.0, 1.0])


def test_a_level_base_facing_east_has_gravity_upward_and_earth_rate_about_minus_x():
    base = FixedBase(0.0, 9.8, attitude_matrix(0.0, 0.0, 90 * DEG))
    np.testing.assert_allclose(base.specific_force, [0.0, 0.0, 9.8], atol=1e-15)
    # On the equator the Earth turns about north: the left, -x, of a body that looks east.
    np.testing.assert_allclose(base.w_ie_b, [-EARTH_RATE, 0.0, 0.0], atol=1e-19)


def test_the_earth_rate_in_the_sensor_frame_follows_the_table_angle():
    base = FixedBase(0.0, 9.8, np.eye(3))
    w_ie_s = base.w_ie_s(Z, np.array([0.0, 90 * DEG]))
    # Turned left by 90 deg, the sensor's x axis points north.
    expected = EARTH_RATE * np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(w_ie_s, expected, atol=1e-19)


def test_a_measured_gravity_replaces_the_normal_one():
    assert gravity_at(0.9, 100.0, 9.79) == 9.79
    assert gravity_at(0.9, 100.0, None) == pytest.approx(float(normal_gravity(0.9, 100.0)))


def test_levelling_gives_pitch_and_roll_of_the_attitude():
    for pitch, roll in ((0.3, -0.2), (-0.1, 0.4), (0.0, 0.1)):
        base = FixedBase(0.9, 9.8, attitude_matrix(pitch, roll, 1.0))
        assert level(base.specific_force) == pytest.approx((pitch, roll), abs=1e-15)
