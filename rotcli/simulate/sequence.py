"""Exact logs of an IMU on a table of one to three axes that plays a sequence.

Rates, accelerations and forces go from axis to axis outwards in, as in a robot arm (Newton-Euler
recursion): inertial rate w, its derivative and the specific force in the frame of each axis. The
steps of the motion are integrated analytically, so every sample is exact, kinks included; means
and increments are integrals by Gauss-Legendre quadrature between sample times and kinks.
Nothing is shared with the estimator: neither its block means nor its sums over axes.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.earth import earth_rate_n
from rotcli.models.triad import parameters as p
from rotcli.models.triad.motion import TableMotion
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)  # exact to degree 7 within one sample
_CHUNK = 20_000  # samples simulated together


@dataclass(frozen=True, eq=False)
class SequenceSetup:
    """Table and site: axes (K, 3) in b, C_nb (3, 3), C_ms of the mountings (m, 3, 3)."""

    axes: FloatArray
    C_nb: FloatArray
    mountings: FloatArray
    latitude: float
    gravity: float


@dataclass(frozen=True, eq=False)
class SequenceLog:
    """IMU time (n,), gyros and accelerometers (n, 3); table time (m,), angles (m, K), rad."""

    time: FloatArray
    gyro: FloatArray
    accel: FloatArray
    table_time: FloatArray
    angles: FloatArray
    mounting: IntArray


def _rotation(vector: FloatArray) -> FloatArray:
    """Return the rotation matrix (3, 3) of a rotation vector (3,)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))


def _about(axis: FloatArray, angle: FloatArray, v: FloatArray) -> FloatArray:
    """Return vectors (n, 3) turned by minus the angles (n,) about an axis (3,)."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.asarray(c * v - s * np.cross(axis, v) + (1.0 - c) * (v @ axis)[:, None] * axis)


def _true_axes(setup: SequenceSetup, x: FloatArray) -> FloatArray:
    """Return the axes (K, 3) with the table's errors, as rotations of the nominal axes."""
    axes = setup.axes.copy()
    if len(axes) > 1:
        turn = np.cross(setup.axes[1], setup.axes[0]) * x[p.OUTER_MIDDLE]
        axes[1] = _rotation(turn) @ setup.axes[1]
    if len(axes) > 2:
        turn = np.cross(setup.axes[2], setup.axes[1]) * x[p.MIDDLE_INNER]
        zero = _rotation(setup.axes[1] * x[p.MIDDLE_ZERO])
        axes[2] = zero @ _rotation(turn) @ setup.axes[2]
    return axes


