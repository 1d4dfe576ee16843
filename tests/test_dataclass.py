"""The project's `dataclass` next to the one of the standard library: no difference to be seen."""

import copy
import dataclasses
import inspect
import pickle
from dataclasses import field
from functools import cached_property
from types import SimpleNamespace
from typing import ClassVar

import pytest

from rotcli.dataclass import dataclass


def _classes(dataclass):
    """Return classes of every kind that the program contains, made by one of the decorators."""

    @dataclass(frozen=True)
    class Value:
        """A value."""

        kind: ClassVar[str] = "value"
        a: float
        b: "int" = 2
        c: list[int] = field(default_factory=list)
        note: str = field(default="", repr=False, compare=False)

        @cached_property
        def double(self):
            return 2 * self.a

    @dataclass(frozen=True, eq=False)
    class Derived(Value):
        """One more field, and another default of an inherited one."""

        b: "int" = 7
        d: str = "d"

    @dataclass(frozen=True)
    class Completed:
        """Its last field follows from the others."""

        a: float
        twice: float = field(init=False)

        def __post_init__(self):
            object.__setattr__(self, "twice", 2 * self.a)

    @dataclass
    class Counter:
        """A value that changes."""

        n: int = 0

    @dataclass(frozen=True)
    class Own:
        """Methods of its own."""

        a: int

        def __eq__(self, other):
            return False

        def __repr__(self):
            return "own"

    @dataclass()
    class Empty:
        """No field."""

    kinds = (Value, Derived, Completed, Counter, Own, Empty)
    for kind in kinds:
        kind.__qualname__ = kind.__name__
    return SimpleNamespace(**{kind.__name__: kind for kind in kinds})


OURS, STANDARD = _classes(dataclass), _classes(dataclasses.dataclass)
BOTH = pytest.mark.parametrize(
    "expression",
    [
        "repr(k.Value(1.0))",
        "repr(k.Value(a=1.0, b=3, c=[4], note='n'))",
        "repr(k.Derived(1.0, d='e'))",
        "repr(k.Completed(3.0))",
        "repr(k.Own(1)), repr(k.Empty())",
        "k.Value(1.0) == k.Value(1.0), k.Value(1.0) == k.Value(2.0)",
        "k.Value(1.0) == k.Value(1.0, note='other'), k.Value(1.0) != k.Value(1.0, b=4)",
        "k.Value(1.0) == k.Derived(1.0), k.Value(1.0).__eq__((1.0, 2, [], ''))",
        "k.Derived(1.0) == k.Derived(1.0), hash(k.Derived(1.0)) is None",
        "k.Counter(1) == k.Counter(1), k.Counter.__hash__",
        "k.Own(1) == k.Own(1), hash(k.Own(1))",
        "hash(k.Value(1.0, c=(), note='n')), hash(k.Value(1.0, c=()))",
        "hash(k.Value(1.0))",
        "k.Value()",
        "k.Value(1.0, 2, [], '', 5)",
        "k.Value(1.0, a=2.0)",
        "k.Value(1.0, e=2.0)",
        "k.Completed(1.0, twice=2.0)",
        "k.Empty(1)",
        "setattr(k.Value(1.0), 'a', 2.0)",
        "setattr(k.Value(1.0), 'new', 2.0)",
        "delattr(k.Value(1.0), 'a')",
        "setattr(x := k.Counter(), 'n', 3), x",
        "k.Value(1.0).c is k.Value(1.0).c, k.Value(1.0).double",
        "vars(k.Derived(b=4, a=1.0))",
        "dataclasses.asdict(k.Value(1.0)), dataclasses.astuple(k.Derived(1.0))",
        "repr(dataclasses.replace(k.Derived(1.0), a=2.0)), dataclasses.replace(k.Counter(2), n=3)",
        "repr(dataclasses.replace(k.Completed(1.0), a=2.0))",
        "dataclasses.replace(k.Completed(1.0), twice=2.0)",
        "dataclasses.replace(k.Value(1.0), e=2.0)",
        "[f.name for f in dataclasses.fields(k.Derived)], dataclasses.is_dataclass(k.Empty)",
        "k.Value.__match_args__, k.Derived.__match_args__, k.Completed.__match_args__",
        "k.Value.kind, k.Value.b, k.Derived(1.0).kind, k.Value.__doc__",
        "repr(copy.copy(k.Derived(1.0))), copy.deepcopy(k.Value(1.0, c=[[1]]))",
        "[(p.name, p.annotation) for p in inspect.signature(k.Derived).parameters.values()]",
        "str(inspect.signature(k.Completed)), str(inspect.signature(k.Counter))",
    ],
)


@BOTH
def test_a_class_is_like_one_of_the_standard_library(expression):
    assert _outcome(expression, OURS) == _outcome(expression, STANDARD)


def _outcome(expression, classes):
    """Return what an expression gives, as text: its value, or its error."""
    names = {"k": classes, "dataclasses": dataclasses, "copy": copy, "inspect": inspect}
    try:
        return repr(eval(expression, names))
    except (TypeError, ValueError, AttributeError) as error:
        return type(error)


@dataclass(frozen=True)
class Sent:
    """A value that goes to another process."""

    a: float
    b: tuple[int, ...] = ()


def test_a_value_returns_from_another_process_equal():
    assert pickle.loads(pickle.dumps(Sent(1.0, (2,)))) == Sent(1.0, (2,))


def test_a_wrong_argument_is_named():
    with pytest.raises(TypeError, match="missing a required argument: 'a'"):
        Sent(b=())
    with pytest.raises(TypeError, match="unexpected keyword argument 'c'"):
        Sent(1.0, c=3)


def test_a_default_that_is_made_is_shown_by_its_function():
    assert inspect.signature(OURS.Value).parameters["c"].default is list


def test_no_method_is_compiled_for_a_class():
    methods = [method for method in vars(Sent).values() if inspect.isfunction(method)]
    assert len(methods) >= 6
    assert "<string>" not in {method.__code__.co_filename for method in methods}
