"""Exact sensor readings of a turning table, for the tests of the filter."""

import numpy as np

from rotcli.models.earth import earth_rate_n
from rotcli.models.rotation import UNIT_VECTORS, attitude_matrix, axis_rotation
from rotcli.observe.zupt.model import InitialSigma, Noise, Settings
from rotcli.units import DEG, DEG_PER_HOUR

LATITUDE, GRAVITY, DT = 51.0 * DEG, 9.81, 0.01
TURN_ON = (np.array([-0.010, 0.007, 0.008]), np.array([750.0, -1800.0, 1150.0]) * DEG_PER_HOUR)

# The reference cases: rotation axis, pitch, roll (deg).
CASES = {
    "still": (None, 0, 0),
    "y0": ("y", 0, 0),
    "y30": ("y", 30, 0),
    "z0": ("z", 0, 0),
    "z30": ("z", 30, 0),
    "x0": ("x", 0, 0),
    "x30": ("x", 0, 30),
}


def settings(case, **more):
    axis, pitch, roll = CASES[case]
    C_nb = attitude_matrix(pitch * DEG, roll * DEG, 0.0)
    return Settings(LATITUDE, GRAVITY, C_nb, np.array(UNIT_VECTORS[axis or "z"]), **more)


def steady(case, seconds=600.0, rate=10.0 * DEG):
    """Table angle (n,) and rate (n,)."""
    t = DT * np.arange(round(seconds / DT) + 1)
    rate = rate if CASES[case][0] else 0.0
    return rate * t, np.full(len(t), rate)


def staircase(*segments, ramp=2.0):
    """Table angle, rate and its derivative of (rate in deg/s, seconds) with ramps between."""
    rate = [segments[0][0]]
    for value, seconds in segments:
        steps = round(ramp / DT) if value != rate[-1] else 0
        rate += list(rate[-1] + (value - rate[-1]) * np.arange(1, steps + 1) / max(steps, 1))
        rate += [value] * round(seconds / DT)
    rate = np.array(rate) * DEG
    angle = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * DT))
    return angle, rate, np.gradient(rate, DT)


def perfect(C_nb, axis, theta, rate, lever_arm=(0.0, 0.0, 0.0), acceleration=0.0):
    """Gyro and accelerometer (n, 3): w = C_sb C_bn w_ie_n + theta' u, f = C_sb C_bn (0, 0, g)."""
    C_ns = C_nb @ axis_rotation(axis, theta)
    gyro = np.einsum("kji,j->ki", C_ns, earth_rate_n(LATITUDE)) + rate[:, None] * axis
    r = np.array(lever_arm)
    whirl = np.cross(axis, np.cross(axis, r))
    swing = np.broadcast_to(acceleration, rate.shape)[:, None] * np.cross(axis, r)
    return gyro, GRAVITY * C_ns[:, 2, :] + rate[:, None] ** 2 * whirl + swing


def slow_noise(rng, sigma, tau, shape):
    """Stationary first-order Gauss-Markov processes along the last axis but one."""
    from scipy.signal import lfilter

    step = np.exp(-DT / tau)
    drive = rng.normal(size=shape) * sigma * np.sqrt(1.0 - step**2)
    drive[..., 0, :] = rng.normal(size=drive[..., 0, :].shape) * sigma
    return lfilter([1.0], [1.0, -step], drive, axis=-2)


def sensors(rng, perfect_log, noise=Noise(), turn_on=TURN_ON):  # noqa: B008
    """Add noise and biases: gyro, accel and the true biases over time, all (n, 3)."""
    gyro, accel = perfect_log
    b_a = turn_on[0] + slow_noise(
        rng, noise.accel_markov_sigma, noise.accel_correlation_time, accel.shape
    )
    b_g = turn_on[1] + slow_noise(
        rng, noise.gyro_markov_sigma, noise.gyro_correlation_time, gyro.shape
    )
    gyro = gyro + b_g + noise.angle_random_walk / np.sqrt(DT) * rng.normal(size=gyro.shape)
    accel = accel + b_a + noise.velocity_random_walk / np.sqrt(DT) * rng.normal(size=accel.shape)
    return gyro, accel, b_a, b_g


def drawn(rng, runs, initial=InitialSigma()):  # noqa: B008
    """Turn-on biases and attitude errors of `runs` runs, with exactly the prior's covariance.

    Whitened draws: the sample covariance is that of P0, so that 40 runs say what 400 random
    ones would. Returns (runs, 9): accelerometer, gyro biases, attitude errors E, N, U.
    """
    x = rng.normal(size=(runs, 9))
    x -= x.mean(axis=0)
    x = x @ np.linalg.inv(np.linalg.cholesky(x.T @ x / runs)).T
    scale = np.repeat([initial.accel, initial.gyro, initial.tilt], 3)
    scale[8] = initial.azimuth
    return x * scale
