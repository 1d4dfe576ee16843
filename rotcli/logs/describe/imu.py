"""Describe an IMU log: which column is which channel, in which unit, and what is wrong with it.

Names come from the rig, the format, rotcli's own names or the usual words, in this order; units
from the rig, the header, the format, else from the values where they are decisive, else SI.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rotcli.errors import LogError
from rotcli.files.channels import AXES, IMU_CHANNELS, OPTIONAL, Channel
from rotcli.logs.container.header import Header
from rotcli.logs.describe import look
from rotcli.logs.describe.imu_columns import find_columns, missing_channels, needed_channels
from rotcli.logs.describe.layout import Layout, Problem, Source
from rotcli.logs.describe.time import describe_time
from rotcli.logs.describe.units import Choice, choose_unit
from rotcli.logs.describe.values import (
    SENSOR_NAMES,
    find_instance,
    gravity_problems,
    scale_problem,
    unit_from_values,
)
from rotcli.rig.rig import ImuSettings, Rig
from rotcli.units import TEMPERATURE_ZERO, UNITS

TABLE_NAMES = ("angle", "outer", "middle", "inner")


def describe_imu(
    header: Header,
    rig: Rig,
    channels: Sequence[str] | None = None,
    table_log: str | Path | None = None,
) -> Layout:
    """Return the layout of an IMU log; `raise_problems` raises what prevents reading.

    channels: those that the caller needs (default: [imu] channels, else all six axes). table_log:
    the file that is read as that, for messages. Raises LogError for a table log.
    """
    own = header.form.rig_defaults(header.head) if header.form else {}
    if not (header.form and header.records) and header.form:
        own = dict(header.form.rig)
    time, problems, notes = describe_time(header, rig.imu, own, "imu")
    columns = find_columns(header, rig.imu, own)
    if not any(name in columns.found or name in columns.excused for name in AXES):
        _check_not_a_table(header, rig, table_log)
    problems += columns.problems
    notes += columns.notes
    needed = needed_channels(rig.imu, channels)
    missing = missing_channels(header, columns, needed, rig.imu.channels)
    if missing and not header.header_line:
        problems = [p for p in problems if not p.finding.startswith("no time column")]
    problems += missing
    used = dict(columns.found)
    sources: dict[str, Source] = {}
    for sensor in ("gyro", "accel"):
        names = [name for name in used if name.startswith(sensor)]
        if names:
            made, more, said = _triad_sources(header, rig.imu, own, sensor, names, used, time)
            sources |= made
            problems += more
            notes += said
    rates = [p for p in problems if p.finding.startswith("sampling is")]
    if len(rates) == 2:  # of one sensor only: the other one contains increments
        problems = [replace(p, fatal=p is rates[0] or p.fatal) for p in problems]
    for channel in OPTIONAL:
        column = used.get(channel.name)
        if column is not None and not _is_rarely_logged(header, rig.imu, channel, column, notes):
            sources |= _optional(header, rig.imu, own, channel, column, problems)
    if header.unit_conflicts:
        pairs = "; ".join(header.unit_conflicts)
        notes.append(f"{header.path}: the units in names and metadata differ: {pairs}")
    problems += _separate_records(header, sources)
    selected, said, more = find_instance(header, rig.imu, used.values())
    ordered = {c.name: sources[c.name] for c in IMU_CHANNELS if c.name in sources}
    return Layout(
        header.path,
        time,
        ordered,
        selected,
        look.has_blank_records(header, [s.column for s in ordered.values()]),
        (*notes, *said),
        (*problems, *more),
    )


def _is_rarely_logged(
    header: Header, imu: ImuSettings, channel: Channel, column: int, notes: list[str]
) -> bool:
    """Return whether a channel is blank in some records, and add the warning about it."""
    if channel.name in imu.columns or not any(look.blank_records(header, (column,))):
        return False
    notes.append(
        f"{header.path}: {header.names[column]} is blank in some records. It is not used; log it "
        "with each record, or in a file of its own"
    )
    return True


def _separate_records(header: Header, sources: dict[str, Source]) -> list[Problem]:
    """Return the problem of gyros and accelerometers that take turns, each in its own records."""
    blank = [
        look.blank_records(header, [s.column for name, s in sources.items() if name in triad])
        for triad in (AXES[:3], AXES[3:])
    ]
    if not any(blank[0]) or not any(blank[1]):
        return []
    if not all(a or b for a, b in zip(*blank, strict=True)):
        return []
    finding = "gyros and accelerometers are in different records"
    return [Problem(finding, {"imu": {"accel_log": Path(header.path).name}})]


def _check_not_a_table(header: Header, rig: Rig, table_log: str | Path | None) -> None:
    names = [*TABLE_NAMES]
    if isinstance(rig.table.column, str):
        names.append(rig.table.column)
    if any(name in header.names or name in header.bases for name in names):
        raise LogError(header.path, wrong_log_message(header, table_log, "a table log"))


def wrong_log_message(header: Header, other: str | Path | None, kind: str) -> str:
    """Return the message about a log of the other kind, and why that may be."""
    if other is not None and Path(other).exists() and Path(other).samefile(header.path):
        return f"the IMU log and the table log are the same file, and it is {kind}; name both logs"
    return f"this looks like {kind}; is the order IMU_LOG TABLE_LOG swapped?"


def _triad_sources(
    header: Header,
    imu: ImuSettings,
    own: dict[str, Any],
    sensor: str,
    names: list[str],
    columns: dict[str, int],
    time: Any,
) -> tuple[dict[str, Source], list[Problem], list[str]]:
    """Return the sources of the axes of one sensor, with one unit for each."""
    channels = {c.name: c for c in IMU_CHANNELS}
    first = channels[names[0]]
    kinds = (first.quantity, first.increment)
    indices = [columns[name] for name in names]
    choices = [choose_unit(header, k, first.group, kinds, imu.units, own, "imu") for k in indices]
    problems = [p for c in choices for p in c.problems][:1]
    notes = list(dict.fromkeys(note for c in choices for note in c.notes))
    if len({c.unit for c in choices}) > 1:
        pairs = ", ".join(f"{n} {c.unit or 'no unit'}" for n, c in zip(names, choices, strict=True))
        notes.append(f"{header.path}: the axes have different units: {pairs}")
    scaled = bool(imu.scale) or bool(own.get("scale"))
    if not problems and all(c.unit is None for c in choices) and not scaled:
        choice, more, said = unit_from_values(
            header, imu, sensor, indices, [columns[n] for n in AXES[3:] if n in columns], time
        )
        choices = [choice] * len(choices)
        problems += more
        notes += said
    sampling = imu.sampling if imu.sampling != "instant" else own.get("sampling", imu.sampling)
    if own.get("needs_scale") is not None and not imu.scale:
        problems += scale_problem(own["needs_scale"]) if sensor == "gyro" else []
    sources = {}
    for name, k, choice in zip(names, indices, choices, strict=True):
        increments, more = _increments(header, sensor, choice, sampling, imu)
        problems += [p for p in more if p not in problems]
        unit = choice.unit or next(iter(UNITS[first.increment if increments else first.quantity]))
        scale, offset = _affine(imu, own, name, sensor)
        size = choice.size(first.increment if increments else first.quantity)
        sign = -1.0 if sensor == "accel" and imu.reports_gravity else 1.0
        sources[name] = Source(k, sign * scale * size, offset, unit, choice.origin, increments)
    if len({source.increments for source in sources.values()}) > 1:
        pairs = ", ".join(f"{n} in {s.unit}" for n, s in sources.items())
        finding = f"the {SENSOR_NAMES[sensor]} axes mix increments and rates ({pairs})"
        problems.append(Problem(finding, advice=f"set [imu] units {sensor} or sampling"))
    if sensor == "accel" and len(names) == 3 and not problems:
        problems += gravity_problems(header, imu, sources, names, time)
    return sources, problems, notes


def _affine(imu: ImuSettings, own: dict[str, Any], name: str, group: str) -> tuple[float, float]:
    """Return scale and offset of a channel: those of the rig, else of the format."""
    scale = 1.0
    for table in (imu.scale, own.get("scale", {})):
        for key in (name, group, "all"):
            if key in table:
                scale = table[key]
                break
        else:
            continue
        break
    if own.get("signs") and name in own["signs"]:
        scale *= own["signs"][name]
    offset = next((imu.offset[k] for k in (name, group, "all") if k in imu.offset), 0.0)
    return scale, offset


def _increments(
    header: Header, sensor: str, choice: Choice, sampling: str, imu: ImuSettings
) -> tuple[bool, list[Problem]]:
    """Return whether a triad contains increments, by its unit where it has one."""
    quantity = "angle" if sensor == "gyro" else "velocity"
    if choice.unit is None:
        return sampling == "increment", []
    if choice.size(quantity) and choice.kind == quantity:
        if sampling == "increment":
            return True, []
        finding = (
            f"the unit of the {SENSOR_NAMES[sensor]}s is {choice.unit}, so they contain increments"
        )
        return True, [Problem(finding, {"imu": {"sampling": "increment"}})]
    if sampling == "increment" and imu.sampling == "increment":
        kind = f"the {SENSOR_NAMES[sensor]}s"
        finding = f'sampling is "increment", but the unit of {kind} is {choice.unit}'
        return False, [Problem(finding, {"imu": {"sampling": "average"}}, fatal=False)]
    return False, []


def _optional(
    header: Header,
    imu: ImuSettings,
    own: dict[str, Any],
    channel: Channel,
    column: int,
    problems: list[Problem],
) -> dict[str, Source]:
    """Return the source of an optional channel in its unit, such as degC; none if unreadable."""
    name, quantity = channel.name, channel.quantity
    choice = choose_unit(header, column, channel.group, (quantity,), imu.units, own, "imu")
    if choice.problems and name in imu.columns:
        problems += choice.problems
    elif choice.problems or (header.is_text and not len(look.numbers(header, column))):
        return {}
    scale, offset = _affine(imu, own, name, channel.group)
    unit = choice.unit or channel.unit
    size = choice.size(quantity)
    zero = -TEMPERATURE_ZERO.get(unit, 0.0) / size if quantity == "temperature" else 0.0
    return {name: Source(column, scale * size, offset + zero / scale, unit, choice.origin)}
