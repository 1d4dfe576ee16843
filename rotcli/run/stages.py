"""The stages of a run: which segments of its logs are still or turning, which window is navigated.

Those set under [stages] of the rig come first; the others are found from the table angle.
Segments are cut to the time that both logs cover; a log without a table is still.
"""

import numpy as np

from rotcli.errors import LogError
from rotcli.logs.record import ImuSource, Segment, TableLog
from rotcli.rig.rig import Rig
from rotcli.run.edges import FINE_RESOLUTION, refine_edges
from rotcli.run.findings import CheckError
from rotcli.run.motion import encoder_noise
from rotcli.run.segments import MIN_SEGMENT, check_inside, find_segments, segment_between
from rotcli.units import DEG, FloatArray, format_span, show_time

_MAX_STATIC = 60.0  # s, of a log that never turns: the minute of R16 section 3
_MIN_REMAINING = 1.0  # s of a segment, or of a window, after cutting to what both logs cover


def common_span(table: TableLog | None, imu: ImuSource) -> tuple[float, float]:
    """Return start and end (s) of the time that both logs cover."""
    start, end = float(imu.time[0]), float(imu.time[-1])
    if table is not None:
        start, end = max(start, float(table.time[0])), min(end, float(table.time[-1]))
        if start >= end:
            offset = float(imu.time[0] - table.time[0])
            raise LogError(
                table.path,
                f"covers {format_span(table.time[0], table.time[-1])}, the IMU log "
                f"{format_span(imu.time[0], imu.time[-1])}: they do not overlap; check the clocks "
                f"and [table] time_offset (add {offset:.6f} s if both logs start together)",
            )
    return start, end


def _clip(segments: list[Segment], span: tuple[float, float]) -> list[Segment]:
    """Return the segments cut to what both logs cover, those that remain long enough."""
    cut = []
    for s in segments:
        start, end = max(s.start, span[0]), min(s.end, span[1])
        if end - start >= _MIN_REMAINING:
            cut.append(Segment(start, end, s.rate, s.rate * (end - start)))
    return cut


def all_segments(table: TableLog, imu: ImuSource, axis: FloatArray) -> list[Segment]:
    """Return all segments of both logs, still and turning, edges refined by the gyros.

    axis: (3,) table axis. A coarse encoder shows a ramp too late; the gyros show it at once.
    """
    segments = _clip(find_segments(table), common_span(table, imu))
    if encoder_noise(table).resolution <= FINE_RESOLUTION:
        return segments
    return [refine_edges(imu, axis, s, MIN_SEGMENT / 2.0) for s in segments]


def still_segment(rig: Rig, table: TableLog | None, imu: ImuSource) -> Segment:
    """Return the still segment for the biases: the rig's, else the first before turning.

    Of a log that never turns, its first minute at most.

    Raises LogError when there is none, or the rig's is not still or outside the logs.
    """
    span = common_span(table, imu)
    named = rig.stages.static
    if named is not None:
        check_inside(imu.path, "the IMU log", named, (float(imu.time[0]), float(imu.time[-1])))
        if table is None:
            return Segment(*named)
        segment = segment_between(table, *named)
        if segment.rate != 0.0:
            raise CheckError(
                table.path,
                "still-segment-turns",
                f"[stages] static = [{named[0]:g}, {named[1]:g}]: the table turns "
                f"{segment.angle / DEG:.6g} deg in it; choose a still segment",
            )
        return segment
    if table is None:
        return Segment(span[0], min(span[1], span[0] + _MAX_STATIC))
    segments = _clip(find_segments(table), span)
    turning = [s.start for s in segments if s.rate != 0.0]
    still = [s for s in segments if s.rate == 0.0]
    if not still:
        raise CheckError(
            table.path,
            "no-still-segment",
            "no still segment of 5 s; record one, or segments at two rates such as 46 and -46 "
            "deg/s (these suffice for a calibration)",
        )
    if turning:
        return next((s for s in still if s.start < turning[0]), still[0])
    return Segment(still[0].start, min(still[0].end, still[0].start + _MAX_STATIC))


def turning_segments(rig: Rig, table: TableLog | None, imu: ImuSource) -> list[Segment]:
    """Return the segments turning at constant rate: the rig's, else all that are found.

    Raises LogError when there is none, or one of the rig's does not turn or is outside the logs.
    """
    if table is None:
        raise LogError(imu.path, "a turning segment is needed; give the table log as well")
    span = common_span(table, imu)
    if not rig.stages.rotation:
        found = _clip([s for s in find_segments(table) if s.rate != 0.0], span)
        if not found:
            moved = float(np.ptp(table.angle)) / DEG
            raise CheckError(
                table.path,
                "no-turning-segment",
                f"no turning segment of 5 s at constant rate (the table moves through {moved:.6g} "
                "deg in all); check the angle column, or use a steadier rate",
            )
        return found
    segments = []
    for start, end in rig.stages.rotation:
        present = (float(imu.time[0]), float(imu.time[-1]))
        check_inside(imu.path, "the IMU log", (start, end), present)
        segment = segment_between(table, start, end)
        if segment.rate == 0.0:
            raise CheckError(
                table.path,
                "turning-segment-still",
                f"[stages] rotation = [{start:g}, {end:g}]: the table is still in it; choose a "
                "turning segment",
            )
        segments.append(segment)
    return segments


def navigation_window(rig: Rig, table: TableLog | None, imu: ImuSource) -> tuple[float, float]:
    """Return start and end (s) of navigation: the rig's, else the time after calibration.

    That is from the end of the rig's first rotation to the end of the logs; where the rig has
    none, the span of all turning segments (they serve both); of a still log, the time after the
    still segment.

    Raises LogError when it lies outside the logs or nothing remains.
    """
    span = common_span(table, imu)
    if rig.stages.navigation is not None:
        check_inside(imu.path, "the time of the logs", rig.stages.navigation, span)
        return rig.stages.navigation
    if rig.stages.rotation and table is not None:
        start, end = rig.stages.rotation[0][1], span[1]
    else:
        turning = []
        if table is not None:
            turning = _clip([s for s in find_segments(table) if s.rate != 0.0], span)
        if turning:
            return turning[0].start, turning[-1].end
        start, end = still_segment(rig, table, imu).end, span[1]
    if end - start < _MIN_REMAINING:
        raise CheckError(
            imu.path,
            "no-window",
            f"nothing remains to navigate: calibration ends at {show_time(start)} s, the logs at "
            f"{show_time(end)} s; set [stages] navigation",
        )
    return start, end
