"""A log prepared for the ZUPT filter: window, settings, and the sources of the readings.

A calibration is applied to the readings first: an uncalibrated gyro scale factor of 1e-3 at
10 deg/s is a bias of 36 deg/h along the axis, an installation error of 0.1 deg one of 63 deg/h
perpendicular to it. Without a calibration the filter estimates both as states.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rotcli.errors import LogError, RigError, RotcliError
from rotcli.logs.record import PIECE, ImuLog, ImuSource, TableLog, in_blocks
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import attitude_matrix, rotate_about
from rotcli.models.sensors import TriadErrors, correct
from rotcli.observe.zupt import velocity_noise
from rotcli.observe.zupt.checks import (
    dominant_rate,
    noise_warnings,
    rate_warnings,
    rates_of,
    window,
)
from rotcli.observe.zupt.evidence import Explanation
from rotcli.observe.zupt.filter import Estimates, tilted
from rotcli.observe.zupt.model import (
    ACCEL_BIAS,
    GYRO_BIAS,
    TILT,
    Settings,
    UpdateModel,
    build_update_model,
)
from rotcli.observe.zupt.options import Options, initial_sigmas, noise_from_rig
from rotcli.observe.zupt.updates import preintegrate_updates
from rotcli.rig.rig import Rig
from rotcli.run.checks import judge
from rotcli.run.evidence.gravity import check_gravity
from rotcli.run.evidence.stillness import warn_not_covered
from rotcli.run.findings import texts
from rotcli.run.motion import motion_between
from rotcli.run.recording import check_motion
from rotcli.run.table_angle import angle_at
from rotcli.units import FloatArray, show_span

MAX_HISTORY_BYTES = 1e9  # of a history to be smoothed, which stays in memory


@dataclass(frozen=True, eq=False)
class ZuptRun:
    """A log prepared for the filter: its settings and the sources of its readings.

    table: None where it is still. span: the samples of imu from the start to the last update.
    rate: rad/s, the dominant one of the table; angle: rad, at the start. start, end: s, the window.
    gyro_errors, accel_errors: compensated in the readings first. nominal_C_nb: (3, 3). tilt_offset:
    (2,) rad, tilts about east and north of the attitude in `settings` from it, as a first pass
    estimated, with its explanation; None in that pass. measured_noise: whether the velocity noise
    is estimated from the log.
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

        last = calibrated(next(self.imu.pieces(slice(first, first + 1))), slice(0, 1))
        size = max(1, min(updates, PIECE // step)) * step
        for chunk in in_blocks(self.imu.pieces(slice(first + 1, self.span.stop)), step):
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


def prepare_zupt(
    imu: ImuSource,
    table: TableLog | None,
    rig: Rig,
    options: Options,
    gyro_errors: TriadErrors | None = None,
    accel_errors: TriadErrors | None = None,
) -> ZuptRun:
    """Prepare a log; without a table log the IMU is assumed still.

    gyro_errors, accel_errors: a calibration, compensated in the readings first.
    Raises RigError without a site, LogError when the window is too short or the motion is not that
    of the table log, RotcliError for options that exclude each other.
    """
    if rig.site is None:
        raise RigError(f"{rig.path or 'rig'}: site: latitude is missing; set [site] latitude")
    if options.smooth and not options.slave_azimuth:
        raise RotcliError(
            "smoothing needs the slaved azimuth; omit one of --smooth, --free-azimuth"
        )
    warnings = [*imu.warnings, *(table.warnings if table else ())]
    limits = window(imu, table, options.window)
    requested = options.window or (float(imu.time[0]), float(imu.time[-1]))
    warnings += texts(judge("observe", warn_not_covered(imu.path, requested, limits)))
    span = imu.between(*limits)
    step = _samples_per_update(imu, span, limits, options)
    ends = np.concatenate([imu.times(slice(k, k + 1)) for k in (span.start, span.stop - 1)])
    start, end = float(ends[0]), float(ends[1])
    theta = table_angles(table, ends)
    motion = motion_between(table, start, end, (float(theta[0]), float(theta[1])))
    warnings += texts(check_motion("observe", imu, table, rig, motion))
    settings, assumed = _settings(imu, rig, options, gyro_errors, step, turning=not motion.still)
    missing = [name for name in ("pitch", "roll", "azimuth") if getattr(rig.attitude, name) is None]
    if missing:
        warnings.append(
            f"{rig.path or 'rig'}: [attitude] {', '.join(missing)} is missing; 0 deg is assumed"
        )
    warnings += _check_gravity(
        imu, table, span, settings, strict=not {"pitch", "roll"} & {*missing}
    )
    warnings += noise_warnings(imu, span, rig)
    rates = rates_of(imu, table, span, step)
    if options.smooth:
        _check_history(imu, len(rates), settings)
    scale = settings.initial.scale
    warnings += [*assumed, *rate_warnings(rates, options, scale, rig, gyro_errors)]
    run = ZuptRun(
        imu=imu,
        table=table,
        span=slice(span.start, span.start + len(rates) * step + 1),
        settings=settings,
        rate=0.0 if motion.still else dominant_rate(rates),
        angle=float(theta[0]),
        start=start,
        end=end,
        gyro_errors=gyro_errors,
        accel_errors=accel_errors,
        nominal_C_nb=settings.C_nb,
        warnings=tuple(warnings),
    )
    return run if options.velocity_sigma is not None else run.with_velocity_noise()


def _samples_per_update(
    imu: ImuSource, span: slice, limits: tuple[float, float], options: Options
) -> int:
    """Return the IMU samples per update; raise LogError for a window of less than two updates."""
    step = max(1, round(1.0 / (options.update_rate * imu.interval)))
    samples = span.stop - span.start
    if samples < 2 * step + 1:
        raise LogError(
            imu.path,
            f"the window {show_span(*limits)} contains {samples} samples, fewer than two "
            f"updates of {step}; choose a longer --window or a higher --update-rate",
        )
    return step


def _settings(
    imu: ImuSource,
    rig: Rig,
    options: Options,
    gyro_errors: TriadErrors | None,
    step: int,
    *,
    turning: bool,
) -> tuple[Settings, tuple[str, ...]]:
    """Return the settings of the filter, and warnings about figures that are assumed."""
    assert rig.site is not None
    noise, assumed = noise_from_rig(rig)
    nominal = (rig.attitude.pitch or 0.0, rig.attitude.roll or 0.0, rig.attitude.azimuth or 0.0)
    r = rig.lever_arm_s
    settings = Settings(
        latitude=rig.site.latitude,
        gravity=gravity_at(rig.site.latitude, rig.site.height, rig.site.gravity),
        C_nb=attitude_matrix(*nominal),
        axis=rig.table.axis,
        samples=step,
        noise=noise,
        initial=initial_sigmas(options, rig, gyro_errors, turning=turning),
        lever_arm=(float(r[0]), float(r[1]), float(r[2])),
        estimate_lever_arm=options.estimate_lever_arm,
        slave_azimuth=options.slave_azimuth,
        smooth=options.smooth,
        samples_are_means=imu.sampling == "average",
    )
    if options.velocity_sigma is not None:
        settings = replace(settings, velocity_sigma=options.velocity_sigma)
    return settings, assumed


def _check_gravity(
    imu: ImuSource, table: TableLog | None, span: slice, settings: Settings, *, strict: bool
) -> tuple[str, ...]:
    """Compare the gravity that the first minutes measure with the nominal; as `check_gravity`.

    The filter estimates a tilt of a few degrees.
    """
    first = next(imu.pieces(span))
    f_b = rotate_about(settings.axis, table_angles(table, first.time), first.accel).mean(axis=0)
    expected = settings.gravity * settings.C_nb[2]
    found = judge("observe", check_gravity(imu, f_b, expected), lenient=not strict)
    return tuple(texts(found))


def _check_history(imu: ImuSource, count: int, settings: Settings) -> None:
    """Raise LogError for a history of `count` updates that is too large to be smoothed."""
    each = 8 * (3 * len(settings.states) + 2)  # bytes: values, corrections, sigmas, NIS, time
    size = count * each
    if size <= MAX_HISTORY_BYTES:
        return
    samples = np.ceil(1.01 * size / MAX_HISTORY_BYTES * settings.samples)  # per update
    raise LogError(
        imu.path,
        f"--smooth: the history of {count} updates takes {size / 1e9:.2g} GB, more than the "
        f"{MAX_HISTORY_BYTES / 1e9:.2g} GB allowed; choose an --update-rate of "
        f"{1.0 / (samples * imu.interval):.3g} Hz at most, a shorter --window, or omit --smooth",
    )
