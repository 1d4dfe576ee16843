"""Preintegrated rotation and velocity of blocks of IMU samples, with their bias derivatives.

Between two filter updates the rotation and the specific force are integrated in the frame of the
block's start, for all blocks and runs at once. Sensor biases enter linearly: a bias of
1800 deg/h over 0.1 s leaves a second-order error of 4e-7 rad times the rotation of the table,
which is below the noise.
Source: Forster, Carlone, Dellaert, Scaramuzza, IEEE Trans. Robot. 33 (2017) 1, section VI.
"""

from dataclasses import dataclass

import numpy as np

from rotcli.models.rotation import matrix_from_quaternion, multiply, quaternion_from_vector, skew
from rotcli.units import FloatArray


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
    w0, w1 = gyro[:, :last], gyro[:, 1 : last + 1]
    f0, f1 = accel[:, :last], accel[:, 1 : last + 1]
    if averages:
        phi = w1 * dt
        # The mean force over a rotation is shorter by (angle)^2 / 24 perpendicular to the axis.
        f_mid = f1 - np.cross(phi, np.cross(phi, f1)) / 24.0
    else:
        # Coning of a rate that is linear in time (Savage, J. Guid. Control Dyn. 21 (1998) 19).
        phi = 0.5 * dt * (w0 + w1) + dt * dt / 12.0 * np.cross(w0, w1)
        f_mid = np.zeros_like(f1)
    phi, f_mid = by_block(phi), by_block(f_mid)
    f0, f1 = by_block(f0), by_block(f1)

    def rotate(C: FloatArray, f: FloatArray) -> FloatArray:
        """Return C f (count, runs, 3) from C (count, runs, 3, 3) and f (3, count, runs)."""
        result: FloatArray = np.einsum("krab,bkr->kra", C, f)
        return result

    q = np.zeros((4, count, runs))
    q[0] = 1.0
    C = matrix_from_quaternion(q)
    dv = np.zeros((count, runs, 3))
    rotation_integral = np.zeros((count, runs, 3, 3))
    dv_gyro_bias_jacobian, rotation_double_integral = (
        np.zeros_like(rotation_integral),
        np.zeros_like(rotation_integral),
    )
    for i in range(samples):
        C_mid = matrix_from_quaternion(multiply(q, quaternion_from_vector(0.5 * phi[i])))
        q = multiply(q, quaternion_from_vector(phi[i]))
        C_end = matrix_from_quaternion(q)
        # A force that is constant in n is constant here, so the trapezoid of C f is exact for it.
        force = rotate(C_mid, f_mid[i]) if averages else rotate(C, f0[i]) + rotate(C_end, f1[i])
        force *= dt if averages else 0.5 * dt
        dv += force
        dv_gyro_bias_jacobian += skew(force) @ (rotation_integral + 0.5 * dt * C_mid)
        rotation_integral += dt * C_mid
        rotation_double_integral += dt * dt * (samples - i - 0.5) * C_mid
        C = C_end
    return PreintegratedBlocks(
        C, dv, rotation_integral, dv_gyro_bias_jacobian, rotation_double_integral
    )
