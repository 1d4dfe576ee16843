"""Simulate the logs of a single-axis rotation INS on a slowly moving, level vehicle.

The truth is in closed form except for the latitude, an integral. IMU samples are the exact means
over the sample interval for a constant turning rate in it, made chunk by chunk, so that the longest
log needs little memory. The same scenario gives the same logs.
"""

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import ReferenceLog, TableLog
from rotcli.models import earth, sensors
from rotcli.rig.profile import Triad
from rotcli.srins.level_ins import level_rates
from rotcli.srins.reciprocation import RotationScheme
from rotcli.srins.voyage.scenario import SrinsScenario
from rotcli.units import FloatArray

CHUNK = 3600.0  # s of IMU samples made at once
TABLE_INTERVAL = 0.5  # s; the angle is piecewise straight, half a second finds its corners
_GRID = 1.0  # s, of the integration of latitude


def reciprocation(scenario: SrinsScenario) -> RotationScheme:
    """Return the rotation scheme of the scenario."""
    return RotationScheme(scenario.rotation_rate, scenario.dwell, scenario.rotation_kind)


@dataclass(frozen=True, eq=False)
class ImuChunk:
    """Consecutive means over the sample interval: time (n,) s at its end; gyro, accel (n, 3)."""

    time: FloatArray
    gyro: FloatArray
    accel: FloatArray


