"""Describe the log of a turntable: which column is the angle or the rate, in which unit."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.logs.container.header import Header
from rotcli.logs.describe import aliases, look, words
from rotcli.logs.describe.imu import wrong_log_message
from rotcli.logs.describe.layout import Layout, Problem, Source
from rotcli.logs.describe.time import column_index, describe_time, listed, missing_column
from rotcli.logs.describe.units import RAW_WORDS, Choice, choose_unit
from rotcli.rig.rig import TableSettings
from rotcli.units import UNITS, factor, unit_name

# rad/s; a rate without unit above it is in deg/s: 2900 deg/s, three times the fastest tables.
_MAX_RATE = 50.0
_AXIS_NAMES = re.compile(
    r"(outer|middle|inner|yaw|pitch|roll|azimuth|elevation)(_\w+)?"
    r"|(axis|angle|pos|position|enc|encoder|theta)_?(x|y|z|a|b|c|\d)(_\w+)?"
)
_RATE = re.compile(r"rate|speed|vel|omega|rpm|dps")
_COMMANDED = re.compile(r"cmd|command|set|target|demand|desired|ref|err|soll")
_MAX_AXES = 4


@dataclass(frozen=True)
class TableLayout:
    """The layout of a table log.

    candidates: columns of which the one that moves is the axis, where the name does not show it.
    quantity: angle, rate or counts. unit: of the raw values.
    """

    layout: Layout
    quantity: str
    unit: str
    candidates: tuple[int, ...] = ()


def describe_table(
    header: Header, settings: TableSettings, imu_log: str | Path | None = None
) -> TableLayout:
    """Return the layout of a table log; raises LogError for an IMU log."""
    own = header.form.rig_defaults(header.head) if header.form else {}
    wanted = settings.columns.get("rate") or settings.columns.get("angle") or settings.column
    index = column_index(header, wanted)  # type: ignore[arg-type]
    time, problems, notes = describe_time(header, settings, own, "table")
    quantity: str | None = settings.quantity
    quantity = quantity or ("rate" if "rate" in settings.columns else None)
    candidates: tuple[int, ...] = ()
    if index is None and (wanted != "angle" or "angle" in settings.columns):
        _check_not_an_imu(header, imu_log)
        problems.append(missing_column(header, wanted, "column", "table"))  # type: ignore[arg-type]
    elif index is None:
        index, found, candidates = _search(header, settings, quantity, time.columns)
        quantity = quantity or found
    if index is None and not candidates and not _has_missing(problems):
        _check_not_an_imu(header, imu_log)
        problems = _no_angle(header, settings, time.columns, problems)
    places = candidates if index is None else (index,)
    if not places or not header.raw:
        layout = Layout(header.path, time, {}, notes=tuple(notes), problems=tuple(problems))
        return TableLayout(layout, quantity or "angle", "")
    first = places[0]
    named = settings.quantity is not None or "rate" in settings.columns
    if quantity is None:
        unit = settings.units.get("rate") or header.units[first]
        is_rate = bool(unit) and _is_rate(str(unit)) and "angle" not in settings.units
        quantity = "rate" if is_rate and not settings.counts_per_turn else "angle"
    if quantity == "rate" and not named:
        notes.append(_integrated(header, ", ".join(header.raw[k] for k in places)))
    source, unit_text, more, said = _source(header, settings, own, first, quantity)
    layout = Layout(
        header.path,
        time,
        {quantity: source},
        sparse=look.has_blank_records(header, (first,)),
        notes=(*notes, *said),
        problems=(*problems, *more),
    )
    return TableLayout(layout, quantity, unit_text, candidates)


def _has_missing(problems: list[Problem]) -> bool:
    """Return whether a column that the rig names is missing."""
    return any(problem.finding.startswith(("no column", "column:")) for problem in problems)


def _is_imu(header: Header) -> bool:
    return bool(aliases.find_triads(header.bases, "gyro")) or "gyro_z" in header.names


def _check_not_an_imu(header: Header, imu_log: str | Path | None) -> None:
    """Raise LogError for a log with a triad of gyros."""
    if _is_imu(header):
        raise LogError(header.path, wrong_log_message(header, imu_log, "an IMU log"))


def with_column(
    header: Header, settings: TableSettings, table: TableLayout, column: int
) -> TableLayout:
    """Return the layout whose angle is one of the candidates; raises LogError for its unit."""
    own = header.form.rig_defaults(header.head) if header.form else {}
    source, unit, problems, notes = _source(header, settings, own, column, table.quantity)
    layout = replace(
        table.layout,
        sources={table.quantity: source},
        notes=(*table.layout.notes, *notes),
        problems=tuple(problems),
    )
    layout.raise_problems()
    return TableLayout(layout, table.quantity, unit)


def _is_rate(unit: str) -> bool:
    return factor(unit, "rate") is not None and factor(unit, "angle") is None


def _integrated(header: Header, name: str) -> str:
    return (
        f"{header.path}: the log contains the rate ({name}), not the angle. It is integrated; set "
        '[table] quantity = "rate"'
    )


def _search(
    header: Header, settings: TableSettings, quantity: str | None, time: tuple[int, ...]
) -> tuple[int | None, str | None, tuple[int, ...]]:
    """Return the column of the angle or rate by usual names, or the candidates for it."""
    angle = aliases.find_named(header.names, words.ANGLE_NAMES, "angle")
    rate = aliases.find_named(header.names, words.RATE_NAMES, "rate")
    if quantity == "rate":
        return rate if rate is not None else angle, "rate", ()
    axes, rates = _axes(header, time)
    if 2 <= len(axes) <= _MAX_AXES:
        return None, "angle", axes
    if angle is not None and angle not in time:
        return angle, None, ()
    if len(axes) == 1:
        return axes[0], None, ()
    if _is_imu(header):  # its rates are those of the gyros
        return None, None, ()
    ending = _by_ending(header, words.ANGLE_ENDINGS, time)
    if ending is not None:
        return ending, None, ()
    if rate is not None:
        return rate, "rate", ()
    if 2 <= len(rates) <= _MAX_AXES:
        return None, "rate", rates
    ending = rates[0] if len(rates) == 1 else _by_ending(header, words.RATE_ENDINGS, time)
    if ending is not None:
        return ending, "rate", ()
    for kind in ("angle", "rate"):
        places = _by_unit(header, settings, kind, time)
        if len(places) == 1:
            return places[0], kind, ()
        if 2 <= len(places) <= _MAX_AXES:
            return None, kind, places
    return None, None, ()


def _axes(header: Header, time: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the columns of angles and of rates that are named by the axes of a table."""
    named = [
        k for k, name in enumerate(header.names)
        if k not in time and _AXIS_NAMES.fullmatch(aliases.plain_name(name))
    ]  # fmt: skip
    turning = tuple(
        k for k in named
        if _is_rate(header.units[k] or "") or _RATE.search(aliases.plain_name(header.names[k]))
    )  # fmt: skip
    return tuple(k for k in named if k not in turning), turning


