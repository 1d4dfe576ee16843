"""Read the log of the table's rotating axis: an angle that is unwrapped and right-handed.

The log contains angles, encoder counts or rates, which are integrated. Of a long Parquet file the
two columns are filled chunk by chunk, so that a log of days takes little more memory than them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.files.channels import BY_NAME
from rotcli.logs import plausible
from rotcli.logs.container.columns import Loaded, load, load_chunks
from rotcli.logs.container.header import MAX_BYTES, Header, open_log
from rotcli.logs.container.parquet_file import count_rows
from rotcli.logs.describe.layout import Problem, raise_all
from rotcli.logs.describe.table import TableLayout, describe_table
from rotcli.logs.readings import check_size, check_time_unit, check_times, first_times
from rotcli.logs.record import PIECE, TableLog
from rotcli.logs.timing.clock import fit_sample_clock
from rotcli.logs.timing.counting import count_records
from rotcli.logs.timing.stamps import read_stamps
from rotcli.logs.unwrap import Wrap, find_wrap, unwrap
from rotcli.rig.rig import Rig, TableSettings
from rotcli.units import DEG

Array = NDArray[np.float64]

_SPACING_RECORDS = 1_000_000  # records whose spacing is that of all; more are read in chunks
_MIN_MOVING_RATIO = 10.0  # of the range of the axis that moves to that of the others
_ZERO_RANGE = 1e-12
# rad/s; tests of IMUs on tables use less than 170 deg/s, few rate tables reach 2000 deg/s.
_USUAL_RATE, _IMPOSSIBLE_RATE = 3.0, 35.0


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
    loaded, time, raw, notes = _read(header, table, settings)
    column = header.names[table.layout.wanted.columns[-1]]
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
    time, angle, said = _angle(header, table, settings, loaded, time, raw, column)
    warnings = [*notes, *said]
    angle *= settings.direction
    interval = float(np.median(np.diff(time[:_SPACING_RECORDS])))
    warnings += plausible.check_table_rate(header.path, interval)
    warnings += _table_jitter(header.path, time[:_SPACING_RECORDS])
    warnings += plausible.check_table_gaps(header.path, time, angle)
    time += settings.time_offset
    return TableLog(
        path=header.path,
        time=time,
        angle=angle,
        interval=interval,
        rows=len(time),
        warnings=tuple(warnings),
        stamp=header.stamp,
    )


def _angle(
    header: Header,
    table: TableLayout,
    settings: TableSettings,
    loaded: Loaded,
    time: Array,
    raw: Array,
    column: str,
) -> tuple[Array, Array, list[str]]:
    """Return time (n,), s, and angle (n,), rad, from raw values, and warnings."""
    source = table.layout.sources[table.quantity]
    if table.quantity == "rate":
        rate = (raw - source.offset) * source.scale
        angle = np.zeros(len(rate))
        np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time), out=angle[1:])
        return time, angle, []
    turn = 2.0 * np.pi / abs(source.scale)
    notes: list[str] = []
    if settings.wrap is not None:
        wrap = Wrap(settings.wrap / abs(source.scale))
    else:
        wrap = find_wrap(raw, turn)
    _check_counts(header, raw, table, wrap, column)
    if wrap.outside:
        rows = ", ".join(str(loaded.row(i)) for i in wrap.outside)
        value = raw[wrap.outside[0]]
        notes.append(
            f"{header.path}: {column} is {value:.6g} {table.unit} in row {rows}, outside of the "
            "range of all other records. It is omitted"
        )
        raw, time = np.delete(raw, wrap.outside), np.delete(time, wrap.outside)
    if wrap.found:
        degrees = wrap.period * abs(source.scale) / DEG
        notes.append(
            f"{header.path}: {column} starts again after {wrap.period:.7g} {table.unit}, not after "
            f"a turn. It is unwrapped so; set [table] wrap = {degrees:.7g}"
        )
    unwrap(raw, wrap.period)
    if source.offset:
        raw = raw - source.offset
    angle = raw * source.scale
    if source.origin == "assumed":
        angle, said = _without_unit(header, column, time, raw, angle)
        notes += said
    return time, angle, notes


def _without_unit(
    header: Header, column: str, time: Array, raw: Array, angle: Array
) -> tuple[Array, list[str]]:
    """Return the angle (n,), rad, of a column without unit: degrees where radians are absurd."""
    steps = np.abs(np.diff(angle[:_SPACING_RECORDS])) / np.diff(time[:_SPACING_RECORDS])
    fast = float(np.quantile(steps, 0.9)) if len(steps) else 0.0
    if fast <= _USUAL_RATE:
        return angle, []
    if np.array_equal(raw, np.rint(raw)):
        finding = (
            f"{column} has no unit and contains integers from {raw.min():.0f} to "
            f"{raw.max():.0f}: encoder counts or degrees"
        )
        advice = 'with the counts of a turn, or [table] units = "deg"'
        raise_all(header.path, [Problem(finding, {"table": {"counts_per_turn": 4096}}, advice)])
    if fast > _IMPOSSIBLE_RATE:
        return angle * DEG, [
            f"{header.path}: {column} has no unit and changes by {fast:.4g} per second. It is read "
            'as deg; set [table] units = "deg"'
        ]
    return angle, [
        f"{header.path}: {column} has no unit and changes by {fast:.4g} rad/s. rad is assumed; set "
        '[table] units = "rad" to confirm, or "deg"'
    ]


def _check_counts(header: Header, raw: Array, table: TableLayout, wrap: Wrap, column: str) -> None:
    """Raise LogError for integers without unit that wrap: encoder counts or degrees."""
    source = table.layout.sources[table.quantity]
    if source.origin != "assumed" or not wrap.found or source.scale != 1.0:
        return
    if not np.array_equal(raw, np.rint(raw)) or not float(wrap.period).is_integer():
        if abs(wrap.period - 360.0) < 1.0:
            _raise_unit(header, column, raw)
        return
    if wrap.period == 360.0:
        _raise_unit(header, column, raw)
    finding = (
        f"{column} contains integers from {raw.min():.0f} to {raw.max():.0f} that start again "
        f"after {wrap.period:.0f}: encoder counts"
    )
    raise_all(header.path, [Problem(finding, {"table": {"counts_per_turn": int(wrap.period)}})])


def _raise_unit(header: Header, column: str, raw: Array) -> None:
    finding = (
        f"{column} has no unit and starts again after 360 ({raw.min():.6g} to {raw.max():.6g}): "
        "degrees"
    )
    raise_all(header.path, [Problem(finding, {"table": {"units": "deg"}})])


def _table_jitter(path: str, time: Array) -> list[str]:
    """Warn of stamps (n,), s, that deviate from an even clock: angles are used at the stamps."""
    line = fit_sample_clock(time)
    if line is None or line.max_deviation <= plausible.JITTER_WARNING * line.interval:
        return []
    return [
        f"{path}: time stamps jitter by up to {line.max_deviation:.2g} s (RMS {line.rms:.2g} s) "
        f"around {1.0 / line.interval:.6g} Hz. The angle error is rate x jitter; log the time "
        "stamp of the encoder"
    ]


def _read(
    header: Header, table: TableLayout, settings: TableSettings
) -> tuple[Loaded, Array, Array, list[str]]:
    """Return the records, their times (n,), s, and raw values (n,); a long Parquet in chunks."""
    layout = table.layout
    rows = count_rows(header) if header.kind == "parquet" else 0
    simple = layout.time.kind == "unit" and not table.candidates and settings.clock != "count"
    if rows > _SPACING_RECORDS and simple:
        found = _read_in_chunks(header, table, rows)
        if found is not None:
            return (*found, list(layout.notes))
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
        place += _moving(header, table, loaded, notes)
    raw = np.empty(loaded.rows)
    loaded.fill(raw, place, 1.0)
    return loaded, time, raw, notes


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
) -> tuple[Loaded, Array, Array] | None:
    """Return a long Parquet log, None where its stamps go back or repeat."""
    header.check_size(16 * rows, f"its {rows} records need")
    time, raw = np.empty((2, rows))
    before = -np.inf
    for loaded, _ in load_chunks(header, table.layout.wanted, PIECE):
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
