"""Modules that are imported when they are first used.

A module imports what it needs on some paths only in a block at its top:

    with lazily():
        from rotcli.allan import api

`api` represents the module `rotcli.allan.api`, which is imported when one of its names is used
(`api.allan_log(...)`). So the list of imports is at the top, type checkers see it, and `--help` and
other commands do not pay for it. Such a block can only import modules: a function or a class would
have to exist at once. `tests/test_lazy.py` checks this for every block.
"""

import builtins
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType, SimpleNamespace

__all__ = ["lazily"]


class _Module(ModuleType):
    """A module that is imported when one of its names is read or set."""

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):  # an inspection, not a use
            raise AttributeError(name)
        return getattr(import_module(self.__name__), name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(import_module(self.__name__), name, value)

    def __delattr__(self, name: str) -> None:
        delattr(import_module(self.__name__), name)


@contextmanager
def lazily() -> Iterator[None]:
    """Defer the imports of a `with` block at the top of a module.

    Only the import statements of that module are changed, and only within the block.
    """
    block = sys._getframe(2).f_globals
    original = builtins.__import__

    def deferred(
        name: str,
        globals: Mapping[str, object] | None = None,
        locals: Mapping[str, object] | None = None,
        fromlist: Sequence[str] | None = (),
        level: int = 0,
    ) -> ModuleType:
        if globals is not block:  # another thread
            return original(name, globals, locals, fromlist or (), level)
        if fromlist:
            return _package({part: _Module(f"{name}.{part}") for part in fromlist})
        top, _, below = name.partition(".")
        if not below:
            return _Module(top)
        parts = below.split(".")
        module: ModuleType = _Module(name)
        for part in reversed(parts):
            module = _package({part: module})
        return module

    builtins.__import__ = deferred
    try:
        yield
    finally:
        builtins.__import__ = original


def _package(modules: Mapping[str, ModuleType]) -> ModuleType:
    """Return an object from which an import statement takes modules."""
    return SimpleNamespace(**modules)  # type: ignore[return-value]
