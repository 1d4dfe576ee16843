"""Find the time of a log: its column or columns, the form of the stamps and their unit."""

from typing import Any

import numpy as np

from rotcli.files.formats import Column
from rotcli.files.time_text import is_stamp, is_time_of_day, stamp_form
from rotcli.files.toml_schema import to_toml
from rotcli.lazy import lazily
from rotcli.logs.container.header import Header
from rotcli.logs.describe import aliases, look, words
from rotcli.logs.describe.layout import Origin, Problem, TimeSource
from rotcli.rig.rig import LogSettings
from rotcli.units import UNITS, factor, show_time, unit_name

with lazily():
    import pyarrow as pa

_WEEK = 604800.0  # s
_DAY = 86400.0  # s
_MAX_WEEK = 10_000.0  # a GPS week number; seconds of Unix time are far above
# Hz; above it unnamed stamps are in minutes or in another unit rather than of such a logger.
_FASTEST_UNNAMED = 2500.0


def column_index(header: Header, column: Column) -> int | None:
    """Return the index of a column that a rig or a format names or counts, None without it."""
    if isinstance(column, int):
        return column - 1 if 1 <= column <= len(header.raw) else None
    return header.find(column)


def has_columns(header: Header, column: Column | tuple[Column, Column]) -> bool:
    """Return whether a log has the column, or both columns, of a time."""
    wanted = column if isinstance(column, tuple) else (column,)
    return all(column_index(header, one) is not None for one in wanted)


def missing_column(header: Header, column: Column, channel: str, section: str) -> Problem:
    """Return the problem of a column that the rig names and the log lacks."""
    if isinstance(column, int):
        finding = f"{channel}: there is no column {column}, the log has {len(header.raw)}"
        return Problem(finding, advice=f"correct [{section}] columns")
    finding = f"no column {column} (the log has: {listed(header)})"
    return Problem(finding, advice=f"correct [{section}] columns {channel}")


def listed(header: Header) -> str:
    """Return the column names of a log, shortened."""
    names = [name for name in header.raw if name]
    shown = ", ".join(name[:40] for name in names[:12])
    return f"{shown}, … ({len(names)} columns)" if len(names) > 12 else shown or "no names"


def describe_time(
    header: Header, settings: LogSettings, own: dict[str, Any], section: str
) -> tuple[TimeSource, list[Problem], list[str]]:
    """Return where the time of a log comes from, the problems and the warnings.

    own: the keys that the format determines.
    """
    named = settings.columns.get("time")
    if named is None and own.get("interval"):
        source = TimeSource(
            "none",
            start=own["start"] + own["interval"],
            interval=own["interval"],
            correction=own["interval_correction"],
        )
        return source, [], []
    if settings.clock == "count" and settings.rate and named is None:
        return TimeSource("none", interval=1.0 / settings.rate), [], []
    if isinstance(named, tuple):
        return _pair(header, named, section)
    if named is not None:
        index = column_index(header, named)
        if index is None:
            return TimeSource("none"), [missing_column(header, named, "time", section)], []
        return _single(header, index, settings, own, section)
    return _unnamed(header, settings, own, section)


def _unnamed(
    header: Header, settings: LogSettings, own: dict[str, Any], section: str
) -> tuple[TimeSource, list[Problem], list[str]]:
    """Return the time of a log whose rig names no column for it."""
    preset = own.get("columns", {}).get("time")
    if isinstance(preset, tuple):
        return _pair(header, preset, section)
    index = column_index(header, preset) if preset is not None else None
    if index is None:
        index = header.find("time")
    if index is None:
        pair = _named_pair(header)
        if pair is not None:
            return _pair(header, pair, section)
        index = aliases.find_named(header.names, words.TIME_NAMES, "time")
    if index is None:
        index = next((k for k, cell in enumerate(_first(header)) if is_stamp(cell)), None)
    if index is None:
        index = next((k for k, kind in enumerate(header.types) if _is_timestamp(kind)), None)
    if index is not None:
        return _single(header, index, settings, own, section)
    counter = aliases.find_named(header.names, words.COUNTER_NAMES)
    if settings.rate and counter is not None and look.is_counter(look.numbers(header, counter)):
        return _single(header, counter, settings, own, section)
    if settings.rate:
        return TimeSource("none", interval=1.0 / settings.rate), [], []
    rate = own.get("rate") or _stated_rate(header)
    if rate:
        note = f"{header.path}: no time column. {rate:g} Hz is used, the rate in the header"
        return TimeSource("none", interval=1.0 / rate), [], [note]
    finding = f"no time column (the log has: {listed(header)})"
    line: dict[str, Any] = {"rate": 100.0}
    if counter is not None and look.is_counter(look.numbers(header, counter)):
        finding = f"no time column; {header.raw[counter]} counts records"
        line["columns"] = {**settings.columns, "time": header.raw[counter]}
    advice = "with the sampling rate of the logger, Hz"
    return TimeSource("none"), [Problem(finding, {section: line}, advice)], []


