"""One value of a rig, as the file may hold it: its kind, unit, limits; to SI and back.

A value that is not allowed is a Faulty, whose text says what was found and what is allowed; which
key it stands at is the business of `rig_keys`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rotcli.files.names import nearest
from rotcli.rig.formats import AXES as CHANNELS
from rotcli.rig.formats import FORMATS
from rotcli.units import UNITS, factor

Pair = tuple[float, float]
_UNIT_KINDS = {
    "time": ("time",),
    "angle": ("angle",),
    "gyro": ("rate", "angle"),
    "accel": ("acceleration", "velocity"),
    "temperature": ("temperature",),
}
COLUMNS = ("time", *CHANNELS, "temperature")
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


class Faulty(Exception):  # noqa: N818 (told as a RigError)
    """A value is not allowed; the text says why."""


@dataclass(frozen=True)
class Key:
    """One key: its kind, its unit and factor to SI, the limits in the file's unit."""

    kind: str
    unit: str = ""
    factor: float = 1.0
    low: float = -math.inf
    high: float = math.inf
    above: bool = False  # the lower limit itself is not allowed
    choices: tuple[Any, ...] = ()

    @property
    def allowed(self) -> str:
        """The limits in words."""
        unit = f" {self.unit}" if self.unit else ""
        if self.low > -math.inf and self.high < math.inf:
            return f"from {self.low:g} to {self.high:g}{unit}"
        if self.low > -math.inf:
            return f"{'above' if self.above else 'at least'} {self.low:g}{unit}"
        return f"finite{unit and ', in'}{unit}"


