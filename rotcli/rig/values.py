"""Kinds of values that only a rig contains: mounts, axes, columns, units, formats.

The other kinds are in `rotcli.files.toml_schema`. An invalid value raises InvalidValue, whose
text says what was found and what is allowed; `rig.keys` adds the name of the key.
"""

import codecs
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rotcli.files.channels import BY_NAME
from rotcli.files.formats import FORMATS, FRAMES
from rotcli.files.names import suggest
from rotcli.files.toml_schema import (
    KINDS,
    InvalidValue,
    Key,
    number,
    numbers,
    show,
    text,
)
from rotcli.units import UNITS, FloatArray, factor, unit_name

UNIT_VECTORS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

_MOUNT_TOLERANCE = 1e-6  # of orthogonality: a mount is written to seven digits
_MAX_AXIS = 1e6  # of a component of a vector
_MAX_COLUMN = 100_000  # number of a column
_MIN_AXIS = 1e-6  # length below which a vector has no direction
_UNIT_LENGTH = 1e-14  # rounding of a vector of length 1


def _unit_kinds(group: str) -> tuple[str, ...]:
    """Return the kinds of units of a group of channels, or of the time."""
    if group == "time":
        return ("time",)
    channel = next(c for c in BY_NAME.values() if c.group == group)
    return (channel.quantity, *((channel.increment,) if channel.increment else ()))


def _mount(key: Key, value: object) -> FloatArray:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise InvalidValue(f"{show(value)} is not three rows of three numbers")
    m = np.array([numbers(key, row, 3) for row in value])
    deviation = float(np.abs(m @ m.T - np.eye(3)).max())
    if deviation > _MOUNT_TOLERANCE:
        raise InvalidValue(
            f"the rows are not orthogonal unit vectors (deviation {deviation:.2g}); "
            "write each sensor axis in the mounting frame, with seven digits or more"
        )
    if np.linalg.det(m) < 0:
        raise InvalidValue(
            "a reflection (determinant -1), not a rotation; check its signs. For accelerometers "
            "that read -g upward set reports_gravity = true"
        )
    return m


def _axis(_: Key, value: object) -> FloatArray:
    allowed = "allowed: x, y, z or a list of 3 numbers"
    if isinstance(value, str):
        if value not in UNIT_VECTORS:
            raise InvalidValue(f"{show(value)} is not allowed; {allowed}")
        return np.array(UNIT_VECTORS[value])
    try:
        vector = np.array(numbers(Key("number", low=-_MAX_AXIS, high=_MAX_AXIS), value, 3))
    except InvalidValue as error:
        raise InvalidValue(f"{str(error).partition('; allowed')[0]}; {allowed}") from error
    length = float(np.sqrt(np.sum(vector**2)))
    if length < _MIN_AXIS:
        raise InvalidValue(f"{show(value)} has no direction; write a vector of length 1")
    return vector if abs(length - 1.0) < _UNIT_LENGTH else vector / length


def _axes(key: Key, value: object) -> tuple[FloatArray, ...]:
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= 3:
        raise InvalidValue(f'{show(value)} is not a list of 1 to 3 axes such as ["z", "x"]')
    return tuple(_axis(key, v) for v in value)


def _directions(_: Key, value: object) -> tuple[int, ...]:
    if not isinstance(value, list | tuple) or not all(v in (1, -1) for v in value):
        raise InvalidValue(f"{show(value)} is not a list of 1 and -1, one for each axis")
    return tuple(int(v) for v in value)


def _column(_: Key, value: object) -> str | int:
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= _MAX_COLUMN:
        return value
    if isinstance(value, Mapping):
        example = 'write columns = { time = "…", angle = "…" }'
        raise InvalidValue(f"{show(value)} is not a column name in quotes; {example}")
    if not isinstance(value, str) or not value.strip():
        raise InvalidValue(f"{show(value)} is not a column name in quotes, nor its number from 1")
    return value


def _named(key: Key, value: object) -> Mapping[str, Any]:
    """Return a table whose keys are all among the choices."""
    if not isinstance(value, Mapping):
        raise InvalidValue(f'{show(value)} is not a table such as {{ {key.choices[0]} = "…" }}')
    for name in value:
        if name not in key.choices:
            raise InvalidValue(f"{name}: unknown key; {suggest(str(name), key.choices)}")
    return value


# Names of the angle columns by number of table axes, outermost first.
AXIS_COLUMNS = {1: ("angle",), 2: ("outer", "inner"), 3: ("outer", "middle", "inner")}


def _columns(key: Key, value: object) -> dict[str, str | int | tuple[str | int, ...]]:
    found: dict[str, str | int | tuple[str | int, ...]] = {}
    if isinstance(value, list | tuple) and "outer" in key.choices and len(value) in AXIS_COLUMNS:
        # A list names the angles of the table's axes, outermost first.
        value = dict(zip(AXIS_COLUMNS[len(value)], value, strict=True))
    for name, column in _named(key, value).items():
        try:
            if name == "time" and isinstance(column, list | tuple) and len(column) == 2:
                found[name] = (_column(key, column[0]), _column(key, column[1]))
            else:
                found[name] = _column(key, column)
        except InvalidValue as error:
            raise InvalidValue(f"{name}: {error}") from None
    plain = [c for c in found.values() if not isinstance(c, tuple)]
    if len(set(plain)) < len(plain):
        raise InvalidValue(f"{show(value)} names one column of the log twice")
    return found


