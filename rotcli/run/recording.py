"""A recording: IMU log and table log of one run, their segments and windows, and their checks.

Segments and windows come from the rig or are found (`rotcli.run.stages`); the logs are compared
with each other here, with the severities of `rotcli.run.checks`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.files.toml_schema import Pair
from rotcli.logs.record import ImuLog, ImuSource, Segment, TableLog
from rotcli.rig.rig import Rig
from rotcli.run import direction, stages, stillness
from rotcli.run.alignment import check_lag
from rotcli.run.checks import Command, judge
from rotcli.run.findings import CheckError, Finding, texts
from rotcli.run.motion import IntervalMotion, motion_between
from rotcli.run.segments import find_segments
from rotcli.run.table_angle import angle_at
from rotcli.units import show_span

Array = NDArray[np.float64]

_FIRST_SAMPLES = 41  # samples of the first angles: 0.4 s at 100 Hz
_MIN_WINDOW_SAMPLES = 4  # samples: the quadrature of the strapdown needs them
_MIN_OVERLAP = 1.0  # s: shorter parts of a segment in a window are not checked


@dataclass(frozen=True, eq=False)
class NavigationRun:
    """The logs of one run and the spans of them that navigation needs.

    table: None where it is still; window and static: spans of imu; axis (3,) u in b; lever_arm
    (3,) m in s. rate: rad/s, mean table rate over the window; constant_rate: whether it is the
    only rate.
    """

    imu: ImuSource
    table: TableLog | None
    window: slice
    static: slice | None
    axis: Array
    lever_arm: Array
    rate: float
    constant_rate: bool
    log_warnings: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the warnings of reading and of the checks."""
        return (*self.log_warnings, *texts(self.findings))

    def angle(self, span: slice) -> Array:
        """Return the table angle (k,), rad, at the samples of a span."""
        return self.angle_at(self.imu.times(span))

    def angle_at(self, time: Array) -> Array:
        """Return the table angle (k,), rad, at times (k,), s."""
        return _angle(self.table, time)

    def initial_angle_and_rate(self) -> tuple[float, float]:
        """Return the table angle (rad) and rate (rad/s) at the window's first sample.

        The rate is that of a quintic through the first 0.4 s: it looks forward only, for a ramp
        may end where the window starts.
        """
        first = self.window.start
        theta = self.angle(slice(first, min(first + _FIRST_SAMPLES, self.window.stop)))
        x = np.linspace(-1.0, 1.0, len(theta))
        powers = np.vander(x, min(6, len(theta)), increasing=True)
        c = np.linalg.lstsq(powers, theta - theta[0], rcond=None)[0]
        k: Array = np.arange(1, len(c), dtype=float)
        slope = -(k * c[1:]) @ (-1.0) ** k  # of the polynomial in x at x = -1
        return float(theta[0]), float(2.0 * slope / ((len(theta) - 1) * self.imu.interval))

    def mean(self, span: slice, of: Callable[[ImuLog, Array], Array]) -> Array:
        """Return the mean (3,) over a span of what `of` makes (n, 3) of a log and table angle."""
        total = np.zeros(3)
        for piece in self.imu.pieces(span):
            total += of(piece, self.angle_at(piece.time)).sum(axis=0)
        return np.asarray(total / (span.stop - span.start))


def _angle(table: TableLog | None, time: Array) -> Array:
    return np.zeros(len(time)) if table is None else angle_at(table, time)


def navigation_run(
    imu: ImuSource, table: TableLog | None, rig: Rig, *, need_static: bool
) -> NavigationRun:
    """Return the run that is navigated; no table log means still.

    need_static: whether the still segment is needed as well. Raises LogError when the logs do not
    contain the segments or a check of severity error fails.
    """
    start, end = stages.navigation_window(rig, table, imu)
    spans, still = [(start, end)], None
    findings: list[Finding] = []
    if need_static:
        still = stages.still_segment(rig, table, imu)
        white = rig.imu.figure("angle_random_walk")
        findings += stillness.warn_segment_shortened(imu.path, rig.stages.static, still)
        findings += stillness.check_still(imu, still, white)
        spans.append((still.start, still.end))
    if table is None:
        findings += stillness.check_still_without_table(imu, start, end, still)
    else:
        findings += check_lag(imu, table, rig.table.axis, time_offset=rig.table.time_offset)
    judged = judge("navigate", findings)
    window = imu.between(start, end)
    if window.stop - window.start < _MIN_WINDOW_SAMPLES:
        raise CheckError(
            imu.path,
            "window-samples",
            f"window {show_span(start, end)} contains {window.stop - window.start} samples, at "
            f"least {_MIN_WINDOW_SAMPLES} are needed; the log covers "
            f"{show_span(imu.time[0], imu.time[-1])}",
        )
    limits = imu.between(min(span[0] for span in spans), max(span[1] for span in spans))
    motion = _window_motion(imu, table, window, limits)
    if table is not None:
        judged += judge("navigate", check_turning(imu, table, rig.table.axis, motion))
    return NavigationRun(
        imu=imu,
        table=table,
        window=window,
        static=None if still is None else imu.within(still.start, still.end),
        axis=rig.table.axis,
        lever_arm=rig.lever_arm_s,
        rate=motion.rate,
        constant_rate=motion.constant_rate,
        log_warnings=(*imu.warnings, *(table.warnings if table else ())),
        findings=judged,
    )


