"""Linear error dynamics of an inertial navigation system on a turntable.

Errors are computed minus true, in n: `C_hat = (I + [eps x]) C`, measured = true + bias.
The 12 states are `[dv, eps, gamma, d]` with gamma = C_ns b_a and d = C_ns b_g, the sensor biases
in n. Source: "Observability of a rotating MEMS INS", Sensors 2017, 17, 698, equations (29)
to (31), with right-handed rotations.

Two models: `simplified` drops Earth rate from the attitude errors, as the paper does; `full`
keeps it.
"""

from typing import Literal

import numpy as np

from rotcli.models.earth import earth_rate_n
from rotcli.models.rotation import skew
from rotcli.units import FloatArray

ErrorModel = Literal["simplified", "full"]

_INERTIAL = ("dv_E", "dv_N", "dv_U", "eps_E", "eps_N", "eps_U")
N_STATES = (*_INERTIAL, "gamma_E", "gamma_N", "gamma_U", "d_E", "d_N", "d_U")
S_STATES = (*_INERTIAL, *(f"accel_bias_{a}" for a in "xyz"), *(f"gyro_bias_{a}" for a in "xyz"))

VELOCITY, ATTITUDE, ACCEL, GYRO = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)


def coriolis(latitude: float) -> FloatArray:
    """Return Omega_v (3, 3), rad/s: dv' = Omega_v dv, the Coriolis term of a still table."""
    return -2.0 * skew(earth_rate_n(latitude))


def force_coupling(f_n: FloatArray) -> FloatArray:
    """Return F_n (3, 3), m/s^2: dv' = F_n eps, for a specific force f_n (3,) in n.

    >>> force_coupling(np.array([0.0, 0.0, 9.8])) + 0.0  # at rest
    array([[ 0. ,  9.8,  0. ],
           [-9.8,  0. ,  0. ],
           [ 0. ,  0. ,  0. ]])
    """
    return -skew(f_n)


def zupt_error_dynamics(
    latitude: float, f_n: FloatArray, w_ns_n: FloatArray, model: ErrorModel = "simplified"
) -> FloatArray:
    """Return F (12, 12) of the states `N_STATES`: x' = F x, SI units.

    f_n: (3,) m/s^2, specific force in n; (0, 0, g) at rest.
    w_ns_n: (3,) rad/s, rate of the table against n, in n: rate * C_nb u; zero when still.
    Source: O17 (29) to (31).
    """
    F = np.zeros((12, 12))
    F[VELOCITY, VELOCITY] = coriolis(latitude)
    F[VELOCITY, ATTITUDE] = force_coupling(f_n)
    F[VELOCITY, ACCEL] = np.eye(3)
    if model == "full":
        F[ATTITUDE, ATTITUDE] = -skew(earth_rate_n(latitude))
    F[ATTITUDE, GYRO] = np.eye(3)
    F[ACCEL, ACCEL] = F[GYRO, GYRO] = skew(w_ns_n)
    return F


def velocity_measurement(states: int = 12) -> FloatArray:
    """Return H (3, states) of a velocity measurement: the first three states."""
    return np.eye(3, states)


def euler_errors(
    eps: FloatArray, pitch: float, azimuth: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the errors of pitch, roll, azimuth (rad) from small attitude errors eps (..., 3).

    Level and facing north: dp = eE, dr = eN, dA = -eU. Source: O17 (24), pitch sign corrected.
    """
    eE, eN, eU = eps[..., 0], eps[..., 1], eps[..., 2]
    horizontal = eE * np.sin(azimuth) + eN * np.cos(azimuth)
    d_pitch: FloatArray = eE * np.cos(azimuth) - eN * np.sin(azimuth)
    d_roll: FloatArray = horizontal / np.cos(pitch)
    d_azimuth: FloatArray = -eU + np.tan(pitch) * horizontal
    return d_pitch, d_roll, d_azimuth
