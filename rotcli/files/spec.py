"""Specification of a product, `spec.toml`: limits of its parameters, and how folders name units.

    [limits]
    bias_z = { min = -120, max = 120, unit = "deg/h", guard = 2.0 }
    "gyro_x.random_walk" = { max = 0.5, unit = "deg/sqrt(h)" }

    [fleet]
    path = "{unit}/{day}"     # the folders above a result, where it states no serial or date

Units of measure are compared, not converted, except within one kind that `rotcli.units` knows.
"""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.names import suggest
from rotcli.files.text import parse_toml, read_text
from rotcli.files.toml_schema import Key, check_keys, check_number
from rotcli.models.conformity import DEFAULT_GUARD, Limits

_LIMIT = Key("number", low=-1e12, high=1e12)  # in the unit of the file
KEYS = {
    "min": _LIMIT,
    "max": _LIMIT,
    "unit": Key("text"),
    "guard": Key("number", low=0.0, high=100.0),
}
_PATH_FIELDS = ("unit", "day", "turn_on")


@dataclass(frozen=True)
class Spec:
    """Limits by parameter, and the pattern of folders (None: the results name unit and day)."""

    path: str
    limits: Mapping[str, Limits] = field(default_factory=dict)
    folders: str | None = None

    def check_known(self, parameters: Mapping[str, str]) -> None:
        """Raise RigError for a limit on a parameter that no result has, or in another unit.

        parameters: name to the unit of measure of the results.
        """
        for name, limits in self.limits.items():
            if name not in parameters:
                close = f"; {suggest(name, parameters)}" if parameters else ""
                raise RigError(f"{self.path}: [limits] {name}: no result has this parameter{close}")
            if scale(limits.unit, parameters[name]) is None:
                raise RigError(
                    f"{self.path}: [limits] {name}: unit {limits.unit}, but the results are in "
                    f"{parameters[name]}; use that unit"
                )

    def limits_in(self, name: str, unit: str) -> Limits | None:
        """Return the limits of a parameter in the unit of the results, or None."""
        limits = self.limits.get(name)
        factor = None if limits is None else scale(limits.unit, unit)
        if limits is None or factor is None:
            return None
        return Limits(
            None if limits.low is None else limits.low * factor,
            None if limits.high is None else limits.high * factor,
            unit,
            limits.guard,
        )


def scale(unit: str, other: str) -> float | None:
    """Return the factor from one unit of measure to another, or None when they do not convert.

    >>> scale("deg/s", "deg/h"), scale("deg/h", "ppm")
    (3600.0, None)
    """
    if unit == other:
        return 1.0
    for kind in units.UNITS:
        one, two = units.factor(unit, kind), units.factor(other, kind)
        if one is not None and two is not None:
            return float(f"{one / two:.15g}")
    return None


def read_spec(path: str) -> Spec:
    """Read a spec file; raises RigError, one line, for anything that it should not contain."""
    try:
        data = parse_toml(read_text(path))
    except OSError as fault:
        raise RigError(f"{path}: cannot be read: {fault.strerror or fault}") from fault
    except ValueError as fault:
        raise RigError(f"{path}: not a TOML file: {fault}; correct it") from fault
    check_keys(path, "", data, ("limits", "fleet"))
    limits = data.get("limits", {})
    if not isinstance(limits, dict):
        raise RigError(f"{path}: [limits] must be a table of parameters")
    table = data.get("fleet", {})
    check_keys(path, "[fleet] ", table, ("path",))
    return Spec(
        path, {name: _limits(path, name, v) for name, v in limits.items()}, _folders(path, table)
    )


def _limits(path: str, name: str, entry: Any) -> Limits:
    place = f"[limits] {name}: "
    check_keys(path, place, entry, KEYS)
    low, high = (
        check_number(path, f"{place}{key}", KEYS[key], entry[key]) if key in entry else None
        for key in ("min", "max")
    )
    if low is None and high is None:
        raise RigError(f"{path}: {place}neither min nor max; set at least one")
    if low is not None and high is not None and low >= high:
        raise RigError(f"{path}: {place}min {low:g} is not below max {high:g}")
    unit = entry.get("unit")
    if not isinstance(unit, str) or not unit:
        raise RigError(f"{path}: {place}unit is missing; set the unit of measure")
    guard = check_number(path, f"{place}guard", KEYS["guard"], entry.get("guard", DEFAULT_GUARD))
    return Limits(low, high, unit, guard)


def _folders(path: str, table: Mapping[str, Any]) -> str | None:
    pattern = table.get("path")
    if pattern is None:
        return None
    names = [part[1:-1] for part in str(pattern).split("/") if part.startswith("{")]
    wrong = [name for name in names if name not in _PATH_FIELDS]
    if not isinstance(pattern, str) or wrong or not names:
        raise RigError(
            f"{path}: [fleet] path: {pattern!r} must be folders such as "
            '"{unit}/{day}"; known fields: {unit}, {day}, {turn_on}, {}'
        )
    return pattern
