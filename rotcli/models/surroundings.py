"""Gravity and geography about a starting point, as a moving sensor feels them.

n0 is East-North-Up at the starting point, turning with the Earth; `d_n0` is the displacement from
there, so that differences of large numbers never arise. Arrays are components first, (3, m).
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.models import earth, rotation

Array = NDArray[np.float64]

_GRAVITY_KNOWN = 1e6  # m; an unaided height that has run farther feels the gravity there


class Surroundings:
    """Gravity and geography about a starting point (rad, m), functions of the displacement in n0.

    gravity: m/s^2 at the start, in place of normal gravity.
    """

    def __init__(self, latitude: float, height: float, gravity: float | None) -> None:
        self.w_ie = earth.earth_rate_n(latitude)
        normal = float(earth.normal_gravity(latitude, height))
        self._scale = 1.0 if gravity is None else gravity / normal
        self._r0_e = earth.position_e(latitude, 0.0, height)
        self._C_en0 = earth.C_ne(latitude, 0.0).T

    def _normal_e(self, d_n0: Array) -> tuple[Array, Array, Array]:
        """Return the ellipsoid's outward normal in e (3, m), sin of latitude and height."""
        r = self._r0_e[:, None] + self._C_en0 @ d_n0
        return earth.ellipsoid_normal(r)

    def geodetic(self, d_n0: Array) -> tuple[Array, Array, Array]:
        """Return latitude, longitude from the start's meridian (rad) and height (m)."""
        normal, _, height = self._normal_e(d_n0)
        latitude = np.arctan2(normal[2], np.hypot(normal[0], normal[1]))
        return latitude, np.arctan2(normal[1], normal[0]), height

    def gravitation(self, d_n0: Array) -> Array:
        """Return gravity plus what the start's own centripetal motion leaves, (3, m), in n0.

        d'' in i is f + g(r) + w x (w x d): gravitation less the acceleration of the start.
        """
        normal, sin_latitude, height = self._normal_e(d_n0)
        height = np.clip(height, -_GRAVITY_KNOWN, _GRAVITY_KNOWN)
        g = self._scale * earth.normal_gravity_sin(sin_latitude, height)
        down = self._C_en0.T @ normal
        w = self.w_ie
        centripetal = np.outer(w, w @ d_n0) - (w @ w) * d_n0
        return centripetal - g * down

    def vertical_restraint(self, d_n0: Array, v_n0: Array, a_n0: Array) -> Array:
        """Return the acceleration (3, m) along the vertical that keeps the height constant.

        a_n0: acceleration in i, seen in n0, without the restraint.
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
        restraint: Array = -up * (np.einsum("kn,kn->n", relative, up) + curvature)
        return restraint