@dataclass(frozen=True, eq=False)
class Voyage:
    """The true motion of a scenario."""

    scenario: SrinsScenario

    def velocity(self, time: FloatArray, *, doppler: bool = False) -> FloatArray:
        """Return the velocity east, north (2, n), m/s; doppler: that of a noiseless Doppler log."""
        scenario = self.scenario
        v = np.array([scenario.v_east, scenario.v_north])[:, None] + np.zeros_like(time)
        for m in scenario.maneuvers:
            gained = np.clip(time - m.start, 0.0, m.duration)
            if doppler and m.doppler == "held":
                gained = 0.0 * gained
            elif doppler and m.doppler == "frozen":
                gained = np.where(time < m.start + m.duration, 0.0, m.duration)
            v += np.array([m.a_east, m.a_north])[:, None] * gained
        return v

    def distance(self, time: FloatArray) -> FloatArray:
        """Return the distance east, north (2, n), m: the integral of the velocity."""
        scenario = self.scenario
        distance = np.array([scenario.v_east, scenario.v_north])[:, None] * time
        for m in scenario.maneuvers:
            during = np.clip(time - m.start, 0.0, m.duration)
            after = np.maximum(time - m.start - m.duration, 0.0)
            gained = 0.5 * during**2 + m.duration * after
            distance += np.array([m.a_east, m.a_north])[:, None] * gained
        return distance

    @cached_property
    def _grid(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times (s), latitude and longitude (rad) on an even grid over the complete voyage."""
        scenario = self.scenario
        time: FloatArray = _GRID * np.arange(
            int(np.ceil(scenario.duration / _GRID)) + 2, dtype=float
        )
        east, north = np.diff(self.distance(time), axis=1)
        latitude = np.full(len(time), scenario.latitude)
        for _ in range(4):  # the radius hardly changes: each sweep gains three digits
            R_M, _ = earth.radii(0.5 * (latitude[1:] + latitude[:-1]))
            latitude = scenario.latitude + np.concatenate([[0.0], np.cumsum(north / R_M)])
        middle = 0.5 * (latitude[1:] + latitude[:-1])
        _, R_N = earth.radii(middle)
        steps = east / (R_N * np.cos(middle))
        longitude = scenario.longitude + np.concatenate([[0.0], np.cumsum(steps)])
        return time, latitude, longitude

    def position(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return latitude and longitude (n,), rad."""
        grid, latitude, longitude = self._grid
        return np.interp(time, grid, latitude), np.interp(time, grid, longitude)

    def theta(self, time: FloatArray) -> FloatArray:
        """Return the IMU's angle about up against east, north (n,), rad."""
        return reciprocation(self.scenario).angle(time) - self.scenario.azimuth

    def sense(self, start: float, end: float) -> ImuChunk:
        """Return the exact means of ideal sensors in the samples within [start, end] (s)."""
        scenario = self.scenario
        first, last = (round(t * scenario.rate) for t in (start, end))
        edges = np.arange(first, last + 1) / scenario.rate
        theta = self.theta(edges)
        turn, middle = np.diff(theta), 0.5 * (theta[1:] + theta[:-1])
        t = 0.5 * (edges[1:] + edges[:-1])
        v = self.velocity(t)
        latitude, _ = self.position(t)
        w, coriolis, _ = level_rates((v[0], v[1]), (v[0], v[1]), latitude)
        gain = np.diff(self.velocity(edges), axis=1) * scenario.rate
        R_M, R_N = earth.radii(latitude)
        up = (
            earth.normal_gravity(latitude, 0.0)
            - (2.0 * earth.EARTH_RATE * np.cos(latitude) + v[0] / R_N) * v[0]
            - v[1] ** 2 / R_M
        )
        shrink = np.sinc(0.5 * turn / np.pi)
        c, s = shrink * np.cos(middle), shrink * np.sin(middle)

        def sensed(east: FloatArray, north: FloatArray, vertical: FloatArray) -> FloatArray:
            return np.stack([c * east + s * north, c * north - s * east, vertical], axis=1)

        return ImuChunk(
            time=edges[1:],
            gyro=sensed(w[0], w[1], w[2] + turn * scenario.rate),
            accel=sensed(gain[0] - coriolis * v[1], gain[1] + coriolis * v[0], up),
        )


def imu_chunks(scenario: SrinsScenario) -> Iterator[ImuChunk]:
    """Yield the IMU log an hour at a time; a sample is the mean over the interval it ends."""
    voyage = Voyage(scenario)
    edges = np.append(np.arange(0.0, scenario.duration, CHUNK), scenario.duration)
    for k, (start, end) in enumerate(pairwise(edges)):
        ideal = voyage.sense(float(start), float(end))
        rng = np.random.default_rng([scenario.seed, 1, k])
        yield ImuChunk(
            ideal.time,
            _read(rng, ideal.gyro, scenario.gyro, scenario.rate),
            _read(rng, ideal.accel, scenario.accel, scenario.rate),
        )


def _read(rng: np.random.Generator, true: FloatArray, triad: Triad, rate: float) -> FloatArray:
    read = sensors.distort(sensors.TriadErrors(triad.matrix, triad.bias), true)
    white = triad.noise.get("white", 0.0)
    if white:
        read += white * np.sqrt(rate) * rng.standard_normal(true.shape)
    return read


def table_log(scenario: SrinsScenario) -> TableLog:
    """Return the table's log: the angle as it is."""
    time: FloatArray = TABLE_INTERVAL * np.arange(
        int(scenario.duration / TABLE_INTERVAL) + 1, dtype=float
    )
    return TableLog(
        "simulation", time, reciprocation(scenario).angle(time), TABLE_INTERVAL, len(time)
    )


def gnss_log(scenario: SrinsScenario) -> ReferenceLog:
    """Return the GNSS log: position and velocity with white noise, without the outages."""
    voyage = Voyage(scenario)
    time = _times(scenario, scenario.gnss_rate)
    rng = np.random.default_rng([scenario.seed, 2])
    noise = rng.standard_normal((4, len(time)))
    latitude, longitude = voyage.position(time)
    v = voyage.velocity(time) + scenario.gnss_velocity * noise[:2]
    R_M, R_N = earth.radii(latitude)
    values = {
        "latitude": latitude + scenario.gnss_position * noise[2] / R_M,
        "longitude": longitude + scenario.gnss_position * noise[3] / (R_N * np.cos(latitude)),
        "v_east": v[0],
        "v_north": v[1],
    }
    kept = np.ones(len(time), dtype=bool)
    for start, end in scenario.outages:
        kept &= (time < start) | (time > end)
    return _reference(time[kept], {name: value[kept] for name, value in values.items()})


def doppler_log(scenario: SrinsScenario) -> ReferenceLog:
    """Return the Doppler log: velocity with white noise; it may not follow maneuvers."""
    time = _times(scenario, scenario.doppler_rate)
    rng = np.random.default_rng([scenario.seed, 3])
    v = Voyage(scenario).velocity(time, doppler=True)
    v += scenario.doppler_noise * rng.standard_normal(v.shape)
    return _reference(time, {"v_east": v[0], "v_north": v[1]})


def truth_log(scenario: SrinsScenario, interval: float = 1.0) -> ReferenceLog:
    """Return the true position and velocity."""
    voyage = Voyage(scenario)
    time = _times(scenario, 1.0 / interval)
    latitude, longitude = voyage.position(time)
    v = voyage.velocity(time)
    return _reference(
        time,
        {"latitude": latitude, "longitude": longitude, "v_east": v[0], "v_north": v[1]},
    )


def _times(scenario: SrinsScenario, rate: float) -> FloatArray:
    return np.arange(int(scenario.duration * rate + 1e-9) + 1) / rate


def _reference(time: FloatArray, values: dict[str, FloatArray]) -> ReferenceLog:
    return ReferenceLog("simulation", time, values, len(time))
