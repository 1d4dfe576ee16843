"""Rotary inertial navigation of a log on a still table, and its errors (R16 section 2.1).

The sensor frame is mechanized; the table angle is then taken out of the attitude, which equals
turning the readings into b first (R16 (1), (2)) and needs no differenced encoder.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError, RigError
from rotcli.logs import checks, segments
from rotcli.logs.lag import check_lag
from rotcli.logs.motion import check_swing
from rotcli.logs.record import ImuLog, ImuSource, Progress, Stretch, TableLog
from rotcli.logs.rig import Rig
from rotcli.models import earth, rotation, strapdown
from rotcli.models.running import RunningErrors
from rotcli.models.sensors import TriadErrors, correct
from rotcli.units import DEG, show_span, wrap_pi

Array = NDArray[np.float64]

_STEADY = 1.0 * DEG  # rad, how far the angle of one constant rate may stray from a line

_WRONG_RATE = 0.1 * DEG  # rad/s; R16 table 7: within 0.025 deg/s after calibration
_RUN_AWAY = 1e4  # m; unaided, height multiplies by e in ten minutes and soon means nothing

ERROR_NAMES = (
    "north",
    "east",
    "up",
    "v_north",
    "v_east",
    "v_up",
    "pitch",
    "roll",
    "azimuth",
)


@dataclass(frozen=True, eq=False)
class Place:
    """The still base that errors are taken against: rad, rad, m, m/s^2 or None, C_nb (3, 3)."""

    latitude: float
    longitude: float
    height: float
    gravity: float | None
    pitch: float
    roll: float
    azimuth: float

    @property
    def C_nb(self) -> Array:
        """Attitude of the body, (3, 3)."""
        return rotation.attitude_matrix(self.pitch, self.roll, self.azimuth)

    @property
    def specific_force(self) -> Array:
        """What an accelerometer at rest feels, (3,) m/s^2, in b."""
        normal = float(earth.normal_gravity(self.latitude, self.height))
        return np.asarray((normal if self.gravity is None else self.gravity) * self.C_nb[2])


@dataclass(frozen=True, eq=False)
class Navigation:
    """A navigated window: what was computed and how far it is from the still table.

    time (n,) s; latitude, longitude (n,) rad, height (n,) m of the point on the rotation axis;
    v_n (n, 3) m/s; pitch, roll, azimuth (n,) rad of the body; errors (n, 9) in the order of
    ERROR_NAMES: m, m/s, rad. rate: rad/s, mean table rate over the window.
    """

    mode: str
    rate: float
    time: Array
    latitude: Array
    longitude: Array
    height: Array
    v_n: Array
    pitch: Array
    roll: Array
    azimuth: Array
    errors: Array

    @property
    def rms(self) -> Array:
        """Root mean square of each error over the window, (9,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=0)))

    @property
    def final(self) -> Array:
        """Errors at the end of the window, (9,)."""
        return np.asarray(self.errors[-1])

    @property
    def greatest(self) -> Array:
        """Greatest magnitude of each error, (9,)."""
        return np.asarray(np.max(np.abs(self.errors), axis=0))


@dataclass(frozen=True, eq=False)
class Run:
    """What every mode of navigating one log shares.

    table: None where it is still; window and static: spans of imu; axis (3,) u in b; lever_arm
    (3,) m in s; errors are taken against `place`. rate: rad/s, mean table rate over the window;
    steady: whether it is the one rate.
    """

    imu: ImuSource
    table: TableLog | None
    window: slice
    static: slice | None
    place: Place
    axis: Array
    lever_arm: Array
    rate: float
    steady: bool
    warnings: tuple[str, ...]

    def angle(self, span: slice) -> Array:
        """Return the table angle (k,), rad, at the samples of a span."""
        return _angle(self.table, self.imu.times(span))


def _angle(table: TableLog | None, time: Array) -> Array:
    return np.zeros(len(time)) if table is None else segments.angle_at(table, time)


