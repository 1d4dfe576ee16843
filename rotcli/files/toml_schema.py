"""The schema of TOML files: kinds of values, units, limits and one form of message.

Rigs, profiles and scenarios describe each key by a `Key`; `parse` checks a value and converts it
to SI. A message reads `FILE: [section] key: finding; allowed values`.
"""

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.names import suggest
from rotcli.units import FloatArray

Pair = tuple[float, float]

_MAX_SHOWN = 60  # letters of a value in a message
_LARGEST = sys.float_info.max  # integers above it do not fit a float64
MAX_TIME = 1e10  # s, of a clock: the year 2286 in Unix time


class InvalidValue(Exception):  # noqa: N818 (becomes a RigError)
    """A value that a key does not allow; the text says what is allowed."""


@dataclass(frozen=True)
class Key:
    """One key: its kind, its unit and factor to SI, the limits in the unit of the file.

    above: the lower limit itself is not allowed. choices: allowed texts or names.
    """

    kind: str
    unit: str = ""
    factor: float = 1.0
    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    choices: tuple[Any, ...] = ()

    @property
    def allowed(self) -> str:
        """The limits in words."""
        unit = f" {self.unit}" if self.unit else ""
        if self.low > -math.inf and self.high < math.inf:
            lowest = f"above {self.low:g}, at most" if self.above else f"{self.low:g} to"
            return f"{lowest} {self.high:g}{unit}"
        if self.low > -math.inf:
            return f"{'above' if self.above else 'at least'} {self.low:g}{unit}"
        return f"a finite number{unit and ', in'}{unit}"


def show(value: object) -> str:
    """Return a value as TOML writes it, shortened."""
    text = _toml(value)
    return text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + "..."


def to_toml(value: object) -> str:
    """Return a value as TOML writes it, on one line."""
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"').replace("\t", "\\t") + '"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_toml_key(k)} = {to_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(to_toml, value)) + "]"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _toml_key(key: str) -> str:
    plain = key.replace("_", "").replace("-", "")
    return key if plain.isascii() and plain.isalnum() else to_toml(key)


def _toml(value: object) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def number(key: Key, value: object) -> float:
    """Return a number in SI; raises InvalidValue."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidValue(f"{show(value)} is not a number; allowed: {key.allowed}")
    found = float(value) if abs(value) <= _LARGEST else math.inf
    if not math.isfinite(found):
        raise InvalidValue(f"{show(value)} is not finite; allowed: {key.allowed}")
    if not key.low <= found <= key.high or (key.above and found == key.low):
        raise InvalidValue(f"{show(value)} is out of range; allowed: {key.allowed}")
    return found * key.factor


def numbers(key: Key, value: object, count: int) -> tuple[float, ...]:
    """Return `count` numbers in SI; raises InvalidValue."""
    if not isinstance(value, list | tuple) or len(value) != count:
        raise InvalidValue(f"{show(value)} is not a list of {count} numbers")
    return tuple(number(key, v) for v in value)


def _figure(key: Key, value: object) -> float | tuple[float, ...]:
    return numbers(key, value, 3) if isinstance(value, list | tuple) else number(key, value)


def text(_: Key, value: object) -> str:
    """Return a text that is not empty; raises InvalidValue."""
    if not isinstance(value, str) or not value.strip():
        raise InvalidValue(f"{show(value)} is not a text in quotes")
    return value


def _choice(key: Key, value: object) -> Any:
    if isinstance(value, bool) or value not in key.choices:
        allowed = ", ".join(map(str, key.choices))
        raise InvalidValue(f"{show(value)} is not allowed; allowed: {allowed}")
    return key.choices[key.choices.index(value)]


def _vector(key: Key, value: object) -> FloatArray:
    return np.array(numbers(key, value, 3))


def pair(_: Key, value: object) -> Pair:
    """Return a time interval (s); raises InvalidValue."""
    first, last = numbers(Key("number", "s", low=-MAX_TIME, high=MAX_TIME), value, 2)
    if not first < last:
        raise InvalidValue(f"{show(value)} ends before it starts; write [start, end] in s")
    return first, last


def _pairs(key: Key, value: object) -> tuple[Pair, ...]:
    if not isinstance(value, list | tuple) or not value:
        raise InvalidValue(f"{show(value)} is not [start, end] nor a list of such pairs")
    if isinstance(value[0], list | tuple):
        return tuple(pair(key, v) for v in value)
    return (pair(key, value),)


def _pair_or_pairs(key: Key, value: object) -> Pair | tuple[Pair, ...]:
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple):
        return tuple(pair(key, v) for v in value)
    return pair(key, value)


def _count(key: Key, value: object) -> int:
    allowed = f"{max(key.low, 0):g} to {min(key.high, 1e18):g}"
    if isinstance(value, bool) or not isinstance(value, int):
        raise InvalidValue(f"{show(value)} is not an integer; allowed: {allowed}")
    if not max(key.low, 0) <= value <= min(key.high, 1e18):
        raise InvalidValue(f"{show(value)} is out of range; allowed: {allowed}")
    return value


def _switch(_: Key, value: object) -> bool:
    if not isinstance(value, bool):
        raise InvalidValue(f"{show(value)} is not allowed; allowed: true, false")
    return value


KINDS: dict[str, Callable[[Key, Any], Any]] = {
    "number": number,
    "figure": _figure,
    "text": text,
    "choice": _choice,
    "vector": _vector,
    "pair": pair,
    "pairs": _pairs,
    "pair or pairs": _pair_or_pairs,
    "count": _count,
    "switch": _switch,
}


def parse_value(path: str, place: str, key: Key, value: object) -> Any:
    """Return a value of one of `KINDS` in SI; raises RigError with file and place."""
    try:
        return KINDS[key.kind](key, value)
    except InvalidValue as error:
        raise RigError(f"{path}: {place}: {error}") from None


def check_keys(path: str, place: str, table: object, known: Iterable[str]) -> None:
    """Raise RigError unless `table` is a table whose keys are all known."""
    if not isinstance(table, dict):
        raise RigError(f"{path}: {place or 'the file '}must be a table of keys")
    names = tuple(known)
    for key in table:
        if key not in names:
            raise RigError(f"{path}: {place}{key}: unknown key; {suggest(key, names)}")


def check_number(path: str, place: str, key: Key, value: object) -> float:
    """Return a number within the limits of its key, in SI; raises RigError."""
    return float(parse_value(path, place, key, value))


def check_numbers(path: str, place: str, key: Key, value: object, count: int) -> FloatArray:
    """Return a list of `count` numbers, each within the limits, in SI; raises RigError."""
    try:
        return np.array(numbers(key, value, count))
    except InvalidValue as error:
        raise RigError(f"{path}: {place}: {error}") from None


def check_seed(path: str, value: object) -> int:
    """Return the seed of random numbers, an integer from 0; raises RigError."""
    return int(parse_value(path, "seed", Key("count"), value))