def _is_timestamp(kind: Any) -> bool:
    return str(kind).startswith("timestamp")


def _first(header: Header) -> tuple[str, ...]:
    return header.records[0] if header.records else ()


def _stated_rate(header: Header) -> float | None:
    """Return the sampling rate in the comments of a log, Hz."""
    pattern = r"(?i)(?:sampl\w*|update|output|data|logging)[ _]?(?:rate|freq\w*)\W+([0-9.]+)\s*Hz"
    found = header.head.comment_value(pattern)
    return float(found) if found and float(found) > 0.0 else None


def _named_pair(header: Header) -> tuple[Column, Column] | None:
    """Return the columns of seconds and nanoseconds, where a log has both."""
    seconds = aliases.find_named(header.names, words.SECOND_NAMES)
    nano = aliases.find_named(header.names, words.NANOSECOND_NAMES)
    return None if seconds is None or nano is None else (seconds + 1, nano + 1)


def _pair(
    header: Header, columns: tuple[Column, Column], section: str
) -> tuple[TimeSource, list[Problem], list[str]]:
    """Return the time of two columns: GPS week and seconds, or seconds and nanoseconds."""
    found = [column_index(header, column) for column in columns]
    missing = [
        missing_column(header, column, "time", section)
        for column, index in zip(columns, found, strict=True)
        if index is None
    ]
    if missing or found[0] is None or found[1] is None:
        return TimeSource("none"), missing, []
    first, second = found[0], found[1]
    if _is_week(header, first, second):
        return TimeSource("week", (first, second), (_WEEK, 1.0), unit="s"), [], []
    small = factor(_unit_of_part(header, second) or _unit_by_size(header, second), "time")
    return TimeSource("split", (first, second), (1.0, small or 1e-9), unit="s"), [], []


def _is_week(header: Header, first: int, second: int) -> bool:
    """Whether two columns are GPS week and seconds of the week, not seconds and their parts.

    Seconds since power-on are as small as a week, but they change, and their parts are larger than
    the seconds of a week or have a unit.
    """
    weeks, seconds = look.numbers(header, first), look.numbers(header, second)
    if not len(weeks) or float(np.median(weeks)) >= _MAX_WEEK:
        return False
    if (_unit_of_part(header, second) or "s") != "s":
        return False
    return len(np.unique(weeks)) <= 2 and not (len(seconds) and float(seconds.max()) > _WEEK + 1.0)


def _unit_of_part(header: Header, index: int) -> str | None:
    """Return the unit of the part of a second that its column names, None without it."""
    plain = aliases.plain_name(header.names[index])
    named = aliases.unit_in_name(plain, "time")[1] or unit_name(plain, "time")
    return header.units[index] or named


def _unit_by_size(header: Header, index: int) -> str:
    """Return the unit of parts of a second by the largest of them: ms, us or ns."""
    parts = look.numbers(header, index)
    largest = float(parts.max()) if len(parts) else 0.0
    return "ms" if 0.0 < largest < 1e3 else "us" if 0.0 < largest < 1e6 else "ns"


def _single(
    header: Header, index: int, settings: LogSettings, own: dict[str, Any], section: str
) -> tuple[TimeSource, list[Problem], list[str]]:
    """Return the time of one column: text, a counter or numbers in a unit."""
    cell = _first(header)[index] if index < len(_first(header)) else ""
    if not cell:
        cell = next((c[index] for c in header.records if index < len(c) and c[index]), "")
    if is_stamp(cell) or _is_text_type(header, index):
        return _text(cell, index), [], []
    times = look.numbers(header, index)
    pair = _named_pair(header)
    if pair is not None and pair[0] == index + 1 and not look.step(times[:50]):
        names = [header.raw[int(k) - 1] for k in pair]
        finding = f"the time column {names[0]} repeats, {names[1]} has its digits"
        return (
            TimeSource("split", (index, int(pair[1]) - 1), (1.0, 1e-9)),
            [Problem(finding, {section: {"columns": {**settings.columns, "time": names}}})],
            [],
        )
    unit, origin = _unit_of(header, index, settings, own)
    if settings.rate and not unit and look.counts_other_records(times):
        note = (
            f"{header.path}: {header.names[index]} increases unevenly, so it counts other records "
            f"as well. The records of the IMU are counted at {settings.rate:g} Hz"
        )
        return TimeSource("none", interval=1.0 / settings.rate), [], [note]
    counter_rate = None if unit and origin == "rig" else own.get("counter_rate")
    if settings.rate and (own.get("needs_rate") or (not unit and look.is_counter(times))):
        counter_rate = settings.rate
    if counter_rate:
        source = TimeSource("counter", (index,), (counter_rate,), periods=_wraps(header, own))
        return source, [], []
    if own.get("needs_rate"):
        finding = "no SampleTimeFine and no update rate in the comments"
        return (
            TimeSource("counter", (index,)),
            [Problem(finding, {section: {"rate": 100.0}}, "with the rate of the export, Hz")],
            [],
        )
    notes = _conflict(header, index, settings, section)
    if settings.rate and settings.clock != "count":
        notes.append(
            f"{header.path}: [{section}] rate is not needed: the log has a time column. The time "
            "stamps are used"
        )
    if unit is None:
        return _without_unit(header, index, times, section, settings, notes)
    scale = factor(unit, "time")
    if scale is None:
        known = ", ".join(UNITS["time"])
        finding = f"{header.names[index]}: unknown unit {unit!r}, known: {known}"
        return (
            TimeSource("unit", (index,)),
            [Problem(finding, {section: _units("s", settings)})],
            [],
        )
    periods = tuple(scale * p for p in own.get("wraps", ()))
    return TimeSource("unit", (index,), (scale,), periods, unit=unit, origin=origin), [], notes