def prepare(imu: ImuSource, table: TableLog | None, rig: Rig, *, need_static: bool) -> Run:
    """Find the stretches of a log and the base it stands on; no table log means still.

    Pitch and roll that the rig leaves out are levelled from the still stretch; an azimuth that it
    leaves out is taken as north, with a warning. Raises RigError without a site, LogError when
    the logs do not hold the stretches or the table turns otherwise than the rig says.
    """
    axis = rig.table.axis
    warnings = [*imu.warnings, *(table.warnings if table else ())]
    start, end = segments.navigation_window(rig, table, imu)
    spans = [(start, end)]
    static = None
    if need_static or rig.attitude.pitch is None or rig.attitude.roll is None:
        static = segments.static_stretch(rig, table, imu)
        warnings += checks.check_cut(imu.path, rig.stages.static, static)
        warnings += checks.check_still(imu, static, rig.imu.figure("angle_random_walk"))
        spans.append((static.start, static.end))
    if table is None:
        checks.check_untabled(imu, start, end, static)
    else:
        warnings += check_lag(imu, table, axis, time_offset=rig.table.time_offset)
    window = imu.between(start, end)
    count = window.stop - window.start
    if count < 4:
        raise LogError(
            imu.path,
            f"the window {show_span(start, end)} holds {count} samples, at least 4 are needed; "
            f"the log covers {show_span(imu.time[0], imu.time[-1])}",
        )
    limits = imu.between(min(span[0] for span in spans), max(span[1] for span in spans))
    ends = (limits.start, limits.stop - 1, window.start, window.stop - 1)
    time = np.concatenate([imu.times(slice(k, k + 1)) for k in ends])
    theta = _angle(table, time)
    rate, strays = float((theta[3] - theta[2]) / (time[3] - time[2])), 0.0
    if table is not None:
        strays = segments.stray(table, float(time[2]), float(time[3]), float(theta[2]), rate)
    if table is not None and abs(theta[3] - theta[2]) > 0.5 * np.pi and strays < _STEADY:
        turned = Stretch(float(time[2]), float(time[3]), rate, float(theta[3] - theta[2]))
        checks.check_direction(imu, table, axis, turned)
    elif table is not None:
        check_swing(imu, table, axis, start, end)

    inside = None if static is None else imu.within(static.start, static.end)
    place, assumed = _place(rig, imu, table, inside)
    first = next(iter(imu.pieces(window)))
    f_b = rotation.turn_about(axis, _angle(table, first.time), first.accel).mean(axis=0)
    warnings += checks.check_gravity(imu, f_b, place.specific_force)
    return Run(
        imu=imu,
        table=table,
        window=window,
        static=inside,
        place=place,
        axis=axis,
        lever_arm=rig.lever_arm_s,
        rate=rate,
        steady=strays < _STEADY,
        warnings=(*warnings, *assumed),
    )


def _place(
    rig: Rig, imu: ImuSource, table: TableLog | None, static: slice | None
) -> tuple[Place, tuple[str, ...]]:
    """Return the base: the rig's site and attitude, what it leaves out levelled or assumed."""
    name = rig.path or "no rig.toml"
    if rig.site is None:
        raise RigError(
            f"{name}: [site] latitude: missing; navigation needs to know where the table stands: "
            "write a rig.toml beside the log, or name one with --rig"
        )
    warnings = []
    pitch, roll, azimuth = rig.attitude.pitch, rig.attitude.roll, rig.attitude.azimuth
    if static is not None and (pitch is None or roll is None):
        axis = rig.table.axis
        levelled = level(
            _mean(imu, table, static, lambda log, a: rotation.turn_about(axis, a, log.accel))
        )
        pitch = levelled[0] if pitch is None else pitch
        roll = levelled[1] if roll is None else roll
        warnings.append(
            f"{name}: [attitude] leaves out pitch or roll: levelled by the accelerometers to "
            f"pitch {pitch / DEG:.3f} deg, roll {roll / DEG:.3f} deg"
        )
    if azimuth is None:
        warnings.append(
            f"{name}: [attitude] leaves out azimuth: taken as 0 (north), so up to 15 deg/h of "
            "Earth rate may be taken out along the wrong axes; add it"
        )
    site = rig.site
    attitude = (pitch or 0.0, roll or 0.0, azimuth or 0.0)
    return Place(site.latitude, site.longitude, site.height, site.gravity, *attitude), tuple(
        warnings
    )


def _mean(
    imu: ImuSource,
    table: TableLog | None,
    span: slice,
    of: Callable[[ImuLog, Array], Array],
) -> Array:
    """Return the mean (3,) over a span of what `of` makes (n, 3) of a log and the table angle."""
    total = np.zeros(3)
    for piece in imu.pieces(span):
        total += of(piece, _angle(table, piece.time)).sum(axis=0)
    return np.asarray(total / (span.stop - span.start))


