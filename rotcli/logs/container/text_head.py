"""The head of a text log: where the records begin, how they are written, what names them.

The last lines of the head show how records look: their delimiter, decimal sign and number of
cells. The first line of this form is the first record; the lines above it are preamble, column
names and, in some logs, a line of units.
"""

import itertools
import re
from collections import Counter
from dataclasses import replace
from typing import NoReturn

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.dialect import DECIMAL_COMMA, NUMBER, Dialect, is_number
from rotcli.files.formats import LogFormat
from rotcli.files.time_text import is_stamp
from rotcli.units import unit_name

_DELIMITERS = ("\t", ";", "|", ",", " ")
COMMENT_SIGNS = ("//", "#", "%", "!")
_TAIL_LINES = 40  # last lines of the head, which show the form of the records
_KEPT_RECORDS = 400  # records kept for a look at their values: 4 s at 100 Hz
_MIN_REGULAR = 0.6  # share of lines with the usual number of cells
_MAX_WITHOUT_RECORDS = 5  # lines of a log that was just begun: names, units, comments
_MIN_NUMERIC = 0.5  # share of cells of a record that are numbers, times or empty
# The first keys of a result document.
_RIG = re.compile(rb"(?:\s*#[^\n]*\n)*\s*\[(?:site|attitude|stages)\]\s*\n\s*\w+ = ")  # of a rig
_RESULT = re.compile(rb'\s*\{\s*"kind"\s*:\s*"([\w-]+)"\s*,\s*"schema"\s*:\s*\d+\s*,\s*"rotcli"')
_UNIT_CELL = re.compile(r"[\[(]?\s*(.*?)\s*[\])]?")


@dataclass(frozen=True)
class TextHead:
    """The head of a text log.

    names: of the columns, empty without a header line. units: of a line of units, else empty.
    before: lines above the first record. comments: the lines above the records that are neither
    names nor values. values: (line, numbers) of the lines of numbers that a format has there.
    records: cells of the first records. header_line: line of the names, 0 for none.
    """

    dialect: Dialect
    names: tuple[str, ...]
    units: tuple[str, ...]
    before: int
    comments: tuple[str, ...]
    values: tuple[tuple[int, list[float]], ...]
    records: tuple[tuple[str, ...], ...]
    header_line: int


@dataclass(frozen=True)
class Given:
    """What rig and format say of a text; None where the text itself shows it."""

    delimiter: str | None = None
    decimal: str | None = None
    comment: str | None = None
    skip: int | None = None
    encoding: str = "utf-8"


def read_head(path: str, text: str, given: Given, form: LogFormat | None = None) -> TextHead:
    """Return the head of a text log; `text` contains complete lines.

    Raises LogError where there are no rows, or the lines of numbers of a format are missing.
    """
    lines = list(enumerate(re.split(r"\r\n|\r|\n", text), start=1))[given.skip or 0 :]
    clean = form.clean if form is not None and type(form).clean is not LogFormat.clean else None
    dialect = Dialect(
        given.delimiter or ",", given.decimal or ".", given.comment or "", given.encoding, clean,
        '"' in text,
    )  # fmt: skip
    signs = (dialect.comment,) if dialect.comment else () if clean else COMMENT_SIGNS
    rows = [(k, line) for k, line in lines if line.strip() and not line.strip().startswith(signs)]
    if clean is not None:  # messages of other kinds
        rows = [(k, line) for k, line in rows if clean(line.encode()).strip()]
    if form is not None and form.head_lines:
        return _fixed_head(path, lines, rows, dialect, given, form)
    if not rows:
        raise LogError(path, "no rows of numbers; is this the right file, and its format?")
    dialect = _record_dialect([line for _, line in rows[-_TAIL_LINES:]], dialect, given)
    first, width = _first_record(rows, dialect)
    head = _names_above(lines, rows, first, width, dialect)
    before = rows[first][0] - 1 if first < len(rows) else lines[-1][0]
    records = tuple(tuple(dialect.split(line)) for _, line in rows[first:][:_KEPT_RECORDS])
    used = {head.header_line, head.header_line + 1 if head.units else 0}
    comments = tuple(line for k, line in lines if k <= before and line.strip() and k not in used)
    below = head.header_line or before
    amid = {s for k, line in lines if k > below for s in signs if line.strip().startswith(s)}
    if not dialect.comment and len(amid) == 1:
        dialect = replace(dialect, comment=amid.pop())
    if not records and len(rows) > _MAX_WITHOUT_RECORDS:
        _raise_no_records(path, rows[0][1].strip(), rows[-1], dialect)
    names = head.names
    if names and records and len(records[0]) == len(names) + 1:
        if not records[0][-1]:
            names = (*names, "")  # each record ends with a delimiter
        elif _are_row_names([cells[0] for cells in records]):
            names = ("", *names)  # as R and pandas write a table with its index
    return replace(
        head, dialect=dialect, names=names, before=before, comments=comments, records=records
    )


