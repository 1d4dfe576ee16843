"""A recording: IMU log and table log of one run, their segments and windows, and their checks.

Segments and windows come from the rig or are found (`rotcli.run.stages`); the logs are compared
with each other here, with the severities of `rotcli.run.checks`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.files.toml_schema import Pair
from rotcli.logs.record import ImuLog, ImuSource, Segment, TableLog
from rotcli.rig.rig import Rig
from rotcli.run import stages
from rotcli.run.alignment.checks import check_alignment
from rotcli.run.checks import Command, judge
from rotcli.run.evidence import direction, stillness
from rotcli.run.evidence.leaps import LEAP, SMALL_LEAP, check_leaps
from rotcli.run.evidence.records import check_record_interval
from rotcli.run.evidence.repeats import find_repeats
from rotcli.run.findings import CheckError, Finding, texts
from rotcli.run.motion import IntervalMotion, encoder_noise, motion_between
from rotcli.run.segments import find_segments, segment_eccentricity
from rotcli.run.table_angle import angle_at
from rotcli.units import DEG, FloatArray, format_span

_FIRST_SAMPLES = 41  # samples of the first angles: 0.4 s at 100 Hz
_MIN_WINDOW_SAMPLES = 4  # samples: the quadrature of the strapdown needs them
SAME_RATE = 1e-3  # of a rate: two that differ by less are one
_OVERLAP_TOLERANCE = 0.1  # s: segments named by round numbers may share an end
_MIN_UNEVEN_ANGLE = 0.5 * np.pi  # rad of motion at changing rates: a quarter of a turn
# rad: at 30 deg/s for a minute it changes the rate by 20 ppm, a seventh of the sigma of MEMS gyros
_MIN_ECCENTRICITY = 0.03 * DEG
_MIN_TURN = 2.0 * np.pi  # rad in a window: with less a leap need not be the cause of its rate
_MIN_OVERLAP = 1.0  # s: shorter parts of a segment in a window are not checked


@dataclass(frozen=True, eq=False)
class NavigationRun:
    """The logs of one run and the spans of them that navigation needs.

    table: None where it is still; window and static: spans of imu; axis (3,) u in b; lever_arm
    (3,) m in s. rate: rad/s, mean table rate over the window; constant_rate: whether it is the
    only rate. still: the still segment, if it was asked for and its checks found nothing.
    """

    imu: ImuSource
    table: TableLog | None
    window: slice
    static: slice | None
    axis: FloatArray
    lever_arm: FloatArray
    rate: float
    constant_rate: bool
    log_warnings: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    still: Segment | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the warnings of reading and of the checks."""
        return (*self.log_warnings, *texts(self.findings))

    def angle(self, span: slice) -> FloatArray:
        """Return the table angle (k,), rad, at the samples of a span."""
        return self.angle_at(self.imu.times(span))

    def angle_at(self, time: FloatArray) -> FloatArray:
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
        k: FloatArray = np.arange(1, len(c), dtype=float)
        slope = -(k * c[1:]) @ (-1.0) ** k  # of the polynomial in x at x = -1
        return float(theta[0]), float(2.0 * slope / ((len(theta) - 1) * self.imu.interval))

    def mean(self, span: slice, of: Callable[[ImuLog, FloatArray], FloatArray]) -> FloatArray:
        """Return the mean (3,) over a span; of: the sum (3,) over a part and its table angle."""
        total = np.zeros(3)
        for piece in self.imu.chunks(span):
            total += of(piece, self.angle_at(piece.time))
        return np.asarray(total / (span.stop - span.start))


def _angle(table: TableLog | None, time: FloatArray) -> FloatArray:
    return np.zeros(len(time)) if table is None else angle_at(table, time)


