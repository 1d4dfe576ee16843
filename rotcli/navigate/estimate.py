"""Rotary inertial navigation of a log on a still table, and its errors (R16 section 2.1).

The sensor frame is mechanized. The table angle is then removed from the attitude, which equals
rotating the readings into b first (R16 (1), (2)) and needs no differenced encoder.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import CodedText
from rotcli.logs.record import ImuLog, Progress
from rotcli.models import earth, rotation, strapdown
from rotcli.models.base import FixedBase
from rotcli.models.running import RunningStatistics
from rotcli.models.sensors import TriadErrors, correct
from rotcli.navigate.place import Place
from rotcli.run.recording import NavigationRun
from rotcli.units import DEG, FloatArray

_WRONG_RATE = 0.1 * DEG  # rad/s; R16 table 7: within 0.025 deg/s after calibration
_MAX_HEIGHT_ERROR = 1e4  # m; unaided, height multiplies by e in ten minutes and soon means nothing

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
_PAIRS = ((0, 1), (3, 4))  # of ERROR_NAMES: horizontal position and velocity


@dataclass(frozen=True, eq=False)
class Navigation:
    """A navigated window: the solution and its errors against the fixed base.

    time (n,) s; latitude, longitude (n,) rad, height (n,) m of the point on the rotation axis;
    v_n (n, 3) m/s; pitch, roll, azimuth (n,) rad of the body; errors (n, 9) in the order of
    ERROR_NAMES: m, m/s, rad. rate: rad/s, mean table rate over the window.
    """

    mode: str
    rate: float
    time: FloatArray
    latitude: FloatArray
    longitude: FloatArray
    height: FloatArray
    v_n: FloatArray
    pitch: FloatArray
    roll: FloatArray
    azimuth: FloatArray
    errors: FloatArray

    @property
    def rms(self) -> FloatArray:
        """Root mean square of each error over the window, (9,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=0)))

    @property
    def final(self) -> FloatArray:
        """Errors at the end of the window, (9,)."""
        return np.asarray(self.errors[-1])

    @property
    def max(self) -> FloatArray:
        """Maximum magnitude of each error, (9,)."""
        return np.asarray(np.max(np.abs(self.errors), axis=0))


def warn_wrong_rate(run: NavigationRun, mean: FloatArray) -> tuple[str, ...]:
    """Return a warning where the window's mean corrected rate is not the table's and the Earth's.

    mean: (3,) rad/s, mean residual. The limit is four times what R16 table 7 leaves: the
    calibration is of another device or another day. For runs whose noise figures are unknown.
    """
    if np.max(np.abs(mean)) < _WRONG_RATE + 1e-3 * abs(run.rate):
        return ()
    measured = ", ".join(f"{v / DEG:.3g}" for v in mean)
    return (
        f"{run.imu.path}: after calibration the gyros are off by ({measured}) deg/s on average: is "
        "the calibration of this device and this day? calibrate again",
    )


def still_gyro_biases(run: NavigationRun, base: FixedBase) -> TriadErrors:
    """Return the gyro biases (rad/s): mean of the still segment less Earth rate."""
    if run.static is None:
        raise ValueError("the run was prepared without a still segment")

    def left(imu: ImuLog, angle: FloatArray) -> FloatArray:
        earth_rate = rotation.sum_rotated(run.axis, -angle, base.w_ie_b)
        return np.asarray(imu.gyro.sum(axis=0) - earth_rate)

    return TriadErrors(bias=run.mean(run.static, left))


