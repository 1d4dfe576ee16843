"""Rotation and velocity increments of blocks of IMU samples, with their bias derivatives.

Between two filter updates a sensor turns and is accelerated; both are integrated in the frame of
the block's start, for all blocks and runs at once. Sensor biases enter linearly: a bias of
1800 deg/h over 0.1 s leaves a second-order error of 4e-7 rad times the table's turn, far below
the noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.models.rotation import (
    matrix_from_quaternion,
    multiply,
    quaternion_from_vector,
    skew,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Blocks:
    """Increments over n blocks of `runs` logs, seen in the sensor frame at each block's start.

    turn: (n, runs, 3, 3) takes vectors from the block's end to its start.
    velocity: (n, runs, 3) m/s, integral of specific force.
    lever: (n, runs, 3, 3) s, integral of the turn: `-lever @ b_g` is the rotation vector that a
        gyro bias takes away, `-lever @ b_a` the velocity that an accelerometer bias does.
    sway: (n, runs, 3, 3): `+sway @ b_g` is what taking a gyro bias away adds to the velocity.
    remaining: (n, runs, 3, 3) s^2, integral of the turn times the time left in the block.
    """

    turn: Array
    velocity: Array
    lever: Array
    sway: Array
    remaining: Array


def integrate(
    gyro: Array, accel: Array, interval: float, samples: int, averages: bool = False
) -> Blocks:
    """Integrate blocks of `samples` IMU intervals; what is left at the end is dropped.

    gyro (rad/s), accel (m/s^2): (runs, n, 3). averages: sample k is the mean over the interval
    that ends there; otherwise it is the value at its time. Sample 0 is the start of block 0.
    A sensor that turns steadily under a constant force is integrated without error of second
    order in the angle per sample.
    """
    runs, n, _ = gyro.shape
    count = (n - 1) // samples
    dt = interval

    def by_block(a: Array) -> Array:
        """Reorder (runs, count * samples, 3) to (samples, 3, count, runs)."""
        return a.reshape(runs, count, samples, 3).transpose(2, 3, 1, 0)

    last = count * samples
    w0, w1 = gyro[:, :last], gyro[:, 1 : last + 1]
    f0, f1 = accel[:, :last], accel[:, 1 : last + 1]
    if averages:
        phi = w1 * dt
        # The mean force over a turn is shorter across the axis by (turn)^2 / 24.
        f_mid = f1 - np.cross(phi, np.cross(phi, f1)) / 24.0
    else:
        phi = 0.5 * dt * (w0 + w1) + dt * dt / 12.0 * np.cross(w0, w1)  # with coning
        f_mid = np.zeros_like(f1)
    phi, f_mid = by_block(phi), by_block(f_mid)
    f0, f1 = by_block(f0), by_block(f1)

    def turned(C: Array, f: Array) -> Array:
        """C (count, runs, 3, 3) times f (3, count, runs), to (count, runs, 3)."""
        result: Array = np.einsum("krab,bkr->kra", C, f)
        return result

    q = np.zeros((4, count, runs))
    q[0] = 1.0
    C = matrix_from_quaternion(q)
    velocity = np.zeros((count, runs, 3))
    lever = np.zeros((count, runs, 3, 3))
    sway, remaining = np.zeros_like(lever), np.zeros_like(lever)
    for i in range(samples):
        C_mid = matrix_from_quaternion(multiply(q, quaternion_from_vector(0.5 * phi[i])))
        q = multiply(q, quaternion_from_vector(phi[i]))
        C_end = matrix_from_quaternion(q)
        # A force constant in n is constant here, so the trapezoid of C f is exact for it.
        force = turned(C_mid, f_mid[i]) if averages else turned(C, f0[i]) + turned(C_end, f1[i])
        force *= dt if averages else 0.5 * dt
        velocity += force
        sway += skew(force) @ (lever + 0.5 * dt * C_mid)
        lever += dt * C_mid
        remaining += dt * dt * (samples - i - 0.5) * C_mid
        C = C_end
    return Blocks(C, velocity, lever, sway, remaining)
