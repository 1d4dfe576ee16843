"""Gravity and geodetic coordinates near a starting point.

n0 is East-North-Up at the starting point, turning with the Earth; `d_n0` is the displacement from
there, so that differences of large numbers never arise. Arrays are components first, (3, m).
"""

import numpy as np

from rotcli.models import earth, rotation
from rotcli.units import FloatArray

_MAX_GRAVITY_HEIGHT = 1e6  # m; the height term of normal gravity is a series, which is clipped here


class LocalGravity:
    """Gravity and geodetic coordinates as functions of the displacement from a start (rad, m).

    gravity: m/s^2 at the start, in place of normal gravity.
    """

    def __init__(self, latitude: float, height: float, gravity: float | None) -> None:
        self.w_ie = earth.earth_rate_n(latitude)
        normal = float(earth.normal_gravity(latitude, height))
        self._scale = 1.0 if gravity is None else gravity / normal
        self._r0_e = earth.position_e(latitude, 0.0, height)
        self._C_en0 = earth.C_ne(latitude, 0.0).T

    def _normal_e(self, d_n0: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the ellipsoid's outward normal in e (3, m), sin of latitude and height."""
        r = self._r0_e[:, None] + self._C_en0 @ d_n0
        return earth.ellipsoid_normal(r)

    def geodetic(self, d_n0: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return latitude, longitude from the start's meridian (rad) and height (m)."""
        normal, _, height = self._normal_e(d_n0)
        latitude = np.arctan2(normal[2], np.hypot(normal[0], normal[1]))
        return latitude, np.arctan2(normal[1], normal[0]), height

    def gravitation(self, d_n0: FloatArray) -> FloatArray:
        """Return gravitation minus the acceleration of the start, (3, m), in n0.

        In i, d'' = f + g(r) + w x (w x d).
        """
        normal, sin_latitude, height = self._normal_e(d_n0)
        height = np.clip(height, -_MAX_GRAVITY_HEIGHT, _MAX_GRAVITY_HEIGHT)
        g = self._scale * earth.normal_gravity_sin(sin_latitude, height)
        down = self._C_en0.T @ normal
        w = self.w_ie
        centripetal = np.outer(w, w @ d_n0) - (w @ w) * d_n0
        return centripetal - g * down

    def height_hold_acceleration(
        self, d_n0: FloatArray, v_n0: FloatArray, a_n0: FloatArray
    ) -> FloatArray:
        """Return the acceleration (3, m) along the vertical that keeps the height constant.

        a_n0: acceleration against i, in n0, without the restraint.
        """
        normal, sin_latitude, height = self._normal_e(d_n0)
        up = self._C_en0.T @ normal
        w = self.w_ie
        relative = a_n0 - 2.0 * rotation.cross(w, v_n0) - (np.outer(w, w @ d_n0) - (w @ w) * d_n0)
        R_M, R_N = earth.radii(np.arcsin(sin_latitude))
        v_up = np.einsum("kn,kn->n", v_n0, up)
        east = np.cross(self._C_en0[2], up.T).T
        east /= np.linalg.norm(east, axis=0)
        v_east = np.einsum("kn,kn->n", v_n0, east)
        v_horizontal2 = np.einsum("kn,kn->n", v_n0, v_n0) - v_up**2
        curvature = v_east**2 / (R_N + height) + (v_horizontal2 - v_east**2) / (R_M + height)
        restraint: FloatArray = -up * (np.einsum("kn,kn->n", relative, up) + curvature)
        return restraint