def navigate(
    run: NavigationRun,
    place: Place,
    gyro_errors: TriadErrors,
    accel_errors: TriadErrors | None = None,
    *,
    mode: str,
    hold_height: bool = False,
) -> Navigation:
    """Navigate a run whose sensors have the given errors, and keep the complete solution."""
    parts = navigate_chunks(
        run, place, gyro_errors, accel_errors, mode=mode, hold_height=hold_height
    )
    complete = list(parts)

    def joined(name: str) -> FloatArray:
        return np.concatenate([getattr(part, name) for part in complete])

    return replace(
        complete[0],
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


def navigate_chunks(
    run: NavigationRun,
    place: Place,
    gyro_errors: TriadErrors,
    accel_errors: TriadErrors | None = None,
    *,
    mode: str,
    hold_height: bool = False,
    progress: Progress | None = None,
    watch: Callable[[ImuLog, FloatArray], None] | None = None,
) -> Iterator[Navigation]:
    """Navigate a run whose sensors have the given errors, yielding the window part by part.

    The start is the still base's position and attitude, at rest except for the lever arm's motion.
    progress: receives the share (0 to 1) that is done; watch: receives each chunk of the log with
    cosine and sine (2, n) of half the table angle at its samples.
    """
    imu, axis, lever_arm = run.imu, run.axis, run.lever_arm
    first, stop = run.window.start, run.window.stop
    theta, rate = run.initial_angle_and_rate()
    C_ns = place.base.C_nb @ rotation.axis_rotation(axis, theta)
    start = strapdown.InitialState(
        latitude=place.latitude,
        longitude=place.longitude,
        height=place.height,
        v_n=C_ns @ np.cross(rate * axis, lever_arm),
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
    done, before, waiting = first, np.zeros(3), np.empty((2, 0))
    for piece, last in _mark_last(imu.chunks(run.window)):
        half = 0.5 * run.angle_at(piece.time)
        turned = np.stack([np.cos(half), np.sin(half)])
        if watch:
            watch(piece, turned)
        # Samples that the mechanization keeps for its next block.
        waiting = np.concatenate([waiting, turned], axis=1)
        f_s = piece.accel if accel_errors is None else correct(accel_errors, piece.accel)
        way = carried.advance(correct(gyro_errors, piece.gyro), f_s, last=last)
        span = slice(done, done + len(way.height))
        done = span.stop
        if span.stop > span.start:
            count = len(way.height)
            part = _refer_to_axis(run, place, way, span, waiting[:, :count], mode)
            waiting = waiting[:, count:]
            before = continue_angles(part.errors.T[6:], before)
            yield part
        if progress:
            progress((done - first) / (stop - first))


def _mark_last(pieces: Iterable[ImuLog]) -> Iterator[tuple[ImuLog, bool]]:
    """Yield the pieces, and whether each is the last one."""
    waiting = None
    for piece in pieces:
        if waiting is not None:
            yield waiting, False
        waiting = piece
    if waiting is not None:
        yield waiting, True


def continue_angles(angles: FloatArray, before: FloatArray) -> FloatArray:
    """Remove, in place, the jumps of angles (3, n), rad, by a turn; return the last ones (3,).

    before: (3,) rad, those of the sample before. An error that passes half a turn continues.
    """
    low, high = np.minimum(angles.min(axis=1), before), np.maximum(angles.max(axis=1), before)
    far = high - low > np.pi
    if far.any():
        angles[far] = np.unwrap(np.column_stack([before[far], angles[far]]), axis=1)[:, 1:]
    return angles[:, -1].copy()


def _refer_to_axis(
    run: NavigationRun,
    place: Place,
    way: strapdown.Trajectory,
    span: slice,
    turned: FloatArray,
    mode: str,
) -> Navigation:
    """Return the trajectory of the point on the axis from that of the IMU, and its errors.

    turned: (2, n), cosine and sine of half the table angle.
    """
    R_M, R_N = earth.radii(place.latitude)
    metres = (R_M + place.height, (R_N + place.height) * np.cos(place.latitude))
    latitude, longitude, height, v_n = way.latitude, way.longitude, way.height, way.v_n
    if np.any(run.lever_arm):
        arm_n, arm_velocity_n = _lever_arm_in_n(run, way.q_ns, span)
        latitude = latitude - arm_n[1] / metres[0]
        longitude = longitude - arm_n[0] / metres[1]
        height = height - arm_n[2]
        v_n = v_n - arm_velocity_n.T

    q_nb = rotation.multiply_by_turn(way.q_ns, -run.axis, turned)
    pitch, roll, azimuth = rotation.euler_angles_of_quaternion(q_nb)
    reference = place.pitch, place.roll, place.azimuth
    errors = np.empty((9, len(height)))
    errors[0] = (latitude - place.latitude) * metres[0]
    errors[1] = (longitude - place.longitude) * metres[1]
    errors[2] = height - place.height
    errors[3], errors[4], errors[5] = v_n[:, 1], v_n[:, 0], v_n[:, 2]
    errors[6:] = rotation.attitude_errors(q_nb, (pitch, roll, azimuth), reference)
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
        errors=errors.T,
    )


def _lever_arm_in_n(
    run: NavigationRun, q_ns: FloatArray, span: slice
) -> tuple[FloatArray, FloatArray]:
    """Return the lever arm (3, n), m, and its velocity (3, n), m/s, in n at the samples of a span.

    The table rate is the central difference of the angle.
    """
    window = run.window
    wider = slice(max(span.start - 1, window.start), min(span.stop + 1, window.stop))
    inside = slice(span.start - wider.start, span.stop - wider.start)
    rate = np.gradient(run.angle(wider), run.imu.interval)[inside]
    arm_s = np.broadcast_to(run.lever_arm[:, None], (3, len(rate)))
    velocity_s = np.cross(run.axis, run.lever_arm)[:, None] * rate
    return rotation.rotate(q_ns, arm_s), rotation.rotate(q_ns, velocity_s)


def _with_horizontal(figures: FloatArray) -> FloatArray:
    """Return figures (9,) followed by the root sum of squares of each of _PAIRS, (11,)."""
    return np.concatenate([figures, [np.hypot(figures[i], figures[j]) for i, j in _PAIRS]])


class Summary:
    """The errors of a window that comes part by part: rms, max, final, each (11,).

    Those of ERROR_NAMES, then horizontal position (m) and velocity (m/s). time: first and last, s.
    """

    def __init__(self, mode: str, rate: float) -> None:
        self.mode, self.rate = mode, rate
        self.time = np.array([np.inf, -np.inf])
        self._errors = RunningStatistics()
        self._max_horizontal = np.zeros(len(_PAIRS))
        self._run_away: float | None = None

    def add(self, part: Navigation) -> None:
        """Take the part that follows."""
        self._errors.add(part.errors)
        rows = part.errors.T
        squares = [float((rows[i] * rows[i] + rows[j] * rows[j]).max()) for i, j in _PAIRS]
        self._max_horizontal = np.maximum(self._max_horizontal, np.sqrt(squares))
        self.time = np.array([min(self.time[0], part.time[0]), part.time[-1]])
        if self._run_away is None and self._errors.max[2] > _MAX_HEIGHT_ERROR:
            self._run_away = float(part.time[np.argmax(np.abs(rows[2]) > _MAX_HEIGHT_ERROR)])

    @property
    def rms(self) -> FloatArray:
        """Root mean square of each error, (11,)."""
        return _with_horizontal(self._errors.rms)

    @property
    def max(self) -> FloatArray:
        """Largest magnitude of each error, (11,)."""
        return np.concatenate([self._errors.max, self._max_horizontal])

    @property
    def final(self) -> FloatArray:
        """Each error at the end of the window, (11,)."""
        return _with_horizontal(self._errors.final)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Whether the height ran away."""
        if self._run_away is None:
            return ()
        text = (
            f"the unaided height error exceeds {_MAX_HEIGHT_ERROR / 1e3:g} km at "
            f"{self._run_away:.6g} s. Later results are invalid; use the height hold"
        )
        return (CodedText("height-diverges", text),)
