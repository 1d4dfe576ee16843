"""Tables for a terminal: they fit its width, and no name is cut.

Long headings are stacked, long texts continue on further lines, and a table that is still too
wide continues below itself with its first columns repeated.
"""

import textwrap
from collections.abc import Sequence

from rotcli.files.tables.model import KEYS, Table

WIDTH = 80  # letters of a line where there is no terminal
HEADING_WIDTH = 12  # letters of a stacked heading
_LONG_HEADING = 16  # letters; a longer one is stacked
_NARROW_HEADING = 8  # letters of a heading where the width is short
_TEXT_WIDTH = 16  # letters that a column of text keeps where the width is short
_GAP = "  "

Lines = list[str]


def to_text(table: Table, width: int = WIDTH) -> str:
    """Return the table as aligned columns under a title, at most `width` letters wide."""
    plain = [_heading_lines(table, k, None) for k in range(len(table.columns))]
    if _total(_widths(table, plain)) > width:
        plain = [_heading_lines(table, k, _NARROW_HEADING) for k in range(len(table.columns))]
    widths = _widths(table, plain)
    _narrow_texts(table, widths, width)
    parts = textwrap.wrap(table.title, width)
    for k, block in enumerate(_blocks(table, widths, width)):
        parts += [""] if k else []
        parts += _block_lines(table, block, plain, widths)
    return "\n".join(parts + textwrap.wrap(table.note, width)) + "\n"


def heading_lines(heading: str, width: int = HEADING_WIDTH) -> Lines:
    """Return a heading in lines of at most `width` letters, words uncut."""
    return textwrap.wrap(heading, width, break_long_words=False, break_on_hyphens=False)


def _heading_lines(table: Table, index: int, limit: int | None) -> Lines:
    heading = table.headings[index]
    if not table.columns[index].is_number:
        return [heading]
    if limit is None:
        return [heading] if len(heading) <= _LONG_HEADING else heading_lines(heading)
    return heading_lines(heading, limit)


def _widths(table: Table, headings: Sequence[Lines]) -> list[int]:
    return [
        max([len(line) for line in headings[k]] + [len(row[k]) for row in table.shown])
        for k in range(len(table.columns))
    ]


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + len(_GAP) * (len(widths) - 1)


def _narrow_texts(table: Table, widths: list[int], width: int) -> None:
    """Make columns of text narrower, the widest first, until the table fits or all are narrow."""
    texts = [k for k, column in enumerate(table.columns) if not column.is_number]
    while (over := _total(widths) - width) > 0:
        widest = max(texts, key=lambda k: widths[k], default=None)
        if widest is None or widths[widest] <= _TEXT_WIDTH:
            return
        others = [widths[k] for k in texts if k != widest and widths[k] < widths[widest]]
        floor = max([_TEXT_WIDTH, *others])
        step = widths[widest] - floor if widths[widest] > floor else 1
        widths[widest] = max(_TEXT_WIDTH, widths[widest] - min(over, max(1, step)))


def _blocks(table: Table, widths: Sequence[int], width: int) -> list[list[int]]:
    """Return the columns of each block; the first ones, which name a row, are in every block."""
    columns = range(len(table.columns))
    if _total(widths) <= width:
        return [list(columns)]
    first_value = next(
        (k for k in columns if table.columns[k].is_number and table.headings[k] not in KEYS), 0
    )
    names = list(columns[: max(1, first_value)])
    while len(names) > 1 and _total([widths[k] for k in names]) > width // 2:
        names.pop()
    blocks: list[list[int]] = [list(names)]
    for k in columns[len(names) :]:
        block = blocks[-1]
        if len(block) > len(names) and _total([widths[i] for i in (*block, k)]) > width:
            block = list(names)
            blocks.append(block)
        block.append(k)
    return blocks


def _block_lines(
    table: Table, block: Sequence[int], headings: Sequence[Lines], widths: Sequence[int]
) -> Lines:
    height = max(len(headings[k]) for k in block)
    heads = [[""] * (height - len(headings[k])) + headings[k] for k in block]
    lines = [_row(table, block, widths, cells) for cells in zip(*heads, strict=True)]
    lines.append(_GAP.join("-" * widths[k] for k in block))
    for row in table.shown:
        cells = [_wrapped(row[k], widths[k]) for k in block]
        deep = max(len(cell) for cell in cells)
        filled = [cell + [""] * (deep - len(cell)) for cell in cells]
        lines += [_row(table, block, widths, line) for line in zip(*filled, strict=True)]
    return lines


def _wrapped(cell: str, width: int) -> Lines:
    if len(cell) <= width:
        return [cell]
    return textwrap.wrap(cell, width, break_on_hyphens=False) or [""]


def _row(table: Table, block: Sequence[int], widths: Sequence[int], cells: Sequence[str]) -> str:
    aligned = (
        cell.rjust(widths[k]) if table.columns[k].is_number else cell.ljust(widths[k])
        for k, cell in zip(block, cells, strict=True)
    )
    return _GAP.join(aligned).rstrip()