def show(value: object) -> str:
    """Return a value as TOML writes it, a long one cut short."""
    text = _toml(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _toml(value: object) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _number(key: Key, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Faulty(f"{show(value)} is not a number; give a number {key.allowed}")
    number = float(value) if abs(value) < 1e308 else math.inf
    if not math.isfinite(number):
        raise Faulty(f"{show(value)} is not finite; give a number {key.allowed}")
    if not key.low <= number <= key.high or (key.above and number == key.low):
        raise Faulty(f"{show(value)} is impossible; allowed: {key.allowed}")
    return number * key.factor


def _numbers(key: Key, value: object, count: int) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or len(value) != count:
        raise Faulty(f"{show(value)} is not a list of {count} numbers")
    return tuple(_number(key, v) for v in value)


def _figure(key: Key, value: object) -> float | tuple[float, ...]:
    if isinstance(value, list | tuple):
        return _numbers(key, value, 3)
    return _number(key, value)


def _text(_: Key, value: object) -> str:
    if not isinstance(value, str) or not value.strip():
        raise Faulty(f"{show(value)} is not a text in quotes")
    return value


def _choice(key: Key, value: object) -> Any:
    if isinstance(value, bool) or value not in key.choices:
        raise Faulty(f"{show(value)} is impossible; allowed: {', '.join(map(str, key.choices))}")
    return key.choices[key.choices.index(value)]


def _mount(key: Key, value: object) -> np.ndarray[Any, Any]:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise Faulty(f"{show(value)} is not three rows of three numbers")
    m = np.array([_numbers(key, row, 3) for row in value])
    off = float(np.abs(m @ m.T - np.eye(3)).max())
    if off > 1e-6:
        raise Faulty(
            f"the rows are not orthogonal unit vectors (off by {off:.2g}); "
            "each row is one sensor axis in the mounting frame, to seven digits or more"
        )
    if np.linalg.det(m) < 0:
        raise Faulty("a mirror image, not a rotation (determinant -1); reverse one of the rows")
    return m


def _vector(key: Key, value: object) -> np.ndarray[Any, Any]:
    return np.array(_numbers(key, value, 3))


def _axis(_: Key, value: object) -> np.ndarray[Any, Any]:
    if isinstance(value, str):
        if value not in AXES:
            raise Faulty(f"{show(value)} is impossible; allowed: x, y, z or a list of 3 numbers")
        return np.array(AXES[value])
    try:
        vector = np.array(_numbers(Key("number"), value, 3))
    except Faulty as fault:
        raise Faulty(f"{fault}; allowed: x, y, z or a list of 3 numbers") from fault
    length = float(np.sqrt(np.sum((vector / max(float(np.abs(vector).max()), 1e-300)) ** 2)))
    length *= float(np.abs(vector).max())
    if length < 1e-6:
        raise Faulty(f"{show(value)} has no direction; give a vector of length 1")
    return vector if abs(length - 1.0) < 1e-14 else vector / length


def _axes(key: Key, value: object) -> tuple[np.ndarray[Any, Any], ...]:
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= 3:
        raise Faulty(f'{show(value)} is not a list of 1 to 3 axes such as ["z", "x"]')
    return tuple(_axis(key, v) for v in value)


def _directions(_: Key, value: object) -> tuple[int, ...]:
    if not isinstance(value, list | tuple) or not all(v in (1, -1) for v in value):
        raise Faulty(f"{show(value)} is not a list of 1 and -1, one for each axis")
    return tuple(int(v) for v in value)


def _pair(_: Key, value: object) -> Pair:
    first, last = _numbers(Key("number", "s"), value, 2)
    if not first < last:
        raise Faulty(f"{show(value)} ends before it starts; give [start, end] in s")
    return first, last


def _pairs(key: Key, value: object) -> tuple[Pair, ...]:
    if not isinstance(value, list | tuple) or not value:
        raise Faulty(f"{show(value)} is not [start, end] nor a list of such pairs")
    if isinstance(value[0], list | tuple):
        return tuple(_pair(key, v) for v in value)
    return (_pair(key, value),)


def _column(key: Key, value: object) -> str:
    if isinstance(value, Mapping):
        what = 'is not a text in quotes; write columns = { time = "…", angle = "…" }'
        raise Faulty(f"{show(value)} {what}")
    return _text(key, value)


def _names(value: object, known: tuple[str, ...], *, places: bool = False) -> dict[str, Any]:
    """Return a table of names; with `places` a whole number from 1 may stand for one."""
    if not isinstance(value, Mapping):
        raise Faulty(f'{show(value)} is not a table such as {{ {known[0]} = "…" }}')
    for name, text in value.items():
        if name not in known:
            raise Faulty(f"{name}: unknown key; did you mean {nearest(name, known)}?")
        if places and isinstance(text, int) and not isinstance(text, bool):
            if text < 1:
                raise Faulty(f"{name}: {text}: columns are counted from 1")
        elif not isinstance(text, str) or not text.strip():
            number = ", nor a column's number" if places else ""
            raise Faulty(f"{name}: {show(text)} is not a text in quotes{number}")
    return dict(value)


def _format(_: Key, value: object) -> str:
    if value not in FORMATS:
        known = ", ".join(FORMATS)
        near = f"; did you mean {nearest(value, FORMATS)}?" if isinstance(value, str) else ""
        raise Faulty(f"{show(value)} is not a known format; known: {known}{near}")
    return str(value)


def _delimiter(_: Key, value: object) -> str:
    if not isinstance(value, str) or len(value) != 1 or value in '\r\n"':
        what = 'is not one sign in quotes, such as "\\t", ";" or " " (any run of blanks)'
        raise Faulty(f"{show(value)} {what}")
    return value


def _count(_: Key, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 100_000:
        raise Faulty(f"{show(value)} is not a number of lines; give a whole one from 0")
    return value


def _columns(key: Key, value: object) -> dict[str, str | int]:
    names = _names(value, key.choices, places=key.choices == COLUMNS)
    if len(set(names.values())) < len(names):
        raise Faulty(f"{show(value)} names one column of the log twice")
    return names


def _units(key: Key, value: object) -> dict[str, str]:
    names = _names(value, key.choices)
    for name, unit in names.items():
        kinds = _UNIT_KINDS[name]
        if factor(unit, *kinds) is None:
            known = ", ".join(u for kind in kinds for u in UNITS[kind])
            raise Faulty(f"{name}: {show(unit)} is not a known unit; known: {known}")
    return names


def _table_units(key: Key, value: object) -> dict[str, str]:
    """Return the units of the table's columns; a text alone is that of the angle."""
    if isinstance(value, str):
        return _units(key, {"angle": value})
    if not isinstance(value, Mapping):
        how = 'write units = "deg" or units = { time = "ms", angle = "deg" }'
        raise Faulty(f"{show(value)} is not a unit in quotes; {how}")
    return _units(key, value)


_PARSERS = {
    "number": _number,
    "figure": _figure,
    "text": _text,
    "choice": _choice,
    "mount": _mount,
    "vector": _vector,
    "axis": _axis,
    "axes": _axes,
    "directions": _directions,
    "pair": _pair,
    "pairs": _pairs,
    "format": _format,
    "delimiter": _delimiter,
    "count": _count,
    "column": _column,
    "columns": _columns,
    "units": _units,
    "table units": _table_units,
}


def parse(key: Key, value: object) -> Any:
    """Return a file's value checked and in SI; raises Faulty where it is not allowed."""
    return _PARSERS[key.kind](key, value)


def written(key: Key, value: Any) -> Any:
    """Return a value in SI as the file would hold it: its unit, plain lists and numbers."""
    if isinstance(value, float):
        return _human(value, key.factor)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return [written(key, v) for v in value]
    if key.kind == "table units" and list(value) == ["angle"]:
        return value["angle"]
    return dict(value) if isinstance(value, dict) else value


def _human(value: float, to_si: float) -> float:
    """Return the shortest number that `to_si` takes to exactly `value`, if there is one.

    So 51.08 deg comes back as 51.08, and a rig that went through a result file is the same rig.
    """
    plain = value / to_si
    candidates = [float(f"{plain:.15g}"), plain, math.nextafter(plain, math.inf)]
    candidates += [math.nextafter(plain, -math.inf)]
    return next((c for c in candidates if c * to_si == value), plain)
