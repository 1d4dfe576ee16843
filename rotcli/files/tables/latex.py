"""Tables in LaTeX: booktabs rules, siunitx columns, a label each, sizes that fit two columns.

A table is set in one column of a two-column class where it fits, else across both (`table*`); a
table that is too wide continues in further tables with its first columns repeated, and one that
is too long in further tables of its rows. A last guard shrinks a tabular that would still run over.
Widths are estimated from letters, for the narrowest common class (article, two columns, A4).
"""

import re
from collections.abc import Sequence

from rotcli.files.tables.model import KEYS, Table
from rotcli.files.tables.text import HEADING_WIDTH, heading_lines

PACKAGES = r"\usepackage{booktabs,siunitx,graphicx}"
_COLUMN, _PAGE = 221.0, 453.0  # pt: one column and both of article, two columns, A4
_ROWS = 45  # of one float; more do not fit a page
_LETTER = 4.3  # pt, a digit in \footnotesize
_GAP = 8.0  # pt, between two columns with \tabcolsep 4 pt
_TEXT = 26  # letters of a column of text that is set in lines

_SIGNS = {
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
    "±": r"\ensuremath{\pm}",
    "…": r"\dots{}",
    "–": "--",
    "\n": " ",
}
_NUMBER = re.compile(r"(-?)(\d+)(?:\.(\d+))?(?: ± (\d+)(?:\.(\d+))?)?")


def latex_text(text: str) -> str:
    r"""Return text that LaTeX sets letter by letter; `-3` has a minus sign, `^2` is raised.

    >>> latex_text("50 % of -3 m/s^2")
    '50 \\% of \\ensuremath{-}3 m/s\\textsuperscript{2}'
    """
    minus = r"\ensuremath{-}"
    parts = re.split(r"(\^-?\d+|(?<![\w.])-(?=\d))", text)
    for k, part in enumerate(parts):
        if not k % 2:
            parts[k] = "".join(_SIGNS.get(c, c) for c in part)
        elif part == "-":
            parts[k] = minus
        else:
            parts[k] = rf"\textsuperscript{{{part[1:].replace('-', minus)}}}"
    return "".join(parts)


def label(title: str) -> str:
    """Return the label of a table.

    >>> label("RMS errors for each mode, m/s")
    'tab:rms-errors-for-each-mode-m-s'
    """
    return "tab:" + "-".join(re.findall(r"[a-z0-9]+", title.casefold()))[:60].strip("-")


def to_latex(table: Table, used: set[str] | None = None) -> str:
    """Return the table as one or more floats with captions and labels.

    used: labels of the document so far, to which this table's are added; a repeated title gets a
    number.
    """
    used = set() if used is None else used
    parts = []
    for columns in _column_blocks(table):
        for first in range(0, max(1, len(table.rows)), _ROWS):
            parts.append((columns, range(first, min(first + _ROWS, len(table.rows)))))
    return "\n".join(
        _float(table, columns, rows, used, continued=k > 0, last=k == len(parts) - 1)
        for k, (columns, rows) in enumerate(parts)
    )


def _float(
    table: Table,
    columns: Sequence[int],
    rows: range,
    used: set[str],
    *,
    continued: bool,
    last: bool,
) -> str:
    name = label(table.title)
    unique, number = name, 1
    while unique in used:
        number += 1
        unique = f"{name}-{number}"
    used.add(unique)
    star = "*" if _width(table, columns) > _COLUMN else ""
    caption = latex_text(table.title) + (" (continued)" if continued else "")
    kinds = [_column(table, k, rows) for k in columns]
    heads = " & ".join(_heading(table, k, kind) for k, kind in zip(columns, kinds, strict=True))
    body = [
        " & ".join(_cell(table.shown[r][k], kind) for k, kind in zip(columns, kinds, strict=True))
        + r" \\"
        for r in rows
    ]
    note = rf"\par\smallskip\raggedright\footnotesize {latex_text(table.note)}"
    return "\n".join(
        [
            rf"\begin{{table{star}}}",
            r"\centering",
            rf"\caption{{{caption}}}",
            rf"\label{{{unique}}}",
            r"\footnotesize",
            r"\setlength{\tabcolsep}{4pt}",
            r"\renewcommand{\arraystretch}{0.95}",
            rf"\sbox0{{\begin{{tabular}}{{@{{}}{' '.join(kinds)}@{{}}}}",
            r"\toprule",
            heads + r" \\",
            r"\midrule",
            *body,
            r"\bottomrule",
            r"\end{tabular}}",
            r"\ifdim\wd0>\linewidth\resizebox{\linewidth}{!}{\usebox0}\else\usebox0\fi",
            *([note] if table.note and last else []),
            rf"\end{{table{star}}}",
            "",
        ]
    )