def _window_motion(
    imu: ImuSource, table: TableLog | None, window: slice, limits: slice
) -> IntervalMotion:
    """Return the motion of the table over a window of samples.

    limits: of all samples used. Raises LogError where the table log does not cover them.
    """
    ends = (limits.start, limits.stop - 1, window.start, window.stop - 1)
    time = np.concatenate([imu.times(slice(k, k + 1)) for k in ends])
    theta = _angle(table, time)
    return motion_between(table, float(time[2]), float(time[3]), (float(theta[2]), float(theta[3])))


def check_turning(
    imu: ImuSource, table: TableLog, axis: Array, motion: IntervalMotion
) -> tuple[Finding, ...]:
    """Compare the gyros with a table that turns: at constant rate, or as an oscillation."""
    if motion.constant_rate and abs(motion.angle) > direction.MIN_TURN_FOR_AXIS:
        segment = Segment(motion.start, motion.end, motion.rate, motion.angle)
        return direction.check_direction(imu, table, axis, segment)
    return direction.check_oscillation(imu, table, axis, motion.start, motion.end)


def check_motion(
    command: Command, imu: ImuSource, table: TableLog | None, rig: Rig, motion: IntervalMotion
) -> tuple[Finding, ...]:
    """Compare the motion of the table in an interval with that of the IMU; None: it is still.

    Raises CheckError where the IMU turns otherwise than the table, or is not still.
    """
    white, axis = rig.imu.figure("angle_random_walk"), rig.table.axis
    start, end = motion.start, motion.end
    if table is None or motion.still:
        return judge(command, stillness.check_still(imu, Segment(start, end), white))
    findings: list[Finding] = []
    for segment in find_segments(table):
        first, last = max(segment.start, start), min(segment.end, end)
        if last - first < _MIN_OVERLAP:
            continue
        segment = Segment(first, last, segment.rate, segment.rate * (last - first))
        if abs(segment.angle) > direction.MIN_TURN_FOR_AXIS:
            findings += direction.check_direction(imu, table, axis, segment)
        elif not segment.rate:
            findings += stillness.check_still(imu, segment, white)
    findings += direction.check_oscillation(imu, table, axis, start, end)
    findings += check_lag(imu, table, axis, time_offset=rig.table.time_offset)
    return judge(command, findings)


@dataclass(frozen=True)
class NamedSegment:
    """A segment for calibration, and the limits (s) that the user named for it, if any."""

    segment: Segment
    named: Pair | None


@dataclass(frozen=True)
class CalibrationRun:
    """The segments of a run that calibration uses: still, and turning at one rate each."""

    static: tuple[NamedSegment, ...]
    rotation: tuple[NamedSegment, ...]
    log_warnings: tuple[str, ...]
    findings: tuple[Finding, ...]


def calibration_run(
    imu: ImuSource, table: TableLog, rig: Rig, static: Sequence[Pair] = ()
) -> CalibrationRun:
    """Return the segments for calibration and the findings; `static` (s) overrides the rig's.

    Raises LogError when the logs do not contain them, or a check of severity error fails.
    """
    lag = check_lag(imu, table, rig.table.axis, time_offset=rig.table.time_offset)
    findings = judge("calibrate", lag)
    rigs = [rig.override({"stages": {"static": list(pair)}}) for pair in static] or [rig]
    still = [stages.still_segment(each, table, imu) for each in rigs]
    turning = stages.turning_segments(rig, table, imu)
    named = rig.stages.rotation or (None,) * len(turning)
    run = CalibrationRun(
        tuple(NamedSegment(s, each.stages.static) for s, each in zip(still, rigs, strict=True)),
        tuple(NamedSegment(s, pair) for s, pair in zip(turning, named, strict=True)),
        (*imu.warnings, *table.warnings),
        (),
    )
    checked = judge("calibrate", _check_segments(imu, table, rig, run))
    return replace(run, findings=(*findings, *checked))


def _check_segments(
    imu: ImuSource, table: TableLog, rig: Rig, run: CalibrationRun
) -> list[Finding]:
    """Compare the segments with the readings of the IMU in them."""
    white = rig.imu.figure("angle_random_walk")
    findings: list[Finding] = []
    for part in run.static:
        findings += stillness.warn_segment_shortened(table.path, part.named, part.segment)
        findings += stillness.check_still(imu, part.segment, white)
    for part in run.rotation:
        findings += stillness.warn_segment_shortened(table.path, part.named, part.segment)
    turning = [part.segment for part in run.rotation]
    return [*findings, *direction.check_segments(imu, table, rig.table.axis, turning)]
