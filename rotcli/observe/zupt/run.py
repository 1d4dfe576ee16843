"""A log made ready for the zero-velocity filter, and its way through it, part by part.

A calibration is applied to the readings first: an uncalibrated gyro scale factor of 1e-3 at
10 deg/s shows as 36 deg/h of bias along the axis, an installation error of 0.1 deg as 63 deg/h
across it. Without a calibration the filter carries both along as states.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError, RigError, RotcliError
from rotcli.logs.record import PIECE, ImuLog, ImuSource, Progress, TableLog, in_blocks
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import attitude_matrix, rotate_about
from rotcli.models.sensors import TriadErrors, correct
from rotcli.observe.zupt.checks import dominant_rate, rate_warnings, rates_of, window
from rotcli.observe.zupt.filter import (
    Estimates,
    FilteredUpdates,
    ZuptFilter,
    significant_tilt,
    smooth_updates,
    tilted,
)
from rotcli.observe.zupt.model import Settings, UpdateModel, build_update_model
from rotcli.observe.zupt.options import Options, initial_sigmas, noise_from_rig
from rotcli.rig.rig import Rig
from rotcli.run.checks import judge
from rotcli.run.findings import texts
from rotcli.run.gravity import check_gravity
from rotcli.run.motion import motion_between
from rotcli.run.recording import check_motion
from rotcli.run.stillness import warn_not_covered
from rotcli.run.table_angle import angle_at
from rotcli.units import DEG, show_span

Array = NDArray[np.float64]

UPDATES = 4096  # filtered together: the covariance then runs in 128 blocks side by side
MAX_HISTORY_BYTES = 1e9  # bytes; of a history to be smooth_updates, which is held, at most


class AttitudeOffsetError(RotcliError):
    """A first pass found the table off its given attitude; `run` is what to filter in its stead."""

    def __init__(self, run: "ZuptRun") -> None:
        super().__init__("the table stands off the attitude given")
        self.run = run


@dataclass(frozen=True, eq=False)
class ZuptRun:
    """A log made ready: what the filter is told and where it finds the readings.

    table: None where it is still. span: the samples of imu from the start to the last update.
    rate: rad/s, the table's main one; angle: rad, at the start. start, end: s, the window.
    gyro_errors, accel_errors: removed from the readings first. given: (3, 3) the attitude C_nb
    given. off: (2,) rad, tilts about east and north of the attitude in `settings` against it, known
    from a first pass; None in that.
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
    nominal_C_nb: Array
    tilt_offset: Array | None = None
    warnings: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """How many updates there are."""
        return int(self.span.stop - self.span.start - 1) // self.settings.samples

    @property
    def calibrated(self) -> bool:
        """Whether gyro scale factor and installation are removed from the readings."""
        return self.gyro_errors is not None and bool(np.any(self.gyro_errors.matrix))

    def plan(self, done: int, count: int) -> UpdateModel:
        """Plan `count` updates after the first `done`."""
        step, span = self.settings.samples, self.span
        first = span.start + done * step
        last = first + count * step
        wide = slice(max(first - step, span.start), min(last + step + 1, span.stop))
        theta = angles(self.table, self.imu.times(wide))
        within = slice(first - wide.start, last + 1 - wide.start)
        return build_update_model(theta, self.imu.interval, self.settings, within)

    def about_estimated_attitude(self, off: Array) -> "ZuptRun":
        """Return the run about the attitude that a first pass found, off (2,) rad from this one."""
        told = (
            f"the table stands {np.hypot(*off) / DEG:.2g} deg off the attitude given, and was "
            "filtered as it stands: correct [attitude]"
        )
        found = replace(self.settings, C_nb=tilted(self.nominal_C_nb, off))
        return replace(self, settings=found, tilt_offset=off, warnings=(*self.warnings, told))

    def total_estimates(self, part: Estimates) -> Estimates:
        """Return estimates on the log's clock: whole values, and tilts from the attitude given.

        What the calibration removed is part of the biases, the scale factor and installation; the
        lever arm of the rig is part of that across the axis.
        """
        s, values = self.settings, part.values.copy()
        values[:, s.layout.LEVER_ARM] += (np.array(s.lever_arm) @ s.lever_axes)[
            : s.layout.LEVER_ARM.stop - 12
        ]
        if self.tilt_offset is not None:
            values[:, 3:5] += self.tilt_offset
        for errors, at in ((self.accel_errors, slice(6, 9)), (self.gyro_errors, slice(9, 12))):
            if errors is not None:
                values[:, at] = values[:, at] @ (np.eye(3) + errors.matrix).T + errors.bias
        if self.gyro_errors is not None and s.initial.scale:
            at, matrix = s.layout.AXIS_COLUMN, self.gyro_errors.matrix
            values[:, at] = values[:, at] @ (np.eye(3) + matrix).T + matrix @ s.axis
        return replace(part, C_nb=self.nominal_C_nb, values=values, time=part.time + self.start)


