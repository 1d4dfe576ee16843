"""One kind of table, written as text, Markdown, CSV, LaTeX or HTML.

A table contains values; the format of a value belongs to its column, so that CSV can keep every
digit while a page shows three.
"""

import csv
import html
import io
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rotcli.lazy import lazily

if TYPE_CHECKING:
    from pandas import DataFrame

from rotcli.files.text import spreadsheet_text, visible

with lazily():
    import pandas

_WIDTH = 80  # letters of a line where there is no terminal
_HEADING_WIDTH = 12  # letters of a stacked heading
_NARROW_HEADING = 8  # letters of one in a table that is wider than the terminal
_LATEX_WIDTH = 455.0  # pt: 16 cm
_LATEX_ROWS = 40  # of a table; more are set closer, to stay on one page
_LONG_HEADING = 16  # letters; on a terminal a longer one is stacked
Cell = str | float | int | None

_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "\n": " ",
}


@dataclass(frozen=True)
class Column:
    """A column: its heading, and the format of its numbers (empty for text)."""

    heading: str
    format: str = ""

    def show(self, value: Cell) -> str:
        """Return the value as a reader sees it; what is not there is a dash."""
        if value is None:
            return "-"
        if isinstance(value, str):
            return visible(value)
        keeps_format = isinstance(value, int) or self.format != "d"  # a file may say 1.5 rows
        return format(value, (self.format if keeps_format else "") or "g")


@dataclass(frozen=True)
class Table:
    """A titled table; `note` says what the reader must know of it."""

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[tuple[Cell, ...]]
    note: str = ""
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

    def _is_number(self, index: int) -> bool:
        return bool(self.columns[index].format)

    def to_frame(self) -> "DataFrame":
        """Return the table as a pandas frame: one column per heading, full precision."""
        return pandas.DataFrame.from_records(list(self.rows), columns=self.headings)


def rows_have(rows: Sequence[tuple[Cell, ...]], index: int) -> bool:
    """Return whether any row has a value in a column."""
    return any(row[index] is not None for row in rows)


def known_columns(
    title: str, columns: Sequence[Column], rows: Sequence[tuple[Cell, ...]], note: str
) -> Table:
    """Return a table without the columns that hold nothing."""
    kept = [k for k in range(len(columns)) if rows_have(rows, k)]
    return Table(
        title, tuple(columns[k] for k in kept), [tuple(row[k] for k in kept) for row in rows], note
    )


def to_text(table: Table, width: int = _WIDTH) -> str:
    """Return the table for a terminal: aligned columns under a title, long headings stacked.

    width: letters of a line; a wider table has all its headings stacked.
    """
    heads, widths = _stacked(table, _LONG_HEADING, _HEADING_WIDTH)
    if sum(widths) + 2 * (len(widths) - 1) > width:
        heads, widths = _stacked(table, _NARROW_HEADING, _NARROW_HEADING)

    def row(cells: Sequence[str]) -> str:
        aligned = (
            cell.rjust(width) if table._is_number(k) else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(cells, widths, strict=True))
        )
        return "  ".join(aligned).rstrip()

    parts = [table.title, *(row(head) for head in heads), row(["-" * w for w in widths])]
    parts += [row(cells) for cells in table.shown]
    return "\n".join(parts + textwrap.wrap(table.note, width)) + "\n"


def _stacked(table: Table, longest: int, width: int) -> tuple[list[list[str]], list[int]]:
    """Return the lines of the headings, those above `longest` letters stacked, and the widths."""
    stacks = [
        [line.rstrip(",") for line in textwrap.wrap(heading, width, break_long_words=False)]
        if table._is_number(k) and len(heading) > longest
        else [heading]
        for k, heading in enumerate(table.headings)
    ]
    height = max(len(stack) for stack in stacks)
    filled = ([""] * (height - len(stack)) + stack for stack in stacks)
    heads = [list(line) for line in zip(*filled, strict=True)]
    widths = [max(len(line[k]) for line in [*heads, *table.shown]) for k in range(len(stacks))]
    return heads, widths


def to_markdown(table: Table) -> str:
    """Return the table in GitHub's Markdown, title as a heading of level 3."""

    def row(cells: Sequence[str]) -> str:
        return "| " + " | ".join(markdown_text(cell) for cell in cells) + " |"

    rules = ["---:" if table._is_number(k) else "---" for k in range(len(table.columns))]
    parts = [f"### {markdown_text(table.title)}", "", row(table.headings)]
    parts += ["| " + " | ".join(rules) + " |", *(row(cells) for cells in table.shown)]
    return "\n".join(parts + (["", markdown_text(table.note)] if table.note else [])) + "\n"


