import numpy as np
import pytest

from rotcli.models import earth
from rotcli.models.local_gravity import LocalGravity

LATITUDE, HEIGHT = 0.9, 1100.0


def test_at_the_start_gravity_is_normal_gravity_downward_or_the_measured_value():
    here = np.zeros((3, 1))
    normal = float(earth.normal_gravity(LATITUDE, HEIGHT))
    for measured, expected in ((None, normal), (9.79, 9.79)):
        gravity = LocalGravity(LATITUDE, HEIGHT, measured).gravitation(here)[:, 0]
        np.testing.assert_allclose(gravity, [0.0, 0.0, -expected], atol=1e-9)


def test_a_displacement_becomes_latitude_longitude_and_height():
    moved = np.array([[0.0, 100.0, 0.0], [200.0, 0.0, 0.0], [0.0, 0.0, 30.0]])
    latitude, longitude, height = LocalGravity(LATITUDE, HEIGHT, None).geodetic(moved)
    R_M, R_N = earth.radii(LATITUDE)
    # The tangent plane leaves the ellipsoid by d^2 / 2 R: 3 mm at 200 m; ppm of the angles.
    assert (latitude[0] - LATITUDE) * (R_M + HEIGHT) == pytest.approx(200.0, abs=1e-2)
    assert longitude[1] * (R_N + HEIGHT) * np.cos(LATITUDE) == pytest.approx(100.0, abs=1e-2)
    np.testing.assert_allclose(height - HEIGHT, [0.0, 0.0, 30.0], atol=4e-3)