def angles(table: TableLog | None, time: Array) -> Array:
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
    """Make a log ready; without a table log the IMU is taken as still.

    gyro_errors, accel_errors: a calibration, removed from the readings first.
    Raises RigError without a site, LogError when the window holds too little or the motion is
    another than said, RotcliError for options that do not go together.
    """
    if rig.site is None:
        raise RigError(
            f"{rig.path or 'rig'}: site: latitude is missing; give it in [site] or as --latitude"
        )
    if options.smooth and not options.slave_azimuth:
        raise RotcliError("--smooth: needs the slaved azimuth; leave out --free-azimuth")
    warnings = [*imu.warnings, *(table.warnings if table else ())]
    limits = window(imu, table, options.window)
    wanted = options.window or (float(imu.time[0]), float(imu.time[-1]))
    warnings += texts(judge("observe", warn_not_covered(imu.path, wanted, limits)))
    span = imu.between(*limits)
    step = max(1, round(1.0 / (options.update_rate * imu.interval)))
    samples = span.stop - span.start
    if samples < 2 * step + 1:
        raise LogError(
            imu.path,
            f"the window {show_span(*limits)} holds {samples} samples, fewer than two "
            f"updates of {step}; name a longer --window or a higher --update-rate",
        )
    ends = np.concatenate([imu.times(slice(k, k + 1)) for k in (span.start, span.stop - 1)])
    start, end = float(ends[0]), float(ends[1])
    theta = angles(table, ends)
    motion = motion_between(table, start, end, (float(theta[0]), float(theta[1])))
    warnings += texts(check_motion("observe", imu, table, rig, motion))
    noise, assumed = noise_from_rig(rig)
    pitch, roll, azimuth = (
        angle or 0.0 for angle in (rig.attitude.pitch, rig.attitude.roll, rig.attitude.azimuth)
    )
    unnamed = [name for name in ("pitch", "roll", "azimuth") if getattr(rig.attitude, name) is None]
    if unnamed:
        warnings.append(
            f"the rig names no {', '.join(unnamed)} under [attitude]: taken as 0 deg; add it"
        )
    r = rig.lever_arm_s
    settings = Settings(
        latitude=rig.site.latitude,
        gravity=gravity_at(rig.site.latitude, rig.site.height, rig.site.gravity),
        C_nb=attitude_matrix(pitch, roll, azimuth),
        axis=rig.table.axis,
        samples=step,
        velocity_sigma=options.velocity_sigma,
        noise=noise,
        initial=initial_sigmas(options, rig, gyro_errors, turning=not motion.still),
        lever_arm=(float(r[0]), float(r[1]), float(r[2])),
        estimate_lever_arm=options.estimate_lever_arm,
        slave_azimuth=options.slave_azimuth,
        smooth=options.smooth,
        samples_are_means=imu.sampling == "average",
    )
    warnings += _check_gravity(
        imu, table, span, settings, strict=not {"pitch", "roll"} & {*unnamed}
    )
    rates = rates_of(imu, table, span, step)
    if options.smooth:
        _check_held(imu, len(rates), settings)
    warnings += [
        *assumed,
        *rate_warnings(rates, options, settings.initial.scale, rig, gyro_errors),
    ]
    return ZuptRun(
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


def _check_gravity(
    imu: ImuSource, table: TableLog | None, span: slice, settings: Settings, *, strict: bool
) -> tuple[str, ...]:
    """Compare the gravity that the first minutes feel with what it should be; as `check_gravity`.

    A few degrees of tilt are for the filter to find.
    """
    first = next(imu.pieces(span))
    f_b = rotate_about(settings.axis, angles(table, first.time), first.accel).mean(axis=0)
    expected = settings.gravity * settings.C_nb[2]
    found = judge("observe", check_gravity(imu, f_b, expected), lenient=not strict)
    return tuple(texts(found))


def _check_held(imu: ImuSource, count: int, settings: Settings) -> None:
    """Refuse a history of `count` updates that is too long to be held and smoothed."""
    each = 8 * (3 * len(settings.states) + 2)  # bytes: values, corrections, sigmas, NIS, time
    if count * each <= MAX_HISTORY_BYTES:
        return
    least = np.ceil(
        1.01 * count * each / MAX_HISTORY_BYTES * settings.samples
    )  # samples per update
    raise LogError(
        imu.path,
        f"--smooth: the history of {count} updates takes {count * each / 1e9:.2g} GB, "
        f"more than the {MAX_HISTORY_BYTES / 1e9:.2g} GB allowed; give an --update-rate of "
        f"{1.0 / (least * imu.interval):.3g} Hz at most, a shorter --window, or leave --smooth out",
    )


def estimate_parts(run: ZuptRun, progress: Progress | None = None) -> Iterator[Estimates]:
    """Filter a run, yielding its estimates part by part.

    progress: told how much (0 to 1) is done. Raises AttitudeOffsetError, at the end of the filter's
    pass, where the table clearly stands off the attitude that the run was made ready with.
    """
    smooth = run.settings.smooth
    held: list[FilteredUpdates] = []
    for part in _filtered(run, progress, 0.5 if smooth else 1.0):
        if smooth:
            held.append(part)
        else:
            yield part.estimates
        last = part.estimates
    off = significant_tilt(last) if run.tilt_offset is None else None
    if off is not None:
        raise AttitudeOffsetError(run.about_estimated_attitude(off))
    if smooth:
        yield from _smoothed(run, held, progress)


def _filtered(run: ZuptRun, progress: Progress | None, share: float) -> Iterator[FilteredUpdates]:
    """Yield the parts of the filter's pass, `share` of what there is to be done."""
    way, s, done = ZuptFilter(run.settings, run.count), run.settings, 0
    for gyro, accel in _readings(run, s.samples, UPDATES):
        part = way.advance(run.plan(done, (len(gyro) - 1) // s.samples), gyro, accel)
        done = way.done
        yield part
        if progress:
            progress(share * done / run.count)


def _readings(run: ZuptRun, step: int, updates: int) -> Iterator[tuple[Array, Array]]:
    """Yield gyro and accelerometer readings, calibrated, of up to so many updates at a time.

    Each (n step + 1, 3): the last sample of one is the first of the next.
    """
    first = run.span.start

    def calibrated(log: ImuLog, part: slice) -> tuple[Array, Array]:
        gyro, accel = log.gyro[part], log.accel[part]
        return (
            gyro if run.gyro_errors is None else correct(run.gyro_errors, gyro),
            accel if run.accel_errors is None else correct(run.accel_errors, accel),
        )

    before = calibrated(next(run.imu.pieces(slice(first, first + 1))), slice(0, 1))
    size = max(1, min(updates, PIECE // step)) * step
    for piece in in_blocks(run.imu.pieces(slice(first + 1, run.span.stop)), step):
        for k in range(0, piece.samples, size):
            now = calibrated(piece, slice(k, k + size))
            yield np.concatenate([before[0], now[0]]), np.concatenate([before[1], now[1]])
            before = now[0][-1:], now[1][-1:]


def _smoothed(
    run: ZuptRun, held: list[FilteredUpdates], progress: Progress | None
) -> Iterator[Estimates]:
    """Go back through the parts that the filter left, then yield them from the first on.

    The gains are found once more, part by part: to hold those of days takes ten times as much.
    """
    later, done = None, run.count
    found: list[Estimates] = []
    while held:
        part = held.pop()
        n = len(part.estimates.time)
        done -= n
        estimates, later = smooth_updates(run.plan(done, n), part, later)
        found.append(estimates)
        if progress:
            progress(1.0 - 0.5 * done / run.count)
    while found:
        yield found.pop()
