"""Choose the unit of one column: of the rig, the header, its name or the format."""

import re
from collections.abc import Mapping
from typing import Any

from rotcli.dataclass import dataclass
from rotcli.logs.container.header import Header
from rotcli.logs.describe import aliases
from rotcli.logs.describe.layout import Origin, Problem
from rotcli.units import UNITS, factor, unit_name

# Texts in place of a unit that say that the numbers are raw.
RAW_WORDS = ("counts", "count", "cnt", "lsb", "raw", "ticks", "pulses", "steps", "adc", "digits")


@dataclass(frozen=True)
class Choice:
    """The unit of a column, None where nothing names it, and where it is from."""

    unit: str | None
    origin: Origin
    kind: str = ""
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()

    def size(self, quantity: str) -> float:
        """Return the size of the unit in SI; without a unit 1."""
        if self.unit is None:
            return 1.0
        kinds = (quantity, self.kind) if self.kind else (quantity,)
        return factor(self.unit, *kinds) or 1.0


def choose_unit(
    header: Header,
    column: int,
    group: str,
    kinds: tuple[str, ...],
    rig_units: Mapping[str, str],
    own: Mapping[str, Any],
    section: str,
) -> Choice:
    """Return the unit of a column; the rig overrides header and format.

    group: the key under `units`. kinds: of units that the channel may have. own: keys of the
    format.
    """
    ours, theirs = rig_units.get(group), header.units[column]
    name = header.names[column]
    notes: tuple[str, ...] = ()
    if ours:
        if theirs and factor(theirs, *kinds) not in (None, factor(ours, *kinds)):
            notes = (
                f"{header.path}: the header unit of {group} is {theirs}, [{section}] units "
                f"{group} is {ours}. The rig is used",
            )
        return _made(ours, "rig", kinds, notes)
    if theirs and theirs.lower() in RAW_WORDS:
        return Choice(None, "assumed")
    if theirs:
        if factor(theirs, *kinds) is None:
            return Choice(None, "header", "", (_unknown(name, theirs, group, kinds, section),))
        return _made(theirs, "header", kinds)
    preset = own.get("units", {}).get(group)
    if preset:
        return _made(preset, "format", kinds)
    ending = _unit_of_name(header.bases[column], kinds)
    if ending:
        return _made(ending, "name", kinds)
    bracket = header.brackets[column]
    if bracket and _resembles_unit(bracket):
        return Choice(None, "header", "", (_unknown(name, bracket, group, kinds, section),))
    return Choice(None, "assumed")  # another text in brackets is a part of the name


def _resembles_unit(text: str) -> bool:
    """Return whether a text that is no known unit is meant as one: `deg/ss`, not `x8005`.

    >>> [_resembles_unit(text) for text in ("deg/ss", "furlong", "x8005", "0", "X", "lsb")]
    [True, True, False, False, False, False]
    """
    if text.lower() in RAW_WORDS:
        return False
    return re.search(r"[/^²°]", text) is not None or re.fullmatch(r"[^\W\d_]{3,}", text) is not None


def _unit_of_name(name: str, kinds: tuple[str, ...]) -> str | None:
    """Return the unit at the end of a name, after the axis (gyro_x_dps) or before (gyro_dps_x)."""
    plain = aliases.plain_name(name)
    bare, unit = aliases.unit_in_name(plain, *kinds)
    if unit is None or not bare:
        unit = aliases.unit_in_name(re.sub(r"_?[xyz]$", "", plain), kinds[0])[1]
    return unit


def _made(unit: str, origin: Origin, kinds: tuple[str, ...], notes: tuple[str, ...] = ()) -> Choice:
    name = unit_name(unit, *kinds) or unit
    kind = next((kind for kind in kinds if name in UNITS[kind]), "")
    return Choice(name, origin, kind, (), notes)


def _unknown(name: str, text: str, group: str, kinds: tuple[str, ...], section: str) -> Problem:
    known = ", ".join(UNITS[kinds[0]])
    first = next(iter(UNITS[kinds[0]]))
    finding = f"{name}: unknown unit {text!r}"
    advice = f"or another unit; it overrides the header. Known units: {known}"
    return Problem(finding, {section: {"units": {group: first}}}, advice)
