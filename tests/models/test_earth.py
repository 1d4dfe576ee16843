"""The ellipsoid against published values and against its own defining equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rotcli.models import earth, rotation

DEG = np.pi / 180


def test_normal_gravity_at_45_degrees_is_the_published_one():
    # 9.80619920 m/s^2: GRS 80 at 45 deg (Moritz 2000, table of normal gravity); WGS 84 differs
    # from GRS 80 by 1.4e-6 m/s^2 in the ninth digits of its defining constants.
    assert float(earth.normal_gravity(45 * DEG, 0.0)) == pytest.approx(9.80619920, abs=2e-6)


def test_gravity_falls_with_height_by_the_free_air_gradient():
    # -3.086e-6 1/s^2 at mid latitude (Heiskanen and Moritz, Physical Geodesy, 2-124).
    fall = earth.normal_gravity(45 * DEG, 100.0) - earth.normal_gravity(45 * DEG, 0.0)
    assert float(fall) / 100.0 == pytest.approx(-3.086e-6, rel=1e-3)


def test_radii_of_curvature_at_pole_and_equator_follow_from_the_axes():
    a, b = earth.SEMI_MAJOR_AXIS, 6356752.314245  # m; the WGS 84 report prints 6356752.3142
    R_M, R_N = earth.radii(0.0)
    assert (pytest.approx(b * b / a, rel=1e-12), a) == (R_M, R_N)
    R_M, R_N = earth.radii(np.pi / 2)
    assert pytest.approx(a * a / b, rel=1e-12) == R_M
    assert pytest.approx(a * a / b, rel=1e-12) == R_N


def test_the_earth_turns_once_in_a_sidereal_day():
    assert 2 * np.pi / earth.EARTH_RATE == pytest.approx(86164.09, abs=0.02)


@given(st.floats(-89.9, 89.9), st.floats(-179, 179), st.floats(-1e3, 2e4))
def test_the_ellipsoid_normal_undoes_the_geodetic_position(latitude, longitude, height):
    r = earth.position_e(latitude * DEG, longitude * DEG, height)
    normal, sin_latitude, found = earth.ellipsoid_normal(r[:, None])
    up = earth.C_ne(latitude * DEG, longitude * DEG)[2]
    # Bowring's formula leaves 1e-12 rad at these heights, 6 micrometres on the ground.
    np.testing.assert_allclose(normal[:, 0], up, atol=1e-12)
    assert sin_latitude[0] == pytest.approx(np.sin(latitude * DEG), abs=1e-12)
    # One unit in the last place of the Earth's radius is 1e-9 m.
    assert found[0] == pytest.approx(height, abs=5e-9)


def test_east_north_up_axes_point_where_the_position_moves():
    latitude, longitude, step = 0.7, -2.1, 1e-6
    here = earth.position_e(latitude, longitude, 0.0)
    directions = [
        earth.position_e(latitude, longitude + step, 0.0) - here,
        earth.position_e(latitude + step, longitude, 0.0) - here,
        earth.position_e(latitude, longitude, 10.0) - here,
    ]
    for row, direction in zip(earth.C_ne(latitude, longitude), directions, strict=True):
        # A difference over 6 m bends by half its length over the radius: 1e-6.
        np.testing.assert_allclose(direction / np.linalg.norm(direction), row, atol=2e-6)


def test_the_quaternion_of_east_north_up_is_that_of_the_matrix():
    latitude, longitude = np.array([-0.7, 0.0, 1.2]), np.array([2.5, 0.0, -3.0])
    matrices = rotation.matrix_from_quaternion(earth.q_en(latitude, longitude))
    np.testing.assert_allclose(
        matrices, np.swapaxes(earth.C_ne(latitude, longitude), -1, -2), atol=1e-15
    )
