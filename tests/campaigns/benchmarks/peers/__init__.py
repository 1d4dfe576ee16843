"""Mechanizations next to rotcli's: each takes a problem as it expects it and returns a position.

A mechanization is a function that makes everything ready and returns the one call that is timed,
which returns latitude, longitude (rad) and height (m). Each ends at the result of its users:
position, velocity and attitude (pyins and inu: angles or matrices).

- pyins: North-East-Down, rates (trapezoids) or increments with the one before the start, in data
  frames; degrees. "pyins, core" is its compiled loop alone, on increments that are ready.
- inu: North-East-Down; a sample is the mean over the interval that *follows* it, so it gets the
  exact means whatever the sampling.
"""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.models import rotation, strapdown
from rotcli.models.turntable import Schedule, ScheduleStep, Turntable
from rotcli.units import DEG

Array = NDArray[np.float64]
Position = tuple[Array, Array, Array]

INTERVAL = 0.01
# On the ellipsoid all normal gravity formulas agree; above it pyins leaves out a part.
LATITUDE, LONGITUDE, HEIGHT = 51.08 * DEG, -114.13 * DEG, 0.0
ENU_TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
MOTIONS = {
    "100 deg/s about z": ("z", ScheduleStep(1e5, rate=100 * DEG)),
    "sweep of +-100 deg/s about z": ("z", ScheduleStep(1e5, sweep=100 * DEG)),
    "100 deg/s about x, horizontal": ("x", ScheduleStep(1e5, rate=100 * DEG)),
    "10 deg/s about z": ("z", ScheduleStep(1e5, rate=10 * DEG)),
}


@dataclass(frozen=True, eq=False)
class Problem:
    """Error-free readings (n, 3), rad/s and m/s^2, on a still table.

    averages: each is the mean over the interval that ends at its time; else the value there.
    following: the means over the intervals that begin there.
    """

    time: Array
    w_is_s: Array
    f_s: Array
    averages: bool
    following: tuple[Array, Array]


def problem(motion: str, samples: int, *, averages: bool) -> Problem:
    """Return the exact readings of a level table, facing north, at the instants 0, 0.01 s, ..."""
    axis, piece = MOTIONS[motion]
    unit = np.array(rotation.UNIT_VECTORS[axis])
    table = Turntable(LATITUDE, HEIGHT, np.eye(3), unit, Schedule((piece,)))
    time = INTERVAL * np.arange(samples, dtype=float)
    w, f = table.average(time, INTERVAL) if averages else table.sense(time)
    following = table.average(time + INTERVAL, INTERVAL) if averages else (w, f)
    return Problem(time, w, f, averages, following)


def with_errors(exact: Problem) -> Problem:
    """Return readings with white noise and biases of a MEMS IMU, the same for every program."""
    rng = np.random.default_rng(1)
    shape = exact.w_is_s.shape
    w = exact.w_is_s + [1e-5, -2e-5, 3e-5] + 1e-3 * rng.standard_normal(shape)
    f = exact.f_s + [0.01, -0.02, 0.005] + 0.02 * rng.standard_normal(shape)
    return Problem(exact.time, w, f, exact.averages, (w, f))


def distance(position: Position) -> float:
    """Return the largest distance (m) from the table, which does not move."""
    latitude, longitude, height = position
    radius = 6.39e6  # to a few per mille, as an error needs it
    north = (latitude - LATITUDE) * radius
    east = (longitude - LONGITUDE) * radius * np.cos(LATITUDE)
    return float(np.sqrt(north**2 + east**2 + (height - HEIGHT) ** 2).max())


def rotcli(given: Problem, *, hold_height: bool = False) -> Callable[[], Position]:
    """Run the kernel."""
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, np.zeros(3), np.eye(3))

    def run() -> Position:
        path = strapdown.mechanize_log(
            given.w_is_s,
            given.f_s,
            INTERVAL,
            start,
            averages=given.averages,
            hold_height=hold_height,
        )
        return path.latitude, path.longitude, path.height

    return run


def _pyins_parts(given: Problem) -> tuple[Any, Any, str]:
    """Return pyins's data frame of readings, its start and its word for the sampling."""
    import pandas as pd
    from pyins import transform
    from pyins.util import ACCEL_COLS, GYRO_COLS, TRAJECTORY_COLS

    scale = INTERVAL if given.averages else 1.0
    values = np.hstack([given.w_is_s, given.f_s]) * scale
    imu = pd.DataFrame(values, index=given.time, columns=[*GYRO_COLS, *ACCEL_COLS])
    angles = transform.mat_to_rph(ENU_TO_NED)
    start = [LATITUDE / DEG, LONGITUDE / DEG, HEIGHT, 0.0, 0.0, 0.0, *angles]
    pva = pd.Series(start, index=TRAJECTORY_COLS, name=given.time[0])
    return imu, pva, "increment" if given.averages else "rate"


def pyins(given: Problem) -> Callable[[], Position]:
    """Make increments from readings, then integrate, by the public interface."""
    from pyins import strapdown as peer

    imu, pva, kind = _pyins_parts(given)

    def run() -> Position:
        increments = peer.compute_increments_from_imu(imu, kind)
        integrator = peer.Integrator(pva)
        integrator.integrate(increments)
        way = integrator.trajectory
        return way.lat.values * DEG, way.lon.values * DEG, way.alt.values

    return run


def pyins_core(given: Problem) -> Callable[[], Position]:
    """Run the compiled loop alone."""
    from pyins import strapdown as peer
    from pyins._numba_integrate import integrate

    imu, _, kind = _pyins_parts(given)
    increments = peer.compute_increments_from_imu(imu, kind)
    dt = np.asarray(increments.dt)
    theta = np.ascontiguousarray(increments[["theta_x", "theta_y", "theta_z"]])
    dv = np.ascontiguousarray(increments[["dv_x", "dv_y", "dv_z"]])
    count = len(dt) + 1
    lla, velocity, mat_nb = np.empty((count, 3)), np.zeros((count, 3)), np.empty((count, 3, 3))
    lla[0], mat_nb[0] = (LATITUDE / DEG, LONGITUDE / DEG, HEIGHT), ENU_TO_NED

    def run() -> Position:
        integrate(dt, lla, velocity, mat_nb, theta, dv, 0, True)
        return lla[:, 0] * DEG, lla[:, 1] * DEG, lla[:, 2]

    return run


def inu(given: Problem) -> Callable[[], Position]:
    """Run the mechanization loop."""
    import inu as peer
    import r3f

    w, f = (np.ascontiguousarray(values.T) for values in given.following)
    llh, angles = np.array([LATITUDE, LONGITUDE, HEIGHT]), r3f.dcm_to_rpy(ENU_TO_NED)

    def run() -> Position:
        way, _, _ = peer.mech(f, w, llh, np.zeros(3), angles, INTERVAL, show_progress=False)
        return way[0], way[1], way[2]

    return run


MECHANIZATIONS = {"rotcli": rotcli, "pyins": pyins, "pyins, core": pyins_core, "inu": inu}


def missing(name: str) -> bool:
    """Return whether a peer is not installed."""
    return name != "rotcli" and importlib.util.find_spec(name.partition(",")[0]) is None
