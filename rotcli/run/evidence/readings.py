"""Rows of an IMU log that no sensor writes: zeros, repeated rows, straight lines, clipping."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.logs.record import ImuLog
from rotcli.run.findings import Finding
from rotcli.units import show_time

FloatArray = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Rows in which all six readings are exactly zero, equal to the row before, or on a straight line
# with the two rows before: noise of a step of the resolution does it with a chance below 1e-3 per
# row and never five times in succession.
MIN_RUN = 5
_RANGE_TOLERANCE = 1.0 - 1e-7  # of the range: single precision stores seven digits
_MIN_SIGN_CHANGES = 0.3  # of neighbouring steps: 2/3 in white noise, 0 in a smooth curve
_MAX_REPEATED_SHARE = 0.2  # of the rows equal to the row before: a logger faster than the sensor
_MAX_SEARCHED = 400_000  # rows of a segment searched for copies: an hour at 100 Hz


@dataclass(frozen=True)
class RowFault:
    """Rows of one kind of fault: how many, time (s) of the first and the last."""

    count: int = 0
    first: float = np.nan
    last: float = np.nan

    def add(self, times: FloatArray) -> "RowFault":
        """Return the fault with further times (k,), s."""
        if not len(times):
            return self
        first = float(times[0]) if not self.count else self.first
        return RowFault(self.count + len(times), first, float(times[-1]))


@dataclass(frozen=True)
class ReadingFaults:
    """Faulted rows of a segment; repeated: single rows equal to the row before."""

    rows: int = 0
    zeros: RowFault = RowFault()
    lines: RowFault = RowFault()
    repeated: RowFault = RowFault()
    copies: RowFault = RowFault()
    clipped: RowFault = RowFault()
    clipped_channel: str = ""

    def findings(self, path: str, where: str) -> tuple[Finding, ...]:
        """Return the findings of a segment; where: its limits in words."""
        found = []
        kinds = (
            ("zero-rows", self.zeros, "rows of zeros", 0),
            ("straight-rows", self.lines, "rows on a straight line (frozen or interpolated)", 0),
            ("copied-rows", self.copies, "rows equal to earlier rows in all readings", 0),
            (
                "repeated-rows",
                self.repeated,
                "rows equal to the row before; the logger is faster than the sensor",
                _MAX_REPEATED_SHARE * self.rows,
            ),
        )
        for code, fault, kind, limit in kinds:
            if fault.count > limit:
                text = (
                    f"{path}: segment {where}: {fault.count} {kind}, {show_time(fault.first)} to "
                    f"{show_time(fault.last)} s; exclude this part"
                )
                found.append(Finding(code, text, "warning", where, float(fault.count), limit))
        return tuple(found)


def scan_readings(
    log: ImuLog, before: ImuLog | None, faults: ReadingFaults, gyro_range: float | None
) -> ReadingFaults:
    """Return the faults with those of a further chunk of a segment.

    before: the chunk before, whose last rows belong to runs that continue. gyro_range: rad/s.
    """
    head = 0 if before is None else min(MIN_RUN, before.samples)
    gyro, accel, time = log.gyro, log.accel, log.time
    if before is not None and head:
        gyro = np.concatenate([before.gyro[-head:], gyro])
        accel = np.concatenate([before.accel[-head:], accel])
        time = np.concatenate([before.time[-head:], time])
    faults = replace(faults, rows=faults.rows + log.samples)
    zeros = _all_six(gyro[head:], accel[head:], lambda v: v == 0.0)
    faults = replace(faults, zeros=faults.zeros.add(log.time[zeros]))
    if not _noisy(gyro):
        return faults
    equal = _all_six(gyro, accel, _equal_to_previous) & ~_all_six(gyro, accel, lambda v: v == 0.0)
    line = _all_six(gyro, accel, _on_a_line)
    if log.missing is not None and log.missing.any():  # interpolated by rotcli: not the logger's
        missing = np.concatenate([np.zeros(head, dtype=bool), log.missing])
        line &= ~_near(missing)
    runs = _long_runs(line)
    runs[:head] = False
    faults = replace(
        faults,
        lines=faults.lines.add(time[runs & ~_all_six(gyro, accel, lambda v: v == 0.0)]),
        repeated=faults.repeated.add(time[head:][equal[head:] & ~runs[head:]]),
    )
    if faults.rows <= _MAX_SEARCHED:
        copied = _copies(log)
        faults = replace(faults, copies=faults.copies.add(log.time[copied & ~runs[head:]]))
    return _clipped(log, faults, gyro_range)


def _clipped(log: ImuLog, faults: ReadingFaults, gyro_range: float | None) -> ReadingFaults:
    if gyro_range is None:
        return faults
    limit = gyro_range * _RANGE_TOLERANCE
    for k, axis in enumerate("xyz"):
        column = log.gyro[:, k]
        if max(column.max(), -column.min()) >= limit:
            at = log.time[np.abs(column) >= limit]
            faults = replace(faults, clipped=faults.clipped.add(at), clipped_channel=f"gyro_{axis}")
    return faults


def _noisy(gyro: FloatArray) -> bool:
    """Return whether the steps of a gyro change sign as those of noise do (not a simulation)."""
    for column in gyro[:2000].T:
        steps = np.diff(column)
        steps = steps[steps != 0.0]
        if len(steps) > MIN_RUN and np.mean(steps[1:] * steps[:-1] < 0.0) > _MIN_SIGN_CHANGES:
            return True
    return False


def _all_six(gyro: FloatArray, accel: FloatArray, flags_of: "object") -> Flags:
    """Return the rows (n,) at which flags_of a column (n,) is true for all six channels."""
    result = flags_of(gyro[:, 0])  # type: ignore[operator]
    for values in (gyro, accel):
        for k in range(3):
            if not result.any():
                return np.asarray(result)
            result = result & flags_of(values[:, k])  # type: ignore[operator]
    return np.asarray(result)


def _equal_to_previous(column: FloatArray) -> Flags:
    flags = np.zeros(len(column), dtype=bool)
    flags[1:] = column[1:] == column[:-1]
    return flags


def _on_a_line(column: FloatArray) -> Flags:
    """Return where the second difference is zero, to the rounding of double precision."""
    flags = np.zeros(len(column), dtype=bool)
    size = np.abs(column).max(initial=0.0)
    flags[2:] = np.abs(np.diff(column, 2)) <= 1e-14 * size
    return flags


def _near(flags: Flags) -> Flags:
    """Return the flags with two rows to either side of each."""
    result = flags.copy()
    for shift in (1, 2):
        result[shift:] |= flags[:-shift]
        result[:-shift] |= flags[shift:]
    return result


def _long_runs(flags: Flags) -> Flags:
    """Return the flags of runs of MIN_RUN - 2 or more: as many rows with the two before them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    result = np.zeros(len(flags), dtype=bool)
    for first, last in edges.reshape(-1, 2):
        if last - first >= MIN_RUN - 2:
            result[first:last] = True
    return result


def _copies(log: ImuLog) -> Flags:
    """Return the rows that repeat, five and more in succession, earlier rows of the chunk."""
    keys = np.zeros(log.samples, dtype=np.uint64)
    for values in (log.gyro, log.accel):
        for k in range(3):
            bits = np.ascontiguousarray(values[:, k]).view(np.uint64)
            keys = keys * np.uint64(6364136223846793005) + bits
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    result = np.zeros(log.samples, dtype=bool)
    if len(same) < MIN_RUN:
        return result
    later, lag = order[same + 1], order[same + 1] - order[same]
    by_time = np.argsort(later)
    later, lag = later[by_time], lag[by_time]
    follows = (np.diff(later) == 1) & (np.diff(lag) == 0) & (lag[1:] > 1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], follows, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        if last - first + 1 >= MIN_RUN:
            result[later[first : last + 1]] = True
    return result
