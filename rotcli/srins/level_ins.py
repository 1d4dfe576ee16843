"""Level-channel mechanization of a rotating IMU on a slowly moving, level vehicle (V_up = 0).

The nonlinear system whose linear error dynamics are in `rotcli.srins.model`: attitude from the
gyros, V from the accelerometers and Coriolis terms, and the damped velocity
`V_d = V + K1 (u1 + u2)` for transport rate and position.

IMU samples are first integrated over blocks of about a second (`preintegrate_means`): the IMU
rotates about its z axis, all other rotation is small. Then one pass over the blocks (`mechanize`)
with plain numbers, or with arrays of many runs. Second order in the block's length.

Sources: the SRINS level-damping paper ("S"); Savage, "Strapdown Inertial Navigation Integration
Algorithm Design", JGCD 21 (1998), for increments between updates.
"""

import math
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models import earth
from rotcli.srins.model import Damping
from rotcli.units import FloatArray

_E2 = earth.ECCENTRICITY_SQUARED


def level_rates(
    v: Any, v_d: Any, latitude: Any, lib: ModuleType = np
) -> tuple[tuple[Any, Any, Any], Any, tuple[Any, Any]]:
    """Return w_in_n (3), the Coriolis rate and the rates of latitude and longitude, rad/s.

    v, v_d: (east, north) m/s, undamped and damped. The Coriolis rate w gives
    `V_E' = f_E + w V_N`, `V_N' = f_N - w V_E`. Numbers, arrays or complex numbers alike.
    """
    s, c = lib.sin(latitude), lib.cos(latitude)
    w2 = 1.0 - _E2 * s * s
    R_N = earth.SEMI_MAJOR_AXIS / lib.sqrt(w2)
    R_M = R_N * (1.0 - _E2) / w2
    t, W = s / c, earth.EARTH_RATE
    east, north = v_d[0] / R_N, v_d[1] / R_M
    w_in_n = (-north, W * c + east, W * s + east * t)
    return w_in_n, 2.0 * W * s + v[0] * t / R_N, (north, east / c)


