"""Sequence files: positions, still times and spins of a table of one to three axes, as TOML.

axes = ["z", "x", "y"]       # outermost first, all angles zero
acceleration = 20.0          # deg/s^2, of ramps and slews
slew_rate = 20.0             # deg/s, between positions

[[steps]]
go = [0, 45, 45]             # deg

[[steps]]
hold = 30                    # s

[[steps]]
spin = "outer"               # outer, middle, inner; or axis
rate = 100                   # deg/s
turns = 4
both = true                  # forward, then backward at once

[[steps]]
mount = 2                    # the IMU in the second of [[mountings]]

[[mountings]]                # after the first, which is the identity
mount = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]

[errors]                     # for simulate, in the units of results
gsens_xx = 10.0
"""

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.names import suggest
from rotcli.files.text import parse_toml, read_text
from rotcli.files.toml_schema import InvalidValue, Key, check_keys, check_number
from rotcli.models.triad import parameters as p
from rotcli.models.triad.motion import (
    ACCELERATION,
    SLEW_RATE,
    Go,
    Hold,
    MotionBuilder,
    Mount,
    Spin,
    Step,
    TableMotion,
)
from rotcli.models.triad.sequences import NAMED
from rotcli.rig.values import parse
from rotcli.units import DEG, FloatArray

AXIS_NAMES = {1: ("axis",), 2: ("outer", "inner"), 3: ("outer", "middle", "inner")}
_DEFAULT_AXES = {1: ("z",), 2: ("x", "z"), 3: ("z", "x", "y")}
_KEYS = ("axes", "acceleration", "slew_rate", "steps", "mountings", "errors")
_STEP_KEYS = ("go", "hold", "spin", "rate", "turns", "both", "mount")
_MOST_STEPS = 10_000
NUMBERS = {
    "acceleration": Key("number", "deg/s^2", DEG, 0.0, 1e5, above=True),
    "slew_rate": Key("number", "deg/s", DEG, 0.0, 1e5, above=True),
    "go": Key("number", "deg", DEG, -1e6, 1e6),
    "hold": Key("number", "s", low=0.0, high=1e6),
    "rate": Key("number", "deg/s", DEG, 0.0, 1e5, above=True),
    "turns": Key("number", low=0.0, high=1e5, above=True),
    "error": Key("number", low=-1e7, high=1e7),  # of [errors], in the units of results
}


@dataclass(frozen=True, eq=False)
class TableSequence:
    """A sequence: axes (K, 3), limits in SI, steps, C_ms of all mountings, errors (p,) SI."""

    name: str
    axes: FloatArray
    acceleration: float
    slew_rate: float
    steps: tuple[Step, ...]
    mountings: FloatArray
    errors: FloatArray = field(default_factory=lambda: np.zeros(p.count()))

    def motion(self) -> TableMotion:
        """Return the motion."""
        builder = MotionBuilder(len(self.axes), self.acceleration, self.slew_rate)
        builder.play(self.steps)
        return builder.motion()


def read_sequence(name: str) -> TableSequence:
    """Return a named sequence (S1, S2, M5, faces) or that of a file; raises RigError."""
    if name in NAMED:
        builder = NAMED[name]()
        axes = np.array([dict(zip("xyz", np.eye(3), strict=True))[a] for a in "zxy"])
        return TableSequence(
            name, axes, ACCELERATION, SLEW_RATE, tuple(builder.steps), np.eye(3)[None]
        )
    try:
        values = parse_toml(read_text(name))
    except OSError as fault:
        raise RigError(
            f"{name}: cannot be read: {fault.strerror or fault}; named sequences are "
            f"{', '.join(NAMED)}"
        ) from fault
    except ValueError as fault:
        raise RigError(f"{name}: not TOML: {' '.join(str(fault).split())}") from fault
    check_keys(name, "", values, _KEYS)
    steps = values.get("steps")
    if not isinstance(steps, list) or not 0 < len(steps) <= _MOST_STEPS:
        raise RigError(f"{name}: steps: give 1 to {_MOST_STEPS} tables [[steps]]")
    named = values["axes"] if "axes" in values else list(_default_axes(name, steps))
    try:
        axes = np.array(parse(Key("axes"), named))
    except InvalidValue as error:
        raise RigError(f"{name}: axes: {error}") from None
    mountings = _mountings(name, values.get("mountings", []))
    played = tuple(_step(name, k, one, len(axes), len(mountings)) for k, one in enumerate(steps, 1))
    if not any(isinstance(step, Hold | Spin) for step in played):
        raise RigError(f"{name}: steps: no hold and no spin; add one")
    return TableSequence(
        name,
        axes,
        _number(name, "", "acceleration", values.get("acceleration", ACCELERATION / DEG)),
        _number(name, "", "slew_rate", values.get("slew_rate", SLEW_RATE / DEG)),
        played,
        mountings,
        read_errors(name, values.get("errors", {}), len(mountings)),
    )


def _number(path: str, place: str, key: str, value: Any) -> float:
    return check_number(path, f"{place}{key}", NUMBERS[key], value)