def _by_ending(header: Header, endings: Sequence[str], time: tuple[int, ...]) -> int | None:
    """Return the only column whose name ends with a word, and is no command; else None."""
    names = [
        aliases.unit_in_name(aliases.plain_name(name), "angle", "rate")[0] for name in header.names
    ]
    found = [
        k for k, name in enumerate(names)
        if k not in time and name.endswith(tuple(f"_{e}" for e in endings))
        and not _COMMANDED.search(name)
    ]  # fmt: skip
    return found[0] if len(found) == 1 else None


def _by_unit(
    header: Header, settings: TableSettings, kind: str, time: tuple[int, ...]
) -> tuple[int, ...]:
    """Return the columns with a unit of angles or of rates."""
    return tuple(
        k for k, unit in enumerate(header.units)
        if k not in time and unit in UNITS[kind] and not _COMMANDED.search(header.names[k].lower())
    )  # fmt: skip


def _no_angle(
    header: Header, settings: TableSettings, time: tuple[int, ...], problems: list[Problem]
) -> list[Problem]:
    """Return the problems of a log without a known column of the angle."""
    if not header.header_line and "time" not in settings.columns and len(header.raw) > 1:
        finding = f"row {header.before + 1}: no header line, {len(header.raw)} columns of numbers"
        line = {"table": {"columns": {"time": 1, "angle": 2}}}
        others = [p for p in problems if not p.finding.startswith("no time column")]
        return [*others, Problem(finding, line, "or the numbers of other columns")]
    finding = f"no column angle (the log has: {listed(header)})"
    numeric = [
        k for k, name in enumerate(header.raw)
        if name and k not in time and len(look.numbers(header, k))
    ]  # fmt: skip
    if len(numeric) == 1:
        column: Any = header.raw[numeric[0]] if header.header_line else numeric[0] + 1
        return [*problems, Problem(finding, {"table": {"column": column}})]
    return [*problems, Problem(finding, advice="set [table] column")]


def _source(
    header: Header, settings: TableSettings, own: dict[str, Any], index: int, quantity: str
) -> tuple[Source, str, list[Problem], list[str]]:
    """Return the source of the angle or rate, its unit, problems and warnings."""
    scale = settings.scale.get(quantity, settings.scale.get("all", 1.0))
    offset = settings.offset.get(quantity, settings.offset.get("all", 0.0))
    if settings.counts_per_turn and quantity == "angle":
        size = 2.0 * np.pi / settings.counts_per_turn
        return Source(index, size * scale, offset, "counts", "rig"), "counts", [], []
    kinds = (quantity,)
    choice = choose_unit(header, index, quantity, kinds, settings.units, own, "table")
    notes = list(choice.notes)
    problems = list(choice.problems)
    if choice.unit is None and not problems and scale == 1.0:
        choice, problems, said = _from_values(header, index, quantity)
        notes += said
    text = (header.brackets[index] or header.units[index] or "").lower()
    if quantity == "angle" and text in RAW_WORDS and choice.unit is None:
        finding = f"{header.raw[index]} contains encoder counts"
        line = {"table": {"counts_per_turn": 4096}}
        problems.append(Problem(finding, line, "with the counts of a turn"))
    unit = choice.unit or {"angle": "rad", "rate": "rad/s"}[quantity]
    size = choice.size(quantity) * scale
    return Source(index, size, offset, unit, choice.origin), unit, problems, notes


def _from_values(
    header: Header, index: int, quantity: str
) -> tuple[Choice, list[Problem], list[str]]:
    """Return the unit of values without one, where they are decisive."""
    values = look.numbers(header, index)
    plain = aliases.plain_name(header.names[index])
    itself = unit_name(plain, quantity) if len(plain) > 1 else None
    if itself:  # a column that is called rpm, deg or turns
        return Choice(itself, "name", quantity), [], []
    if quantity == "rate" and len(values) and float(np.abs(values).max()) > _MAX_RATE:
        note = (
            f"{header.path}: {header.raw[index]} has no unit and reaches "
            f'{np.abs(values).max():.4g}. It is read as deg/s; set [table] units = "deg/s"'
        )
        return Choice("deg/s", "values"), [], [note]
    return Choice(None, "assumed"), [], []