def markdown_text(text: str) -> str:
    """Return text that Markdown shows letter by letter, on one line."""
    text = html.escape(" ".join(text.split()), quote=False)
    for sign in "\\`*_[]|":
        text = text.replace(sign, "\\" + sign)
    return text


def to_latex(table: Table) -> str:
    """Return a LaTeX table environment with booktabs rules, long headings stacked."""

    def row(cells: Sequence[str]) -> str:
        return " & ".join(_latex(cell) for cell in cells) + r" \\"

    heads = (
        _latex_heading(heading) if table._is_number(k) else _latex(heading)
        for k, heading in enumerate(table.headings)
    )
    spec = "".join("r" if table._is_number(k) else "l" for k in range(len(table.columns)))
    note = [rf"\par\smallskip\footnotesize {_latex(table.note)}"] if table.note else []
    return "\n".join(
        [
            r"\begin{table}",
            r"\centering",
            *_latex_size(table),
            rf"\caption{{{_latex(table.title)}}}",
            rf"\begin{{tabular}}{{{spec}}}",
            r"\toprule",
            " & ".join(heads) + r" \\",
            r"\midrule",
            *(row(cells) for cells in table.shown),
            r"\bottomrule",
            r"\end{tabular}",
            *note,
            r"\end{table}",
            "",
        ]
    )


def _latex_size(table: Table) -> list[str]:
    """Return the size of letters, gaps and lines with which a table fits a page of 16 cm."""
    heads = [
        max(map(len, textwrap.wrap(h, _HEADING_WIDTH))) if table._is_number(k) else len(h)
        for k, h in enumerate(table.headings)
    ]
    letters = sum(
        max([head, *(len(row[k]) for row in table.shown)]) for k, head in enumerate(heads)
    )
    size, gap = r"\footnotesize", 6.0  # pt, LaTeX's own gap either side of a column
    for size, width in ((r"\footnotesize", 4.3), (r"\scriptsize", 3.9)):  # noqa: B007 (pt a letter)
        gap = min(6.0, (_LATEX_WIDTH - letters * width) / (2 * len(table.columns)))
        if gap >= 2.0:
            break
    lines = [size] if gap >= 6.0 else [size, rf"\setlength{{\tabcolsep}}{{{max(gap, 1.0):.1f}pt}}"]
    long = len(table.rows) > _LATEX_ROWS
    return [*lines, r"\renewcommand{\arraystretch}{0.9}"] if long else lines


def _latex_heading(heading: str) -> str:
    """Return the heading of a column of numbers, its words and its unit one above the other."""
    name, _, unit = heading.rpartition(", ")
    lines = textwrap.wrap(name or unit, _HEADING_WIDTH) + ([f"({unit})"] if name else [])
    if len(lines) < 2:
        return _latex(heading)
    return r"\shortstack[r]{" + r" \\ ".join(_latex(line) for line in lines) + "}"


def _latex(text: str) -> str:
    return "".join(_LATEX.get(letter, letter) for letter in text)


def to_csv(tables: Sequence[Table]) -> str:
    """Return tables as CSV, every number at full precision, the title in the first column."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    for k, table in enumerate(tables):
        if k:
            writer.writerow([])
        writer.writerow(["table", *table.headings])
        for row in table.rows:
            writer.writerow([spreadsheet_text(table.title), *map(_csv_cell, row)])
    return stream.getvalue()


def _csv_cell(value: Cell) -> Cell:
    if value is None:
        return ""
    return spreadsheet_text(value) if isinstance(value, str) else value


def to_html(table: Table) -> str:
    """Return an HTML table with caption; everything is escaped."""
    sides = ["num" if table._is_number(k) else "text" for k in range(len(table.columns))]

    def row(cells: Sequence[str], tag: str) -> str:
        return (
            "<tr>"
            + "".join(
                f'<{tag} class="{side}">{html.escape(cell)}</{tag}>'
                for side, cell in zip(sides, cells, strict=True)
            )
            + "</tr>"
        )

    note = f'<p class="note">{html.escape(table.note)}</p>' if table.note else ""
    return (
        f'<div class="table"><table><caption>{html.escape(table.title)}</caption>'
        f"<thead>{row(table.headings, 'th')}</thead>"
        f"<tbody>{''.join(row(cells, 'td') for cells in table.shown)}</tbody></table></div>{note}"
    )


# What writes tables into a file with this suffix.
WRITERS: dict[str, Callable[[Sequence[Table]], str]] = {
    ".txt": lambda tables: "\n".join(to_text(table) for table in tables),
    ".md": lambda tables: "\n".join(map(to_markdown, tables)),
    ".tex": lambda tables: "\n".join(map(to_latex, tables)),
    ".csv": to_csv,
}