def _default_axes(path: str, steps: Sequence[Any]) -> tuple[str, ...]:
    """Return the names of as many axes as the first attitude has angles, one without any."""
    for step in steps:
        if isinstance(step, dict) and isinstance(step.get("go"), list):
            if not 1 <= len(step["go"]) <= 3:
                raise RigError(f"{path}: steps: go: {step['go']!r} is not 1 to 3 angles, deg")
            return _DEFAULT_AXES[len(step["go"])]
    return _DEFAULT_AXES[1]


def _mountings(path: str, entry: Any) -> FloatArray:
    if not isinstance(entry, list):
        raise RigError(f"{path}: mountings: not a list of tables; write each as [[mountings]]")
    found = [np.eye(3)]
    for k, one in enumerate(entry, start=2):
        check_keys(path, f"mountings {k}: ", one, ("mount",))
        try:
            found.append(parse(Key("mount"), one.get("mount")).T)
        except InvalidValue as error:
            raise RigError(f"{path}: mountings {k}: mount: {error}") from None
    return np.array(found)


def _step(path: str, k: int, entry: Any, axes: int, mountings: int) -> Step:
    """Return one step; raises RigError."""
    place = f"steps {k}: "
    check_keys(path, place, entry, _STEP_KEYS)
    kinds = [key for key in ("go", "hold", "spin", "mount") if key in entry]
    if len(kinds) != 1:
        raise RigError(f"{path}: {place}give exactly one of go, hold, spin, mount")
    if kinds[0] == "go":
        angles = entry["go"]
        if not isinstance(angles, list) or len(angles) != axes:
            raise RigError(f"{path}: {place}go: {angles!r} is not a list of {axes} angles, deg")
        return Go(tuple(_number(path, place, "go", a) for a in angles))
    if kinds[0] == "hold":
        return Hold(_number(path, place, "hold", entry["hold"]))
    if kinds[0] == "mount":
        number = entry["mount"]
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= mountings:
            raise RigError(f"{path}: {place}mount: {number!r} is not 1 to {mountings}")
        return Mount(number - 1)
    names = AXIS_NAMES[axes]
    if entry["spin"] not in names:
        raise RigError(f"{path}: {place}spin: {entry['spin']!r} must be one of {', '.join(names)}")
    both = entry.get("both", True)
    if not isinstance(both, bool):
        raise RigError(f"{path}: {place}both: {both!r} is not true or false")
    rate = _number(path, place, "rate", entry.get("rate"))
    turns = _number(path, place, "turns", entry.get("turns", 1))
    return Spin(names.index(entry["spin"]), rate, turns, both)


def read_errors(path: str, entry: Any, mountings: int = 1) -> FloatArray:
    """Return the errors (p,), SI, of a table of parameter names; raises RigError."""
    if not isinstance(entry, dict):
        raise RigError(f"{path}: errors: not a table of names and numbers")
    names, factors = p.names(mountings), p.unit_factors(mountings)
    x = np.zeros(len(names))
    for name, value in entry.items():
        if name not in names:
            raise RigError(f"{path}: errors: {name}: unknown; {suggest(name, names)}")
        number = check_number(path, f"errors: {name}", NUMBERS["error"], value)
        x[names.index(name)] = number * factors[names.index(name)]
    return x


def sequence_text(sequence: TableSequence, remark: str = "") -> str:
    """Return a sequence as a file that `read_sequence` reads."""
    names = AXIS_NAMES[len(sequence.axes)]
    lines = [f"# {line}" for line in remark.splitlines()]
    lines += [f"axes = {_axes_text(sequence.axes)}"]
    lines += [f"acceleration = {_shown(sequence.acceleration / DEG)}  # deg/s^2"]
    lines += [f"slew_rate = {_shown(sequence.slew_rate / DEG)}  # deg/s"]
    for step in sequence.steps:
        lines += ["", "[[steps]]"]
        if isinstance(step, Go):
            lines.append(f"go = [{', '.join(_shown(a / DEG) for a in step.attitude)}]  # deg")
        elif isinstance(step, Hold):
            lines.append(f"hold = {_shown(step.duration)}  # s")
        elif isinstance(step, Mount):
            lines.append(f"mount = {step.mounting + 1}")
        else:
            lines.append(f'spin = "{names[step.axis]}"')
            lines.append(f"rate = {_shown(step.rate / DEG)}  # deg/s")
            lines.append(f"turns = {_shown(step.turns)}")
            lines.append(f"both = {str(step.both).lower()}")
    for C_ms in sequence.mountings[1:]:
        rows = ", ".join("[" + ", ".join(_shown(v) for v in row) + "]" for row in C_ms.T)
        lines += ["", "[[mountings]]", f"mount = [{rows}]"]
    return "\n".join(lines) + "\n"


def _shown(value: float) -> str:
    """Return the shortest text of a number to 12 digits."""
    return f"{float(f'{value:.12g}') + 0.0:.12g}"


def _axes_text(axes: FloatArray) -> str:
    parts = []
    for axis in axes:
        named = [n for n, unit in zip("xyz", np.eye(3), strict=True) if np.array_equal(unit, axis)]
        parts.append(f'"{named[0]}"' if named else f"[{', '.join(repr(float(v)) for v in axis)}]")
    return f"[{', '.join(parts)}]"
