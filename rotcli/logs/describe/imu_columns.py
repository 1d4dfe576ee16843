"""Find the columns of an IMU log: those that the rig names, the format's, else usual names."""

from collections.abc import Sequence
from dataclasses import field
from typing import Any

from rotcli.dataclass import dataclass
from rotcli.files.channels import AXES, IMU_CHANNELS, OPTIONAL, Channel
from rotcli.files.formats import FORMATS
from rotcli.files.names import closest_match
from rotcli.logs.container.header import Header
from rotcli.logs.describe import aliases, look
from rotcli.logs.describe.layout import Problem
from rotcli.logs.describe.time import column_index, listed, missing_column
from rotcli.logs.describe.values import SENSOR_NAMES
from rotcli.rig.rig import ImuSettings
from rotcli.units import UNITS

_EUROC = {k: v for k, v in FORMATS["euroc"].rig["columns"].items() if isinstance(v, str)}


@dataclass
class ImuColumns:
    """The columns (index) of channels, what is wrong with the rig's, and warnings.

    excused: channels without a column for which there is a problem already.
    """

    found: dict[str, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    excused: set[str] = field(default_factory=set)


def find_columns(header: Header, imu: ImuSettings, own: dict[str, Any]) -> ImuColumns:
    """Return the column of each channel that the log contains.

    own: the keys that the format determines. A column that the rig names and the log lacks is a
    problem.
    """
    result = ImuColumns(notes=_number_conflicts(header, imu))
    for sensor in ("gyro", "accel"):
        names = [name for name in AXES if name.startswith(sensor)]
        if sensor == "accel" and imu.accel_log is not None:
            continue  # they are in that file
        for name in names:
            if name in imu.columns:
                _take_named(header, imu, name, result)
        rest = [name for name in names if name not in imu.columns]
        _find_triad(header, own, sensor, rest, result)
    for channel in OPTIONAL:
        _find_optional(header, imu, own, channel, result)
    if imu.channels:  # the others are not used even where the log has them
        stated = needed_channels(imu, None)
        result.found = {k: v for k, v in result.found.items() if k in stated or k not in AXES}
    return result


def _take_named(header: Header, imu: ImuSettings, name: str, result: ImuColumns) -> None:
    """Take the column that the rig names for a channel."""
    column = imu.columns[name]
    assert not isinstance(column, tuple)  # only the time has two columns
    index = column_index(header, column)
    if index is None:
        problem = missing_column(header, column, name, "imu")
        if header.find(name) is not None:
            advice = f"the log has {name}: remove [imu] columns {name}, or correct it"
            problem = Problem(problem.finding, advice=advice)
        result.problems.append(problem)
        result.excused.add(name)
        return
    result.found[name] = index


def _number_conflicts(header: Header, imu: ImuSettings) -> list[str]:
    """Return the warning about column numbers whose columns have the name of another channel."""
    pairs = []
    for name, column in imu.columns.items():
        if not isinstance(column, int) or column > len(header.raw):
            continue
        label = header.bases[column - 1]
        if label != name and label in ("time", *AXES):
            pairs.append(f"{name} = {column} ({label})")
    if not pairs:
        return []
    finding = f"[imu] columns name columns of other channels by number: {', '.join(pairs)}"
    return [f"{header.path}: {finding}. The rig is used; correct it if this is not intended"]


def _find_triad(
    header: Header, own: dict[str, Any], sensor: str, names: Sequence[str], result: ImuColumns
) -> None:
    """Find the columns of axes of one sensor: by the format, rotcli's names or usual names."""
    triad: tuple[int, ...] | None = None
    for name in names:
        preset = own.get("columns", {}).get(name)
        if isinstance(preset, int) and preset > len(header.raw):
            result.problems.append(missing_column(header, preset, name, "imu"))
            result.excused.add(name)
            continue
        for option in (preset, name, _EUROC.get(name)):
            index = column_index(header, option) if option is not None else None
            if index is not None:
                result.found[name] = index
                break
        else:
            triad = triad or _alias_triad(header, sensor, result.problems)
            if triad:
                result.found[name] = triad["xyz".index(name[-1])]


def _find_optional(
    header: Header, imu: ImuSettings, own: dict[str, Any], channel: Channel, result: ImuColumns
) -> None:
    name = channel.name
    column = imu.columns.get(name, own.get("columns", {}).get(name))
    if column is None:
        index = aliases.find_named(header.names, channel.names, channel.quantity)
    else:
        assert not isinstance(column, tuple)
        index = column_index(header, column)
        if index is None and name in imu.columns:
            result.problems.append(missing_column(header, column, name, "imu"))
    if index is not None:
        result.found[name] = index


def _alias_triad(header: Header, sensor: str, problems: list[Problem]) -> tuple[int, ...] | None:
    """Return the columns of the one triad with usual names; several are a problem."""
    found = next(
        (f for names in (header.bases, header.names, header.raw)
         if (f := aliases.find_triads(names, sensor))), []
    )  # fmt: skip
    found = found or aliases.find_triads_by_unit(header.bases, header.units, sensor)
    if len(found) > 1:
        firsts = ", ".join(header.raw[t.columns[0]] for t in found)
        names = {
            f"{sensor}_{axis}": header.raw[k]
            for axis, k in zip("xyz", found[0].columns, strict=True)
        }
        finding = f"{len(found)} {SENSOR_NAMES[sensor]} triads ({firsts}, …)"
        problems.append(Problem(finding, {"imu": {"columns": names}}, "or those of another triad"))
    return found[0].columns if found else None


def needed_channels(imu: ImuSettings, channels: Sequence[str] | None) -> list[str]:
    """Return the channels that must be in the log: a caller's, the rig's, else all six axes."""
    if channels is not None:
        return list(channels)
    if imu.channels:
        return [c.name for c in IMU_CHANNELS if {c.name, c.group} & set(imu.channels)]
    if imu.accel_log:
        return [name for name in AXES if name.startswith("gyro")]
    return list(AXES)


def missing_channels(
    header: Header, columns: ImuColumns, needed: Sequence[str], stated: Sequence[str]
) -> list[Problem]:
    """Return the problems of channels that the log lacks; stated: [imu] channels."""
    lacking = [n for n in needed if n not in columns.found and n not in columns.excused]
    if not lacking:
        return []
    if not header.header_line:
        first = header.before + 1
        finding = f"row {first}: no header line, {len(header.raw)} columns of numbers"
        numbered = _numbered_columns(header)
        if numbered:
            advice = "or other numbers where the order differs"
            return [Problem(finding, {"imu": numbered}, advice, instead="add one or ")]
        example = "add one or set [imu] columns = { time = 1, gyro_x = 2, … }"
        return [Problem(finding, advice=example)]
    have = [name for name in AXES if name in columns.found]
    if not have and not columns.excused and (single := _single_gyro(header)):
        return [single]
    if stated and have:
        finding = f"{', '.join(lacking)} missing; this command needs them"
        return [Problem(finding, advice="set [imu] accel_log, or use a log that contains them")]
    without = {name[:-2] for name in lacking}
    no_accel = not any(n.startswith("accel") for n in have)
    if have and without == {"accel"} and no_accel:
        finding = f"no accelerometer columns (the log has: {listed(header)})"
        advice = "for a log of gyros only, else set [imu] columns or accel_log"
        return [Problem(finding, {"imu": {"channels": ["gyro"]}}, advice)]
    if have and len(have) < 3 and no_accel:
        finding = f"no columns {', '.join(lacking)} (the log has: {listed(header)})"
        return [Problem(finding, {"imu": {"channels": have}}, "for a log of these axes only")]
    text = ", ".join(lacking)
    finding = f"no column {text} (the log has: {listed(header)})"
    mixed = {
        f"{sensor}_{axis}": header.raw[k]
        for sensor in ("gyro", "accel")
        if not any(name.startswith(sensor) for name in have)
        for axis, k in aliases.mixed_axes(header.names, sensor).items()
    }
    if set(lacking) <= set(mixed):
        lines = {"columns": {name: mixed[name] for name in lacking}}
        return [Problem(finding, {"imu": lines}, "if these are one triad")]
    return [Problem(finding, advice=_columns_advice(header, lacking))]


def _numbered_columns(header: Header) -> dict[str, Any]:
    """Return the keys for records of six or seven numbers: time, and which triad shows gravity."""
    width = len(header.raw) - (header.raw[-1:] == ("",))
    first = width - len(AXES)
    if first not in (0, 1):
        return {}
    sizes = [look.gravity_size(header, range(k, k + 3)) for k in (first, first + 3)]
    gravity = [look.acceleration_unit(size) is not None for size in sizes]
    order = ("accel", "gyro") if gravity == [True, False] else ("gyro", "accel")
    names = [f"{sensor}_{axis}" for sensor in order for axis in "xyz"]
    columns = {"time": 1} if first else {}
    columns |= {name: first + 1 + k for k, name in enumerate(names)}
    ordered = {name: columns[name] for name in ("time", *AXES) if name in columns}
    return {"columns": ordered} if first else {"columns": ordered, "rate": 100.0}


def _single_gyro(header: Header) -> Problem | None:
    """Return the problem of a log of one or two gyros under a usual name, None for others."""
    axes = aliases.single_axes(header.names, "gyro")
    if aliases.single_axes(header.names, "accel"):
        return None
    columns = {f"gyro_{axis}": header.raw[k] for axis, k in sorted(axes.items())}
    advice = "for a log of these axes only"
    if not columns:
        rates = [k for k, unit in enumerate(header.units) if unit in UNITS["rate"]]
        if len(rates) != 1:
            return None
        columns = {"gyro_z": header.raw[rates[0]]}
        advice = "for a log of one gyro, with its axis"
    finding = f"only {len(columns)} gyro column{'s' * (len(columns) > 1)} (the log has: "
    rig = {"imu": {"columns": columns, "channels": list(columns)}}
    return Problem(f"{finding}{listed(header)})", rig, advice)


def _columns_advice(header: Header, lacking: Sequence[str]) -> str:
    """Return which name could be meant by one misspelled column; else the line to fill in."""
    if len(lacking) == 1:
        axis = lacking[0][-1]
        others = [n for n in header.names if n and n.lower().endswith(axis)]
        near = closest_match(lacking[0], others)
        if near:
            return f'set [imu] columns = {{ {lacking[0]} = "{near}" }}'
    more = ", … }" if len(lacking) > 1 else " }"
    return f'set [imu] columns = {{ {lacking[0]} = "?"{more}, with the name in the log for each "?"'
