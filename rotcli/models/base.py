"""The still base that a table stands on: what the Earth does to sensors at rest there.

The body b is that of the table at angle zero; turned by the angle about the axis it is the
sensor's frame s.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.models import earth, rotation

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Base:
    """The still base: latitude (rad), gravity (m/s^2), attitude of the body C_nb (3, 3)."""

    latitude: float
    gravity: float
    C_nb: Array

    @property
    def w_ie_n(self) -> Array:
        """The Earth rate (3,), rad/s, in n."""
        return earth.earth_rate_n(self.latitude)

    @property
    def w_ie_b(self) -> Array:
        """The Earth rate (3,), rad/s, in b."""
        return np.asarray(self.C_nb.T @ self.w_ie_n)

    @property
    def specific_force(self) -> Array:
        """What an accelerometer at rest feels, (3,) m/s^2, in b; level it is (0, 0, g)."""
        return np.asarray(self.gravity * self.C_nb[2])

    def w_ie_s(self, axis: Array, angle: Array) -> Array:
        """Return the Earth rate (n, 3), rad/s, in s, at table angles (n,) about an axis (3,)."""
        return rotation.turn_about(axis, -angle, np.broadcast_to(self.w_ie_b, (len(angle), 3)))


def level(f_b: Array) -> tuple[float, float]:
    """Return pitch and roll (rad) of the body from its mean specific force (3,) while still.

    >>> level(np.array([0.0, 0.0, 9.8]))
    (0.0, 0.0)
    """
    x, y, z = f_b
    return float(np.arctan2(y, np.hypot(x, z))), float(np.arctan2(-x, z) + 0.0)
