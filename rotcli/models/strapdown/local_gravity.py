"""Gravity and geodetic coordinates near a starting point.

The frame e is fixed to the Earth: x outward in the meridian of the start, y east, z along the
Earth's axis. Vectors are (3, m). Displacements from the start are arguments, so that no
differences of large numbers arise.
"""

import numpy as np

from rotcli.models import earth
from rotcli.models.rotation import cross
from rotcli.units import FloatArray

_MAX_GRAVITY_HEIGHT = 1e6  # m; the height term of normal gravity is a series, clipped here
_W_IE = np.array([[0.0], [0.0], [earth.EARTH_RATE]])


class LocalGravity:
    """Gravity and geodetic coordinates as functions of the displacement from a start (rad, m).

    gravity: m/s^2 at the start; None for normal gravity. vector: (3,) m/s^2, the start's gravity
    in e.
    """

    def __init__(self, latitude: float, height: float, gravity: float | None) -> None:
        normal = float(earth.normal_gravity(latitude, height))
        self._scale = 1.0 if gravity is None else gravity / normal
        self.vector = -self._scale * normal * np.array([np.cos(latitude), 0.0, np.sin(latitude)])
        self._start = earth.position_e(latitude, 0.0, height)[:, None]
        self._at_start = self._gravity(*self.vertical(np.zeros((3, 1))))

    def axis_distance(self, d: FloatArray) -> FloatArray:
        """Return the distances (m,), m, from the Earth's axis."""
        distance: FloatArray = np.hypot(self._start[0] + d[0], d[1])
        return distance

    def geodetic(self, d: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return latitude, longitude from the starting meridian (rad) and height (m), (m,)."""
        up, height = self.vertical(d)
        return np.arctan2(up[2], np.hypot(up[0], up[1])), np.arctan2(up[1], up[0]), height

    def vertical(self, d: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the upward unit vectors (3, m) and the heights (m,), m."""
        up, _, height = earth.ellipsoid_normal(self._start + d)
        return up, height

    def change(self, d: FloatArray) -> FloatArray:
        """Return gravity at d minus gravity at the start, plus w x (w x d), (3, m) m/s^2.

        The second term is the acceleration of the start: a displacement d against inertial space
        has d'' = f + g(r) + w x (w x d).
        """
        change = self._gravity(*self.vertical(d)) - self._at_start
        change[:2] -= earth.EARTH_RATE**2 * d[:2]
        return change

    def height_hold_change(self, d: FloatArray, v: FloatArray, reference: FloatArray) -> FloatArray:
        """Return `change` less a reference, and the vertical acceleration that keeps the height.

        v: (3, m) m/s, velocity against the Earth; reference: (3, 1) m/s^2. The specific force plus
        gravity at the start plus the reference must have no vertical part.
        A constant height above a curved Earth needs the centripetal acceleration v^2/R downward.
        """
        up, height = self.vertical(d)
        change = self._gravity(up, height) - self._at_start - reference
        relative = change - 2.0 * cross(np.broadcast_to(_W_IE, v.shape), v)
        change[:2] -= earth.EARTH_RATE**2 * d[:2]
        across = np.hypot(up[0], up[1])
        v_up, v_east = dot(v, up), (up[0] * v[1] - up[1] * v[0]) / across
        R_M, R_N = earth.radii_sin(up[2])
        v_north_2 = dot(v, v) - v_up**2 - v_east**2
        curvature = v_east**2 / (R_N + height) + v_north_2 / (R_M + height)
        change -= (dot(relative, up) + curvature) * up
        return change

    def _gravity(self, up: FloatArray, height: FloatArray) -> FloatArray:
        height = np.minimum(np.maximum(height, -_MAX_GRAVITY_HEIGHT), _MAX_GRAVITY_HEIGHT)
        return -self._scale * earth.normal_gravity_sin(up[2], height) * up


def dot(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the scalar products (m,) of vectors (3, m)."""
    product: FloatArray = np.einsum("km,km->m", x, y)
    return product