class _Instants:
    """Readings without noise at instants of table time."""

    def __init__(self, setup: SequenceSetup, motion: TableMotion, x: FloatArray) -> None:
        self.setup, self.motion, self.x = setup, motion, x
        self.axes = _true_axes(setup, x)
        tilt = np.array([x[p.BASE_EAST], x[p.BASE_NORTH], 0.0])
        azimuth = np.array([0.0, 0.0, x[p.BASE_AZIMUTH]])
        self.C_nb = _rotation(azimuth) @ _rotation(tilt) @ setup.C_nb
        self.C_ms = [
            (np.eye(3) if m == 0 else _rotation(x[p.FIXED_COUNT + 3 * m - 3 :][:3])) @ C
            for m, C in enumerate(setup.mountings)
        ]

    def state(self, time: FloatArray, step: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return inertial rate, its derivative and force (n, 3) in s at the crossing of axes."""
        angle, rate, change = self.motion.at(time, step)
        n = len(time)
        w = np.broadcast_to(self.C_nb.T @ earth_rate_n(self.setup.latitude), (n, 3))
        up = np.array([0.0, 0.0, self.setup.gravity + self.x[p.GRAVITY]])
        f = np.broadcast_to(self.C_nb.T @ up, (n, 3))
        dw = np.zeros((n, 3))
        for k, axis in enumerate(self.axes):
            w, dw, f = (_about(axis, angle[k], v) for v in (w, dw, f))
            spin = axis * rate[k][:, None]
            dw = dw + axis * change[k][:, None] + np.cross(w, spin)
            w = w + spin
        mounting = self.motion.mounting[step]
        turned = []
        for v in (w, dw, f):
            out = np.empty((n, 3))
            for m, C in enumerate(self.C_ms):
                out[mounting == m] = v[mounting == m] @ C
            turned.append(out)
        return turned[0], turned[1], turned[2]

    def gyro(self, time: FloatArray, step: IntArray) -> FloatArray:
        """Return gyro readings (n, 3), rad/s."""
        x = self.x
        w, dw, f = self.state(time, step)
        v = w @ (np.eye(3) + x[p.N].reshape(3, 3)).T
        centre = x[p.LEVERS].reshape(3, 3).mean(axis=0)
        sensed = f + np.cross(dw, centre) + np.cross(w, np.cross(w, centre))
        return np.asarray(
            v + x[p.GYRO_BIAS] + sensed @ x[p.G].reshape(3, 3).T + x[p.GYRO_ASYMMETRY] * np.abs(v)
        )

    def accel(self, time: FloatArray, step: IntArray) -> FloatArray:
        """Return accelerometer readings (n, 3), m/s^2."""
        x = self.x
        w, dw, f = self.state(time, step)
        rows, levers = np.eye(3) + x[p.M].reshape(3, 3), x[p.LEVERS].reshape(3, 3)
        u = np.empty_like(f)
        for i in range(3):
            there = f + np.cross(dw, levers[i]) + np.cross(w, np.cross(w, levers[i]))
            u[:, i] = there @ rows[i]
        return np.asarray(u + x[p.ACCEL_BIAS] + x[p.K2] * u**2 + x[p.ACCEL_ASYMMETRY] * np.abs(u))


Readings = Callable[[FloatArray, IntArray], FloatArray]


def _integrals(read: Readings, motion: TableMotion, edges: FloatArray) -> FloatArray:
    """Return the integrals (n, 3) of readings between edges (n + 1,), s, exact across kinks."""
    inside = motion.start[(motion.start > edges[0]) & (motion.start < edges[-1])]
    cuts = np.unique(np.concatenate([edges, inside]))
    width = np.diff(cuts)
    total = np.zeros((len(width), 3))
    step = motion.step(cuts[:-1] + 0.5 * width)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        total += 0.5 * weight * width[:, None] * read(cuts[:-1] + 0.5 * width * (1 + node), step)
    running = np.concatenate([np.zeros((1, 3)), np.cumsum(total, axis=0)])
    return np.asarray(np.diff(running[np.searchsorted(cuts, edges)], axis=0))


def _read(
    read: Readings, motion: TableMotion, time: FloatArray, interval: float, sampling: str
) -> FloatArray:
    """Return instants, means or increments (n, 3) of readings at sample times (n,), s."""
    parts = []
    for first in range(0, len(time), _CHUNK):
        t = time[first : first + _CHUNK]
        if sampling == "instant":
            parts.append(read(t, motion.step(t)))
            continue
        edges = np.concatenate([[t[0] - interval], t])
        integral = _integrals(read, motion, edges)
        parts.append(integral if sampling == "increment" else integral / interval)
    return np.concatenate(parts)


def simulate_sequence(
    setup: SequenceSetup,
    motion: TableMotion,
    x: FloatArray,
    *,
    rate: float = 100.0,
    table_rate: float = 50.0,
    sampling: str = "instant",
) -> SequenceLog:
    """Return the exact logs of a motion; x (p,) are the errors, in the order of `parameters`.

    sampling: "instant", "average" or "increment". The clock offsets of x delay the table's motion
    in the readings: a sample at t shows the table at t - tau.
    """
    n = int(np.floor(motion.duration * rate + 1e-6)) + 1
    m = int(np.floor(motion.duration * table_rate + 1e-6)) + 1
    time = motion.start[0] + np.arange(n) / rate
    table_time = motion.start[0] + np.arange(m) / table_rate
    instants = _Instants(setup, motion, x)
    gyro = _read(instants.gyro, motion, time - x[p.CLOCK_GYRO], 1.0 / rate, sampling)
    accel = _read(instants.accel, motion, time - x[p.CLOCK_ACCEL], 1.0 / rate, sampling)
    angles = motion.at(table_time)[0].T
    mounting = motion.mounting[motion.step(time)]
    return SequenceLog(time, gyro, accel, table_time, angles, mounting)