def navigation_run(
    imu: ImuSource, table: TableLog | None, rig: Rig, *, need_static: bool
) -> NavigationRun:
    """Return the run that is navigated; no table log means still.

    need_static: whether the still segment is needed as well. Raises LogError when the logs do not
    contain the segments or a check of severity error fails.
    """
    if table is not None:
        judge("navigate", check_record_interval(imu, table, rig.table.axis))
    start, end = stages.navigation_window(rig, table, imu)
    spans, still = [(start, end)], None
    findings: list[Finding] = []
    if need_static:
        still = stages.still_segment(rig, table, imu)
        white = rig.imu.figure("angle_random_walk")
        findings += stillness.warn_segment_shortened(imu.path, rig.stages.static, still)
        findings += stillness.check_still(imu, still, white)
        spans.append((still.start, still.end))
    calm = None if findings else still
    if table is None:
        findings += stillness.check_still_without_table(imu, start, end, still)
        findings += find_repeats(imu).findings(imu.path)
    else:
        findings += check_alignment(imu, table, rig)
    judged = judge("navigate", findings)
    window = imu.between(start, end)
    if window.stop - window.start < _MIN_WINDOW_SAMPLES:
        raise CheckError(
            imu.path,
            "window-samples",
            f"window {format_span(start, end)} contains {window.stop - window.start} samples, at "
            f"least {_MIN_WINDOW_SAMPLES} are needed; the log covers "
            f"{format_span(imu.time[0], imu.time[-1])}",
        )
    limits = imu.between(min(span[0] for span in spans), max(span[1] for span in spans))
    motion = _window_motion(imu, table, window, limits)
    if table is not None:
        leaps = check_leaps(table, motion.start, motion.end, encoder_noise(table).resolution, LEAP)
        if leaps and not motion.constant_rate and abs(motion.angle) > _MIN_TURN:
            path, _, message = leaps[0].text.partition(": ")
            raise CheckError(path, leaps[0].code, message)
        judged += judge("navigate", (*leaps, *check_turning(imu, table, rig, motion)))
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
        still=calm,
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
    imu: ImuSource, table: TableLog, rig: Rig, motion: IntervalMotion
) -> tuple[Finding, ...]:
    """Compare the gyros with a table that turns: at constant rate, or as an oscillation."""
    if motion.constant_rate and abs(motion.angle) > direction.MIN_TURN_FOR_AXIS:
        segment = Segment(motion.start, motion.end, motion.rate, motion.angle)
        return direction.check_direction(imu, table, rig, segment)
    return direction.check_oscillation(imu, table, rig, motion.start, motion.end)


def check_motion(
    command: Command, imu: ImuSource, table: TableLog | None, rig: Rig, motion: IntervalMotion
) -> tuple[Finding, ...]:
    """Compare the motion of the table in an interval with that of the IMU; None: it is still.

    Raises CheckError where the IMU turns otherwise than the table, or is not still.
    """
    white = rig.imu.figure("angle_random_walk")
    start, end = motion.start, motion.end
    if table is None or motion.still:
        still = stillness.check_still(imu, Segment(start, end), white)
        return judge(command, (*still, *find_repeats(imu).findings(imu.path)))
    judge(command, check_record_interval(imu, table, rig.table.axis))
    findings = [*check_leaps(table, start, end, encoder_noise(table).resolution, LEAP)]
    for segment in find_segments(table):
        first, last = max(segment.start, start), min(segment.end, end)
        if last - first < _MIN_OVERLAP:
            continue
        segment = Segment(first, last, segment.rate, segment.rate * (last - first))
        if abs(segment.angle) > direction.MIN_TURN_FOR_AXIS:
            findings += direction.check_direction(imu, table, rig, segment)
        elif not segment.rate:
            findings += stillness.check_still(imu, segment, white)
    findings += direction.check_oscillation(imu, table, rig, start, end)
    findings += check_alignment(imu, table, rig)
    return judge(command, findings)


@dataclass(frozen=True)
class NamedSegment:
    """A segment for calibration, and the limits (s) that the user named for it, if any."""

    segment: Segment
    named: Pair | None


@dataclass(frozen=True)
class CalibrationRun:
    """The segments of a run that calibration uses: still, and turning at one rate each.

    uneven: the interval in which the table moves at changing rates, where there are no segments
    at two rates; then static and rotation are empty.
    """

    static: tuple[NamedSegment, ...]
    rotation: tuple[NamedSegment, ...]
    log_warnings: tuple[str, ...]
    findings: tuple[Finding, ...]
    uneven: Segment | None = None

    @property
    def segments(self) -> list[Segment]:
        """All segments, still first."""
        return [part.segment for part in (*self.static, *self.rotation)]


