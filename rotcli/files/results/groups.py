"""Result documents as runs that can be separated and grouped.

A run belongs to a unit under test: an IMU and, where the table turned, the axis it turned about.
Order is always IMU, axis, mode, rate, whatever the order of the files.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.results.documents import number

MODES = ("conventional", "partial", "full")
# Conventional navigation of a turning table: not a conventional run, which is still.
UNCALIBRATED = "conventional, turning"
NAMELESS = "unnamed IMU"
_ORDER = ("conventional", UNCALIBRATED, "partial", "full")
# Rates that differ by less are one rate, measured twice.
_RATE_SHARE, _RATE_LEAST = 0.005, 0.05  # fraction; deg/s


@dataclass(frozen=True)
class Source:
    """A result document and the file it was read from."""

    path: str
    doc: Mapping[str, Any]

    def number(self, *keys: str) -> float:
        """Return the finite number at `keys`; raises ResultError that names file and keys."""
        return number(self.doc, self.path, *keys)

    def number_or_none(self, *keys: str) -> float | None:
        """Return the number at `keys`, or None where the file has null or nothing."""
        value: Any = self.doc
        for key in keys:
            value = value.get(key) if isinstance(value, Mapping) else None
        return None if value is None else self.number(*keys)

    def section(self, *keys: str) -> Mapping[str, Any]:
        """Return the object at `keys`, an empty one where there is none."""
        value: Any = self.doc
        for key in keys:
            value = value.get(key) if isinstance(value, Mapping) else None
        return value if isinstance(value, Mapping) else {}

    @property
    def imu(self) -> str:
        """The IMU's name in the rig."""
        name = self.section("rig", "imu").get("name")
        return " ".join(str(name).split()) if name else NAMELESS

    @property
    def axis(self) -> str:
        """The table's axis: x, y, z or the unit vector as text."""
        axis = self.doc.get("axis") or self.section("rig", "table").get("axis") or "z"
        if isinstance(axis, str):
            return axis
        if isinstance(axis, list) and all(isinstance(a, int | float) for a in axis):
            return "(" + ", ".join(f"{a:.3g}" for a in axis) + ")"
        raise ResultError(
            f"{self.path}: axis: {axis!r} is not x, y, z or a vector; create it again with rotcli"
        )

    @property
    def warnings(self) -> list[str]:
        """What the command that made the result had to warn of."""
        members = self.doc.get("warnings")
        return (
            [" ".join(str(text).split()) for text in members] if isinstance(members, list) else []
        )


@dataclass(frozen=True)
class Run:
    """One result of a unit under test. rate: deg/s; values: figures by name, None where unknown."""

    path: str
    imu: str
    axis: str
    mode: str
    rate: float
    values: Mapping[str, float | None]
    duration: float = 0.0


@dataclass(frozen=True)
class Group:
    """The runs of one unit, mode and rate (deg/s)."""

    imu: str
    axis: str
    mode: str
    rate: float
    runs: tuple[Run, ...]

    @property
    def label(self) -> str:
        """The unit under test as a table names it; the axis is said where it is not z."""
        return device_label(self.imu, self.axis)

    def mean(self, name: str) -> float | None:
        """Return the mean of a figure over the runs that have it."""
        return mean([run.values.get(name) for run in self.runs])


def device_label(imu: str, axis: str) -> str:
    """Return the name of a unit under test.

    >>> device_label("NAV440", "z"), device_label("NAV440", "x")
    ('NAV440', 'NAV440 about x')
    """
    return imu if axis == "z" else f"{imu} about {axis}"


def mean(values: Sequence[float | None]) -> float | None:
    """Return the mean of the values that are known, None of none.

    >>> mean([1.0, None, 3.0])
    2.0
    """
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def ratio(ours: float | None, other: float | None) -> float | None:
    """Return ours / other where both are known."""
    return None if ours is None or not other else ours / other


def grouped(runs: Sequence[Run]) -> list[Group]:
    """Return the runs put together by unit, mode and rate, in that order.

    >>> run = Run("a.json", "B", "z", "full", 10.0, {})
    >>> [g.rate for g in grouped([run, Run("b.json", "B", "z", "full", 10.03125, {})])]
    [10.015625]
    """
    groups: list[list[Run]] = []
    for run in sorted(runs, key=_order):
        if groups and _same(groups[-1][0], run):
            groups[-1].append(run)
        else:
            groups.append([run])
    return [
        Group(
            first.imu,
            first.axis,
            first.mode,
            sum(run.rate for run in members) / len(members),
            tuple(members),
        )
        for members in groups
        for first in members[:1]
    ]


def _order(run: Run) -> tuple[Any, ...]:
    mode = _ORDER.index(run.mode) if run.mode in _ORDER else len(_ORDER)
    return run.imu.casefold(), run.imu, run.axis, mode, run.rate, run.path


def _same(first: Run, run: Run) -> bool:
    near = max(_RATE_LEAST, _RATE_SHARE * abs(first.rate))
    return (first.imu, first.axis, first.mode) == (run.imu, run.axis, run.mode) and abs(
        first.rate - run.rate
    ) <= near
