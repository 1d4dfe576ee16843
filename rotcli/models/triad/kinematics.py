"""Kinematics of a table of one to three axes, seen from the sensor.

Frame b belongs to the table's base, m to the innermost axis, s to the sensor, n is East-North-Up.
The attitude is a product of rotations about fixed axes, outermost first, with all angles zero in
b: C_bs = E_1 E_2 ... E_K C_ms with E_k = Exp(a_k theta_k). No chain of link frames is necessary,
so every order of axes works, and parallel axes are not singular. Vectors are turned one axis
after the other; no rotation matrix per sample is made.

Arrays have components first: angles (K, n), vectors (3, n), rad and SI.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.earth import earth_rate_n
from rotcli.models.rotation import axis_rotation, cross
from rotcli.models.triad import parameters as p
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]


def exp_rotation(phi: FloatArray) -> FloatArray:
    """Return the rotation matrix (3, 3) of a rotation vector (3,), rad."""
    angle = float(np.linalg.norm(phi))
    if angle == 0.0:
        return np.eye(3)
    return axis_rotation(np.asarray(phi, dtype=float) / angle, angle)


@dataclass(frozen=True, eq=False)
class Table:
    """Nominal table: axes (K, 3) in b, C_nb of the rig, C_ms of each mounting, site.

    mountings: (m, 3, 3) matrices from s to m. latitude rad, gravity m/s^2.
    """

    axes: FloatArray
    C_nb: FloatArray
    mountings: FloatArray
    latitude: float
    gravity: float

    @property
    def axis_count(self) -> int:
        """Number of table axes K."""
        return len(self.axes)

    @property
    def mounting_count(self) -> int:
        """Number of mountings."""
        return len(self.mountings)


def table(
    axes: Sequence[str | Sequence[float]],
    *,
    latitude: float,
    gravity: float,
    C_nb: FloatArray | None = None,
    mountings: Sequence[FloatArray] | None = None,
) -> Table:
    """Return a table from axis names or unit vectors; level, north and one mounting by default."""
    named = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    vectors = [named[a] if isinstance(a, str) else a for a in axes]
    return Table(
        axes=np.array(vectors, dtype=float),
        C_nb=np.eye(3) if C_nb is None else C_nb,
        mountings=np.array([np.eye(3)] if mountings is None else list(mountings), dtype=float),
        latitude=latitude,
        gravity=gravity,
    )


def actual_axes(nominal: Table, x: FloatArray) -> FloatArray:
    """Return the axes (K, 3) with the table errors of the parameter vector."""
    axes = nominal.axes.copy()
    if len(axes) > 1:
        k = x[p.OUTER_MIDDLE]
        axes[1] = np.cos(k) * nominal.axes[1] + np.sin(k) * nominal.axes[0]
    if len(axes) > 2:
        k = x[p.MIDDLE_INNER]
        crooked = np.cos(k) * nominal.axes[2] + np.sin(k) * nominal.axes[1]
        axes[2] = exp_rotation(nominal.axes[1] * x[p.MIDDLE_ZERO]) @ crooked
    return axes


def base_attitude(nominal: Table, x: FloatArray) -> FloatArray:
    """Return C_nb (3, 3) of the base: tilt first, azimuth second.

    In this order the direction of gravity in b does not depend on the poorly known azimuth.
    """
    tilt = np.array([x[p.BASE_EAST], x[p.BASE_NORTH], 0.0])
    azimuth = np.array([0.0, 0.0, x[p.BASE_AZIMUTH]])
    return exp_rotation(azimuth) @ exp_rotation(tilt) @ nominal.C_nb


def mounting_matrices(nominal: Table, x: FloatArray) -> FloatArray:
    """Return C_ms (m, 3, 3) of all mountings with their rotations (first one exact)."""
    turned = [nominal.mountings[0]]
    for m in range(1, nominal.mounting_count):
        first = p.FIXED_COUNT + 3 * (m - 1)
        turned.append(exp_rotation(x[first : first + 3]) @ nominal.mountings[m])
    return np.array(turned)


class Pose:
    """Rotations of the table at some instants, and the mounting of each.

    Takes fixed vectors of the frame behind axis k into the sensor frame.
    """

    def __init__(
        self, nominal: Table, x: FloatArray, angles: FloatArray, mounting: IntArray
    ) -> None:
        """Prepare sines and cosines of angles (K, n); mounting: (n,), index of each instant."""
        self.table = nominal
        self.axes = actual_axes(nominal, x)
        self.C_nb = base_attitude(nominal, x)
        self.mounting = mounting
        self.C_ms = mounting_matrices(nominal, x)
        self._cos, self._sin = np.cos(angles), np.sin(angles)
        self.size = angles.shape[1]

    def back(self, k: int, v: FloatArray) -> FloatArray:
        """Return E_k^T v: (3, 1) or (3, n) rotated by minus the angle of axis k (0 = outermost)."""
        a = self.axes[k][:, None]
        c, s = self._cos[k], self._sin[k]
        along = a * (self.axes[k] @ v)
        result: FloatArray = along + c * (v - along) - s * cross(np.broadcast_to(a, v.shape), v)
        return result

    def into_sensor(self, k: int, v: FloatArray) -> FloatArray:
        """Return P_k^T v (3, n): v (3,) or (3, n) of the frame behind axis k, seen in s.

        k = -1 is the base.
        """
        v = np.asarray(v, dtype=float)
        v = v[:, None] if v.ndim == 1 else v
        for j in range(k + 1, len(self.axes)):
            v = self.back(j, v)
        if len(self.C_ms) == 1:
            return np.broadcast_to(self.C_ms[0].T @ v, (3, self.size))
        v = np.broadcast_to(v, (3, self.size))
        result = np.empty((3, self.size))
        for m, matrix in enumerate(self.C_ms):
            at = self.mounting == m
            result[:, at] = matrix.T @ v[:, at]
        return result


@dataclass(frozen=True, eq=False)
class Motion:
    """What the sensor frame goes through, each (3, n) in s.

    table_rate w_t, acceleration d w_t/dt seen in s, earth_rate e, force f0 where the axes meet;
    axes: A_k, axis k in s.
    """

    table_rate: FloatArray
    acceleration: FloatArray
    earth_rate: FloatArray
    force: FloatArray
    axes: list[FloatArray]

    def lever_force(self, lever: FloatArray) -> FloatArray:
        """Return W r (3, n), m/s^2: the force that a lever r (3,) or (3, n), m, adds.

        W = [alpha x] + [w_t x]^2 + 2 [e x][w_t x], Coriolis of the Earth included.
        """
        r = np.broadcast_to(lever[:, None] if lever.ndim == 1 else lever, self.force.shape)
        speed = cross(self.table_rate, r)
        return cross(self.acceleration, r) + cross(self.table_rate + 2.0 * self.earth_rate, speed)

    def lever_matrix(self) -> FloatArray:
        """Return W (3, 3, n)."""
        return np.stack([self.lever_force(unit) for unit in np.eye(3)], axis=1)


def motion(pose: Pose, x: FloatArray, rates: FloatArray, accelerations: FloatArray) -> Motion:
    """Return the sensor's motion from table rates and accelerations (K, n), rad/s, rad/s^2."""
    down = pose.C_nb.T
    earth = pose.into_sensor(-1, down @ earth_rate_n(pose.table.latitude))
    force = pose.into_sensor(-1, down @ np.array([0.0, 0.0, pose.table.gravity + x[p.GRAVITY]]))
    axes = [pose.into_sensor(k, pose.axes[k]) for k in range(len(pose.axes))]
    total = np.zeros((3, pose.size))
    change = np.zeros((3, pose.size))
    for k, axis in enumerate(axes):
        own = axis * rates[k]
        # Axis k is fixed behind the axes before it: their rate turns it, seen from s.
        change += axis * accelerations[k] + cross(total, own)
        total = total + own
    return Motion(total, change, earth, force, axes)


def at_clock(
    angles: FloatArray, rates: FloatArray, accelerations: FloatArray, tau: float
) -> tuple[FloatArray, FloatArray]:
    """Return angles and rates tau (s) earlier, exact for constant acceleration."""
    if tau == 0.0:
        return angles, rates
    return (
        angles - rates * tau + 0.5 * accelerations * tau**2,
        rates - accelerations * tau,
    )
