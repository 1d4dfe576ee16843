"""Read the log of the table's rotating axis: an angle that is unwrapped and right-handed.

The log contains angles, encoder counts or rates, which are integrated. Of a long Parquet file the
two columns are filled chunk by chunk, so that a log of days takes little more memory than them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from rotcli.errors import LogError
from rotcli.files.channels import BY_NAME
from rotcli.logs import plausible
from rotcli.logs.angle import table_angle
from rotcli.logs.container.columns import Loaded
from rotcli.logs.container.header import MAX_BYTES, Header
from rotcli.logs.container.loading import load, load_chunks
from rotcli.logs.container.opening import open_log
from rotcli.logs.container.parquet_file import count_rows
from rotcli.logs.describe.layout import Problem, raise_all
from rotcli.logs.describe.table import TableLayout, describe_table, with_column
from rotcli.logs.readings import check_size, check_time_unit, check_times, first_times
from rotcli.logs.record import CHUNK_SAMPLES, TableLog
from rotcli.logs.timing.clock import fit_sample_clock, is_even
from rotcli.logs.timing.counting import count_records
from rotcli.logs.timing.stamps import read_stamps
from rotcli.rig.rig import Rig, TableSettings
from rotcli.units import FloatArray, show_time

_SPACING_RECORDS = 1_000_000  # records whose spacing is that of all; more are read in chunks
_MIN_MOVING_RATIO = 10.0  # of the range of the axis that moves to that of the others
_MAX_WRONG_STAMPS = 5  # stamps that are off from an otherwise even clock are listed
_EVEN = 0.1  # of the deviation of a wrong stamp: the largest of an even clock
_ZERO_RANGE = 1e-12


def read_table(
    path: str | Path,
    rig: Rig,
    *,
    imu_log: str | Path | None = None,
    max_bytes: int = MAX_BYTES,
) -> TableLog:
    """Read the log of the table's rotating axis: unwrapped, right-handed, on the IMU's clock.

    An angle within one turn is assumed to wrap, and to change by less than half a turn between
    two records; one that exceeds a turn counts on. imu_log: the file read as that, for messages.

    Raises LogError when the file cannot be read, the column is missing, or a number is invalid.
    """
    settings = rig.table
    header = open_log(path, settings, max_bytes)
    table = describe_table(header, settings, imu_log)
    table.layout.raise_problems()
    table, loaded, time, raw, notes = _read(header, table, settings)
    check_times(loaded, time)
    source = next(iter(table.layout.sources.values()))
    limit = BY_NAME[table.quantity].limit / abs(source.scale)
    check_size(
        loaded,
        raw[None],
        [table.quantity],
        table.layout.sources,
        {table.quantity: limit},
        section="table",
    )
    time, angle, said = table_angle(header, table, settings, loaded, time, raw)
    warnings = [*notes, *said]
    angle *= settings.direction
    interval = float(np.median(np.diff(time[:_SPACING_RECORDS])))
    warnings += plausible.check_table_rate(header.path, interval)
    warnings += _table_jitter(header.path, time[:_SPACING_RECORDS])
    warnings += plausible.check_table_gaps(header.path, time, angle, interval)
    if settings.clock_rate or settings.time_offset:
        time += settings.clock_rate * (time - time[0]) + settings.time_offset
    return TableLog(
        path=header.path,
        time=time,
        angle=angle,
        interval=interval,
        rows=len(time),
        warnings=tuple(warnings),
        stamp=header.stamp,
    )


def _table_jitter(path: str, time: FloatArray) -> list[str]:
    """Warn of stamps (n,), s, that deviate from an even clock: angles are used at the stamps."""
    if is_even(time, plausible.JITTER_WARNING):
        return []
    line = fit_sample_clock(time)
    if line is None or line.max_deviation <= plausible.JITTER_WARNING * line.interval:
        return []
    rest = np.abs(time - line.start - line.interval * line.slots)
    off = np.flatnonzero(rest > 0.5 * line.max_deviation)
    few = len(off) <= _MAX_WRONG_STAMPS
    if few and float(np.delete(rest, off).max()) < _EVEN * line.max_deviation:
        times = ", ".join(show_time(float(time[k])) for k in off)
        return [
            f"{path}: the time stamps near {times} s are off by up to {line.max_deviation:.2g} s; "
            f"the others are even ({1.0 / line.interval:.6g} Hz). Correct or remove these records"
        ]
    return [
        f"{path}: time stamps jitter by up to {line.max_deviation:.2g} s (RMS {line.rms:.2g} s) "
        f"around {1.0 / line.interval:.6g} Hz. The angle error is rate x jitter; log the time "
        "stamp of the encoder"
    ]


def _read(
    header: Header, table: TableLayout, settings: TableSettings
) -> tuple[TableLayout, Loaded, FloatArray, FloatArray, list[str]]:
    """Return the layout with the axis that moves, the records, their times (n,), s, raw values.

    A long Parquet file is read in chunks.
    """
    layout = table.layout
    rows = count_rows(header) if header.kind == "parquet" else 0
    simple = layout.time.kind == "unit" and not table.candidates and settings.clock != "count"
    if rows > _SPACING_RECORDS and simple:
        found = _read_in_chunks(header, table, rows)
        if found is not None:
            return (table, *found, list(layout.notes))
    notes = list(layout.notes)
    wanted = layout.wanted
    if table.candidates:
        wanted = replace(
            wanted, columns=(*layout.time.columns, *table.candidates), values=table.candidates
        )
    loaded = load(header, wanted)
    check_time_unit(header, layout, first_times(loaded, layout), "table")
    stamps = read_stamps(loaded, layout, settings, "table")
    notes += stamps.notes
    loaded, time = stamps.loaded, stamps.time
    if settings.clock == "count":
        time = count_records(time, settings.rate).times()
    elif stamps.repeated:
        raise LogError(header.path, 'time stamps repeat; set [table] clock = "count"')
    place = len(layout.time.columns)
    if table.candidates:
        moving = _moving(header, table, loaded, notes)
        place += moving
        before = len(layout.notes)
        table = with_column(header, settings, table, table.candidates[moving])
        notes += table.layout.notes[before:]
    raw = np.empty(loaded.rows)
    loaded.fill(raw, place, 1.0)
    return table, loaded, time, raw, notes


def _moving(header: Header, table: TableLayout, loaded: Loaded, notes: list[str]) -> int:  # noqa: RET503
    """Return which of the candidate columns moves; raises LogError where several do."""
    first = len(table.layout.time.columns)
    values = [
        np.asarray(loaded.column(first + k), dtype=float) for k in range(len(table.candidates))
    ]
    spans = np.array([float(np.ptp(v)) for v in values])
    order = np.argsort(spans)[::-1]
    names = [header.names[k] for k in table.candidates]
    if spans[order[0]] > _MIN_MOVING_RATIO * max(spans[order[1]], _ZERO_RANGE):
        name = names[int(order[0])]
        notes.append(
            f"{header.path}: of {', '.join(names)} only {name} moves. It is used; set [table] "
            f'column = "{name}"'
        )
        return int(order[0])
    finding = f"several columns of angles move ({', '.join(names)})"
    raise_all(
        header.path,
        [Problem(finding, {"table": {"column": names[int(order[0])]}}, "or another one")],
    )


def _read_in_chunks(
    header: Header, table: TableLayout, rows: int
) -> tuple[Loaded, FloatArray, FloatArray] | None:
    """Return a long Parquet log, None where its stamps go back or repeat."""
    header.check_size(16 * rows, f"its {rows} records need")
    time, raw = np.empty((2, rows))
    before = -np.inf
    for loaded, _ in load_chunks(header, table.layout.wanted, CHUNK_SAMPLES):
        part = slice(loaded.first, loaded.first + loaded.rows)
        loaded.fill(time[part], 0, table.layout.time.scale[0])
        loaded.fill(raw[part], 1, 1.0)
        if np.diff(time[part], prepend=before).min() <= 0.0:
            return None
        if before == -np.inf:
            check_time_unit(header, table.layout, time[part], "table")
        before = float(time[part.stop - 1])
    header.check_unchanged()
    return Loaded(header, rows, []), time, raw
