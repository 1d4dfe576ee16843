"""Log files of an IMU or a reference to validated records; a table's are read in `table_log`.

`read_imu`, `read_reference`; these rooms alone know column names and file units. Units come from
the bracket in the column name, else from the Parquet field, else from the rig, else SI. What
stands in the file is read in `readings`, the clock is set straight in `clock`.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.files.columns import write_columns
from rotcli.logs import plausible
from rotcli.logs.clock import Line, literal_line, resample, spread, straight_line
from rotcli.logs.columns import Loaded, load
from rotcli.logs.header import MAX_BYTES, Progress, open_log
from rotcli.logs.readings import (
    READING_LIMITS,
    Limit,
    check_size,
    check_time_unit,
    check_times,
    read_readings,
    read_times,
    require,
    unit_factor,
)
from rotcli.logs.record import ImuLog, ReferenceLog
from rotcli.rig.formats import AXES
from rotcli.rig.rig import ImuSettings, Rig
from rotcli.units import factor, show_span, show_time

__all__ = ["read_imu", "read_reference", "write_columns"]

Array = NDArray[np.float64]

_REFERENCE = {
    "latitude": "angle",
    "longitude": "angle",
    "height": "length",
    "v_east": "velocity",
    "v_north": "velocity",
    "v_up": "velocity",
}
_REFERENCE_LIMITS: dict[str, Limit] = {
    "latitude": (0.5 * math.pi, "rad", "latitude"),
    "longitude": (2.0 * math.pi, "rad", "longitude"),
    "height": (1e6, "m", "height of a vehicle"),
    **dict.fromkeys(("v_east", "v_north", "v_up"), (10000.0, "m/s", "velocity of a vehicle")),
}


def read_imu(
    path: str | Path,
    rig: Rig,
    *,
    max_gap: int | None = 5,
    table_log: str | Path | None = None,
    progress: Progress | None = None,
    max_bytes: int = MAX_BYTES,
) -> ImuLog:
    """Read an IMU log into the sensor frame, evenly sampled.

    Gaps up to `max_gap` samples are bridged by straight lines, marked in `missing` and told in
    `warnings`; None bridges every gap. table_log: the file read as that, for messages.
    progress: told how much (0 to 1) is read. max_bytes: that may be read at most.

    Raises LogError when the file cannot be read, a column is missing, a number or time is at
    fault, or a gap is longer than `max_gap`.
    """
    imu = rig.imu
    found = read_readings(path, rig, progress, table_log, max_bytes)
    loaded, time, values, warnings = found.loaded, found.time, found.values, found.warnings
    header = loaded.header
    check_size(loaded, values, AXES, READING_LIMITS)
    plausible.check_median_rate(header.path, time)
    line = straight_line(time)
    literal = line is None or imu.clock == "stamps"
    if line is None:
        line = literal_line(time)
    plausible.check_rate(header.path, line.interval)
    warnings += plausible.check_axes(header.path, time, values)
    if imu.clock == "regular":
        warnings += clock_warnings(header.path, line, time if literal else None)
    if found.increments:
        values[:, 1:] /= np.diff(time) if literal else line.interval
        values[:, 0] /= line.interval
        if literal:  # after a gap, the increment of one interval only
            after = np.flatnonzero(np.diff(line.index) > 1) + 1
            values[:, after] *= np.diff(time)[after - 1] / line.interval
    warnings += _gap_warnings(loaded, time, line, max_gap)
    for clipped, part in zip(clipping(imu), (values[:3], values[3:]), strict=True):
        clipped.add(time, part)
        warnings += clipped.warnings(header.path)

    averages = imu.sampling != "instant"
    if literal:
        time, values, missing = resample(time, values, line, averages=averages)
    else:
        values, missing = spread(values, line)
        time = line.times()
    gyro, accel = values[:3], values[3:]
    if not np.array_equal(imu.mount, np.eye(3)):
        gyro, accel = imu.mount.T @ gyro, imu.mount.T @ accel
    return ImuLog(
        path=header.path,
        time=time,
        gyro=gyro.T,
        accel=accel.T,
        interval=line.interval,
        sampling="average" if averages else "instant",
        missing=missing,
        rows=loaded.rows,
        warnings=tuple(warnings),
        stamp=header.stamp,
    )


def clipping(imu: ImuSettings) -> tuple["Clipped", "Clipped"]:
    """Return what counts the clipped samples of the gyros and of the accelerometers."""
    gyro = Clipped(imu.gyro_range, "gyro", "deg/s")
    return gyro, Clipped(imu.accel_range, "accel", "m/s^2")


def clock_warnings(path: str, line: Line, literal: Array | None) -> list[str]:
    """Return what a user must know of the clock; literal: the stamps, where they were kept."""
    rate = f"{1.0 / line.interval:.6g} Hz"
    if literal is not None:
        time = literal
        worst = int(np.argmax(np.abs(time - line.start - line.interval * line.index)))
        return [
            f"{path}: the time stamps do not keep to an even clock of {rate} (they stray by up to "
            f"{line.largest:.3g} s, near {show_time(time[worst])} s); they were taken literally"
        ]
    if line.largest > plausible.JITTER_WORTH_TELLING * line.interval:
        return [
            f"{path}: the time stamps jitter by up to {line.largest:.2g} s (rms {line.rms:.2g} s) "
            f"about an even {rate}; the even clock was used"
        ]
    return []


def _gap_warnings(loaded: Loaded, time: Array, line: Line, max_gap: int | None) -> list[str]:
    """Return the warning about bridged gaps; raise LogError for one that is too long."""
    lost = np.diff(line.index) - 1
    gaps = np.flatnonzero(lost > 0)
    limit = longest_gap(loaded.rows, max_gap)
    if gaps.size and lost.max() > limit:
        i = int(np.argmax(lost > limit))
        raise too_long(loaded, i + 1, int(lost[i]), (float(time[i]), float(time[i + 1])), max_gap)
    return gap_warnings(loaded.header.path, [(float(time[i]), int(lost[i])) for i in gaps])


def longest_gap(rows: int, max_gap: int | None) -> int:
    """Return how many samples may be lost at once in a log of `rows` records."""
    # Even where every gap is bridged, a clock that jumps must not fill the memory.
    return 10 * rows + 1_000_000 if max_gap is None else max_gap


def too_long(
    loaded: Loaded, record: int, lost: int, span: tuple[float, float], max_gap: int | None
) -> LogError:
    """Return the error of a gap before a record that is too long to be bridged."""
    advice = "cut the log there" if max_gap is None else "cut the log there or raise --max-gap"
    what = (
        f"{lost} samples missing from {show_span(*span)}, more than "
        f"{longest_gap(loaded.rows, max_gap)}; {advice}"
    )
    return LogError(loaded.header.path, what, row=loaded.row(record), column="time")


def gap_warnings(path: str, gaps: list[tuple[float, int]]) -> list[str]:
    """Return the warning about bridged gaps: the time before each (s), the samples lost."""
    if not gaps:
        return []
    total = sum(lost for _, lost in gaps)
    places = ", ".join(f"{show_time(time)} s ({lost})" for time, lost in gaps[:3])
    more = f" and {len(gaps) - 3} more" if len(gaps) > 3 else ""
    gap, sample = ("gap" if len(gaps) == 1 else "gaps"), ("sample" if total == 1 else "samples")
    advice = "leave those parts out, or find what the logger lost"
    return [f"{path}: {len(gaps)} {gap} ({total} {sample}) bridged, after {places}{more}; {advice}"]


class Clipped:
    """Counts the samples at or past a range, axis by axis, piece by piece."""

    def __init__(self, limit: float | None, kind: str, unit: str) -> None:
        self.limit, self.kind, self.unit = limit, kind, unit
        self.counts = [0, 0, 0]
        self.first = [0.0, 0.0, 0.0]

    def add(self, time: Array, values: Array) -> None:
        """Look at values (3, n), SI, at times (n,), s."""
        if self.limit is None:
            return
        for k, column in enumerate(values):
            # Seven digits are all that a log in single precision has.
            edge = self.limit * (1.0 - 1e-7)
            if max(column.max(), -column.min()) < edge:
                continue
            clipped = np.abs(column) >= edge
            self.first[k] = self.first[k] if self.counts[k] else float(time[np.argmax(clipped)])
            self.counts[k] += int(np.count_nonzero(clipped))

    def warnings(self, path: str) -> list[str]:
        """Return what a user must know of each axis."""
        if self.limit is None:
            return []
        shown = self.limit / (factor(self.unit, "rate", "acceleration") or 1.0)
        return [
            f"{path}: {self.kind}_{name}: {count} {'sample' if count == 1 else 'samples'} at or "
            f"past the range of {shown:.6g} {self.unit}, first at {show_time(first)} s; leave that "
            "part out, or turn slower"
            for name, count, first in zip("xyz", self.counts, self.first, strict=True)
            if count
        ]


def read_reference(path: str | Path, *, max_bytes: int = MAX_BYTES) -> ReferenceLog:
    """Read a reference log: `time` and whichever of position and velocity are there.

    max_bytes: that may be read at most. Raises LogError when the file cannot be read, none of
    the columns is there, or a number is at fault.
    """
    header = open_log(path, max_bytes=max_bytes)
    time_column = require(header, "time", None, "rename the column")
    there = {name: header.find(name) for name in _REFERENCE}
    wanted = {name: column for name, column in there.items() if column is not None}
    if not wanted:
        what = f"no reference column; at least one of {', '.join(_REFERENCE)} is needed"
        raise LogError(header.path, what)
    warnings: list[str] = []
    scale = unit_factor(header, time_column, "time", None, "", warnings)
    scales = [
        unit_factor(header, column, _REFERENCE[name], None, "", warnings)
        for name, column in wanted.items()
    ]
    loaded = load(header, [time_column, *wanted.values()])
    values = np.empty((len(wanted), loaded.rows))
    for i, to_si in enumerate(scales):
        loaded.fill(values[i], i + 1, to_si)
    check_size(loaded, values, list(wanted), [_REFERENCE_LIMITS[name] for name in wanted])
    time = read_times(loaded, scale)
    check_time_unit(header, time_column, time, None, "reference")
    check_times(loaded, time)
    return ReferenceLog(
        path=header.path,
        time=time,
        values=dict(zip(wanted, values, strict=True)),
        rows=loaded.rows,
        warnings=tuple(warnings),
        stamp=header.stamp,
    )