def _raise_no_records(path: str, first: str, row: tuple[int, str], dialect: Dialect) -> NoReturn:
    """Raise LogError for a text of several lines without a record."""
    line = row[1].strip()
    shown = repr(line[:60])
    if first.startswith(("{", "[")):
        raise LogError(path, "the log is JSON; write it as CSV or Parquet")
    cells = dialect.split(line)
    if sum(re.fullmatch(r"\w+\s*[=:]\s*[-+.\d].*", cell) is not None for cell in cells) > 1:
        finding = f"row {row[0]}: {shown}: each cell contains a name and a value"
        raise LogError(path, f"{finding}; write the names in a header line and plain numbers below")
    finding = f"row {row[0]}: {shown}: no rows of numbers were found"
    raise LogError(path, f'{finding}; set [imu] delimiter = "…" and decimal, or write plain CSV')


def _are_row_names(cells: list[str]) -> bool:
    """Return whether cells number the records one by one."""
    if not all(cell.isdigit() for cell in cells):
        return False
    return all(int(b) - int(a) == 1 for a, b in itertools.pairwise(cells))


def _fixed_head(
    path: str,
    lines: list[tuple[int, str]],
    rows: list[tuple[int, str]],
    dialect: Dialect,
    given: Given,
    form: LogFormat,
) -> TextHead:
    """Return the head of a format that has lines of numbers above its records."""
    if not rows:
        raise LogError(path, "no rows of numbers; is this the right file, and its format?")
    if given.delimiter is None:
        dialect = replace(dialect, delimiter=_first_delimiter(rows[0][1]))
    names: tuple[str, ...] = ()
    header_line = 0
    cells = dialect.split(rows[0][1])
    if not all(NUMBER.fullmatch(cell) for cell in cells if cell):
        names, header_line, rows = tuple(cells), rows[0][0], rows[1:]
    values = [(k, _numbers(path, k, dialect.split(line))) for k, line in rows[: form.head_lines]]
    if len(values) < form.head_lines:
        finding = f"the file ends before the {form.head_lines} lines of numbers of its head"
        raise LogError(path, f"{finding}; is this the right format?")
    before = values[-1][0]
    records = tuple(
        tuple(dialect.split(line)) for k, line in rows[form.head_lines :][:_KEPT_RECORDS]
    )
    comments = tuple(line for k, line in lines if k <= before and dialect.is_skipped(line))
    return TextHead(dialect, names, (), before, comments, tuple(values), records, header_line)


def _first_delimiter(line: str) -> str:
    return next((sign for sign in ("\t", ";", ",") if sign in line.strip()), " ")


def _numbers(path: str, row: int, cells: list[str]) -> list[float]:
    for cell in cells:
        if not NUMBER.fullmatch(cell):
            finding = f"{cell[:40]!r} is not a number; the head of the log contains numbers here"
            raise LogError(path, finding, row=row)
    return [float(cell) for cell in cells]


def is_value(cell: str, decimal: str = ".") -> bool:
    """Return whether a cell is a number, a time or empty, as those of records are."""
    cell = cell.replace("−", "-")  # a sign of typesetting; the reader names it
    return (
        not cell
        or is_number(cell, decimal)
        or is_stamp(cell)
        or (cell.lower() in ("nan", "inf", "-inf", "true", "false"))
    )


def _record_dialect(tail: list[str], dialect: Dialect, given: Given) -> Dialect:
    """Return the dialect with the delimiter and the decimal sign of the last lines."""
    if given.delimiter is None:
        scores = [(_regularity(tail, replace(dialect, delimiter=s)), s) for s in _DELIMITERS]
        found = next((s for share, s in scores if share >= _MIN_REGULAR), None)
        best = max(scores, key=lambda pair: pair[0])
        sign = found or (best[1] if best[0] > 0.0 else _first_delimiter(tail[-1]))
        if _are_single_values(tail):
            sign = ","
        dialect = replace(dialect, delimiter=sign)
    if given.decimal is None:  # a comma in a cell of commas is in quotation marks
        cells = [cell for line in tail for cell in dialect.split(line)]
        commas = sum(DECIMAL_COMMA.fullmatch(cell) is not None for cell in cells)
        points = sum(NUMBER.fullmatch(cell) is not None and "." in cell for cell in cells)
        if commas > points:
            dialect = replace(dialect, decimal=",")
    return dialect


def _are_single_values(tail: list[str]) -> bool:
    """Return whether lines contain one number each: a log of one channel without time."""
    single = sum(NUMBER.fullmatch(line.strip()) is not None for line in tail)
    return len(tail) > 1 and single >= _MIN_REGULAR * len(tail)


def _regularity(tail: list[str], dialect: Dialect) -> float:
    """Return the share of lines that have the usual number of cells, two or more, of values."""
    split = [dialect.split(line) for line in tail]
    counts = Counter(len(cells) for cells in split)
    width, _ = counts.most_common(1)[0]
    if width < 2:
        return 0.0
    decimal = "," if dialect.delimiter != "," or dialect.quotes else "."
    good = sum(len(c) == width and _share(c, decimal) >= _MIN_NUMERIC for c in split)
    return good / len(split)


