"""What the readings of an IMU log show, and both logs of one run together: `rotcli inspect`."""

from typing import Any

import numpy as np

from rotcli.logs.plausible import check_gravity_magnitude, check_rest_readings
from rotcli.logs.record import ImuLog, TableLog
from rotcli.rig.rig import Rig
from rotcli.run.alignment.checks import check_lag
from rotcli.run.alignment.lag import find_lag
from rotcli.run.evidence.direction import sense_advice
from rotcli.run.evidence.repeats import find_repeats
from rotcli.run.segments import find_segments
from rotcli.units import DEG, PPM, FloatArray, format_span

_MAX_SEGMENTS = 12  # that are listed
_BLOCK = 0.2  # s over which rates are compared
_MIN_TURNING = 1.0 * DEG  # rad/s
_REST_TIME = 5.0  # s at the start that are compared with readings at rest
_MIN_REST_SAMPLES = 100
_MAX_REST_TURN = 0.5 * DEG  # rad, of a table at rest
_MAX_REST_SCATTER = 0.02  # of the largest specific force: an IMU at rest
_RESOLUTION_SAMPLES = 20_000
_MIN_VALUES = 3
_ROUNDING = 1e-9  # of the largest value: smaller steps are those of rounding
_MAX_SHARE_OF_VALUES = 0.5  # of the samples: more different values are no steps


def examine_readings(
    imu: ImuLog, rig: Rig, table: TableLog | None = None
) -> tuple[dict[str, Any], list[str]]:
    """Return facts about resolution, clipping and repeated rows of a log, and warnings.

    The unit of gravity and the readings at rest are checked where the log begins at rest. table:
    shows whether it does.
    """
    facts: dict[str, Any] = {}
    for sensor, unit, size in (("gyro", "deg/s", DEG), ("accel", "m/s^2", 1.0)):
        rows = [imu.column(name) for name in imu.channels if name.startswith(sensor)]
        steps = [step for step in map(_resolution, rows) if step is not None]
        name = {"gyro": "gyro", "accel": "accelerometer"}[sensor]
        if steps:
            facts[f"{name} resolution ({unit})"] = float(f"{min(steps) / size:.4g}")
        if rows:
            facts[f"largest {name} reading ({unit})"] = float(
                f"{max(float(np.abs(row).max()) for row in rows) / size:.5g}"
            )
    repeats = find_repeats(imu)
    facts["rows equal to the row before (%)"] = round(100.0 * repeats.repeated_share, 2)
    notes = [finding.text for finding in repeats.findings(imu.path)]
    count = min(imu.samples, round(_REST_TIME / imu.interval))
    gyro, accel = imu.gyro[:count], imu.accel[:count]
    if (
        count < _MIN_REST_SAMPLES
        or accel.std(axis=0).max() > _MAX_REST_SCATTER * np.abs(accel).max()
    ):
        return facts, notes
    if "accel_z" in imu.channels:
        notes += check_gravity_magnitude(imu.path, accel)
    if "gyro_z" in imu.channels and not _turns(table, float(imu.time[0])):
        notes += check_rest_readings(
            imu.path, gyro, imu.interval, rig.imu.figure("angle_random_walk")
        )
    return facts, notes


def _turns(table: TableLog | None, start: float) -> bool:
    """Return whether the table moves in the first seconds after a start (s)."""
    if table is None:
        return False
    first = (table.time >= start) & (table.time <= start + _REST_TIME)
    return bool(first.any()) and float(np.ptp(table.angle[first])) > _MAX_REST_TURN


def _resolution(row: FloatArray) -> float | None:
    """Return the smallest step between the values of a channel, None without steps."""
    values = np.unique(row[:_RESOLUTION_SAMPLES])
    if not _MIN_VALUES <= len(values) < _MAX_SHARE_OF_VALUES * min(len(row), _RESOLUTION_SAMPLES):
        return None
    steps = np.diff(values)
    return float(steps[steps > _ROUNDING * np.abs(values).max()].min())


def compare_logs(imu: ImuLog, table: TableLog, rig: Rig) -> tuple[dict[str, Any], list[str]]:
    """Return facts about overlap, axis, sense and segments, and notes with rig lines."""
    start, end = max(imu.time[0], table.time[0]), min(imu.time[-1], table.time[-1])
    if end <= start:
        offset = float(imu.time[0] - table.time[0]) + rig.table.time_offset
        note = (
            f"the logs do not overlap: the IMU log spans {format_span(imu.time[0], imu.time[-1])}, "
            f"the table log {format_span(table.time[0], table.time[-1])}. If both start together, "
            f"set [table] time_offset = {offset:.6f}"
        )
        return {"overlap (s)": 0.0}, [note]
    facts: dict[str, Any] = {"overlap": format_span(start, end)}
    notes: list[str] = []
    found = find_segments(table)
    facts["segments"] = [
        f"{format_span(s.start, s.end)}: "
        + ("still" if s.rate == 0.0 else f"{s.rate / DEG:.6g} deg/s")
        for s in found[:_MAX_SEGMENTS]
    ]
    axis = _axis_of_rotation(imu, table, start, end)
    if axis is not None:
        facts["gyro rates per table rate"] = [float(f"{v:.4g}") for v in axis]
        notes += _axis_notes(imu, axis, rig)
        _add_clocks(imu, table, axis, rig, facts, notes)
    return facts, notes


def _add_clocks(
    imu: ImuLog,
    table: TableLog,
    axis: FloatArray,
    rig: Rig,
    facts: dict[str, Any],
    notes: list[str],
) -> None:
    """Add lag and rate difference of the clocks, along the measured axis."""
    unit = axis / float(np.linalg.norm(axis))
    found = find_lag(imu, table, unit)
    if found is None:
        facts["lag of the gyro log"] = "not shown: the table rate does not change"
        return
    facts["lag of the gyro log (ms)"] = (
        f"{1e3 * found.lag + 0.0:.2f} (sigma {1e3 * found.sigma:.2f})"
    )
    facts["clock rate difference (ppm)"] = (
        f"{found.drift / PPM + 0.0:.1f} (sigma {found.drift_sigma / PPM:.1f})"
        if np.isfinite(found.drift_sigma)
        else "not significant, or changes of the rate less than 20 s apart"
    )
    notes += [
        finding.text.removeprefix(f"{imu.path}: ")
        for finding in check_lag(imu, table, unit, settings=rig.table)
    ]


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


def _axis_notes(imu: ImuLog, axis: Any, rig: Rig) -> list[str]:
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
        notes.append(f"the gyros turn in the opposite sense of the table: {sense_advice(imu, rig)}")
    elif abs(float(unit @ nominal)) < 0.9:
        components = ", ".join(f"{v:.3g}" for v in unit)
        notes.append(
            f"the gyros rotate about ({components}), [table] axis is {rig.table.axis_name}. "
            "Correct [table] axis or [imu] mount"
        )
    return notes
