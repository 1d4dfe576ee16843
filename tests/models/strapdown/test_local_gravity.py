"""Gravity and geodetic coordinates near a start against closed forms and finite differences."""

import numpy as np
import pytest

from rotcli.models import earth
from rotcli.models.strapdown.local_gravity import LocalGravity

LATITUDE, HEIGHT = 0.9, 1100.0
# Unit vectors of e at the start, in e: x outward, y east, z along the Earth's axis.
EAST = np.array([[0.0], [1.0], [0.0]])
NORTH = np.array([[-np.sin(LATITUDE)], [0.0], [np.cos(LATITUDE)]])
UP = np.array([[np.cos(LATITUDE)], [0.0], [np.sin(LATITUDE)]])


def test_gravity_at_the_start_is_normal_gravity_downward_or_the_measured_value():
    normal = float(earth.normal_gravity(LATITUDE, HEIGHT))
    for measured, expected in ((None, normal), (9.79, 9.79)):
        gravity = LocalGravity(LATITUDE, HEIGHT, measured)
        np.testing.assert_allclose(gravity.vector, -expected * UP[:, 0], atol=1e-14)
        np.testing.assert_array_equal(gravity.change(np.zeros((3, 1))), 0.0)


def test_a_displacement_becomes_latitude_longitude_and_height():
    d = np.hstack([200.0 * NORTH, 100.0 * EAST, 30.0 * UP])
    latitude, longitude, height = LocalGravity(LATITUDE, HEIGHT, None).geodetic(d)
    R_M, R_N = earth.radii(LATITUDE)
    # The tangent plane leaves the ellipsoid by d^2 / 2 R: 3 mm at 200 m; ppm of the angles.
    assert (latitude[0] - LATITUDE) * (R_M + HEIGHT) == pytest.approx(200.0, abs=1e-2)
    assert longitude[1] * (R_N + HEIGHT) * np.cos(LATITUDE) == pytest.approx(100.0, abs=1e-2)
    np.testing.assert_allclose(height - HEIGHT, [0.0, 0.0, 30.0], atol=4e-3)


def test_gravity_changes_by_its_gradient():
    # Gravity follows the vertical, g/R across; g falls by 3.086e-6 1/s^2 upward; w x (w x d).
    size = 100.0
    change = LocalGravity(LATITUDE, HEIGHT, None).change(size * np.hstack([NORTH, EAST, UP]))
    g = float(earth.normal_gravity(LATITUDE, HEIGHT))
    R_M, R_N = earth.radii(LATITUDE)
    w = earth.EARTH_RATE * np.array([[0.0], [0.0], [1.0]])

    def centripetal(direction):
        return np.cross(w, np.cross(w, direction, axis=0), axis=0)

    expected = [
        -g / (R_M + HEIGHT) * NORTH + centripetal(NORTH),
        -g / (R_N + HEIGHT) * EAST + centripetal(EAST),
        3.085e-6 * UP + centripetal(UP),
    ]
    # 3.0877e-6 - 4.4e-9 sin^2(latitude) of the surface, less 7.2e-13 per m: 3.084e-6 at 1100 m.
    # The change of g with the latitude, 8.1e-9 1/s^2 northward, is not in the expectation.
    np.testing.assert_allclose(change / size, np.hstack(expected), atol=9e-9)


def test_the_acceleration_at_constant_height_is_that_of_a_circle_over_the_earth():
    v_east = 100.0
    gravity = LocalGravity(LATITUDE, HEIGHT, None)
    change = gravity.height_hold_change(np.zeros((3, 1)), v_east * EAST, np.zeros((3, 1)))
    _, R_N = earth.radii(LATITUDE)
    # At rest against the Earth's axis the circle of latitude has the rate w + v / p; its
    # centripetal acceleration less that of the start is 2 w v + v^2 / p toward the axis. The
    # height needs the vertical part of it.
    p = (R_N + HEIGHT) * np.cos(LATITUDE)
    toward_axis = 2.0 * earth.EARTH_RATE * v_east + v_east**2 / p
    np.testing.assert_allclose(change, -toward_axis * np.cos(LATITUDE) * UP, rtol=1e-9)
