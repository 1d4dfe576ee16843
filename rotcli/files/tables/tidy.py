"""Tables as one long table: a line per value, with device, run, quantity, sigma and unit.

`row` and `column` say where a value is shown, so that every table can be put together again.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files.tables.model import KEYS, Cell, Estimate, Table, is_known
from rotcli.files.text import visible
from rotcli.lazy import lazily

with lazily():
    import pandas

if TYPE_CHECKING:
    from pandas import DataFrame

COLUMNS = (
    "table",
    "unit",
    "serial",
    "date",
    "axis",
    "rate",
    "mode",
    "quantity",
    "value",
    "sigma",
    "unit of measure",
    "source file",
    "text",
    "row",
    "column",
)
_NUMBERS = ("rate", "value", "sigma")
# Units at the end of a heading or of a name, as in `horizontal position, m` and `curve (deg/h)`.
UNITS = frozenset(
    {
        *("m", "km", "mm", "m/s", "m/s^2", "m/s/sqrt(h)", "m/s^2/sqrt(s)", "m/s^2/degC"),
        *("deg", "arcsec", "urad", "rad", "deg/s", "deg/h", "deg/h/g", "deg/h/degC", "deg/h^2"),
        *("deg/sqrt(h)", "deg/h/sqrt(h)", "deg/h/sqrt(s)", "deg per deg/s", "1e-3 deg/h"),
        *("ppm", "%", "ppm of full scale", "ppm of rate", "ppm/K", "ppm/degC", "deg/h/K"),
        *("s", "ms", "us", "min", "h", "Hz", "degC", "samples"),
        *("ug", "mg", "g", "ug/h", "ug/sqrt(s)", "ug/sqrt(Hz)", "ug/sqrt(h)", "ug/g^2"),
    }
)
_GENERIC = ("value", "estimate")  # columns whose name says nothing next to the row's

# Of a table and the number of a row: names of the device (unit, serial, date, source file).
Origin = Callable[[Table, int], Mapping[str, str]]


def split_unit(heading: str) -> tuple[str, str]:
    """Return name and unit of a heading.

    >>> split_unit("horizontal position, m"), split_unit("tau (s)"), split_unit("RMS ratio")
    (('horizontal position', 'm'), ('tau', 's'), ('RMS ratio', ''))
    """
    if heading in UNITS:  # a column of figures that have no other name
        return heading, heading
    name, _, unit = heading.rpartition(", ")
    if unit in UNITS:
        return name, unit
    name, _, unit = heading.partition(" (")
    return (name, unit[:-1]) if unit.endswith(")") and unit[:-1] in UNITS else (heading, "")


def to_tidy(tables: Sequence[Table], origin: Origin | None = None) -> "DataFrame":
    """Return the long table of several tables, a pandas frame with the columns COLUMNS.

    Numbers keep their full precision; a value of which neither figure
    nor sigma is known has no line. origin: names of the
    device and the files behind a row.
    """
    lines = [line for table in tables for line in _lines(table, origin)]
    named: dict[str, Any] = {}
    for name in COLUMNS:
        if name in _NUMBERS:
            named[name] = np.array([_number(line.get(name)) for line in lines], dtype=float)
        elif name == "row":
            named[name] = np.array([line[name] for line in lines], dtype=int)
        else:
            texts = [line.get(name) for line in lines]
            named[name] = ["" if text is None else str(text) for text in texts]
    return pandas.DataFrame(named)


def _number(cell: Cell) -> float:
    """Return a number; NaN for what is none, as in a result that was edited."""
    try:
        return float(cell) if isinstance(cell, int | float) else np.nan
    except OverflowError:  # an integer beyond float64
        return np.nan


def _lines(table: Table, origin: Origin | None) -> Iterator[dict[str, Cell]]:
    roles = Roles(table)
    for number, row in enumerate(table.rows):
        line: dict[str, Cell] = {"table": table.title, "row": number + 1}
        line |= origin(table, number) if origin else {}
        for k in roles.keys:
            if row[k] is not None:
                line[KEYS[table.headings[k]]] = row[k]
        item = roles.item(row)
        for k in roles.texts:
            if row[k] is not None:
                heading = table.headings[k]
                yield {
                    **line,
                    "quantity": f"{item}, {heading}" if item else heading,
                    "text": visible(str(row[k])),
                    "column": heading,
                }
        for k, sigma in roles.values:
            if is_known(row[k]) or (sigma is not None and row[sigma] is not None):
                yield {**line, **_value(table, roles, row, k, sigma)}


def _value(
    table: Table, roles: "Roles", row: Sequence[Cell], index: int, sigma: int | None
) -> dict[str, Cell]:
    """Return quantity, value, sigma and unit of one cell."""
    heading, cell = table.headings[index], row[index]
    item, unit = split_unit(roles.item(row))
    name, own_unit = split_unit(heading)
    generic = item and name in _GENERIC
    filled: dict[str, Cell] = {
        "quantity": item if generic else f"{item}, {name}" if item else name,
        "column": heading,
    }
    if own_unit or unit:
        filled["unit of measure"] = own_unit or unit
    if isinstance(cell, Estimate):
        limit = cell.value is None
        filled |= {"value": cell.limit if limit else cell.value, "sigma": cell.sigma}
        return filled | ({"text": "95 % upper limit"} if limit else {})
    filled["value"] = cell
    return filled | ({} if sigma is None else {"sigma": row[sigma]})


class Roles:
    """The role of each column of a table: key, name of the row, value with its sigma, text."""

    def __init__(self, table: Table) -> None:
        columns = table.columns
        self.keys = [k for k, c in enumerate(columns) if c.heading in KEYS]
        numbers = [k for k, c in enumerate(columns) if c.is_number and k not in self.keys]
        first = numbers[0] if numbers else len(columns)
        plain = [k for k, c in enumerate(columns) if not c.is_number and k not in self.keys]
        self.items = [k for k in plain if k < first] if numbers else []
        self.texts = [k for k in plain if k not in self.items]
        sigmas = {k for k in numbers if columns[k].heading == "sigma" and k - 1 in numbers}
        self.values = [(k, k + 1 if k + 1 in sigmas else None) for k in numbers if k not in sigmas]

    def item(self, row: Sequence[Cell]) -> str:
        """Return the name of a row: its texts before the first value."""
        return ", ".join(visible(str(row[k])) for k in self.items if row[k] is not None)
