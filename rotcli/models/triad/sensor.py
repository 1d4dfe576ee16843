"""Readings of both triads on a table, from the parameters (forward model).

gyro = v + d + G fbar + Ag o |v| with v = (I + N) w; accelerometer i: u_i = row_i(I + M) f_i,
reading u + b + K2 o u o u + Aa o |u|. Nonlinear terms act on the output of an axis: only so they
do not depend on the choice of the sensor frame (IEEE Std 1293 words them so, too).
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.models.triad import parameters as p
from rotcli.models.triad.kinematics import Motion, Pose, Table, at_clock, motion
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]


def gyro_readings(x: FloatArray, moved: Motion) -> FloatArray:
    """Return gyro readings (3, n), rad/s."""
    v = (np.eye(3) + x[p.N].reshape(3, 3)) @ (moved.earth_rate + moved.table_rate)
    centre = x[p.LEVERS].reshape(3, 3).mean(axis=0)
    sensed = x[p.G].reshape(3, 3) @ (moved.force + moved.lever_force(centre))
    result: FloatArray = v + x[p.GYRO_BIAS][:, None] + sensed
    return result + x[p.GYRO_ASYMMETRY][:, None] * np.abs(v)


def axis_force(x: FloatArray, moved: Motion) -> FloatArray:
    """Return u (3, n): the force along each accelerometer's input axis, at its lever."""
    rows = np.eye(3) + x[p.M].reshape(3, 3)
    u = rows @ moved.force
    for i, lever in enumerate(x[p.LEVERS].reshape(3, 3)):
        if np.any(lever):
            u[i] += rows[i] @ moved.lever_force(lever)
    return u


def accel_readings(x: FloatArray, moved: Motion) -> FloatArray:
    """Return accelerometer readings (3, n), m/s^2."""
    u = axis_force(x, moved)
    result: FloatArray = u + x[p.ACCEL_BIAS][:, None] + x[p.K2][:, None] * u**2
    return result + x[p.ACCEL_ASYMMETRY][:, None] * np.abs(u)


def readings(
    table: Table,
    x: FloatArray,
    angles: FloatArray,
    rates: FloatArray,
    accelerations: FloatArray,
    mounting: IntArray | None = None,
) -> FloatArray:
    """Return the six readings (6, n), gyros first, at instants of constant table acceleration.

    angles, rates, accelerations: (K, n) of the table log, rad, rad/s, rad/s^2; the clock offsets
    of gyros and accelerometers are applied here.
    """
    at = np.zeros(angles.shape[1], dtype=np.int64) if mounting is None else mounting
    taus = (float(x[p.CLOCK_GYRO]), float(x[p.CLOCK_ACCEL]))
    moved: list[Motion] = []
    for tau in taus if taus[0] != taus[1] else taus[:1]:
        earlier, rate = at_clock(angles, rates, accelerations, tau)
        moved.append(motion(Pose(table, x, earlier, at), x, rate, accelerations))
    return np.concatenate([gyro_readings(x, moved[0]), accel_readings(x, moved[-1])])
