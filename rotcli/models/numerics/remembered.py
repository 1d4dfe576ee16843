"""Keep the last results of a function of numbers and arrays for calls with the same arguments.

Runs of a batch that follow one plan need the same matrices again. The arguments must agree to the
last bit, so that a result does not depend on the runs before it.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache, wraps
from typing import Any, TypeVar, cast

import numpy as np

Function = TypeVar("Function", bound=Callable[..., object])


_forget: list[Callable[[], None]] = []


def forget() -> None:
    """Forget the results of all functions: the next call of each computes."""
    for forget_results in _forget:
        forget_results()


def remembered(maxsize: int) -> Callable[[Function], Function]:
    """Decorate a function without side effects; its last `maxsize` results are kept.

    Its arguments are positional: numbers, texts, None, arrays, and tuples or dataclasses of them
    (TypeError for others). The arrays in a result become read-only.

    >>> double = remembered(2)(lambda x: 2.0 * x)
    >>> one, same = double(np.ones(2)), double(np.ones(2))
    >>> one is same, one.flags.writeable
    (True, False)
    """

    def decorate(function: Function) -> Function:
        @lru_cache(maxsize=maxsize)
        def result_of(arguments: _Arguments) -> object:
            result = function(*arguments.values)
            for array in _arrays(result):
                array.flags.writeable = False
            return result

        @wraps(function)
        def wrapper(*values: object) -> object:
            return result_of(_Arguments(values))

        _forget.append(result_of.cache_clear)
        return cast("Function", wrapper)

    return decorate


class _Arguments:
    """Arguments that are equal where every bit is."""

    __slots__ = ("_hash", "_key", "values")

    def __init__(self, values: tuple[object, ...]) -> None:
        self.values = values
        self._key = exact_key(values)
        self._hash = hash(self._key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Arguments) and self._key == other._key


def exact_key(value: Any) -> object:
    """Return a hashable object that is equal for values with the same type and bits.

    >>> exact_key((1.0, "z")) == exact_key((1.0, "z")), exact_key(0.0) == exact_key(-0.0)
    (True, False)
    >>> exact_key(np.zeros(2)) == exact_key(np.zeros((2, 1))), exact_key(1) == exact_key(True)
    (False, False)
    """
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, float):
        return value.hex()
    if value is None or isinstance(value, (str, int)):
        return type(value), value
    if isinstance(value, tuple):
        return type(value), *map(exact_key, value)
    members = getattr(value, "__dataclass_fields__", None)
    if members is None:
        raise TypeError(f"{type(value).__name__} has no exact key")
    return type(value), *(exact_key(getattr(value, name)) for name in members)


def _arrays(value: Any) -> Iterator[np.ndarray[Any, Any]]:
    """Yield the arrays in a result."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, (tuple, list)):
        for member in value:
            yield from _arrays(member)
    elif isinstance(value, dict):
        yield from _arrays(tuple(value.values()))
    elif hasattr(value, "__dataclass_fields__"):
        yield from _arrays(tuple(getattr(value, name) for name in value.__dataclass_fields__))