def calibration_run(
    imu: ImuSource, table: TableLog, rig: Rig, static: Sequence[Pair] = ()
) -> CalibrationRun:
    """Return the segments for calibration and the findings; `static` (s) overrides the rig's.

    All still and turning segments that are found serve, unless the rig names them. Raises LogError
    when the logs do not contain them, or a check of severity error fails.
    """
    found = (*check_record_interval(imu, table, rig.table.axis), *check_alignment(imu, table, rig))
    findings = judge("calibrate", found)
    still, turning = _calibration_segments(imu, table, rig, static)
    warnings = (*imu.warnings, *table.warnings)
    if not _separable([part.segment for part in (*still, *turning)]):
        uneven = _uneven(imu, table, rig)
        if uneven is not None:
            return CalibrationRun((), (), warnings, findings, uneven)
        stages.turning_segments(rig, table, imu)  # raises if none turns
    run = CalibrationRun(tuple(still), tuple(turning), warnings, ())
    checked = judge("calibrate", _check_segments(imu, table, rig, run))
    return replace(run, findings=(*findings, *checked))


def _calibration_segments(
    imu: ImuSource, table: TableLog, rig: Rig, static: Sequence[Pair]
) -> tuple[list[NamedSegment], list[NamedSegment]]:
    """Return the still and the turning segments: those named, else all found."""
    named = tuple(static) or ((rig.stages.static,) if rig.stages.static else ())
    rigs = [rig.override({"stages": {"static": list(pair)}}) for pair in named]
    still = [
        NamedSegment(stages.still_segment(each, table, imu), each.stages.static) for each in rigs
    ]
    turning = []
    if rig.stages.rotation:
        found = stages.turning_segments(rig, table, imu)
        turning = [NamedSegment(s, p) for s, p in zip(found, rig.stages.rotation, strict=True)]
    if not named or not turning:
        all_found = stages.all_segments(table, imu, rig.table.axis)
        if not named:
            still = [NamedSegment(s, None) for s in all_found if s.rate == 0.0]
        if not turning:
            turning = [NamedSegment(s, None) for s in all_found if s.rate != 0.0]
    _check_overlap(table.path, [*still, *turning])
    return still, turning


def _check_overlap(path: str, segments: Sequence[NamedSegment]) -> None:
    """Raise CheckError where segments overlap: no sample may count twice."""
    ordered = sorted((part.segment.start, part.segment.end) for part in segments)
    for (a, b), (c, d) in pairwise(ordered):
        if c < b - _OVERLAP_TOLERANCE:
            raise CheckError(
                path,
                "segment-overlap",
                f"the segments {format_span(a, b)} and {format_span(c, d)} overlap, so samples "
                "would count twice; correct [stages]",
            )


def _separable(segments: Sequence[Segment]) -> bool:
    """Return whether the segments have two rates, so that bias and scale factor separate."""
    if not segments:
        return False
    rates = np.array([s.rate for s in segments])
    return bool(np.ptp(rates) > SAME_RATE * np.max(np.abs(rates)))


def _uneven(imu: ImuSource, table: TableLog, rig: Rig) -> Segment | None:
    """Return the interval of a table that moves at changing rates, None if it does not.

    It is checked as an oscillation: axis, sense and rate of the gyros.
    """
    start, end = stages.common_span(table, imu)
    motion = motion_between(table, start, end)
    if motion.constant_rate or motion.angle_range < _MIN_UNEVEN_ANGLE:
        return None
    judge("calibrate", direction.check_oscillation(imu, table, rig, start, end))
    return Segment(start, end, motion.rate, motion.angle)


def check_eccentricity(table: TableLog, turning: Sequence[Segment]) -> list[Finding]:
    """Return the finding of an encoder whose error once per turn matters."""
    for segment in turning:
        found = segment_eccentricity(table, segment)
        if found is not None and found.amplitude > _MIN_ECCENTRICITY:
            where = format_span(segment.start, segment.end)
            text = (
                f"{table.path}: segment {where}: the encoder has an error of "
                f"{found.amplitude / DEG:.3g} deg once per turn (eccentric); it averages out over "
                "full turns"
            )
            values = found.amplitude / DEG, _MIN_ECCENTRICITY / DEG
            return [Finding("encoder-eccentricity", text, "warning", where, *values, "deg")]
    return []


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
    findings += check_eccentricity(table, turning)
    resolution = encoder_noise(table).resolution
    for segment in turning:
        findings += check_leaps(table, segment.start, segment.end, resolution, SMALL_LEAP)
    return [*findings, *direction.check_segments(imu, table, rig, turning)]
