"""The log of the table's rotating axis: from a file to an angle that is unwrapped and right-handed.

Of a long Parquet file the two columns are filled piece by piece, so that a log of days takes
little more than them.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs import plausible
from rotcli.logs.clock import straight_line
from rotcli.logs.columns import Loaded, load, load_batches, parquet_rows
from rotcli.logs.header import MAX_BYTES, Header, open_log
from rotcli.logs.readings import (
    MOST_TURNED,
    check_size,
    check_time_unit,
    check_times,
    read_times,
    require,
    swapped,
    unit_factor,
)
from rotcli.logs.record import PIECE, TableLog
from rotcli.rig.rig import Rig

Array = NDArray[np.float64]

_ENOUGH = 1_000_000  # records whose spacing tells that of all; more are read in pieces


def read_table(
    path: str | Path,
    rig: Rig,
    *,
    imu_log: str | Path | None = None,
    max_bytes: int = MAX_BYTES,
) -> TableLog:
    """Read the log of the table's rotating axis: unwrapped, right-handed, on the IMU's clock.

    An angle that stays within one turn is taken to wrap, and less than half a turn to pass
    between two records; one that counts on past a turn is taken as it is.
    imu_log: the file read as that, for messages.

    Raises LogError when the file cannot be read, the column is missing, or a number is at fault.
    """
    header = open_log(path, max_bytes=max_bytes)
    settings = rig.table
    if header.find(settings.column) is None and header.find("gyro_x") is not None:
        raise LogError(header.path, swapped(header, imu_log, "an IMU log"))
    time_name = settings.columns.get("time")
    others = [n for n in header.names if n and n != (time_name or "time")]
    advice = (
        f"columns there: {', '.join(others[:8]) or 'none'}; name one as [table] column in the rig"
    )
    how = 'name it in the rig, [table] columns = { time = "…" }, or rename the column'
    wanted = [
        require(header, "time", time_name, how),
        require(header, settings.column, None, advice),
    ]
    warnings: list[str] = []
    units, where = settings.units, "[table] units"
    scale = unit_factor(header, wanted[0], "time", units.get("time"), where, warnings)
    loaded, time, angle = _time_and_angle(header, wanted, scale)
    check_time_unit(header, wanted[0], time, units.get("time"), "table")
    check_times(loaded, time)
    to_si = unit_factor(header, wanted[1], "angle", units.get("angle"), where, warnings)
    unit = header.units[wanted[1]] or units.get("angle") or "rad"
    check_size(loaded, angle[None], [settings.column], [(MOST_TURNED / to_si, unit, "table angle")])
    _unwrap(angle, 2.0 * math.pi / to_si)
    angle *= settings.direction * to_si
    warnings += plausible.check_table_rate(header.path, float(np.median(np.diff(time[:_ENOUGH]))))
    warnings += _table_jitter(header.path, time[:_ENOUGH])
    warnings += plausible.check_drop_outs(header.path, time, angle)
    time += settings.time_offset
    return TableLog(
        path=header.path,
        time=time,
        angle=angle,
        interval=float(np.median(np.diff(time[:_ENOUGH]))),
        rows=len(time),
        warnings=tuple(warnings),
        stamp=header.stamp,
    )


def _table_jitter(path: str, time: Array) -> list[str]:
    """Warn of stamps (n,), s, that stray from an even clock: the angle is taken at the stamps."""
    line = straight_line(time)
    if line is None or line.largest <= plausible.JITTER_WORTH_TELLING * line.interval:
        return []
    return [
        f"{path}: the time stamps jitter by up to {line.largest:.2g} s (rms {line.rms:.2g} s) "
        f"about an even {1.0 / line.interval:.6g} Hz: each angle is taken at its stamp, so a "
        "table that turns is off by the rate times that; log the encoder's own time, or write "
        "even stamps"
    ]


def _time_and_angle(header: Header, wanted: list[int], scale: float) -> tuple[Loaded, Array, Array]:
    """Return the times (n,), s, and the angles (n,) as logged; of a long Parquet, in pieces.

    With a `Loaded` that knows their rows.
    """
    rows = parquet_rows(header) if header.kind == "parquet" else 0
    if rows <= _ENOUGH:
        loaded = load(header, wanted)
        angle = np.empty(loaded.rows)
        loaded.fill(angle, 1, 1.0)
        return loaded, read_times(loaded, scale), angle
    header.check_size(16 * rows, f"its {rows} records would fill")
    time, angle = np.empty((2, rows))
    before: float | None = None
    for loaded, _ in load_batches(header, wanted, PIECE):
        part = slice(loaded.first, loaded.first + loaded.rows)
        time[part] = read_times(loaded, scale, before)
        loaded.fill(angle[part], 1, 1.0)
        before = float(time[part.stop - 1])
    header.check_unchanged()
    return Loaded(header, rows, []), time, angle


def _unwrap(angle: Array, turn: float) -> None:
    """Take out the jumps of whole turns of an angle (n,) that wraps, in place."""
    if angle.max() - angle.min() > turn * (1.0 + 1e-3):  # counts on: nothing wraps
        return
    turns, last = 0.0, float(angle[0])
    for first in range(0, len(angle), PIECE):
        part = angle[first : first + PIECE]
        jumps = np.rint(np.diff(part, prepend=last) / turn)
        last = float(part[-1])
        jumps[0] += turns
        np.cumsum(jumps, out=jumps)
        turns = float(jumps[-1])
        part -= turn * jumps
