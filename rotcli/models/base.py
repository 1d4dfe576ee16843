"""Earth rate and specific force at the fixed base of a turntable.

The body frame b is the frame of the table at angle zero. Rotation about the table axis by the
table angle gives the sensor frame s.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import earth, rotation
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class FixedBase:
    """The fixed base: latitude (rad), gravity (m/s^2), attitude of the body C_nb (3, 3)."""

    latitude: float
    gravity: float
    C_nb: FloatArray

    @property
    def w_ie_n(self) -> FloatArray:
        """The Earth rate (3,), rad/s, in n."""
        return earth.earth_rate_n(self.latitude)

    @property
    def w_ie_b(self) -> FloatArray:
        """The Earth rate (3,), rad/s, in b."""
        return np.asarray(self.C_nb.T @ self.w_ie_n)

    @property
    def specific_force(self) -> FloatArray:
        """The specific force at rest (3,), m/s^2, in b; (0, 0, g) for a level base."""
        return np.asarray(self.gravity * self.C_nb[2])

    def w_ie_s(self, axis: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the Earth rate (n, 3), rad/s, in s, at table angles (n,) about an axis (3,)."""
        return rotation.rotate_about(axis, -angle, np.broadcast_to(self.w_ie_b, (len(angle), 3)))


def level(f_b: FloatArray) -> tuple[float, float]:
    """Return pitch and roll (rad) of the body from its mean specific force (3,) while still.

    >>> level(np.array([0.0, 0.0, 9.8]))
    (0.0, 0.0)
    """
    x, y, z = f_b
    return float(np.arctan2(y, np.hypot(x, z))), float(np.arctan2(-x, z) + 0.0)
