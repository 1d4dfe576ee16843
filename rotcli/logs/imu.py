"""Read IMU logs into evenly sampled records in the sensor frame.

`open_imu` opens any log, short or long (`rotcli.logs.stream`); `read_imu` reads one into memory.
Column names and units of files are known to `rotcli.logs.describe` only, the clock is made even
in `rotcli.logs.timing`.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.files.columns import write_columns
from rotcli.logs import plausible
from rotcli.logs.container.columns import Loaded
from rotcli.logs.container.header import MAX_BYTES, Progress
from rotcli.logs.container.opening import open_log
from rotcli.logs.describe.layout import Layout, Problem
from rotcli.logs.describe.time import has_columns
from rotcli.logs.readings import Readings, check_size, read_readings
from rotcli.logs.record import ImuLog
from rotcli.logs.reference import read_reference
from rotcli.logs.timing.clock import clock_from_stamps, fit_sample_clock
from rotcli.logs.timing.counting import count_records
from rotcli.logs.timing.line import SampleClock
from rotcli.logs.timing.mixed import RecordSpacing
from rotcli.logs.timing.resample import fill_gaps, interpolate, resample
from rotcli.rig.rig import ImuSettings, Rig
from rotcli.units import FloatArray, factor, format_span, show_time

__all__ = ["read_imu", "read_reference", "write_columns"]


def read_imu(
    path: str | Path,
    rig: Rig,
    *,
    max_gap: int | None = 5,
    table_log: str | Path | None = None,
    progress: Progress | None = None,
    max_bytes: int = MAX_BYTES,
    channels: Sequence[str] | None = None,
) -> ImuLog:
    """Read an IMU log into the sensor frame, evenly sampled.

    Gaps up to `max_gap` samples are interpolated linearly, marked in `missing` and reported in
    `warnings`; None interpolates every gap. table_log: the file read as that, for messages.
    progress: gets the share (0 to 1) that is read. max_bytes: that may be read at most. channels:
    the axes that must be there (default: all six, or those that the rig names).

    Raises LogError when the file cannot be read, a column is missing, a number or time is
    invalid, or a gap is longer than `max_gap`.
    """
    found = read_readings(path, rig, progress, table_log, max_bytes, channels)
    log = even_log(found, rig, max_gap)
    if rig.imu.accel_log is None:
        return log
    return _with_accelerometers(log, rig, max_gap, max_bytes)


def even_log(found: Readings, rig: Rig, max_gap: int | None) -> ImuLog:
    """Return readings as an evenly sampled record; raises LogError as `read_imu` does."""
    imu = rig.imu
    loaded, time, values, warnings = found.loaded, found.time, found.values, found.warnings
    path = loaded.header.path
    present = [k for k, name in enumerate(AXES) if name in found.channels]
    check_size(loaded, values[present], found.channels)
    line, literal = sample_clock(found, imu)
    plausible.check_rate(path, line.interval)
    warnings += plausible.check_axes(path, time, values[present], found.channels)
    warnings += unit_warnings(found.layout, values[:3])
    warnings += clock_warnings(path, line, time if literal else None, imu)
    _divide_increments(found, line, literal)
    warnings += _gap_warnings(loaded, time, line, max_gap)
    for counter, triad in zip(clipping_counters(imu), (values[:3], values[3:]), strict=True):
        counter.add(time, triad)
        warnings += counter.warnings(path)

    averages = imu.sampling != "instant" or bool(found.increments)
    rows = np.vstack([values, *found.extras.values()]) if found.extras else values
    if literal:
        time, rows, missing = resample(time, rows, line, averages=averages)
    else:
        rows, missing = fill_gaps(rows, line)
        time = line.times()
    gyro, accel = rows[:3], rows[3:6]
    if not np.array_equal(imu.mount, np.eye(3)):
        gyro, accel = imu.mount.T @ gyro, imu.mount.T @ accel
    return ImuLog(
        path=path,
        time=time,
        gyro=gyro.T,
        accel=accel.T,
        interval=line.interval,
        sampling="average" if averages else "instant",
        missing=missing,
        rows=loaded.rows,
        warnings=tuple(warnings),
        stamp=loaded.header.stamp,
        channels=found.channels,
        extras=dict(zip(found.extras, rows[6:], strict=True)),
    )


def sample_clock(found: Readings, imu: ImuSettings) -> tuple[SampleClock, bool]:
    """Return the clock of readings, and whether their stamps are taken literally."""
    path, time = found.loaded.header.path, found.time
    if imu.clock == "count":
        return count_records(time, imu.rate), False
    if not found.repeated:
        plausible.check_median_rate(path, time)
    if imu.clock == "regular":
        plausible.check_mixed(path, RecordSpacing(time))
    line = fit_sample_clock(time)
    if found.repeated and line is None:
        repeats = np.flatnonzero(np.diff(time) == 0.0)
        row = found.loaded.row(int(repeats[0]) + 1)
        rows = "row" if len(repeats) == 1 else "rows"
        finding = (
            f"time repeats the previous stamp in {len(repeats)} {rows}, with other readings; set "
            '[imu] clock = "count" if no sample was lost'
        )
        error = LogError(path, finding, row=row, column="time")
        said = f"row {row}: time repeats the previous stamp in {len(repeats)} {rows}"
        count = {"imu": {"clock": "count"}}
        error.problems = (Problem(said, count, "if no sample was lost"),)
        raise error
    literal = line is None or imu.clock == "stamps"
    return line or clock_from_stamps(time), literal


def _divide_increments(found: Readings, line: SampleClock, literal: bool) -> None:
    """Turn increments into mean rates over their intervals, in place."""
    time, values = found.time, found.values
    for sensor, rows in (("gyro", slice(0, 3)), ("accel", slice(3, 6))):
        if sensor not in found.increments:
            continue
        triad = values[rows]
        triad[:, 1:] /= np.diff(time) if literal else line.interval
        triad[:, 0] /= line.interval
        if literal:  # after a gap, the increment of one interval only
            after = np.flatnonzero(np.diff(line.slots) > 1) + 1
            triad[:, after] *= np.diff(time)[after - 1] / line.interval


def _with_accelerometers(log: ImuLog, rig: Rig, max_gap: int | None, max_bytes: int) -> ImuLog:
    """Return a log of gyros with the accelerometers of [imu] accel_log on its clock."""
    name = Path(str(rig.imu.accel_log))
    path = name if name.is_absolute() else Path(log.path).with_name(str(name))
    header = open_log(path, rig.imu, max_bytes)
    columns = {  # the name of the time column may be that of the first file only
        name: column
        for name, column in rig.imu.columns.items()
        if not name.startswith("gyro") and (name != "time" or has_columns(header, column))
    }
    imu = replace(rig.imu, accel_log=None, channels=("accel",), columns=columns)
    other = read_imu(path, replace(rig, imu=imu), max_gap=max_gap, max_bytes=max_bytes)
    start, end = max(log.time[0], other.time[0]), min(log.time[-1], other.time[-1])
    if not start < end:
        spans = f"{format_span(other.time[0], other.time[-1])}, the gyros "
        spans += format_span(log.time[0], log.time[-1])
        raise LogError(str(path), f"covers {spans}; the two logs need one clock", column="time")
    kept = log.crop(start, end)
    accel = interpolate(other.time, other.accel.T, kept.time).T
    warnings = [*log.warnings, *other.warnings]
    slack = 1.5 * other.interval
    if start > log.time[0] + slack or end < log.time[-1] - slack:
        warnings.append(
            f"{path}: covers {format_span(start, end)} of the gyro log only. The rest is not used"
        )
    channels = (*log.channels, *other.channels)
    return replace(kept, accel=accel, channels=channels, warnings=tuple(warnings))


def unit_warnings(layout: Layout, gyro: FloatArray) -> list[str]:
    """Return the warning about gyros (3, n) without a unit; exact readings cause none."""
    origins = [s.origin for name, s in layout.sources.items() if name.startswith("gyro")]
    if "assumed" not in origins or not any(plausible.is_noisy(row) for row in gyro):
        return []
    unit = next(s.unit for name, s in layout.sources.items() if name.startswith("gyro"))
    return [
        f"{layout.path}: the gyro columns have no unit. {unit} is assumed; set [imu] units = "
        f'{{ gyro = "{unit}" }} to confirm, or another unit'
    ]


def clipping_counters(imu: ImuSettings) -> tuple["ClippingCounter", "ClippingCounter"]:
    """Return the counters of clipped samples of the gyros and of the accelerometers."""
    gyro = ClippingCounter(imu.gyro_range, "gyro", "deg/s")
    return gyro, ClippingCounter(imu.accel_range, "accel", "m/s^2")


def clock_warnings(
    path: str, line: SampleClock, literal: FloatArray | None, imu: ImuSettings
) -> list[str]:
    """Return the warning about the clock; literal: the stamps, where they are used as logged."""
    rate = f"{1.0 / line.interval:.6g} Hz"
    if imu.clock != "regular":
        return []
    if literal is not None:
        time = literal
        worst = int(np.argmax(np.abs(time - line.start - line.interval * line.slots)))
        return [
            f"{path}: time stamps deviate by up to {line.max_deviation:.3g} s from an even {rate} "
            f"clock, near {show_time(time[worst])} s. They are used as logged; set [imu] clock = "
            '"count" if no sample was lost'
        ]
    if line.counted:
        return [
            f"{path}: time stamps deviate by up to {line.max_deviation:.3g} s (RMS {line.rms:.2g} "
            f"s) from an even {rate} clock and return to it: no sample is missing. The records "
            'are counted; set [imu] clock = "count" to confirm'
        ]
    if line.max_deviation > plausible.JITTER_WARNING * line.interval:
        return [
            f"{path}: time stamps jitter by up to {line.max_deviation:.2g} s (RMS {line.rms:.2g} "
            f"s) around {rate}. An even clock is used"
        ]
    return []


def _gap_warnings(
    loaded: Loaded, time: FloatArray, line: SampleClock, max_gap: int | None
) -> list[str]:
    """Return the warning about interpolated gaps; raise LogError for one that is too long."""
    lost = np.diff(line.slots) - 1
    gaps = np.flatnonzero(lost > 0)
    limit = longest_gap(loaded.rows, max_gap)
    if gaps.size and lost.max() > limit:
        i = int(np.argmax(lost > limit))
        raise gap_error(loaded, i + 1, int(lost[i]), (float(time[i]), float(time[i + 1])), max_gap)
    return gap_warnings(loaded.header.path, [(float(time[i]), int(lost[i])) for i in gaps])


def longest_gap(rows: int, max_gap: int | None) -> int:
    """Return how many samples may be missing at once in a log of `rows` records."""
    # Even where every gap is interpolated, a clock that jumps must not fill the memory.
    return 10 * rows + 1_000_000 if max_gap is None else max_gap


def gap_error(
    loaded: Loaded, record: int, lost: int, span: tuple[float, float], max_gap: int | None
) -> LogError:
    """Return the error of a gap before a record that is too long to be interpolated."""
    advice = "split the log there" + (" or allow longer gaps" if max_gap is not None else "")
    finding = (
        f"{lost} samples missing from {format_span(*span)}, limit "
        f"{longest_gap(loaded.rows, max_gap)}; {advice}"
    )
    return LogError(loaded.header.path, finding, row=loaded.row(record), column="time")


def gap_warnings(path: str, gaps: list[tuple[float, int]]) -> list[str]:
    """Return the warning about interpolated gaps: the time before each (s), samples missing."""
    if not gaps:
        return []
    total = sum(lost for _, lost in gaps)
    places = ", ".join(f"{show_time(time)} s ({lost})" for time, lost in gaps[:3])
    more = f" and {len(gaps) - 3} more" if len(gaps) > 3 else ""
    gap, sample = ("gap" if len(gaps) == 1 else "gaps"), ("sample" if total == 1 else "samples")
    advice = "They are interpolated; check the logger or exclude these parts"
    return [f"{path}: {len(gaps)} {gap} ({total} {sample}), first after {places}{more}. {advice}"]


class ClippingCounter:
    """Counts the samples at or past a range, axis by axis, chunk by chunk."""

    def __init__(self, limit: float | None, kind: str, unit: str) -> None:
        self.limit, self.kind, self.unit = limit, kind, unit
        self.counts = [0, 0, 0]
        self.first = [0.0, 0.0, 0.0]

    def add(self, time: FloatArray, values: FloatArray) -> None:
        """Count in values (3, n), SI, at times (n,), s."""
        if self.limit is None:
            return
        for k, column in enumerate(values):
            # A log in single precision has seven digits.
            edge = self.limit * (1.0 - 1e-7)
            if not max(column.max(), -column.min()) >= edge:
                continue
            clipped = np.abs(column) >= edge
            self.first[k] = self.first[k] if self.counts[k] else float(time[np.argmax(clipped)])
            self.counts[k] += int(np.count_nonzero(clipped))

    def warnings(self, path: str) -> list[str]:
        """Return the warning about each axis with clipped samples."""
        if self.limit is None:
            return []
        shown = self.limit / (factor(self.unit, "rate", "acceleration") or 1.0)
        return [
            f"{path}: {count} {self.kind}_{name} {'sample' if count == 1 else 'samples'} at or "
            f"past the range of {shown:.6g} {self.unit}, first at {show_time(first)} s; exclude "
            "this part or turn more slowly"
            for name, count, first in zip("xyz", self.counts, self.first, strict=True)
            if count
        ]
