"""A table: values, and columns that know how their values are shown.

The format of a value belongs to its column, so that files for other programs keep every digit
while a page shows three.
"""

import math
from collections.abc import Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, NamedTuple

from rotcli.dataclass import dataclass
from rotcli.files.text import visible
from rotcli.lazy import lazily
from rotcli.units import digits

with lazily():
    import pandas

if TYPE_CHECKING:
    from pandas import DataFrame

# Headings of the columns that say which device and run a row is about, and their name in a
# long table.
KEYS = {
    "IMU": "unit",
    "axis": "axis",
    "rate, deg/s": "rate",
    "rate (deg/s)": "rate",
    "mode": "mode",
    "unit": "unit of measure",
}
BY_SIGMA = "sigma"  # format of a column whose digits follow the sigma of each value


class Estimate(NamedTuple):
    """A value with its sigma; where the value is not significant, its 95 % upper limit."""

    value: float | None
    sigma: float | None = None
    limit: float | None = None


Cell = str | float | int | Estimate | None


def is_known(value: Cell) -> bool:
    """Return whether a cell contains something to show."""
    if isinstance(value, Estimate):
        return value.value is not None or value.limit is not None
    return value is not None


@dataclass(frozen=True)
class Column:
    """A column: its heading, and the format of its numbers (empty for text).

    The format BY_SIGMA gives each value the digits of two significant digits of its sigma.
    """

    heading: str
    format: str = ""

    @property
    def is_number(self) -> bool:
        """Whether the column contains numbers."""
        return bool(self.format)

    def show(self, value: Cell) -> str:
        """Return the value as a reader sees it; a dash where there is none."""
        if value is None:
            return "-"
        if isinstance(value, str):
            return visible(value)
        if isinstance(value, Estimate):
            return self._show_estimate(value)
        return self._number(value, None)

    def _show_estimate(self, estimate: Estimate) -> str:
        if estimate.value is None:
            return "-" if estimate.limit is None else f"< {digits(estimate.limit, 2)}"
        if estimate.sigma is None:
            return self._number(estimate.value, None)
        sigma = self._number(estimate.sigma, estimate.sigma)
        return f"{self._number(estimate.value, estimate.sigma)} ± {sigma}"

    def _number(self, value: float, sigma: float | None) -> str:
        if self.format == BY_SIGMA:
            if not sigma or not math.isfinite(sigma):
                return format(value, ".5g")
            return format(value, f".{max(0, 1 - math.floor(math.log10(sigma)))}f")
        keeps_format = isinstance(value, int) or self.format != "d"  # a file may say 1.5 rows
        return format(value, (self.format if keeps_format else "") or "g")


@dataclass(frozen=True)
class Table:
    """A titled table; `note` says what the reader must know of it.

    origins: paths of the results behind each row; empty where they are those of the table's
    section.
    """

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[tuple[Cell, ...]]
    note: str = ""
    origins: Sequence[tuple[str, ...]] = ()
    shown: list[list[str]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        shown = [[c.show(v) for c, v in zip(self.columns, r, strict=True)] for r in self.rows]
        object.__setattr__(self, "shown", shown)
        object.__setattr__(self, "title", visible(self.title))
        object.__setattr__(self, "note", visible(self.note))

    @property
    def headings(self) -> list[str]:
        """The columns' headings."""
        return [column.heading for column in self.columns]

    def to_frame(self) -> "DataFrame":
        """Return the table as a pandas frame: a column per heading, numbers at full precision.

        An estimate takes two columns, its value and `sigma HEADING`.
        """
        named: dict[str, list[Cell]] = {}
        for k, heading in enumerate(self.headings):
            cells = [row[k] for row in self.rows]
            name = heading if heading not in named else f"{heading} ({k + 1})"
            named[name] = [c.value if isinstance(c, Estimate) else c for c in cells]
            if any(isinstance(c, Estimate) for c in cells):
                named[f"sigma {name}"] = [
                    c.sigma if isinstance(c, Estimate) else None for c in cells
                ]
        return pandas.DataFrame(named)


def has_value(rows: Sequence[tuple[Cell, ...]], index: int) -> bool:
    """Return whether any row knows the value of a column."""
    return any(is_known(row[index]) for row in rows)


def drop_empty_columns(
    title: str,
    columns: Sequence[Column],
    rows: Sequence[tuple[Cell, ...]],
    note: str,
    origins: Sequence[tuple[str, ...]] = (),
) -> Table:
    """Return a table without the columns that no row has a value for."""
    kept = [k for k in range(len(columns)) if has_value(rows, k)]
    known = [tuple(row[k] for k in kept) for row in rows]
    return Table(title, tuple(columns[k] for k in kept), known, note, origins)


def with_values(table: Table) -> Table:
    """Return the table without rows that have no value: a row of dashes says nothing."""
    values = [k for k, c in enumerate(table.columns) if c.is_number and c.heading not in KEYS]
    rows = table.rows
    kept = [k for k, row in enumerate(rows) if not values or any(is_known(row[c]) for c in values)]
    if len(kept) == len(rows):
        return table
    origins = [table.origins[k] for k in kept] if table.origins else ()
    return replace(table, rows=[rows[k] for k in kept], origins=origins)
