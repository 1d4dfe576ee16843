"""The readings of an IMU log as they stand in the file, in SI: what `read_imu` makes a record of.

Nothing is interpolated, turned or divided: increments stay increments (rad, m/s), the axes are
the IMU's own, and only the clock is made one of seconds. `rotcli convert` writes them so.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.files.names import nearest
from rotcli.logs.columns import Loaded, load
from rotcli.logs.formats import Layout, layout_of, packet_rate, psins_counts, ticks_of
from rotcli.logs.header import MAX_BYTES, Header, Progress, open_log
from rotcli.rig.formats import AXES, FORMATS, Name, Ticks
from rotcli.rig.rig import Rig
from rotcli.units import UNITS, factor, show_time

# s: no logger of turntables is faster than 100 kHz, slower than 0.1 Hz, or of the year 5138.
_SHORTEST, _LONGEST, _LATEST = 1e-5, 10.0 * (1.0 - 1e-3), 1e11

Array = NDArray[np.float64]
Limit = tuple[float, str, str]  # greatest size in SI, its unit, what has none larger

# Thousands of times what is built for turntables: mere numbers, of another unit or of no sensor.
GYRO_LIMIT: Limit = (1e6, "rad/s", "reading of a gyro")
ACCEL_LIMIT: Limit = (1e6, "m/s^2", "reading of an accelerometer")
READING_LIMITS = 3 * (GYRO_LIMIT,) + 3 * (ACCEL_LIMIT,)
MOST_TURNED = 1e9  # rad: a table of 1000 deg/s turns 3e6 in two days

_ADVICE = "name it under [imu] columns in the rig, or rename the column"
_TABLE_AXES = ("angle", "outer", "middle", "inner")


@dataclass(frozen=True, eq=False)
class Readings:
    """What an IMU log holds: time (n,) s, increasing; values (6, n), gyro then accelerometer.

    values: rad/s and m/s^2, or with `increments` rad and m/s over the interval that ends there.
    """

    loaded: Loaded
    time: Array
    values: Array
    increments: bool
    warnings: list[str]


def read_readings(
    path: str | Path,
    rig: Rig,
    progress: Progress | None = None,
    table_log: str | Path | None = None,
    max_bytes: int = MAX_BYTES,
) -> Readings:
    """Read the time and the six axes of an IMU log in whatever format the rig tells.

    progress: told how much of a text log (0 to 1) is read. table_log: the file read as that, for
    messages. max_bytes: that may be read at most. Raises LogError when the file cannot be read, a
    column is missing, or a number or time is at fault.
    """
    layout = layout_of(rig.imu)
    header = open_log(path, layout.dialect, max_bytes)
    warnings: list[str] = []
    columns, scales = _axes(header, rig, layout, warnings, table_log)
    if header.figures:
        loaded = load(header, [columns[0], *columns], progress=progress)
        scales = list(psins_counts(header).scales)
        time = _psins_time(loaded, header)
    else:
        ticks = None if header.dialect is None else ticks_of(layout, header)
        clock = require(header, ticks.column if ticks else "time", _clock(layout, ticks), _ADVICE)
        loaded = load(header, [clock, *columns], progress=progress)
        if ticks:
            time = increasing(loaded, _ticking(loaded, ticks))
        else:
            unit = layout.units.get("time")
            time = read_times(
                loaded, unit_factor(header, clock, "time", unit, "[imu] units time", warnings)
            )
            check_time_unit(header, clock, time, unit, "imu")
    check_times(loaded, time)
    values = np.empty((6, loaded.rows))
    for i, scale in enumerate(scales):
        loaded.fill(values[i], i + 1, scale)
    return Readings(loaded, time, values, rig.imu.sampling == "increment", warnings)


def imu_columns(
    header: Header, rig: Rig, warnings: list[str], table_log: str | Path | None = None
) -> tuple[list[int], list[float]]:
    """Return where an IMU log has time, gyro x to z, accel x to z, and their factors to SI.

    For a log read piece by piece. Adds to `warnings` what a user must know of the units. Raises
    LogError, also for a format whose time is counted and not written.
    """
    layout = layout_of(rig.imu)
    if counts_time(header, rig):
        what = "this format counts its time; make it Parquet first with rotcli convert"
        raise LogError(header.path, what)
    columns, scales = _axes(header, rig, layout, warnings, table_log)
    clock = require(header, "time", layout.columns.get("time"), _ADVICE)
    unit = layout.units.get("time")
    scale = unit_factor(header, clock, "time", unit, "[imu] units time", warnings)
    return [clock, *columns], [scale, *scales]


def counts_time(header: Header, rig: Rig) -> bool:
    """Return whether the time of a log is counted and not written."""
    if header.dialect is None:
        return False
    return bool(header.figures or ticks_of(layout_of(rig.imu), header))


def _axes(
    header: Header,
    rig: Rig,
    layout: Layout,
    warnings: list[str],
    table_log: str | Path | None = None,
) -> tuple[list[int], list[float]]:
    """Return where the six axes are, and their factors to SI."""
    table_names = {*_TABLE_AXES, rig.table.column}
    named = {n for n in (*AXES, *layout.columns.values()) if isinstance(n, str) and n != "time"}
    looks_like_imu = any(header.find(name) is not None for name in named)
    if not looks_like_imu and any(header.find(name) is not None for name in table_names):
        raise LogError(header.path, swapped(header, table_log, "a table log"))

    columns = [require(header, name, layout.columns.get(name), _ADVICE) for name in AXES]
    increments = rig.imu.sampling == "increment"
    kinds = 3 * ["angle" if increments else "rate"]
    kinds += 3 * ["velocity" if increments else "acceleration"]
    scales = [
        unit_factor(
            header, column, kind, layout.units.get(sensor), f"[imu] units {sensor}", warnings
        )
        for column, kind, sensor in zip(columns, kinds, 3 * ["gyro"] + 3 * ["accel"], strict=True)
    ]
    return columns, scales


def file_columns(found: Readings) -> dict[str, Array]:
    """Return the readings as named columns of a plain log, each (n,), SI."""
    units = ("rad", "m/s") if found.increments else ("rad/s", "m/s^2")
    names = [f"{n} [{units[0] if n.startswith('gyro') else units[1]}]" for n in AXES]
    return {"time [s]": found.time, **dict(zip(names, found.values, strict=True))}


def _clock(layout: Layout, ticks: Ticks | None) -> Name | None:
    return None if ticks else layout.columns.get("time")


def _ticking(loaded: Loaded, ticks: Ticks) -> Array:
    """Return the times (n,), s, of a counter in the first column that starts anew at `wrap`."""
    rate = packet_rate(loaded.header) if ticks.rate is None else ticks.rate
    count = np.empty(loaded.rows)
    loaded.fill(count, 0, 1.0)
    # A step back by more than half the counter's range is a new start.
    turns = np.cumsum(np.diff(count) < -0.5 * ticks.wrap)
    count[1:] += float(ticks.wrap) * turns
    return count / rate


def _psins_time(loaded: Loaded, header: Header) -> Array:
    """Return the times (n,), s, of a PSINS log: even, corrected by a seventh column in us."""
    counts = psins_counts(header)
    time: Array = counts.start + counts.interval * np.arange(1, loaded.rows + 1, dtype=float)
    if len(header.raw) > len(AXES):
        dither = np.empty(loaded.rows)
        load(header, [len(AXES)]).fill(dither, 0, 1e-6)
        time += np.cumsum(dither)
    return increasing(loaded, time)


def require(header: Header, name: str, renamed: Name | None, advice: str) -> int:
    """Return the index of a column that must be there, by the rig's name for it or its own.

    Raises LogError that names the nearest column.
    """
    if isinstance(renamed, int) and header.dialect is not None:
        if renamed <= len(header.raw):
            return renamed - 1
        what = f"column {renamed}: the log has {len(header.raw)}; {advice}"
        raise LogError(header.path, what, column=name)
    renamed = renamed if isinstance(renamed, str) else None
    found = header.find(renamed or name)
    for other in (name, FORMATS["euroc"].columns.get(name)):
        if found is None and isinstance(other, str):
            found = header.find(other)
    if found is None:
        there = [n for n in header.names if n]
        near = f"the nearest is {nearest(renamed or name, there)}; " if there else ""
        raise LogError(header.path, f"no such column; {near}{advice}", column=renamed or name)
    return found


def swapped(header: Header, other: str | Path | None, kind: str) -> str:
    """Say that a log is of the other kind, and why that may be."""
    if other is not None and Path(other).exists() and Path(other).samefile(header.path):
        return f"the IMU log and the table log are the same file, and it is {kind}; name both logs"
    return f"this looks like {kind}; is the order IMU_LOG TABLE_LOG swapped?"


def unit_factor(
    header: Header,
    column: int,
    kind: str,
    rig_unit: str | None,
    where: str,
    warnings: list[str],
) -> float:
    """Return the factor to SI of a column: unit of the header, else of the rig, else SI."""
    unit = header.units[column]
    if unit is not None and rig_unit is not None and factor(unit, kind) != factor(rig_unit, kind):
        text = f"{header.path}: the header gives {unit}, the rig's {where} {rig_unit}; "
        text += "the header was followed"
        if text not in warnings:
            warnings.append(text)
    unit = unit or rig_unit
    if unit is None:
        return 1.0
    found = factor(unit, kind)
    if found is None:
        known = ", ".join(UNITS[kind])
        what = f"unit {unit!r} is not one of {known}; correct the header or the rig's {where}"
        raise LogError(header.path, what, column=header.names[column])
    return found


def check_time_unit(
    header: Header, column: int, time: Array, rig_unit: str | None, section: str
) -> None:
    """Raise LogError for times (n,) that cannot be s, where nothing names their unit."""
    if len(time) < 2 or header.units[column] is not None or rig_unit is not None:
        return
    step = float(np.median(np.diff(time)))
    if _SHORTEST <= step < _LONGEST and abs(time[0]) < _LATEST:
        return
    from_100_hz = {
        unit: abs(math.log10(step * to_si) + 2.0) for unit, to_si in UNITS["time"].items()
    }
    unit = min(from_100_hz, key=lambda unit: from_100_hz[unit])
    what = f"no unit, stamps from {show_time(time[0])} in steps of {step:.3g}: "
    if unit == "s":
        what += "no clock of a logger; is this the right column? name its unit in the header"
    else:
        what += f"looks like {unit}: write `{header.names[column]} [{unit}]` in the header, or "
        what += f'[{section}] units = {{ time = "{unit}" }} in the rig'
    raise LogError(header.path, what, column="time")


def read_times(loaded: Loaded, scale: float, before: float | None = None) -> Array:
    """Return the first loaded column as increasing times (n,), s; raises LogError.

    before: the time of the record before the first one.
    """
    time = np.empty(loaded.rows)
    loaded.fill(time, 0, scale)
    return increasing(loaded, time, before)


def check_times(loaded: Loaded, time: Array) -> None:
    """Raise LogError for increasing times (n,), s, that no clock shows: they leave no digits."""
    if not len(time) or max(-time[0], time[-1]) < _LATEST:
        return
    i = 0 if time[0] <= -_LATEST else int(np.argmax(time >= _LATEST))
    what = f"{time[i]:.6g} s is no time of a clock; correct the row, or name the unit of the stamps"
    raise LogError(loaded.header.path, what, row=loaded.row(i), column="time")


def check_size(
    loaded: Loaded, values: Array, names: Sequence[str], limits: Sequence[Limit]
) -> None:
    """Raise LogError for the first of values (k, n), SI, that is beyond what its kind may be."""
    found = [
        (int(np.argmax(np.abs(row) > limit)), k)
        for k, (row, (limit, _, _)) in enumerate(zip(values, limits, strict=True))
        if row.size and max(row.max(), -row.min()) > limit
    ]
    if found:
        i, k = min(found)
        _, unit, kind = limits[k]
        what = f"{values[k][i]:.6g} {unit} is no {kind}; remove the row, or name the column's unit"
        raise LogError(loaded.header.path, what, row=loaded.row(i), column=names[k])


def increasing(loaded: Loaded, time: Array, before: float | None = None) -> Array:
    """Return times (n,), s, that increase; raises LogError where they do not."""
    steps = np.diff(time, prepend=-np.inf if before is None else before)
    if steps.min() <= 0.0:
        i = int(np.flatnonzero(steps <= 0.0)[0])
        how = f"goes back by {-steps[i]:.6g} s" if steps[i] < 0 else "repeats the row before"
        what = f"time {how}; sort the rows by time, or remove this one"
        raise LogError(loaded.header.path, what, row=loaded.row(i), column="time")
    return time
