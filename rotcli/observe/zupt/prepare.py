"""Prepare a log for the ZUPT filter: its window, its checks and the settings of the filter."""

from dataclasses import replace

import numpy as np

from rotcli.errors import LogError, RigError, RotcliError
from rotcli.logs.record import ImuSource, TableLog
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import attitude_matrix, sum_rotated
from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt.checks.readings import check_readings
from rotcli.observe.zupt.checks.window import (
    dominant_rate,
    noise_warnings,
    rate_warnings,
    rates_of,
    window,
)
from rotcli.observe.zupt.model import Settings
from rotcli.observe.zupt.options import Options, initial_sigmas, noise_from_rig
from rotcli.observe.zupt.run import ZuptRun, table_angles
from rotcli.rig.rig import Rig
from rotcli.run.checks import judge
from rotcli.run.evidence.gravity import check_gravity
from rotcli.run.evidence.stillness import warn_not_covered
from rotcli.run.findings import texts
from rotcli.run.motion import motion_between
from rotcli.run.recording import check_motion
from rotcli.units import format_span

MAX_HISTORY_BYTES = 1e9  # of a history to be smoothed, which stays in memory


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
    _check_options(rig, options)
    limits = window(imu, table, options.window)
    requested = options.window or (float(imu.time[0]), float(imu.time[-1]))
    span = imu.between(*limits)
    step = _samples_per_update(imu, span, limits, options)
    ends = np.concatenate([imu.times(slice(k, k + 1)) for k in (span.start, span.stop - 1)])
    start, end = float(ends[0]), float(ends[1])
    theta = table_angles(table, ends)
    motion = motion_between(table, start, end, (float(theta[0]), float(theta[1])))
    findings = (
        *judge("observe", warn_not_covered(imu.path, requested, limits)),
        *check_motion("observe", imu, table, rig, motion),
    )
    findings = (*findings, *check_readings(imu, table, rig, span, findings))
    settings, assumed = _settings(imu, rig, options, gyro_errors, step, turning=not motion.still)
    rates = rates_of(imu, table, span, step)
    if options.smooth:
        _check_history(imu, len(rates), settings)
    warnings = (
        *imu.warnings,
        *(table.warnings if table else ()),
        *texts(findings),
        *_check_attitude(imu, table, span, rig, settings),
        *noise_warnings(imu, span, rig),
        *assumed,
        *rate_warnings(rates, options, settings.initial.scale, rig, gyro_errors),
    )
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
        findings=findings,
        warnings=warnings,
    )
    return run if options.velocity_sigma is not None else run.with_velocity_noise()


def _check_options(rig: Rig, options: Options) -> None:
    """Raise RigError for a rig without a site, RotcliError for options that exclude each other."""
    if rig.site is None:
        raise RigError(f"{rig.path or 'rig'}: site: latitude is missing; set [site] latitude")
    if options.smooth and not options.slave_azimuth:
        raise RotcliError(
            "smoothing needs the slaved azimuth; omit smoothing or the free azimuth",
            code="smoothing-azimuth",
        )


def _samples_per_update(
    imu: ImuSource, span: slice, limits: tuple[float, float], options: Options
) -> int:
    """Return the IMU samples per update; raise LogError for a window of less than two updates."""
    step = max(1, round(1.0 / (options.update_rate * imu.interval)))
    samples = span.stop - span.start
    if samples < 2 * step + 1:
        raise LogError(
            imu.path,
            f"the window {format_span(*limits)} contains {samples} samples, fewer than two "
            f"updates of {step}; choose a longer window or a higher update rate",
            code="window-updates",
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


def _check_attitude(
    imu: ImuSource, table: TableLog | None, span: slice, rig: Rig, settings: Settings
) -> tuple[str, ...]:
    """Compare the gravity that the first minutes measure with the nominal; as `check_gravity`.

    The filter estimates a tilt of a few degrees. Errors are warnings where the rig lacks the
    attitude.
    """
    missing = [name for name in ("pitch", "roll", "azimuth") if getattr(rig.attitude, name) is None]
    first = next(imu.chunks(span))
    f_b = sum_rotated(settings.axis, table_angles(table, first.time), first.accel) / first.samples
    expected = settings.gravity * settings.C_nb[2]
    found = check_gravity(imu, f_b, expected)
    gravity = texts(judge("observe", found, lenient=bool({"pitch", "roll"} & {*missing})))
    if not missing:
        return tuple(gravity)
    text = f"{rig.path or 'rig'}: [attitude] {', '.join(missing)} is missing; 0 deg is assumed"
    return (text, *gravity)


def _check_history(imu: ImuSource, count: int, settings: Settings) -> None:
    """Raise LogError for a history of `count` updates that is too large to be smoothed."""
    each = 8 * (3 * len(settings.states) + 2)  # bytes: values, corrections, sigmas, NIS, time
    size = count * each
    if size <= MAX_HISTORY_BYTES:
        return
    samples = np.ceil(1.01 * size / MAX_HISTORY_BYTES * settings.samples)  # per update
    raise LogError(
        imu.path,
        f"the history of {count} updates to be smoothed takes {size / 1e9:.2g} GB, more than the "
        f"{MAX_HISTORY_BYTES / 1e9:.2g} GB allowed; choose an update rate of "
        f"{1.0 / (samples * imu.interval):.3g} Hz at most, a shorter window, or omit smoothing",
        code="smoothing-history",
    )
