"""The stages of a run: which stretches of its logs are still, which turn, what is navigated.

Those named under [stages] of the rig come first; what it leaves out is found from the table's
angle. Stretches are cut to what both logs cover; a log without a table is still throughout.
"""

import numpy as np

from rotcli.errors import LogError
from rotcli.logs.record import ImuSource, Segment, TableLog
from rotcli.rig.rig import Rig
from rotcli.run.segments import OTHERWISE, check_inside, find_segments, segment_between
from rotcli.units import DEG, show_span, show_time

_LONGEST_STATIC = 60.0  # s, of a log that never turns: the minute of R16 section 3


def _span(table: TableLog | None, imu: ImuSource) -> tuple[float, float]:
    """Return start and end (s) of what both logs cover."""
    start, end = float(imu.time[0]), float(imu.time[-1])
    if table is not None:
        start, end = max(start, float(table.time[0])), min(end, float(table.time[-1]))
        if start >= end:
            raise LogError(
                table.path,
                f"spans {show_span(table.time[0], table.time[-1])}, the IMU log "
                f"{show_span(imu.time[0], imu.time[-1])}: they do not overlap; check the "
                "clocks and [table] time_offset",
            )
    return start, end


def _clip(stretches: list[Segment], span: tuple[float, float], least: float) -> list[Segment]:
    """Return the stretches cut to what both logs cover, those that remain long enough."""
    cut = []
    for s in stretches:
        start, end = max(s.start, span[0]), min(s.end, span[1])
        if end - start >= least:
            cut.append(Segment(start, end, s.rate, s.rate * (end - start)))
    return cut


def still_segment(rig: Rig, table: TableLog | None, imu: ImuSource) -> Segment:
    """Return the still stretch for the biases: the rig's, else the first before turning.

    Of a log that never turns, its first minute at most.

    Raises LogError when there is none, or the rig's is not still or outside the logs.
    """
    span = _span(table, imu)
    named = rig.stages.static
    if named is not None:
        check_inside(imu.path, "the IMU log", named, (float(imu.time[0]), float(imu.time[-1])))
        if table is None:
            return Segment(*named)
        stretch = segment_between(table, *named)
        if stretch.rate != 0.0:
            what = (
                f"the table turns {stretch.angle / DEG:.6g} deg from {show_span(*named)}, which "
                "[stages] static calls still; name another stretch"
            )
            raise LogError(table.path, what)
        return stretch
    if table is None:
        return Segment(span[0], min(span[1], span[0] + _LONGEST_STATIC))
    stretches = _clip(find_segments(table), span, 1.0)
    turning = [s.start for s in stretches if s.rate != 0.0]
    still = [s for s in stretches if s.rate == 0.0]
    if not still:
        what = "the table is never still for 5 s or more; name a stretch as [stages] static"
        raise LogError(table.path, what)
    if turning:
        return next((s for s in still if s.start < turning[0]), still[0])
    return Segment(still[0].start, min(still[0].end, still[0].start + _LONGEST_STATIC))


def turning_segments(rig: Rig, table: TableLog | None, imu: ImuSource) -> list[Segment]:
    """Return the stretches turning at one rate: the rig's, else all that are found.

    Raises LogError when there is none, or one of the rig's does not turn or is outside the logs.
    """
    if table is None:
        raise LogError(imu.path, "a turning stretch is needed; give the table log as well")
    span = _span(table, imu)
    if not rig.stages.rotation:
        found = _clip([s for s in find_segments(table) if s.rate != 0.0], span, 1.0)
        if not found:
            moved = float(np.ptp(table.angle)) / DEG
            what = (
                "the table never turns at one rate for 5 s or more (it moves through "
                f"{moved:.6g} deg in all); is this the right column, and the right log?"
            )
            raise LogError(table.path, what)
        return found
    stretches = []
    for start, end in rig.stages.rotation:
        there = (float(imu.time[0]), float(imu.time[-1]))
        check_inside(imu.path, "the IMU log", (start, end), there)
        stretch = segment_between(table, start, end)
        if stretch.rate == 0.0:
            what = (
                f"the table is still from {show_span(start, end)}, which [stages] rotation calls "
                "turning; name another stretch"
            )
            raise LogError(table.path, what)
        stretches.append(stretch)
    return stretches


def navigation_window(rig: Rig, table: TableLog | None, imu: ImuSource) -> tuple[float, float]:
    """Return start and end (s) of navigation: the rig's, else what follows calibration.

    That is from the end of the rig's first rotation to the end of the logs; where the rig names
    none, the span of all turning stretches (they serve both); of a still log, what follows the
    static stretch.

    Raises LogError when it lies outside the logs or nothing is left.
    """
    span = _span(table, imu)
    if rig.stages.navigation is not None:
        check_inside(imu.path, "what the logs cover", rig.stages.navigation, span)
        return rig.stages.navigation
    if rig.stages.rotation and table is not None:
        start, end = rig.stages.rotation[0][1], span[1]
    else:
        turning = []
        if table is not None:
            turning = _clip([s for s in find_segments(table) if s.rate != 0.0], span, 1.0)
        if turning:
            return turning[0].start, turning[-1].end
        start, end = still_segment(rig, table, imu).end, span[1]
    if end - start < 1.0:
        what = (
            f"nothing is left to navigate: calibration ends at {show_time(start)} s, the logs at "
            f"{show_time(end)} s; name the stretches {OTHERWISE}"
        )
        raise LogError(imu.path, what)
    return start, end