def _column_blocks(table: Table) -> list[list[int]]:
    """Return the columns of each float; those that name a row are in each."""
    every = list(range(len(table.columns)))
    if _width(table, every) <= 1.15 * _PAGE:  # a little is shrunk by the guard
        return [every]
    value = next((k for k in every if table.columns[k].is_number and not _is_key(table, k)), 0)
    names = every[: max(1, value)]
    blocks = [list(names)]
    for k in every[len(names) :]:
        if len(blocks[-1]) > len(names) and _width(table, [*blocks[-1], k]) > _PAGE:
            blocks.append(list(names))
        blocks[-1].append(k)
    return blocks


def _is_key(table: Table, index: int) -> bool:
    return table.headings[index] in KEYS


def _width(table: Table, columns: Sequence[int]) -> float:
    """Return the estimated width of these columns, pt."""
    letters = 0
    for k in columns:
        heading = max(len(line) for line in _stacked(table, k))
        cells = max([len(row[k]) for row in table.shown], default=0)
        letters += max(heading, cells if table.columns[k].is_number else min(cells, _TEXT))
    return letters * _LETTER + _GAP * (len(columns) - 1)


def _stacked(table: Table, index: int) -> list[str]:
    """Return the lines of a heading: words, and the unit in brackets below them."""
    heading = table.headings[index]
    if not table.columns[index].is_number:
        return [heading]
    name, _, unit = heading.rpartition(", ")
    return heading_lines(name or unit, HEADING_WIDTH) + ([f"({unit})"] if name else [])


def _heading(table: Table, index: int, kind: str) -> str:
    lines = _stacked(table, index)
    side = "r" if table.columns[index].is_number else "l"
    stacked = r" \\ ".join(latex_text(line) for line in lines)
    text = latex_text(lines[0]) if len(lines) == 1 else rf"\shortstack[{side}]{{{stacked}}}"
    return f"{{{text}}}" if kind.startswith("S") else text


def _column(table: Table, index: int, rows: range) -> str:
    """Return the column's type: S of siunitx with its format where the cells are plain numbers."""
    cells = [table.shown[r][index] for r in rows]
    if not table.columns[index].is_number:
        letters = max([len(cell) for cell in cells], default=0)
        return f"p{{{_TEXT * _LETTER:.0f}pt}}" if letters > _TEXT else "l"
    found = [match for cell in cells if (match := _NUMBER.fullmatch(cell))]
    if not found or any(not _NUMBER.fullmatch(cell) and "e" in cell for cell in cells):
        return "r"
    sign = "-" if any(match[1] for match in found) else ""
    before = max(len(match[2]) for match in found)
    places = max(len(match[3] or "") for match in found)
    sigmas = [len((match[4] or "").lstrip("0") + (match[5] or "")) for match in found]
    sigma = f"({max(sigmas)})" if max(sigmas) else ""
    return f"S[table-format={sign}{before}.{places}{sigma}]"


def _cell(text: str, kind: str) -> str:
    if kind.startswith("S"):
        if match := _NUMBER.fullmatch(text):
            return text.replace(" ± ", r" \pm ") if match[4] else text
        return "{--}" if text == "-" else f"{{{latex_text(text)}}}"
    if kind == "r" and re.fullmatch(r"-?[\d.]+e[-+]?\d+", text):
        return rf"\num{{{text}}}"
    return "--" if text == "-" else latex_text(text)
