"""Undo the errors of both triads in readings: the inverse of the sensor model.

f from the accelerometers first, because g-sensitivity needs it:
    f = (I + M)^-1 u,  u + K2 u^2 + Aa |u| = accel - b
    w = (I + N)^-1 v,  v + Ag |v| = gyro - d - G f
The size effect (levers of the accelerometers) is not undone: it needs the derivative of the rate.
"""

import numpy as np

from rotcli.models.triad import parameters as p
from rotcli.units import FloatArray

EQUATION = (
    "f = (I + M)^-1 u with u + K2 u^2 + Aa |u| = accel - b; "
    "w = (I + N)^-1 v with v + Ag |v| = gyro - d - G f"
)
_PASSES = 3  # fixed-point passes: K2 u is 1e-3 at most, so three leave 1e-9 of u


def _axis_output(reading: FloatArray, second: FloatArray, asymmetry: FloatArray) -> FloatArray:
    """Return y (n, 3) of y + second y^2 + asymmetry |y| = reading."""
    y = reading
    if np.any(second) or np.any(asymmetry):
        for _ in range(_PASSES):
            y = reading - second * y**2 - asymmetry * np.abs(y)
    return y


def correct_accel(x: FloatArray, accel: FloatArray) -> FloatArray:
    """Return specific force (n, 3), m/s^2, of readings (n, 3)."""
    u = _axis_output(accel - x[p.ACCEL_BIAS], x[p.K2], x[p.ACCEL_ASYMMETRY])
    return np.asarray(u @ np.linalg.inv(np.eye(3) + x[p.M].reshape(3, 3)).T)


def correct_gyro(x: FloatArray, gyro: FloatArray, force: FloatArray) -> FloatArray:
    """Return rates (n, 3), rad/s, of readings (n, 3); force (n, 3) corrected, m/s^2."""
    reading = gyro - x[p.GYRO_BIAS] - force @ x[p.G].reshape(3, 3).T
    v = _axis_output(reading, np.zeros(3), x[p.GYRO_ASYMMETRY])
    return np.asarray(v @ np.linalg.inv(np.eye(3) + x[p.N].reshape(3, 3)).T)


def correct_readings(
    x: FloatArray, gyro: FloatArray, accel: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rates and specific forces (n, 3) of readings (n, 3)."""
    force = correct_accel(x, accel)
    return correct_gyro(x, gyro, force), force
