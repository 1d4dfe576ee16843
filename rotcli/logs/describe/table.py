"""Describe the log of a turntable: which column is the angle or the rate, in which unit."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rotcli.errors import LogError
from rotcli.logs.container.header import Header
from rotcli.logs.describe import aliases, look, words
from rotcli.logs.describe.imu import wrong_log_message
from rotcli.logs.describe.layout import Layout, Problem, Source
from rotcli.logs.describe.time import column_index, describe_time, listed, missing_column
from rotcli.logs.describe.units import RAW_WORDS, Choice, choose_unit
from rotcli.rig.rig import TableSettings
from rotcli.units import factor

# rad/s; a rate without unit above it is in deg/s: 2900 deg/s, three times the fastest tables.
_MAX_RATE = 50.0
_AXIS_NAMES = re.compile(
    r"(outer|middle|inner|yaw|pitch|roll|azimuth|elevation)(_\w+)?"
    r"|(axis|angle|pos|position|enc|encoder|theta)_?(x|y|z|a|b|c|\d)(_\w+)?"
)
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
    if index is None and any(n in ("gyro_x", "gyro_z") for n in header.names):
        raise LogError(header.path, wrong_log_message(header, imu_log, "an IMU log"))
    time, problems, notes = describe_time(header, settings, own, "table")
    quantity: str | None = settings.quantity
    quantity = quantity or ("rate" if "rate" in settings.columns else None)
    candidates: tuple[int, ...] = ()
    if index is None and wanted != "angle":
        missing = missing_column(header, wanted, "column", "table")  # type: ignore[arg-type]
        problems.append(missing)
    elif index is None:
        index, found, candidates = _search(header, quantity, time.columns)
        quantity = quantity or found
    if index is None and not candidates and not problems:
        problems.append(_no_angle(header, time.columns))
    first = index if index is not None else candidates[0] if candidates else 0
    if quantity is None:
        unit = settings.units.get("rate") or header.units[first] if header.raw else None
        is_rate = bool(unit) and _is_rate(str(unit)) and "angle" not in settings.units
        quantity = "rate" if is_rate else "angle"
        if is_rate and not settings.counts_per_turn:
            notes.append(_integrated(header, header.raw[first]))
    elif quantity == "rate" and settings.quantity is None and "rate" not in settings.columns:
        notes.append(_integrated(header, header.raw[first]))
    source, unit_text, more, said = _source(header, settings, own, first, quantity)
    problems += more
    layout = Layout(
        header.path,
        time,
        {quantity: source} if header.raw else {},
        sparse=look.has_blank_records(header, (first,)),
        notes=(*notes, *said),
        problems=tuple(problems),
    )
    return TableLayout(layout, quantity, unit_text, candidates)


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
    header: Header, quantity: str | None, time: tuple[int, ...]
) -> tuple[int | None, str | None, tuple[int, ...]]:
    """Return the column of the angle or rate by usual names, or the candidates for it."""
    angle = aliases.find_named(header.names, words.ANGLE_NAMES, "angle")
    rate = aliases.find_named(header.names, words.RATE_NAMES, "rate")
    if quantity == "rate":
        return rate if rate is not None else angle, "rate", ()
    axes = tuple(
        k for k, name in enumerate(header.names)
        if k not in time and _AXIS_NAMES.fullmatch(aliases.plain_name(name))
    )  # fmt: skip
    if 2 <= len(axes) <= _MAX_AXES:
        return None, "angle", axes
    if angle is not None and angle not in time:
        return angle, None, ()
    if len(axes) == 1:
        return axes[0], None, ()
    if rate is not None:
        return rate, "rate", ()
    return None, None, ()


def _no_angle(header: Header, time: tuple[int, ...]) -> Problem:
    """Return the problem of a log without a known column of the angle."""
    finding = f"no column angle (the log has: {listed(header)})"
    numeric = [
        k for k, name in enumerate(header.raw)
        if name and k not in time and len(look.numbers(header, k))
    ]  # fmt: skip
    if len(numeric) == 1:
        column: Any = header.raw[numeric[0]] if header.header_line else numeric[0] + 1
        return Problem(finding, {"table": {"column": column}})
    return Problem(finding, advice="set [table] column")


def _source(
    header: Header, settings: TableSettings, own: dict[str, Any], index: int, quantity: str
) -> tuple[Source, str, list[Problem], list[str]]:
    """Return the source of the angle or rate, its unit, problems and warnings."""
    scale = settings.scale.get(quantity, settings.scale.get("all", 1.0))
    offset = settings.offset.get(quantity, settings.offset.get("all", 0.0))
    if settings.counts_per_turn and quantity == "angle":
        size = 2.0 * np.pi / settings.counts_per_turn
        return Source(index, size * scale, offset, "counts", "rig"), "counts", [], []
    if not header.raw:
        return Source(0, 1.0), "", [], []
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
    if quantity == "rate" and len(values) and float(np.abs(values).max()) > _MAX_RATE:
        note = (
            f"{header.path}: {header.raw[index]} has no unit and reaches "
            f'{np.abs(values).max():.4g}. It is read as deg/s; set [table] units = "deg/s"'
        )
        return Choice("deg/s", "values"), [], [note]
    return Choice(None, "assumed"), [], []