def level(f_b: Array) -> tuple[float, float]:
    """Return pitch and roll (rad) of the body from its mean specific force (3,) while still.

    >>> level(np.array([0.0, 0.0, 9.8]))
    (0.0, 0.0)
    """
    x, y, z = f_b
    return float(np.arctan2(y, np.hypot(x, z))), float(np.arctan2(-x, z) + 0.0)


def check_correction(run: Run, gyro_errors: TriadErrors) -> tuple[str, ...]:
    """Compare the window's mean corrected rate with the table's and the Earth's.

    Returns a warning where they differ by more than four times what R16 table 7 leaves: the
    calibration is of another unit or another day.
    """
    w_ie_b = run.place.C_nb.T @ earth.earth_rate_n(run.place.latitude)

    def left(imu: ImuLog, angle: Array) -> Array:
        w_ie_s = rotation.turn_about(run.axis, -angle, np.broadcast_to(w_ie_b, imu.gyro.shape))
        return correct(gyro_errors, imu.gyro) - w_ie_s

    off = _mean(run.imu, run.table, run.window, left) - run.rate * run.axis
    if np.max(np.abs(off)) < _WRONG_RATE + 1e-3 * abs(run.rate):
        return ()
    felt = ", ".join(f"{v / DEG:.3g}" for v in off)
    return (
        f"{run.imu.path}: after calibration the gyros are off by ({felt}) deg/s on average: is the "
        "calibration of this unit and this day? calibrate anew",
    )


def static_errors(run: Run) -> TriadErrors:
    """Return the gyro biases (rad/s): mean of the still stretch less Earth rate."""
    if run.static is None:
        raise ValueError("the run was prepared without a still stretch")
    w_ie_b = run.place.C_nb.T @ earth.earth_rate_n(run.place.latitude)

    def left(imu: ImuLog, angle: Array) -> Array:
        w_ie_s = rotation.turn_about(run.axis, -angle, np.broadcast_to(w_ie_b, imu.gyro.shape))
        return imu.gyro - w_ie_s

    return TriadErrors(bias=_mean(run.imu, run.table, run.static, left))


def navigate(
    run: Run,
    gyro_errors: TriadErrors,
    accel_errors: TriadErrors | None = None,
    *,
    mode: str,
    hold_height: bool = False,
) -> Navigation:
    """Navigate a run whose sensors have the given errors, all of it held at once."""
    parts = navigate_parts(run, gyro_errors, accel_errors, mode=mode, hold_height=hold_height)
    held = list(parts)

    def joined(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in held])

    return replace(
        held[0],
        time=joined("time"),
        latitude=joined("latitude"),
        longitude=joined("longitude"),
        height=joined("height"),
        v_n=joined("v_n"),
        pitch=joined("pitch"),
        roll=joined("roll"),
        azimuth=joined("azimuth"),
        errors=joined("errors"),
    )


def navigate_parts(
    run: Run,
    gyro_errors: TriadErrors,
    accel_errors: TriadErrors | None = None,
    *,
    mode: str,
    hold_height: bool = False,
    progress: Progress | None = None,
) -> Iterator[Navigation]:
    """Navigate a run whose sensors have the given errors, yielding the window part by part.

    The start is the still base's position and attitude, at rest but for the lever arm's motion.
    progress: told how much (0 to 1) is done.
    """
    imu, axis, place, lever_arm = run.imu, run.axis, run.place, run.lever_arm
    first, stop = run.window.start, run.window.stop
    theta = run.angle(slice(first, min(first + 41, stop)))
    C_ns = place.C_nb @ rotation.axis_rotation(axis, theta[0])
    start = strapdown.Start(
        latitude=place.latitude,
        longitude=place.longitude,
        height=place.height,
        v_n=C_ns @ np.cross(_first_rate(theta, imu.interval) * axis, lever_arm),
        C_ns=C_ns,
        offset_n=C_ns @ lever_arm,
    )
    carried = strapdown.Mechanization(
        imu.interval,
        start,
        averages=imu.sampling == "average",
        gravity=place.gravity,
        hold_height=hold_height,
    )
    done = first
    for piece, last in _told_the_last(imu.pieces(run.window)):
        f_s = piece.accel if accel_errors is None else correct(accel_errors, piece.accel)
        way = carried.advance(correct(gyro_errors, piece.gyro), f_s, last=last)
        span = slice(done, done + len(way.height))
        done = span.stop
        if span.stop > span.start:
            yield _on_the_axis(run, way, span, mode)
        if progress:
            progress((done - first) / (stop - first))


