"""Errors of navigation with constant sensor errors, by the nonlinear mechanization.

Ideal readings of a still base on a table that turns at a constant rate are exact in closed form:
`w_is_s = C_sn w_ie_n + w u` and `f_s = C_sn f_n`. With the sensor errors added they are navigated
by the strapdown kernel; the same readings without errors are navigated too, and subtracted, which
removes what is left of the sampling. Nothing is linear in the errors: a tilt eps lowers the force
along the vertical by `g eps^2 / 2`, which no linear model contains.
"""

from functools import lru_cache

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import earth, rotation
from rotcli.models.base import FixedBase
from rotcli.models.strapdown import InitialState, mechanize_log
from rotcli.units import DEG, FloatArray

MAX_TIME = 3600.0  # s; the unaided height diverges by a factor of 4 in 1000 s
_STEP = 5.0 * DEG  # of the table angle from sample to sample: 1e-5 of an error of 0.1 rad
_EVEN = 72  # samples in a turn are a multiple of this: one falls on every 5 deg
_MAX_INTERVAL = 1.0  # s; gyro errors of 1 deg/s then turn by half a step


@dataclass(frozen=True, eq=False)
class SensorError:
    """Constant errors of both triads: gyro bias (3,) rad/s, matrix (3, 3), accel bias m/s^2."""

    gyro_bias: FloatArray
    gyro_matrix: FloatArray
    accel_bias: FloatArray


@dataclass(frozen=True, eq=False)
class NavigationErrors:
    """Errors in n over time (n,) s: attitude (n, 3) rad, velocity (n, 3) m/s, position (n, 3) m.

    attitude: rotation vector eps of `C_hat = exp([eps x]) C`.
    """

    time: FloatArray
    attitude: FloatArray
    velocity: FloatArray
    position: FloatArray


def navigation_errors(
    error: SensorError, base: FixedBase, u: FloatArray, rate: float, duration: float
) -> NavigationErrors:
    """Navigate from rest at table angle 0 for `duration` (s), 3600 s at most.

    u: (3,) rotation axis in b; rate: rad/s, 0 for a still table. The samples divide the duration
    evenly, at 5 deg of table angle or less.
    """
    longest = min(_MAX_INTERVAL, _STEP / abs(rate)) if rate else _MAX_INTERVAL
    samples = _EVEN * int(np.ceil(duration / longest / _EVEN - 1e-9)) + 1
    time = np.linspace(0.0, duration, samples)
    w_is_s, f_s, ideal = _ideal(
        base, (float(u[0]), float(u[1]), float(u[2])), rate, time[1], samples
    )
    erroneous = w_is_s + w_is_s @ error.gyro_matrix.T + error.gyro_bias
    found = _navigated(erroneous, f_s + error.accel_bias, time[1], base)
    eps = _rotation_vectors(rotation.multiply(found[0], rotation.conjugate(ideal[0])))
    return NavigationErrors(time, eps, found[1] - ideal[1], found[2] - ideal[2])


@lru_cache(maxsize=2)  # all sources of one scheme: over a turn, and over the duration
def _ideal(
    base: FixedBase, axis: tuple[float, float, float], rate: float, interval: float, samples: int
) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """Return ideal readings w_is_s, f_s (n, 3) every `interval` (s), and their navigation."""
    u = np.array(axis)
    angle: FloatArray = rate * interval * np.arange(samples, dtype=float)
    w_is_s = base.w_ie_s(u, angle) + rate * u if rate else np.tile(base.w_ie_b, (samples, 1))
    f_b = np.broadcast_to(base.specific_force, (samples, 3))
    f_s = rotation.rotate_about(u, -angle, f_b) if rate else f_b
    return w_is_s, f_s, _navigated(w_is_s, f_s, interval, base)


def _navigated(
    w_is_s: FloatArray, f_s: FloatArray, interval: float, base: FixedBase
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q_ns (4, n), velocity (n, 3) and displacement (n, 3) in n."""
    start = InitialState(base.latitude, 0.0, 0.0, np.zeros(3), base.C_nb)
    trajectory = mechanize_log(w_is_s, f_s, float(interval), start, gravity=base.gravity)
    R_M, R_N = (float(radius) for radius in earth.radii(base.latitude))
    position = np.stack(
        [
            trajectory.longitude * R_N * np.cos(base.latitude),
            (trajectory.latitude - base.latitude) * R_M,
            trajectory.height,
        ],
        axis=1,
    )
    return trajectory.q_ns, trajectory.v_n, position


def _rotation_vectors(q: FloatArray) -> FloatArray:
    """Return the rotation vectors (n, 3), rad, of quaternions (4, n), of half a turn at most."""
    q = np.where(q[0] < 0.0, -q, q)
    size = np.sqrt(np.sum(q[1:] ** 2, axis=0))
    half = np.arctan2(size, q[0])
    factor = np.divide(2.0 * half, size, out=np.full_like(size, 2.0), where=size > 0.0)
    return np.asarray((factor * q[1:]).T)