def navigation_rates(
    state: FloatArray,
    C_ns: FloatArray,
    w_is_s: FloatArray,
    f_s: FloatArray,
    v_ref: FloatArray,
    damping: Damping,
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of the state (8,) and of C_ns (3, 3): the mechanization as an ODE.

    state: V_E, V_N (m/s), latitude, longitude (rad), u1 to u4 (m/s). w_is_s, f_s: (3,) what the
    sensors read. v_ref: (2,) m/s. Works for complex numbers.
    """
    v, latitude, u = state[:2], state[2], state[4:]
    v_d = v + damping.enabled * np.array([u[0] + u[1], u[2] + u[3]])
    w_in_n, coriolis, rates = level_rates(v, v_d, latitude)
    f_n = C_ns @ f_s
    e = v - v_ref
    rate = np.array(
        [
            f_n[0] + coriolis * v[1],
            f_n[1] - coriolis * v[0],
            *rates,
            *(damping.state_matrix @ u[:2] + damping.input_vector * e[0]),
            *(damping.state_matrix @ u[2:] + damping.input_vector * e[1]),
        ]
    )
    return rate, C_ns @ _skew(w_is_s) - _skew(w_in_n) @ C_ns


def _skew(w: Any) -> NDArray[Any]:
    zero = 0.0 * w[0]
    return np.array([[zero, -w[2], w[1]], [w[2], zero, -w[0]], [-w[1], w[0], zero]])


@dataclass(frozen=True, eq=False)
class LevelIncrements:
    """Increments of an IMU in each of n blocks of `duration` s, in the frame s of its start.

    The rotation in a block is `exp(h) Rz(psi)`: level_rotation h (2, n, ...) rad, small;
    heading_increment psi (n, ...) rad. dv: (3, n, ...) m/s. A further axis, if any, is of runs.
    """

    duration: float
    heading_increment: FloatArray
    level_rotation: FloatArray
    dv: FloatArray

    def __len__(self) -> int:
        return len(self.heading_increment)

    @classmethod
    def join(cls, parts: "list[LevelIncrements]") -> "LevelIncrements":
        """Return consecutive blocks as one."""
        return cls(
            float(np.mean([part.duration for part in parts])),
            np.concatenate([part.heading_increment for part in parts]),
            np.concatenate([part.level_rotation for part in parts], axis=1),
            np.concatenate([part.dv for part in parts], axis=1),
        )


def preintegrate_means(
    gyro: FloatArray, accel: FloatArray, interval: float, samples: int
) -> LevelIncrements:
    """Integrate means over the sample interval (n, 3), rad/s and m/s^2, over blocks of `samples`.

    Within a sample the IMU rotates about z by dth and slowly otherwise: the sum of a level vector
    that is constant in n is `sin(dth/2)/(dth/2)` of it, in the frame half-way. Exact to the
    first order of the other rotation, at any rate about z. Samples after the last complete
    block are omitted.
    """
    n = len(gyro) // samples
    psi, h, dv = _interval_means(gyro[: n * samples], accel[: n * samples], interval)
    return _blocks(psi, h, dv, interval, samples)


def preintegrate_instants(
    gyro: FloatArray, accel: FloatArray, interval: float, samples: int
) -> LevelIncrements:
    """Integrate values at instants (n + 1, 3), the first at the start of the first block.

    Trapezoids in the frame half-way between two instants, where the level vectors hardly change.
    """
    n = (len(gyro) - 1) // samples
    gyro, accel = gyro[: n * samples + 1], accel[: n * samples + 1]
    psi = 0.5 * (gyro[1:, 2] + gyro[:-1, 2]) * interval
    c, s = np.cos(0.5 * psi), np.sin(0.5 * psi)

    def mean(v: FloatArray) -> FloatArray:
        x = 0.5 * (c * (v[1:, 0] + v[:-1, 0]) - s * (v[1:, 1] - v[:-1, 1]))
        y = 0.5 * (c * (v[1:, 1] + v[:-1, 1]) + s * (v[1:, 0] - v[:-1, 0]))
        return interval * np.stack([x, y])

    up = 0.5 * interval * (accel[1:, 2] + accel[:-1, 2])
    return _blocks(psi, mean(gyro), np.stack([*mean(accel), up]), interval, samples)


def _interval_means(
    gyro: FloatArray, accel: FloatArray, interval: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return psi (n,), h (2, n) and dv (3, n) of each sample, in the frame half-way."""
    psi = gyro[:, 2] * interval
    scale = interval / np.sinc(0.5 * psi / np.pi)
    h = scale * gyro[:, :2].T
    return psi, h, np.stack([*(scale * accel[:, :2].T), interval * accel[:, 2]])


def _blocks(
    psi: FloatArray, h: FloatArray, dv: FloatArray, interval: float, samples: int
) -> LevelIncrements:
    """Sum samples block by block in the frame s of the block's start."""
    psi = psi.reshape(-1, samples)
    middle = np.cumsum(psi, axis=1) - 0.5 * psi
    c, s = np.cos(middle), np.sin(middle)

    def back(v: FloatArray) -> FloatArray:
        x, y = v[:2].reshape(2, -1, samples)
        return np.stack([c * x - s * y, s * x + c * y])

    h, level, up = back(h), back(dv), dv[2].reshape(-1, samples)
    # Small rotation up to the middle of each sample tilts the force: theta x f.
    theta = np.cumsum(h, axis=2) - 0.5 * h
    level[0] += theta[1] * up
    level[1] -= theta[0] * up
    up = up + theta[0] * level[1] - theta[1] * level[0]
    dv = np.stack([level[0].sum(axis=1), level[1].sum(axis=1), up.sum(axis=1)])
    return LevelIncrements(samples * interval, psi.sum(axis=1), h.sum(axis=2), dv)


@dataclass(frozen=True, eq=False)
class LevelState:
    """The state of a mechanization.

    q_ns: (4, ...); velocity: (2, ...) east, north m/s; position rad; u: (4, ...) m/s, the damping
    states, zero when the damping is switched on.
    """

    q_ns: Any
    velocity: Any
    latitude: Any
    longitude: Any
    u: Any = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class LevelSolution:
    """The state at the ends of the blocks, the start first, each (n + 1, ...).

    velocity: (2, n + 1, ...) m/s east, north, undamped; latitude, longitude rad; u: (4, ...) m/s,
    the damping states; q_ns: (4, ...).
    """

    velocity: FloatArray
    latitude: FloatArray
    longitude: FloatArray
    u: FloatArray
    q_ns: FloatArray

    @property
    def last(self) -> LevelState:
        """The state at the end."""
        return LevelState(
            self.q_ns[:, -1],
            self.velocity[:, -1],
            self.latitude[-1],
            self.longitude[-1],
            self.u[:, -1],
        )

    @property
    def theta(self) -> FloatArray:
        """The IMU's angle about up against east, north (rad), unwrapped over time."""
        w, x, y, z = self.q_ns
        angle = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
        result: FloatArray = np.unwrap(angle, axis=0)
        return result


def mechanize(
    increments: LevelIncrements, start: LevelState, v_ref: FloatArray, damping: Damping
) -> LevelSolution:
    """Navigate over the blocks.

    v_ref: (2, n, ...) m/s, the Doppler log's velocity at the middle of each block. Where the
    increments have an axis of runs, every number of the state has it.
    """
    n, T = len(increments), increments.duration
    runs = increments.heading_increment.shape[1:]
    lib: ModuleType = np if runs else math
    step = _damping_step(damping, T)
    K1 = damping.enabled
    q = [_spread(value, runs) for value in start.q_ns]
    v = [_spread(value, runs) for value in start.velocity]
    L, lam = _spread(start.latitude, runs), _spread(start.longitude, runs)
    u = [_spread(value, runs) for value in start.u]
    out = np.empty((12, n + 1, *runs))
    _store(out, 0, v, L, lam, u, q)
    half_psi = 0.5 * increments.heading_increment
    blocks = zip(
        *(_rows(x) for x in (np.cos(half_psi), np.sin(half_psi))),
        *(_rows(x) for x in (*increments.level_rotation, *increments.dv, *v_ref)),
        strict=True,
    )
    for k, (cz, sz, hx, hy, ax, ay, az, ref_e, ref_n) in enumerate(blocks, start=1):
        v_d = (v[0] + K1 * (u[0] + u[1]), v[1] + K1 * (u[2] + u[3]))
        middle = L + 0.5 * T * v_d[1] / earth.SEMI_MAJOR_AXIS
        w, coriolis, _ = level_rates(v, v_d, middle, lib)
        f = _rotate(q, (ax, ay, az))
        # Rotation of n against i over half a block, then Coriolis at the middle velocity.
        half = 0.5 * T
        gain = (
            f[0] + half * (w[2] * f[1] - w[1] * f[2]),
            f[1] + half * (w[0] * f[2] - w[2] * f[0]),
        )
        mid = (v[0] + 0.5 * gain[0], v[1] + 0.5 * gain[1])
        new = [v[0] + gain[0] + T * coriolis * mid[1], v[1] + gain[1] - T * coriolis * mid[0]]
        mid = (0.5 * (v[0] + new[0]), 0.5 * (v[1] + new[1]))
        u_new = [*_damp(step, u[0], u[1], mid[0] - ref_e), *_damp(step, u[2], u[3], mid[1] - ref_n)]
        v_d = (
            mid[0] + 0.5 * K1 * (u[0] + u[1] + u_new[0] + u_new[1]),
            mid[1] + 0.5 * K1 * (u[2] + u[3] + u_new[2] + u_new[3]),
        )
        w, _, rates = level_rates(mid, v_d, middle, lib)
        q = _advance(q, [-T * x for x in w], (hx, hy), (cz, sz))
        L, lam, v, u = L + T * rates[0], lam + T * rates[1], new, u_new
        _store(out, k, v, L, lam, u, q)
    return LevelSolution(out[0:2], out[2], out[3], out[4:8], out[8:12])


def _rows(x: FloatArray) -> Any:
    """Return one item per block: plain numbers, or rows of runs."""
    return x.tolist() if x.ndim == 1 else x


def _spread(value: Any, runs: tuple[int, ...]) -> Any:
    return np.broadcast_to(np.asarray(value, dtype=float), runs).copy() if runs else float(value)


def _store(out: FloatArray, k: int, v: Any, L: Any, lam: Any, u: Any, q: Any) -> None:
    out[:, k] = (*v, L, lam, *u, *q)


def _damping_step(damping: Damping, T: float) -> tuple[float, ...]:
    """Return a11, a21, a22, b1, b2 of `u_new = A u + b e` over T with e constant, exactly."""
    a, b = math.exp(-damping.w2 * T), math.exp(-damping.w3 * T)
    d = damping.w4 - damping.w3
    a21 = d * (a - b) / (damping.w3 - damping.w2) if damping.w3 != damping.w2 else d * T * a
    A = np.array([[a, 0.0], [a21, b]])
    b1, b2 = np.linalg.solve(damping.state_matrix, (A - np.eye(2)) @ damping.input_vector)
    return a, float(a21), b, float(b1), float(b2)


def _damp(step: tuple[float, ...], u1: Any, u2: Any, e: Any) -> tuple[Any, Any]:
    a11, a21, a22, b1, b2 = step
    return a11 * u1 + b1 * e, a21 * u1 + a22 * u2 + b2 * e


def _rotate(q: Any, v: Any) -> tuple[Any, Any, Any]:
    """Return v rotated by the quaternion q."""
    w, x, y, z = q
    a, b, c = v
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx


def _advance(q: Any, left: Any, h: Any, half_psi: Any) -> list[Any]:
    """Return `exp(left) q exp(h) Rz(psi)`: left (3), h (2) rad; half_psi: (cos, sin) of psi / 2.

    Small rotations by sine and cosine to the fourth order: 1e-17 for 1 mrad.
    """
    w, x, y, z = q
    a, b, c = left
    square = a * a + b * b + c * c
    c0, scale = 1.0 - square / 8.0, 0.5 - square / 48.0
    a, b, c = scale * a, scale * b, scale * c
    w, x, y, z = (
        c0 * w - a * x - b * y - c * z,
        c0 * x + a * w + b * z - c * y,
        c0 * y - a * z + b * w + c * x,
        c0 * z + a * y - b * x + c * w,
    )
    a, b = h
    square = a * a + b * b
    c0, scale = 1.0 - square / 8.0, 0.5 - square / 48.0
    a, b = scale * a, scale * b
    w, x, y, z = (
        c0 * w - x * a - y * b,
        c0 * x + w * a - z * b,
        c0 * y + w * b + z * a,
        c0 * z + x * b - y * a,
    )
    cz, sz = half_psi
    w, x, y, z = cz * w - sz * z, cz * x + sz * y, cz * y - sz * x, cz * z + sz * w
    # One Newton step to unit length.
    norm = 1.5 - 0.5 * (w * w + x * x + y * y + z * z)
    return [norm * w, norm * x, norm * y, norm * z]