def _told_the_last(pieces: Iterable[ImuLog]) -> Iterator[tuple[ImuLog, bool]]:
    held = None
    for piece in pieces:
        if held is not None:
            yield held, False
        held = piece
    if held is not None:
        yield held, True


def _on_the_axis(run: Run, way: strapdown.Trajectory, span: slice, mode: str) -> Navigation:
    """Return what a span's way of the IMU means for the point on the axis, and its errors."""
    axis, place, lever_arm = run.axis, run.place, run.lever_arm
    beside = slice(max(span.start - 1, run.window.start), min(span.stop + 1, run.window.stop))
    theta = run.angle(beside)
    own = slice(span.start - beside.start, span.stop - beside.start)
    swing = np.gradient(theta, run.imu.interval)[own]
    theta = theta[own]

    # From the IMU to the point on the axis: q_ns takes the lever arm and its velocity to n.
    arm_n = rotation.rotate(way.q_ns, np.repeat(lever_arm[:, None], len(theta), axis=1)).T
    swing_s = swing[:, None] * np.cross(axis, lever_arm)
    v_n = way.v_n - rotation.rotate(way.q_ns, swing_s.T).T
    R_M, R_N = earth.radii(place.latitude)
    metres_north = R_M + place.height
    metres_east = (R_N + place.height) * np.cos(place.latitude)
    latitude = way.latitude - arm_n[:, 1] / metres_north
    longitude = way.longitude - arm_n[:, 0] / metres_east
    height = way.height - arm_n[:, 2]

    q_sb = rotation.quaternion_from_vector(-axis[:, None] * theta)
    pitch, roll, azimuth = rotation.euler_angles_of_quaternion(rotation.multiply(way.q_ns, q_sb))
    return Navigation(
        mode=mode,
        rate=run.rate,
        time=run.imu.times(span),
        latitude=latitude,
        longitude=longitude,
        height=height,
        v_n=v_n,
        pitch=pitch,
        roll=roll,
        azimuth=azimuth,
        errors=np.column_stack(
            [
                (latitude - place.latitude) * metres_north,
                (longitude - place.longitude) * metres_east,
                height - place.height,
                v_n[:, [1, 0, 2]],
                wrap_pi(pitch - place.pitch),
                wrap_pi(roll - place.roll),
                wrap_pi(azimuth - place.azimuth),
            ]
        ),
    )


class Summary:
    """The errors of a window that comes part by part: rms, greatest, final, each (11,).

    Those of ERROR_NAMES, then horizontal position (m) and velocity (m/s). time: first and last, s.
    """

    def __init__(self, mode: str, rate: float) -> None:
        self.mode, self.rate = mode, rate
        self.time = np.array([np.inf, -np.inf])
        self.errors = RunningErrors()
        self._run_away: float | None = None

    def add(self, part: Navigation) -> None:
        """Take the part that follows."""
        e = part.errors
        horizontal = [np.hypot(e[:, 0], e[:, 1]), np.hypot(e[:, 3], e[:, 4])]
        self.errors.add(np.column_stack([e, *horizontal]))
        self.time = np.array([min(self.time[0], part.time[0]), part.time[-1]])
        if self._run_away is None and self.errors.greatest[2] > _RUN_AWAY:
            self._run_away = float(part.time[np.argmax(np.abs(e[:, 2]) > _RUN_AWAY)])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Whether the height ran away."""
        if self._run_away is None:
            return ()
        return (
            f"the height has run {_RUN_AWAY / 1e3:g} km away by {self._run_away:.6g} s and spoils "
            "the rest: unaided it always does; hold it with --height hold",
        )


def _first_rate(theta: Array, interval: float) -> float:
    """Return the table rate (rad/s) at the first sample: a quintic through the first 0.4 s.

    It looks forward only, for a ramp may end where the window starts.
    """
    points = min(41, len(theta))
    x = np.linspace(-1.0, 1.0, points)
    powers = np.vander(x, min(6, points), increasing=True)
    c = np.linalg.lstsq(powers, theta[:points] - theta[0], rcond=None)[0]
    k: Array = np.arange(1, len(c), dtype=float)
    slope = -(k * c[1:]) @ (-1.0) ** k  # of the polynomial in x at x = -1
    return float(2.0 * slope / ((points - 1) * interval))
