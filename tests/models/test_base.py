import numpy as np
import pytest

from rotcli.models.base import Base
from rotcli.models.earth import EARTH_RATE, gravity_at, normal_gravity
from rotcli.models.rotation import attitude_matrix

DEG = np.pi / 180
Z = np.array([0.0, 0.0, 1.0])


def test_a_level_base_that_looks_east_feels_gravity_up_and_the_earth_turn_about_its_left():
    base = Base(0.0, 9.8, attitude_matrix(0.0, 0.0, 90 * DEG))
    np.testing.assert_allclose(base.specific_force, [0.0, 0.0, 9.8], atol=1e-15)
    # On the equator the Earth turns about north: the left, -x, of a body that looks east.
    np.testing.assert_allclose(base.w_ie_b, [-EARTH_RATE, 0.0, 0.0], atol=1e-19)


def test_a_table_that_has_turned_sees_the_earth_turn_from_there():
    base = Base(0.0, 9.8, np.eye(3))
    seen = base.w_ie_s(Z, np.array([0.0, 90 * DEG]))
    # Turned left by 90 deg, the sensor's x axis points north.
    expected = EARTH_RATE * np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(seen, expected, atol=1e-19)


def test_a_measured_gravity_stands_for_the_normal_one():
    assert gravity_at(0.9, 100.0, 9.79) == 9.79
    assert gravity_at(0.9, 100.0, None) == pytest.approx(float(normal_gravity(0.9, 100.0)))