def _is_text_type(header: Header, index: int) -> bool:
    return bool(header.types) and (
        pa.types.is_string(header.types[index]) or pa.types.is_large_string(header.types[index])
    )


def _units(unit: str, settings: LogSettings) -> dict[str, Any]:
    return {"units": {**settings.units, "time": unit}}


def _wraps(header: Header, own: dict[str, Any]) -> tuple[float, ...]:
    """Return the counts at which the counter of a format starts again."""
    return tuple(float(wrap) for wrap in (header.form.wraps if header.form else ()))


def _text(cell: str, index: int) -> TimeSource:
    """Return the time of a column of dates or times of day."""
    cell = cell.strip()
    form = stamp_form(cell)
    periods = (_DAY,) if is_time_of_day(cell) else ()
    return TimeSource(
        "text", (index,), (1e-9,), periods, text=form, unit="ISO 8601", origin="values"
    )


def _unit_of(
    header: Header, index: int, settings: LogSettings, own: dict[str, Any]
) -> tuple[str | None, Origin]:
    """Return the unit of a time column and where it is from."""
    if "time" in settings.units:
        return settings.units["time"], "rig"
    if header.units[index]:
        return header.units[index], "header"
    plain = aliases.plain_name(header.names[index])
    ending = aliases.unit_in_name(plain, "time")[1] or (
        unit_name(plain, "time") if plain not in ("h", "min", "d") else None
    )
    if ending and plain not in ("t", "s"):
        return ending, "name"
    if "time" in own.get("units", {}):
        return own["units"]["time"], "format"
    return None, "assumed"


def _conflict(header: Header, index: int, settings: LogSettings, section: str) -> list[str]:
    """Return the warning about a unit in the header that is not that of the rig."""
    ours, theirs = settings.units.get("time"), header.units[index]
    if not ours or not theirs or factor(ours, "time") == factor(theirs, "time"):
        return []
    return [
        f"{header.path}: the header unit of time is {theirs}, [{section}] units time is {ours}. "
        "The rig is used"
    ]


def _without_unit(
    header: Header,
    index: int,
    times: Any,
    section: str,
    settings: LogSettings,
    notes: list[str],
) -> tuple[TimeSource, list[Problem], list[str]]:
    """Return the time of stamps without a unit: s, or the only unit that a logger can have."""
    name = header.names[index]
    source = TimeSource("unit", (index,), unit="s")
    if section == "imu" and look.is_counter(times) and settings.clock != "count":
        finding = f"{name} counts records (steps of 1) and has no unit"
        line = {section: {"rate": 100.0}}
        advice = 'with the sampling rate, Hz; if it is a time, set [imu] units = { time = "ms" }'
        return source, [Problem(finding, line, advice)], notes
    unit = look.time_unit(times, 1.01 if section == "imu" else 10.0)
    if unit:
        size = factor(unit, "time") or 1.0
        line_text = to_toml({**settings.units, "time": unit})
        notes.append(
            f"{header.path}: {name} has no unit, stamps from {show_time(float(times[0]))} in steps "
            f"of {look.step(times):.3g} are {unit}. They are read as {unit}; set [{section}] "
            f"units = {line_text}"
        )
        source = TimeSource("unit", (index,), (size,), unit=unit, origin="values")
    elif section == "imu" and 0.0 < look.mean_step(times) < 1.0 / _FASTEST_UNNAMED:
        notes.append(
            f"{header.path}: {name} has no unit, {1.0 / look.mean_step(times):.6g} records per "
            f"second if it is s. s is assumed; if it is another, set [{section}] units time"
        )
    return source, [], notes
