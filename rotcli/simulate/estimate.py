"""Simulate the logs of an IMU on a still or turning table, with the truth next to them.

Exact motion (`rotcli.models.turntable`), then the sensor errors of a profile. The same scenario
and seed give the same logs.
"""

from collections.abc import Callable

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import ImuLog, TableLog
from rotcli.models import rotation, sensors
from rotcli.models.turntable import Schedule, ScheduleStep, Turntable
from rotcli.rig.profile import Triad
from rotcli.rig.scenario import Scenario
from rotcli.units import FloatArray

_TRUTH = 0.3  # share of the work that the exact motion is
TABLE_INTERVAL = 0.02  # s; the papers' encoder runs at 50 Hz


@dataclass(frozen=True, eq=False)
class Simulation:
    """The simulated logs and where the named stages lie, s.

    stages: name to windows (start, end), in the order of the legs, ramps left out.
    temperature: (n,) degC of the thermometer at the IMU's times, if there is one.
    """

    imu: ImuLog
    table: TableLog
    stages: dict[str, list[tuple[float, float]]]
    schedule: Schedule
    temperature: FloatArray | None = None


def simulate(scenario: Scenario, *, progress: Callable[[float], None] | None = None) -> Simulation:
    """Make the logs of a scenario: IMU at the profile's rate, table at 50 Hz, both from time 0.

    With white noise N the samples scatter by N / sqrt(interval) about the truth of
    `(I + N) w_is_s + d`; readings are cut off at the profile's range. progress
    receives the share (0 to 1) that is done.
    """
    report = progress or _nothing
    schedule, stages = _schedule(scenario)
    turntable = Turntable(
        latitude=scenario.site.latitude,
        height=scenario.site.height,
        gravity=scenario.site.gravity,
        C_nb=rotation.attitude_matrix(*scenario.attitude),
        axis=scenario.rig.table.axis,
        schedule=schedule,
        lever_arm=scenario.rig.lever_arm_s,
    )
    interval = 1.0 / scenario.profile.rate
    time: FloatArray = interval * np.arange(round(schedule.duration / interval) + 1, dtype=float)
    averages = scenario.rig.imu.sampling != "instant"
    if averages:
        w_is_s, f_s = turntable.average(time, interval)
    else:
        w_is_s, f_s = turntable.sense(time)
    report(_TRUTH)
    gyro_rng, accel_rng = np.random.default_rng(scenario.seed).spawn(2)
    around = scenario.environment
    gyro_errors = around.gyro_errors(time, w_is_s) if around else None
    accel_errors = around.accel_errors(time) if around else None
    imu = ImuLog(
        path="simulation",
        time=time,
        gyro=_read(gyro_rng, scenario.profile.gyro, w_is_s, gyro_errors, interval, report, 0),
        accel=_read(accel_rng, scenario.profile.accel, f_s, accel_errors, interval, report, 3),
        interval=interval,
        sampling="average" if averages else "instant",
        rows=len(time),
    )
    samples = round(schedule.duration / TABLE_INTERVAL) + 1
    table_time: FloatArray = TABLE_INTERVAL * np.arange(samples, dtype=float)
    angle, _, _ = schedule.motion(table_time)
    if scenario.encoder_step:
        angle = scenario.encoder_step * np.round(angle / scenario.encoder_step)
    table = TableLog(
        path="simulation",
        time=table_time,
        angle=angle,
        interval=TABLE_INTERVAL,
        rows=len(table_time),
    )
    return Simulation(
        imu=imu,
        table=table,
        stages=stages,
        schedule=schedule,
        temperature=around.thermometer(time, interval) if around else None,
    )


def _schedule(scenario: Scenario) -> tuple[Schedule, dict[str, list[tuple[float, float]]]]:
    """Return the table's schedule, ramps put between legs, and the windows of the stages."""
    pieces: list[ScheduleStep] = []
    stages: dict[str, list[tuple[float, float]]] = {}
    now = 0.0
    for leg in scenario.legs:
        last_rate = pieces[-1].final_rate if pieces else leg.rate
        if scenario.ramp > 0.0 and abs(leg.rate - last_rate) > 1e-12:
            slope = (leg.rate - last_rate) / scenario.ramp
            pieces.append(ScheduleStep(scenario.ramp, rate=last_rate, slope=slope))
            now += scenario.ramp
        pieces.append(ScheduleStep(leg.duration, rate=leg.rate, sweep=leg.sweep, period=leg.period))
        if leg.stage is not None:
            stages.setdefault(leg.stage, []).append((now, now + leg.duration))
        now += leg.duration
    return Schedule(tuple(pieces)), stages


def _nothing(_: float) -> None:
    """Report no progress."""


def _read(
    rng: np.random.Generator,
    triad: Triad,
    true: FloatArray,
    errors: FloatArray | None,
    interval: float,
    report: Callable[[float], None],
    before: int,
) -> FloatArray:
    """Return the readings (n, 3) of a triad for true values (n, 3) and rate or temperature errors.

    before: axes that are already simulated.
    """
    read = sensors.distort(sensors.TriadErrors(triad.matrix, triad.bias), true)
    if errors is not None:
        read += errors
    figures = sensors.NoiseFigures(**triad.noise)
    for axis, axis_rng in enumerate(rng.spawn(3)):
        read[:, axis] += sensors.noise(axis_rng, len(read), interval, figures)
        report(_TRUTH + (1.0 - _TRUTH) * (before + axis + 1) / 6.0)
    if triad.range is not None:
        np.clip(read, -triad.range, triad.range, out=read)
    return triad.effects.apply(read, interval)
