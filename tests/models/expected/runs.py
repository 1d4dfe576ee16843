"""R16's runs with the installed profiles, for the tests of the expected errors; no tests here."""

import numpy as np

from rotcli.models import earth, rotation, strapdown
from rotcli.models.expected.motion import Blocks, StillTable, cut_window
from rotcli.models.expected.sources import (
    AccelSource,
    AxisSource,
    Contrast,
    GyroSource,
    least_squares_contrast,
    still_contrast,
)
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.slow_noise import simulate_slow_noise
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, PPM

LATITUDE, HEIGHT = 51.08 * DEG, 1100.0
GRAVITY = float(earth.normal_gravity(LATITUDE, HEIGHT))
PROFILES = {
    "NAV440": {
        "white": 0.4 * DEG_PER_ROOT_HOUR,
        "slow": SlowNoise(15.66 * DEG_PER_HOUR, 0.35 * DEG_PER_HOUR),
        "accel_white": 0.0008,
        "accel_slow": SlowNoise(4.5e-4),
        "column": np.array([-1100.0, 800.0, 1200.0]) * PPM,
        "accel_bias": np.array([0.022, -0.026, 0.050]),
    },
    "MTi-G": {
        "white": 3.0 * DEG_PER_ROOT_HOUR,
        "slow": SlowNoise(8.28 * DEG_PER_HOUR, 2.6 * DEG_PER_HOUR),
        "accel_white": 0.002,
        "accel_slow": SlowNoise(1.2e-3),
        "column": np.array([-3800.0, 3600.0, 3000.0]) * PPM,
        "accel_bias": np.array([-0.010, 0.007, 0.008]),
    },
}
STILL, TURNING = (0.0, 60.0), (61.0, 121.0)


def window(mode: str) -> tuple[float, float]:
    """Return the navigation window of a mode, s."""
    return (60.0, 360.0) if mode == "conventional" else (121.0, 421.0)


def still_table(axis: str = "z", attitude: tuple[float, float, float] = (0, 0, 0)) -> StillTable:
    """Return the laboratory of the papers; attitude in deg."""
    pitch, roll, azimuth = (a * DEG for a in attitude)
    u = np.array(rotation.UNIT_VECTORS[axis])
    return StillTable(LATITUDE, HEIGHT, GRAVITY, pitch, roll, azimuth, u)


def contrast(mode: str, w: float) -> Contrast:
    """Return how R16's run corrects the gyros in a mode."""
    if mode != "full":
        return still_contrast(*STILL)
    ends = np.array([STILL, TURNING]).T
    return least_squares_contrast(*ends, np.array([0.0, w]))


def run(
    profile: str, mode: str, rate_dps: float, axis: str = "z", duration: float = 300.0
) -> tuple[StillTable, Blocks, GyroSource, AccelSource]:
    """Return the arguments of `expected_errors` for one of R16's runs."""
    p = PROFILES[profile]
    w = 0.0 if mode == "conventional" else rate_dps * DEG
    start = window(mode)[0]
    end = start + duration
    left_in = p["column"] if mode == "partial" else np.zeros(3)
    gyro = GyroSource((AxisSource(p["white"], p["slow"], contrast(mode, w)),), left_in)
    measured = AxisSource(p["accel_white"], p["accel_slow"], still_contrast(*STILL))
    accel = AccelSource((measured,), p["accel_bias"])
    blocks = cut_window(start, end, lambda t: w * (t - start), abs(w))
    return still_table(axis), blocks, gyro, accel


def simulate_noise(profile: str, seed: int, interval: float, length: float) -> np.ndarray:
    """Return noise (6, n) of gyros and accelerometers that have been running for 14 lengths."""
    p = PROFILES[profile]
    n = round(length / interval)
    rng = np.random.default_rng([seed, 21])
    noise = np.empty((6, n))
    for i in range(6):
        white, slow = ("white", "slow") if i < 3 else ("accel_white", "accel_slow")
        noise[i] = simulate_slow_noise(rng, n, interval, p[slow], history=14 * n)
        noise[i] += p[white] / np.sqrt(interval) * rng.standard_normal(n)
    return noise


def navigate_noise(
    profile: str,
    mode: str,
    rate_dps: float,
    noise: np.ndarray,
    interval: float,
    *,
    axis: str = "z",
    rig_error: np.ndarray | None = None,
    duration: float = 300.0,
) -> np.ndarray:
    """Return the errors (n, 9) of a navigation by the nonlinear mechanization; m, m/s, rad.

    rig_error: (3,) rad, rig's attitude minus the true one.
    """
    p, table = PROFILES[profile], still_table(axis)
    u = table.axis
    w = 0.0 if mode == "conventional" else rate_dps * DEG
    time = interval * np.arange(noise.shape[1])
    start = window(mode)[0]
    end = start + duration

    def inside(a: float, b: float) -> slice:
        return slice(round(a / interval), round(b / interval))

    gyro, accel = noise[:3].T, noise[3:].T
    z = [gyro[inside(*s)].mean(axis=0) for s in (STILL, TURNING)]
    bias = z[0]
    column = p["column"] if mode != "full" else -(z[1] - z[0]) / w  # true less estimated
    span = inside(start, end)
    theta = w * (time[span] - start)
    C_nb = table.C_nb
    w_ie_b = C_nb.T @ earth.earth_rate_n(LATITUDE)
    g_b = C_nb.T @ np.array([0.0, 0.0, GRAVITY])
    rates = rotation.rotate_about(u, -theta, np.broadcast_to(w_ie_b, (len(theta), 3)))
    forces = rotation.rotate_about(u, -theta, np.broadcast_to(g_b, (len(theta), 3)))
    C_rig = C_nb
    if rig_error is not None:
        C_rig = rotation.attitude_matrix(
            *(np.array([table.pitch, table.roll, table.azimuth]) + rig_error)
        )
    begin = strapdown.InitialState(LATITUDE, 0.0, HEIGHT, np.zeros(3), C_rig)
    way = strapdown.mechanize_log(
        rates + w * (u + column) + gyro[span] - bias,
        forces + p["accel_bias"] + accel[span],
        interval,
        begin,
    )
    return _errors(way, theta, u, C_rig)


def _errors(way, theta: np.ndarray, u: np.ndarray, C_rig: np.ndarray) -> np.ndarray:
    """Return the errors (n, 9) of a trajectory of a table that stays in its place."""
    C_ns = rotation.matrix_from_quaternion(way.q_ns)
    body = C_ns @ np.swapaxes(rotation.axis_rotation(u, theta), 1, 2)
    angles = np.column_stack(rotation.euler_angles(body))
    reference = np.array(rotation.euler_angles(C_rig))
    R_M, R_N = earth.radii(LATITUDE)
    return np.column_stack(
        [
            (way.latitude - LATITUDE) * (R_M + HEIGHT),
            way.longitude * (R_N + HEIGHT) * np.cos(LATITUDE),
            way.height - HEIGHT,
            way.v_n[:, [1, 0, 2]],
            np.unwrap(angles - reference, axis=0),
        ]
    )
