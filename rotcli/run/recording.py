"""A run: its two logs taken together, cut to the stretches that serve, checked against each other.

What is cut is told by the rig or found (`run_stages`); whether the table's angle and the IMU's
readings belong together and keep still or turn as they should is looked at here (`checks`, `lag`).
Assumes logs on one clock. Faults raise, what is doubtful becomes a warning.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.files.toml_schema import Pair
from rotcli.logs.record import ImuLog, ImuSource, Segment, TableLog
from rotcli.rig.rig import Rig
from rotcli.run import checks, segments, stages
from rotcli.run.lag import check_lag
from rotcli.run.motion import MIN_TURN_FOR_AXIS, check_oscillation
from rotcli.units import DEG, show_span

Array = NDArray[np.float64]

_STEADY = 1.0 * DEG  # rad, how far the angle of one constant rate may stray from a line
_FIRST = 41  # samples: 0.4 s at 100 Hz


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
    warnings: tuple[str, ...]

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
        theta = self.angle(slice(first, min(first + _FIRST, self.window.stop)))
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
    return np.zeros(len(time)) if table is None else segments.angle_at(table, time)


def navigation_run(
    imu: ImuSource, table: TableLog | None, rig: Rig, *, need_static: bool
) -> NavigationRun:
    """Return the run that is navigated; no table log means still.

    need_static: whether the still stretch is needed as well. Raises LogError when the logs do not
    hold the stretches or the table turns otherwise than the rig says.
    """
    axis = rig.table.axis
    warnings = [*imu.warnings, *(table.warnings if table else ())]
    start, end = stages.navigation_window(rig, table, imu)
    spans = [(start, end)]
    static = None
    if need_static:
        static = stages.still_segment(rig, table, imu)
        warnings += checks.warn_segment_shortened(imu.path, rig.stages.static, static)
        warnings += checks.check_still(imu, static, rig.imu.figure("angle_random_walk"))
        spans.append((static.start, static.end))
    if table is None:
        checks.check_still_without_table(imu, start, end, static)
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
    rate, constant_rate = _rate(imu, table, axis, window, limits)
    return NavigationRun(
        imu=imu,
        table=table,
        window=window,
        static=None if static is None else imu.within(static.start, static.end),
        axis=axis,
        lever_arm=rig.lever_arm_s,
        rate=rate,
        constant_rate=constant_rate,
        warnings=tuple(warnings),
    )


def _rate(
    imu: ImuSource, table: TableLog | None, axis: Array, window: slice, limits: slice
) -> tuple[float, bool]:
    """Return the window's mean table rate (rad/s), and whether it is the one rate.

    limits: of all that is used of the log. Raises LogError where the table log does not reach
    them, or turns otherwise than the IMU.
    """
    ends = (limits.start, limits.stop - 1, window.start, window.stop - 1)
    time = np.concatenate([imu.times(slice(k, k + 1)) for k in ends])
    theta = _angle(table, time)
    start, end, turned = float(time[2]), float(time[3]), float(theta[3] - theta[2])
    rate = float((theta[3] - theta[2]) / (time[3] - time[2]))
    if table is None:
        return rate, True
    constant_rate = segments.max_angle_deviation(table, start, end, float(theta[2]), rate) < _STEADY
    if abs(turned) > MIN_TURN_FOR_AXIS and constant_rate:
        checks.check_direction(imu, table, axis, Segment(start, end, rate, turned))
    else:
        check_oscillation(imu, table, axis, start, end)
    return rate, constant_rate


@dataclass(frozen=True)
class NamedSegment:
    """A stretch that serves calibration, and the limits (s) that the user named for it, if any."""

    stretch: Segment
    named: Pair | None


@dataclass(frozen=True)
class CalibrationRun:
    """The stretches of a run that calibration takes: still ones, and turning at one rate each."""

    static: tuple[NamedSegment, ...]
    rotation: tuple[NamedSegment, ...]
    warnings: tuple[str, ...]


def calibration_run(
    imu: ImuSource, table: TableLog, rig: Rig, static: Sequence[Pair] = ()
) -> CalibrationRun:
    """Find the stretches for calibration; `static` (s) stands for the rig's still one.

    Raises LogError when the logs do not hold them, or one log lags the other.
    """
    offset = rig.table.time_offset
    warnings = [*imu.warnings, *table.warnings]
    warnings += check_lag(imu, table, rig.table.axis, time_offset=offset, strict=True)
    rigs = [rig.override({"stages": {"static": list(pair)}}) for pair in static] or [rig]
    still = [stages.still_segment(each, table, imu) for each in rigs]
    turning = stages.turning_segments(rig, table, imu)
    named = rig.stages.rotation or (None,) * len(turning)
    return CalibrationRun(
        tuple(NamedSegment(s, each.stages.static) for s, each in zip(still, rigs, strict=True)),
        tuple(NamedSegment(s, pair) for s, pair in zip(turning, named, strict=True)),
        tuple(warnings),
    )


def check_calibration_run(
    imu: ImuSource, table: TableLog, rig: Rig, found: CalibrationRun
) -> tuple[str, ...]:
    """Compare the stretches with what the IMU feels in them; return warnings.

    Raises LogError for a still one that clearly moves, a turning one that turns otherwise.
    """
    white = rig.imu.figure("angle_random_walk")
    warnings: list[str] = []
    for part in found.static:
        warnings += checks.warn_segment_shortened(table.path, part.named, part.stretch)
        warnings += checks.check_still(imu, part.stretch, white)
    for part in found.rotation:
        warnings += checks.warn_segment_shortened(table.path, part.named, part.stretch)
    for part in found.rotation:
        checks.check_direction(imu, table, rig.table.axis, part.stretch)
    return tuple(warnings)