def _units(key: Key, value: object) -> dict[str, str]:
    if isinstance(value, str) and "angle" in key.choices:
        # A text alone is the unit of the table's angle or rate.
        group = "rate" if factor(value, "angle") is None and factor(value, "rate") else "angle"
        value = {group: value}
    elif "angle" in key.choices and not isinstance(value, Mapping):
        example = 'write units = "deg" or units = { time = "ms", angle = "deg" }'
        raise InvalidValue(f"{show(value)} is not a unit in quotes; {example}")
    for name, unit in _named(key, value).items():
        kinds = _unit_kinds(name)
        if not isinstance(unit, str) or unit_name(unit, *kinds) is None:
            known = ", ".join(u for kind in kinds for u in UNITS[kind])
            raise InvalidValue(f"{name}: {show(unit)} is not a known unit; known: {known}")
    return {name: str(unit_name(unit, *_unit_kinds(name))) for name, unit in dict(value).items()}  # type: ignore[call-overload]


def _by_channel(key: Key, value: object) -> dict[str, float]:
    """Return numbers by group or channel; a number alone is for all, a list for x, y, z."""
    plain = Key("number", low=key.low, high=key.high)
    if not isinstance(value, Mapping):
        return {"all": number(plain, value)}
    found: dict[str, float] = {}
    for name, item in _named(key, value).items():
        try:
            if isinstance(item, list | tuple):
                axes = zip("xyz", numbers(plain, item, 3), strict=True)
                found |= {f"{name}_{axis}": one for axis, one in axes}
            else:
                found[name] = number(plain, item)
        except InvalidValue as error:
            raise InvalidValue(f"{name}: {error}") from None
    return found


def _scale(key: Key, value: object) -> dict[str, float]:
    found = _by_channel(key, value)
    for name, one in found.items():
        if one == 0.0:
            raise InvalidValue(f"{name}: 0 is not allowed; write the size of one count")
    return found


def _sampling(key: Key, value: object) -> str:
    if value not in key.choices:
        raise InvalidValue(f"{show(value)} is not allowed; allowed: {', '.join(key.choices)}")
    return str(value)


def _format(_: Key, value: object) -> str:
    if not isinstance(value, str) or value not in FORMATS:
        raise InvalidValue(f"{show(value)} is not a known format; {suggest(str(value), FORMATS)}")
    return value


def _frame(_: Key, value: object) -> str:
    if not isinstance(value, str) or value not in FRAMES:
        raise InvalidValue(f"{show(value)} is not allowed; allowed: {', '.join(FRAMES)}")
    return value


def _delimiter(_: Key, value: object) -> str:
    if not isinstance(value, str) or len(value) != 1 or value in '\r\n"':
        example = 'write one sign in quotes, such as "\\t", ";" or " " (any run of blanks)'
        raise InvalidValue(f"{show(value)} is not a delimiter; {example}")
    return value


def _encoding(_: Key, value: object) -> str:
    name = text(Key("text"), value)
    try:
        codecs.lookup(name)
    except LookupError:
        raise InvalidValue(f"{show(value)} is not a known encoding; similar: utf-8") from None
    return name


def _texts(_: Key, value: object) -> tuple[str, ...]:
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or not all(isinstance(n, str) and n for n in names):
        raise InvalidValue(f"{show(value)} is not a list of texts in quotes")
    return tuple(names)


def _channels(key: Key, value: object) -> tuple[str, ...]:
    for name in _texts(key, value):
        if name not in key.choices:
            raise InvalidValue(f"{name}: not a channel; {suggest(name, key.choices)}")
    return _texts(key, value)


def _instance(_: Key, value: object) -> int | str:
    valid = isinstance(value, str) and value != ""
    valid |= isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63
    if not valid:
        raise InvalidValue(f"{show(value)} is not a number or a name of an IMU in the log")
    return value  # type: ignore[return-value]


_KINDS: dict[str, Callable[[Key, Any], Any]] = {
    **KINDS,
    "mount": _mount,
    "axis": _axis,
    "axes": _axes,
    "directions": _directions,
    "column": _column,
    "columns": _columns,
    "units": _units,
    "scale": _scale,
    "offset": _by_channel,
    "sampling": _sampling,
    "format": _format,
    "frame": _frame,
    "delimiter": _delimiter,
    "encoding": _encoding,
    "texts": _texts,
    "channels": _channels,
    "instance": _instance,
}


def parse(key: Key, value: object) -> Any:
    """Return a value of the file, checked and in SI; raises InvalidValue."""
    return _KINDS[key.kind](key, value)


def to_file_units(key: Key, value: Any) -> Any:
    """Return a value in SI as the file would contain it: its unit, plain lists and numbers."""
    if isinstance(value, float):
        return _shortest(value, key.factor)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return [to_file_units(key, v) for v in value]
    if key.kind == "units" and "angle" in key.choices and list(value) == ["angle"]:
        return value["angle"]
    if key.kind in ("scale", "offset") and list(value) == ["all"]:
        return value["all"]
    if isinstance(value, dict):
        return {k: list(v) if isinstance(v, tuple) else v for k, v in value.items()}
    return value


def _shortest(value: float, to_si: float) -> float:
    """Return the shortest number that `to_si` takes to exactly `value`, if there is one.

    So 51.08 deg comes back as 51.08, and a rig that was stored in a result is the same rig.
    """
    plain = value / to_si
    candidates = [float(f"{plain:.15g}"), plain, math.nextafter(plain, math.inf)]
    candidates += [math.nextafter(plain, -math.inf)]
    return next((c for c in candidates if c * to_si == value), plain)
