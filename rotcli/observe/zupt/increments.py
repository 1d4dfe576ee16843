"""Preintegrated rotation and velocity of blocks of IMU samples, with their bias derivatives.

Between two filter updates the rotation and the specific force are integrated in the frame of the
block's start, for all blocks and runs at once. Sensor biases enter linearly: a bias of
1800 deg/h over 0.1 s leaves a second-order error of 4e-7 rad times the rotation of the table,
which is below the noise.
Source: Forster, Carlone, Dellaert, Scaramuzza, IEEE Trans. Robot. 33 (2017) 1, section VI.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.rotation import (
    matrix_from_quaternion,
    multiply,
    quaternion_from_vector,
)
from rotcli.units import FloatArray

_SERIES_ANGLE = 0.2  # rad per sample: larger ones take sine and cosine


@dataclass(frozen=True, eq=False)
class PreintegratedBlocks:
    """Increments over n blocks of `runs` logs, in the sensor frame at each block's start.

    C_start_end: (n, runs, 3, 3), takes vectors from the block's end to its start.
    dv: (n, runs, 3) m/s, integral of the specific force.
    rotation_integral: (n, runs, 3, 3) s, integral of C from the sensor to the block's start. A
        gyro bias b_g adds `rotation_integral @ b_g` to the rotation vector, an accelerometer
        bias b_a adds `rotation_integral @ b_a` to the velocity.
    dv_gyro_bias_jacobian: (n, runs, 3, 3), m: a correction of the gyro bias by b_g adds
        `dv_gyro_bias_jacobian @ b_g` to the velocity.
    rotation_double_integral: (n, runs, 3, 3) s^2, integral of C times the time to the block's end.
    """

    C_start_end: FloatArray
    dv: FloatArray
    rotation_integral: FloatArray
    dv_gyro_bias_jacobian: FloatArray
    rotation_double_integral: FloatArray


def preintegrate(
    gyro: FloatArray, accel: FloatArray, interval: float, samples: int, averages: bool = False
) -> PreintegratedBlocks:
    """Integrate blocks of `samples` IMU intervals; samples after the last full block are omitted.

    gyro (rad/s), accel (m/s^2): (runs, n, 3). averages: sample k is the mean over the interval
    that ends there; otherwise it is the value at its time. Sample 0 is the start of block 0.
    A constant rate and a specific force constant in n have no error of second order in the angle
    per sample.
    """
    runs, n, _ = gyro.shape
    count = (n - 1) // samples
    dt = interval

    def by_block(a: FloatArray) -> FloatArray:
        """Reorder (runs, count * samples, 3) to (samples, 3, count, runs)."""
        return a.reshape(runs, count, samples, 3).transpose(2, 3, 1, 0)

    last = count * samples
    w0, w1 = by_block(gyro[:, :last]), by_block(gyro[:, 1 : last + 1])
    f0, f1 = by_block(accel[:, :last]), by_block(accel[:, 1 : last + 1])
    q = np.zeros((4, count, runs))
    q[0] = 1.0
    C = _matrix(q)
    dv = np.zeros((3, count, runs))
    # Matrices have the rows first, (3, 3, count, runs): ten times faster than 3 x 3 products.
    rotation_integral, rotation_double_integral, jacobian = (
        np.zeros((3, 3, count, runs)) for _ in range(3)
    )
    for i in range(samples):
        phi = _rotation_vector(w0[i], w1[i], dt, averages=averages)
        half = _half_rotation(phi)
        q_mid = multiply(q, half)
        q = multiply(q_mid, half)
        C_mid, C_end = _matrix(q_mid), _matrix(q)
        force = _velocity(f0[i], f1[i], phi, (C, C_mid, C_end), dt, averages=averages)
        dv += force
        jacobian += _cross(force, rotation_integral + 0.5 * dt * C_mid)
        rotation_integral += dt * C_mid
        rotation_double_integral += dt * dt * (samples - i - 0.5) * C_mid
        C = C_end

    def matrices(a: FloatArray) -> FloatArray:
        return np.ascontiguousarray(np.moveaxis(a, (0, 1), (-2, -1)))

    return PreintegratedBlocks(
        matrices(C),
        np.ascontiguousarray(np.moveaxis(dv, 0, -1)),
        matrices(rotation_integral),
        matrices(jacobian),
        matrices(rotation_double_integral),
    )


def _rotation_vector(w0: FloatArray, w1: FloatArray, dt: float, *, averages: bool) -> FloatArray:
    """Return the rotation vector (3, ...), rad, of an interval dt (s) with rates at its ends."""
    if averages:
        return np.asarray(w1 * dt)
    # Coning of a rate that is linear in time (Savage, J. Guid. Control Dyn. 21 (1998) 19).
    return np.asarray(0.5 * dt * (w0 + w1) + dt * dt / 12.0 * _cross(w0, w1))


def _velocity(
    f0: FloatArray,
    f1: FloatArray,
    phi: FloatArray,
    rotations: tuple[FloatArray, FloatArray, FloatArray],
    dt: float,
    *,
    averages: bool,
) -> FloatArray:
    """Return the velocity (3, ...), m/s, of an interval; rotations: at start, middle and end."""
    C, C_mid, C_end = rotations
    if averages:
        # The mean force over a rotation is shorter by (angle)^2 / 24 perpendicular to the axis.
        f_mid = f1 - _cross(phi, _cross(phi, f1)) / 24.0
        return np.asarray(dt * _times(C_mid, f_mid))
    # A force constant in n is constant here, so the trapezoid of C f is exact for it.
    return np.asarray(0.5 * dt * (_times(C, f0) + _times(C_end, f1)))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b with the components first: a (3, ...), b (3, ...) or the columns of (3, 3, ...).

    >>> _cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    array([0., 0., 1.])
    """
    (x, y, z), (u, v, w) = a, b
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u])


def _times(C: FloatArray, f: FloatArray) -> FloatArray:
    """Return C f (3, ...) of C (3, 3, ...) and f (3, ...)."""
    return np.asarray(C[:, 0] * f[0] + C[:, 1] * f[1] + C[:, 2] * f[2])


def _matrix(q: FloatArray) -> FloatArray:
    """Return the matrices (3, 3, ...) of unit quaternions (4, ...)."""
    return np.moveaxis(matrix_from_quaternion(q), (-2, -1), (0, 1))


def _half_rotation(phi: FloatArray) -> FloatArray:
    """Return the quaternions (4, ...) of half the rotation vectors phi (3, ...), rad.

    By series where all angles are small: with y = (angle / 4)^2 below _SERIES_ANGLE^2 / 16 the
    first omitted terms, y^5 / 10! and y^5 / 11!, are below 1e-19.
    """
    x, y, z = phi
    square = x * x + y * y + z * z
    if not square.max(initial=0.0) < _SERIES_ANGLE**2:
        return quaternion_from_vector(0.5 * phi)
    square *= 1.0 / 16.0
    cosine, sinc = np.ones_like(square), np.ones_like(square)
    for k in (8, 6, 4, 2):  # Horner's scheme of cos and of sin(a) / a
        cosine = 1.0 - square / (k * (k - 1)) * cosine
        sinc = 1.0 - square / (k * (k + 1)) * sinc
    sinc *= 0.25
    return np.stack([cosine, sinc * x, sinc * y, sinc * z])
