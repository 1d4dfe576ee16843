"""The `dataclass` of the standard library without its compiler, which slows the start of a command.

The standard decorator writes the text of up to six methods per class and compiles it while a module
is imported: 0.4 to 0.8 ms a class on Python 3.11, for `navigate` as long as the import of numpy.
Here it only collects the fields (0.04 ms), and the methods are functions that read them. Fields,
defaults, equality, hash, `repr`, `replace`, `asdict` and pickles are the same; type checkers see
the standard decorator. An instance takes about a microsecond longer to make.
"""

import dataclasses
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

__all__ = ["dataclass"]

Class = TypeVar("Class", bound=type)


def _decorator(cls: type | None = None, /, *, frozen: bool = False, eq: bool = True) -> object:
    """Return a decorator or, for `@dataclass` alone, the class.

    frozen: the fields cannot be set. eq: two are equal where all their fields are equal.

    As with the standard one, a method that the class itself defines is kept.
    """

    def decorate(cls: Class) -> Class:
        own = set(vars(cls))
        dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
        methods: dict[str, object] = {"__init__": _initializer(cls), "__repr__": _repr}
        methods["__signature__"] = _Signature()
        if eq:
            methods |= {"__eq__": _equal, "__hash__": _hash if frozen else None}
        if frozen:
            methods |= {"__setattr__": _refuse_to_set, "__delattr__": _refuse_to_delete}
        for name, method in methods.items():
            # A class with its own `__eq__` alone has the entry None for its hash.
            implied = name == "__hash__" and "__eq__" in own and vars(cls)[name] is None
            if name not in own or implied:
                setattr(cls, name, method)
        return cls

    return decorate if cls is None else decorate(cls)


def _fields(cls: type) -> tuple["dataclasses.Field[Any]", ...]:
    return dataclasses.fields(cls)


def _initializer(cls: type) -> Callable[..., None]:
    """Return the `__init__` of a class: values by position or name, defaults, `__post_init__`."""
    fields = [field for field in _fields(cls) if field.init]
    # In the order of the fields; a value that is still missing is itself the mark MISSING.
    template = {field.name: field.default for field in fields}
    factories = {
        field.name: field.default_factory
        for field in fields
        if field.default_factory is not dataclasses.MISSING
    }
    names = tuple(template)
    required = {n for n, v in template.items() if v is dataclasses.MISSING} - factories.keys()
    completed = hasattr(cls, "__post_init__")

    def __init__(self: Any, *values: object, **named: object) -> None:  # noqa: N807
        given = {**dict(zip(names, values, strict=False)), **named}
        state = {**template, **given}
        clear = len(given) == len(values) + len(named) and len(state) == len(names)
        if not (clear and given.keys() >= required):
            # The error, in the standard words, of a function with these arguments.
            inspect.signature(type(self)).bind(*values, **named)
        for name in factories.keys() - given.keys():
            state[name] = factories[name]()
        vars(self).update(state)
        if completed:
            self.__post_init__()

    return __init__


class _Signature:
    """The arguments of a class, for `help` and other inspections; built when they ask for it."""

    def __get__(self, instance: object, owner: type) -> inspect.Signature:
        arguments = [
            inspect.Parameter(
                field.name,
                inspect.Parameter.POSITIONAL_OR_KEYWORD,
                default=_default(field),
                annotation=field.type,
            )
            for field in _fields(owner)
            if field.init
        ]
        return inspect.Signature(arguments, return_annotation=None)


def _default(field: "dataclasses.Field[Any]") -> object:
    """Return the default, the function that makes it, or the mark for none."""
    defaults = (field.default, field.default_factory, inspect.Parameter.empty)
    return next(default for default in defaults if default is not dataclasses.MISSING)


def _values(item: Any, use: Callable[["dataclasses.Field[Any]"], bool]) -> tuple[object, ...]:
    return tuple(getattr(item, field.name) for field in _fields(type(item)) if use(field))


def _compared(field: "dataclasses.Field[Any]") -> bool:
    return bool(field.compare)


def _equal(self: object, other: object) -> object:
    if type(other) is not type(self):
        return NotImplemented
    return _values(self, _compared) == _values(other, _compared)


def _hash(self: object) -> int:
    return hash(_values(self, _compared))


def _repr(self: object) -> str:
    shown = (f"{f.name}={getattr(self, f.name)!r}" for f in _fields(type(self)) if f.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _refuse_to_set(self: object, name: str, value: object) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_to_delete(self: object, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


if TYPE_CHECKING:
    from dataclasses import dataclass
else:
    dataclass = _decorator