def _share(cells: list[str], decimal: str) -> float:
    return sum(is_value(cell, decimal) for cell in cells) / max(len(cells), 1)


def _first_record(rows: list[tuple[int, str]], dialect: Dialect) -> tuple[int, int]:
    """Return the index of the first record among the rows, and the usual number of cells."""
    split = [dialect.split(line) for _, line in rows[-_TAIL_LINES:]]
    single = _are_single_values([line for _, line in rows[-_TAIL_LINES:]])
    valued = [
        c for c in split if _share(c, dialect.decimal) >= _MIN_NUMERIC and (len(c) > 1 or single)
    ]
    if not valued:
        return len(rows), 0
    width, _ = Counter(len(cells) for cells in valued).most_common(1)[0]
    decimal = dialect.decimal

    def is_record(index: int) -> bool:
        cells = dialect.split(rows[index][1])
        filled = [cell for cell in cells if cell]
        return (
            abs(len(cells) - width) <= 1
            and bool(filled)
            and _share(cells, decimal) >= _MIN_NUMERIC
            and _share(filled, decimal) >= _MIN_NUMERIC
        )

    for k in range(len(rows)):
        if is_record(k) and (k + 1 == len(rows) or is_record(k + 1) or is_record(len(rows) - 1)):
            return k, width
    return len(rows), width


def _names_above(
    lines: list[tuple[int, str]],
    rows: list[tuple[int, str]],
    first: int,
    width: int,
    dialect: Dialect,
) -> TextHead:
    """Return the names (and units) in the lines above the first record; none where none fit."""
    limit = rows[first][0] if first < len(rows) else lines[-1][0] + 1
    above = [(k, _uncommented(line)) for k, line in lines if k < limit and line.strip()]
    empty = TextHead(dialect, (), (), 0, (), (), (), 0)
    if not above:
        return empty
    candidates = [(k, dialect.split(line)) for k, line in above[::-1]]
    units: tuple[str, ...] = ()
    while len(candidates) > 1:
        cells = candidates[0][1]
        if _is_unit_row(cells, width):
            units = _units_of(cells)
        elif not (
            _are_types(cells) or (not units and _repeats(cells, candidates[1][1], width))
        ):  # units that are not known repeat as well
            break
        elif not _are_types(cells):
            units = _units_of(cells)
        candidates = candidates[1:]
    for position, (k, cells) in enumerate(candidates):
        fits = abs(len(cells) - width) <= 1 or not width
        named = _share([c for c in cells if c], ".") < _MIN_NUMERIC
        if fits and named and (len(cells) > 1 or width == 1):
            over = candidates[position + 1][1] if position + 1 < len(candidates) else []
            if not units and over and _is_unit_row(over, width):
                units = _units_of(over)
            return replace(empty, names=tuple(cells), units=units, header_line=k)
    k, cells = candidates[0]
    if len(cells) > 1 and k == limit - 1 and _share(cells, ".") < _MIN_NUMERIC:
        return replace(empty, names=tuple(cells), units=units, header_line=k)
    return empty


def _units_of(cells: list[str]) -> tuple[str, ...]:
    return tuple(_UNIT_CELL.sub(r"\1", cell.strip()) for cell in cells)


def _are_types(cells: list[str]) -> bool:
    """Return whether the cells of a line are types of numbers."""
    return all(re.fullmatch(r"(u?int|float|double|single|real)\d*(_t)?", c.lower()) for c in cells)


def _uncommented(line: str) -> str:
    line = line.strip()
    for sign in COMMENT_SIGNS:
        if line.startswith(sign):
            return line[len(sign) :].strip()
    return line


def _repeats(cells: list[str], above: list[str], width: int) -> bool:
    """Return whether a line repeats texts, as units and no names do, below a line of names."""
    fits = abs(len(cells) - width) <= 1 and abs(len(above) - width) <= 1
    texts = [c for c in cells if c]
    names = [c for c in above if c]
    return (
        fits
        and len(set(texts)) < len(texts)
        and len(set(names)) == len(names)
        and _share(names, ".") < _MIN_NUMERIC
    )


def _is_unit_row(cells: list[str], width: int) -> bool:
    """Return whether each cell of a line is a unit, or blank; half of them at least are units."""
    inside = [_UNIT_CELL.sub(r"\1", cell.strip()) for cell in cells]
    known = [bool(unit_name(text)) for text in inside]
    empty = [text in ("", "-", "1", "none", "n/a") for text in inside]
    return (
        abs(len(cells) - width) <= 1
        and all(k or e for k, e in zip(known, empty, strict=True))
        and 2 * sum(known) >= len(cells)
    )


def reject_other_files(path: str, head: bytes) -> None:
    """Raise LogError where the head of a file is that of a rotcli result or a rig."""
    if found := _RESULT.match(head):
        kind = found[1].decode()
        raise LogError(path, f"is a rotcli result ({kind}), not a log; give the log itself")
    if _RIG.match(head):
        raise LogError(path, "is a rig, not a log; give the log itself")
