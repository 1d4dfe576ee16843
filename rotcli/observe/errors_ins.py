"""Linear error dynamics of an inertial navigation system that rotates in place.

Errors are computed minus true, seen in n: `C_hat = (I + [eps x]) C`, measured = true + bias.
The 12 states are `[dv, eps, gamma, d]` with gamma = C_ns b_a and d = C_ns b_g, the sensor biases
seen in n. Source: O17, "Improving Observability of an Inertial System by Rotary Motions of
an IMU", Sensors 2017, 17, 698, equations (29) to (31), with right-handed rotations.

Two models: `simplified` drops Earth rate from the attitude errors, as the paper does; `full`
keeps it.
"""

from typing import Literal

import numpy as np

from rotcli.models.earth import earth_rate_n
from rotcli.models.rotation import skew
from rotcli.models.states import StateLayout
from rotcli.units import FloatArray

ErrorModel = Literal["simplified", "full"]

# Names of the states with the sensor biases in n, and in s.
LAYOUT = StateLayout(
    VELOCITY_ERROR=("dv_E", "dv_N", "dv_U"),
    ATTITUDE_ERROR=("eps_E", "eps_N", "eps_U"),
    ACCEL_BIAS=("gamma_E", "gamma_N", "gamma_U"),
    GYRO_BIAS=("d_E", "d_N", "d_U"),
)
VELOCITY_ERROR, ATTITUDE_ERROR = LAYOUT.VELOCITY_ERROR, LAYOUT.ATTITUDE_ERROR
ACCEL_BIAS, GYRO_BIAS = LAYOUT.ACCEL_BIAS, LAYOUT.GYRO_BIAS
STATES_IN_N = LAYOUT.names
STATES_IN_S = (
    *STATES_IN_N[: ACCEL_BIAS.start],
    *(f"{sensor}_bias_{axis}" for sensor in ("accel", "gyro") for axis in "xyz"),
)


def coriolis(latitude: float) -> FloatArray:
    """Return Omega_v (3, 3), rad/s: dv' = Omega_v dv, the Coriolis term of a still table."""
    return -2.0 * skew(earth_rate_n(latitude))


def force_coupling(f_n: FloatArray) -> FloatArray:
    """Return F_n (3, 3), m/s^2: dv' = F_n eps, for a specific force f_n (3,) in n.

    >>> force_coupling(np.array([0.0, 0.0, 9.8])) + 0.0  # level rest
    array([[ 0. ,  9.8,  0. ],
           [-9.8,  0. ,  0. ],
           [ 0. ,  0. ,  0. ]])
    """
    return -skew(f_n)


def zupt_error_dynamics(
    latitude: float, f_n: FloatArray, w_ns_n: FloatArray, model: ErrorModel = "simplified"
) -> FloatArray:
    """Return F (12, 12) of the states `STATES_IN_N`: x' = F x, SI units.

    f_n: (3,) m/s^2, specific force in n; (0, 0, g) at rest.
    w_ns_n: (3,) rad/s, rate of the table against n, seen in n: rate * C_nb u; zero when still.
    Source: O17 (29) to (31).
    """
    F = np.zeros((len(LAYOUT), len(LAYOUT)))
    F[VELOCITY_ERROR, VELOCITY_ERROR] = coriolis(latitude)
    F[VELOCITY_ERROR, ATTITUDE_ERROR] = force_coupling(f_n)
    F[VELOCITY_ERROR, ACCEL_BIAS] = np.eye(3)
    if model == "full":
        F[ATTITUDE_ERROR, ATTITUDE_ERROR] = -skew(earth_rate_n(latitude))
    F[ATTITUDE_ERROR, GYRO_BIAS] = np.eye(3)
    F[ACCEL_BIAS, ACCEL_BIAS] = F[GYRO_BIAS, GYRO_BIAS] = skew(w_ns_n)
    return F


def velocity_measurement(states: int = 12) -> FloatArray:
    """Return H (3, states) of a velocity measurement: the first three states."""
    return np.eye(3, states)


def euler_errors(
    eps: FloatArray, pitch: float, azimuth: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the errors of pitch, roll, azimuth (rad) of small attitude errors eps (..., 3).

    Level and looking north: dp = eE, dr = eN, dA = -eU. Source: O17 (24), pitch sign corrected.
    """
    eE, eN, eU = eps[..., 0], eps[..., 1], eps[..., 2]
    tilt = eE * np.sin(azimuth) + eN * np.cos(azimuth)
    d_pitch: FloatArray = eE * np.cos(azimuth) - eN * np.sin(azimuth)
    d_roll: FloatArray = tilt / np.cos(pitch)
    d_azimuth: FloatArray = -eU + np.tan(pitch) * tilt
    return d_pitch, d_roll, d_azimuth
