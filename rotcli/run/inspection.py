"""Compare the IMU log and the table log of one run, for `rotcli inspect`."""

from typing import Any

import numpy as np

from rotcli.logs.record import ImuLog, TableLog
from rotcli.rig.rig import Rig
from rotcli.run.segments import find_segments
from rotcli.units import DEG, show_span

_MAX_SEGMENTS = 12  # that are listed
_BLOCK = 0.2  # s over which rates are compared
_MIN_TURNING = 1.0 * DEG  # rad/s


def compare_logs(imu: ImuLog, table: TableLog, rig: Rig) -> tuple[dict[str, Any], list[str]]:
    """Return facts about overlap, axis, sense and segments, and notes with rig lines."""
    start, end = max(imu.time[0], table.time[0]), min(imu.time[-1], table.time[-1])
    if end <= start:
        offset = float(imu.time[0] - table.time[0]) + rig.table.time_offset
        note = (
            f"the logs do not overlap: the IMU log spans {show_span(imu.time[0], imu.time[-1])}, "
            f"the table log {show_span(table.time[0], table.time[-1])}. If both start together, "
            f"set [table] time_offset = {offset:.6f}"
        )
        return {"overlap (s)": 0.0}, [note]
    facts: dict[str, Any] = {"overlap": show_span(start, end)}
    notes: list[str] = []
    found = find_segments(table)
    facts["segments"] = [
        f"{show_span(s.start, s.end)}: "
        + ("still" if s.rate == 0.0 else f"{s.rate / DEG:.6g} deg/s")
        for s in found[:_MAX_SEGMENTS]
    ]
    axis = _axis_of_rotation(imu, table, start, end)
    if axis is not None:
        facts["gyro rates per table rate"] = [float(f"{v:.4g}") for v in axis]
        notes += _axis_notes(axis, rig)
    return facts, notes


def _axis_of_rotation(imu: ImuLog, table: TableLog, start: float, end: float) -> Any:
    """Return the gyro rates per table rate (3,), None where the table does not turn."""
    edges = np.arange(start, end, _BLOCK)
    if len(edges) < 10:
        return None
    rate = np.diff(np.interp(edges, table.time, table.angle)) / _BLOCK
    sums = np.vstack([np.zeros((1, 3)), np.cumsum(imu.gyro, axis=0)]) * imu.interval
    stamps = np.append(imu.time[0] - imu.interval, imu.time)
    gyro = np.stack([np.diff(np.interp(edges, stamps, column)) for column in sums.T], axis=1)
    gyro /= _BLOCK
    turning = np.abs(rate) > _MIN_TURNING
    if np.count_nonzero(turning) < 10 or np.isnan(gyro).any():
        return None
    return gyro[turning].T @ rate[turning] / float(rate[turning] @ rate[turning])


def _axis_notes(axis: Any, rig: Rig) -> list[str]:
    """Return what the measured axis says about [table] axis, direction and units."""
    size = float(np.linalg.norm(axis))
    unit = axis / size
    nominal = rig.table.axis
    notes = []
    if size * DEG < 1.0 / 1.2 or size * DEG > 1.2:
        if not 0.8 < size < 1.25:
            factor = "deg/s" if abs(size * DEG - 1.0) < 0.2 else "another unit"
            notes.append(
                f"the gyros read {size:.4g} times the table rate: one log is in {factor}. Set "
                "[imu] units gyro or [table] units"
            )
    else:
        notes.append(
            f"the gyros read {size:.4g} times the table rate, which is 180/pi: set [imu] units = "
            '{ gyro = "deg/s" } or [table] units = "deg"'
        )
    if float(unit @ nominal) < -0.9:
        notes.append(
            "the gyros turn in the opposite sense of the table. Set [table] direction = "
            f"{-rig.table.direction}, or [imu] frame if the IMU points down"
        )
    elif abs(float(unit @ nominal)) < 0.9:
        components = ", ".join(f"{v:.3g}" for v in unit)
        notes.append(
            f"the gyros rotate about ({components}), [table] axis is {rig.table.axis_name}. "
            "Correct [table] axis or [imu] mount"
        )
    return notes
