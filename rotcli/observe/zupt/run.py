"""A log prepared for the ZUPT filter: window, settings, and the sources of the readings.

A calibration is applied to the readings first: an uncalibrated gyro scale factor of 1e-3 at
10 deg/s is a bias of 36 deg/h along the axis, an installation error of 0.1 deg one of 63 deg/h
perpendicular to it. Without a calibration the filter estimates both as states.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import CHUNK_SAMPLES, ImuLog, ImuSource, TableLog, align_chunks
from rotcli.models.sensors import TriadErrors, correct
from rotcli.observe.zupt import velocity_noise
from rotcli.observe.zupt.checks.explanation import Explanation
from rotcli.observe.zupt.filter import Estimates, tilted
from rotcli.observe.zupt.model import (
    ACCEL_BIAS,
    GYRO_BIAS,
    TILT,
    Settings,
    UpdateModel,
    build_update_model,
)
from rotcli.observe.zupt.updates import preintegrate_updates
from rotcli.run.findings import Finding
from rotcli.run.table_angle import angle_at
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class ZuptRun:
    """A log prepared for the filter: its settings and the sources of its readings.

    table: None where it is still. span: the samples of imu from the start to the last update.
    rate: rad/s, the dominant one of the table; angle: rad, at the start. start, end: s, the window.
    gyro_errors, accel_errors: compensated in the readings first. nominal_C_nb: (3, 3). tilt_offset:
    (2,) rad, tilts about east and north of the attitude in `settings` from it, as a first pass
    estimated, with its explanation; None in that pass. measured_noise: whether the velocity noise
    is estimated from the log. findings: about the logs, whose texts are among the warnings.
    """

    imu: ImuSource
    table: TableLog | None
    span: slice
    settings: Settings
    rate: float
    angle: float
    start: float
    end: float
    gyro_errors: TriadErrors | None
    accel_errors: TriadErrors | None
    nominal_C_nb: FloatArray
    tilt_offset: FloatArray | None = None
    explanation: Explanation | None = None
    measured_noise: bool = False
    findings: tuple[Finding, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Number of updates."""
        return int(self.span.stop - self.span.start - 1) // self.settings.samples

    @property
    def calibrated(self) -> bool:
        """Whether gyro scale factor and installation errors are compensated in the readings."""
        return self.gyro_errors is not None and bool(np.any(self.gyro_errors.matrix))

    def update_model(self, done: int, count: int) -> UpdateModel:
        """Return the model of `count` updates after the first `done`."""
        step, span = self.settings.samples, self.span
        first = span.start + done * step
        last = first + count * step
        wide = slice(max(first - step, span.start), min(last + step + 1, span.stop))
        theta = table_angles(self.table, self.imu.times(wide))
        inside = slice(first - wide.start, last + 1 - wide.start)
        return build_update_model(theta, self.imu.interval, self.settings, inside)

    def readings(self, updates: int) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield gyro and accelerometer readings, calibrated, of at most so many updates.

        Each (n samples + 1, 3): the last sample of one is the first of the next.
        """
        step, first = self.settings.samples, self.span.start

        def calibrated(log: ImuLog, part: slice) -> tuple[FloatArray, FloatArray]:
            gyro, accel = log.gyro[part], log.accel[part]
            return (
                gyro if self.gyro_errors is None else correct(self.gyro_errors, gyro),
                accel if self.accel_errors is None else correct(self.accel_errors, accel),
            )

        last = calibrated(next(self.imu.chunks(slice(first, first + 1))), slice(0, 1))
        size = max(1, min(updates, CHUNK_SAMPLES // step)) * step
        for chunk in align_chunks(self.imu.chunks(slice(first + 1, self.span.stop)), step):
            for k in range(0, chunk.samples, size):
                now = calibrated(chunk, slice(k, k + size))
                yield np.concatenate([last[0], now[0]]), np.concatenate([last[1], now[1]])
                last = now[0][-1:], now[1][-1:]

    def with_velocity_noise(self) -> "ZuptRun":
        """Return the run with the velocity noise that the start of the log shows."""
        s = self.settings
        dv_n, done = list[FloatArray](), 0
        for gyro, accel in self.readings(velocity_noise.UPDATES):
            model = self.update_model(done, (len(gyro) - 1) // s.samples)
            dv_n.append(preintegrate_updates(model, gyro, accel).dv_n)
            done += len(dv_n[-1])
            if done >= velocity_noise.UPDATES:
                break
        first = slice(self.span.start, self.span.start + done * s.samples + 1)
        theta = table_angles(self.table, self.imu.times(first))[:: s.samples]
        tau = s.samples * self.imu.interval
        sigma = velocity_noise.velocity_sigma(np.concatenate(dv_n), theta, s, tau)
        return replace(self, settings=replace(s, velocity_sigma=sigma), measured_noise=True)

    def about_estimated_attitude(self, tilt: FloatArray, explanation: Explanation) -> "ZuptRun":
        """Return the run about the attitude that a first pass estimated, tilt (2,) rad off."""
        settings = replace(self.settings, C_nb=tilted(self.nominal_C_nb, tilt))
        return replace(self, settings=settings, tilt_offset=tilt, explanation=explanation)

    def total_estimates(self, part: Estimates) -> Estimates:
        """Return estimates on the clock of the log: total values, tilts from the nominal attitude.

        Errors compensated by the calibration are part of the biases and of the axis column; the
        lever arm of the rig is part of that perpendicular to the axis.
        """
        s, values = self.settings, part.values.copy()
        if s.estimate_lever_arm:
            values[:, s.layout.LEVER_ARM] += np.array(s.lever_arm) @ s.lever_axes
        if self.tilt_offset is not None:
            values[:, TILT] += self.tilt_offset
        for errors, at in ((self.accel_errors, ACCEL_BIAS), (self.gyro_errors, GYRO_BIAS)):
            if errors is not None:
                values[:, at] = values[:, at] @ (np.eye(3) + errors.matrix).T + errors.bias
        if self.gyro_errors is not None and s.initial.scale:
            at, matrix = s.layout.AXIS_COLUMN, self.gyro_errors.matrix
            values[:, at] = values[:, at] @ (np.eye(3) + matrix).T + matrix @ s.axis
        return replace(part, C_nb=self.nominal_C_nb, values=values, time=part.time + self.start)


def table_angles(table: TableLog | None, time: FloatArray) -> FloatArray:
    """Return the table angle (n,), rad, at times (n,), s; zero where there is no table log."""
    return np.zeros(len(time)) if table is None else angle_at(table, time)
