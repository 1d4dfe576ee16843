"""Columns of numbers from text logs: one multithreaded pass, or chunk by chunk.

Only when the fast pass fails is the text read again, line by line, to name row and column. A row
is the line of the file; the header is row 1 where it is at the top.
"""

import itertools
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.files.dialect import (
    BLANK_CELLS,
    DECIMAL_COMMA,
    DELIMITER_NAMES,
    RecordStream,
    is_number,
)
from rotcli.files.time_text import nanoseconds
from rotcli.lazy import lazily
from rotcli.logs.container.columns import Chunks, Loaded, Wanted, to_chunks
from rotcli.logs.container.header import Header, Limited, Progress, stream_of
from rotcli.logs.container.lines import text_lines
from rotcli.logs.container.quotes import CheckedStream
from rotcli.logs.container.text_head import COMMENT_SIGNS

with lazily():
    from pyarrow import csv as pc

_TEXT_TIMES = {
    "timestamp": pa.timestamp("ns"),
    "timestamp utc": pa.timestamp("ns", tz="UTC"),
    "time of day": pa.time64("ns"),
}
_MAX_COUNTED = 200_000  # rows below a row of wrong length, of which those like it are counted
_BLOCK = 1 << 20  # bytes that are searched at a time
_COMMENT_LINE = re.compile(rb"(?m)^[ \t]*(" + b"|".join(s.encode() for s in COMMENT_SIGNS) + b")")
_MAX_LOOKED = 1000  # rows below an error that show whether every row has it


def load(header: Header, wanted: Wanted, progress: Progress | None) -> Loaded:
    """Return the wanted columns of a text log."""
    if not header.records:
        return Loaded(header, 0, [[] for _ in wanted.columns])
    integers = header.integers
    while True:
        read, parse, convert = _options(header, wanted, integers)
        try:
            with stream_of(header, progress) as stream:
                table = pc.read_csv(
                    _records_only(stream, header),
                    read_options=read,
                    parse_options=parse,
                    convert_options=convert,
                )
            break
        except pa.ArrowInvalid as error:
            if "Could not skip initial" in str(error):  # a header without a line end
                return Loaded(header, 0, [[] for _ in wanted.columns])
            if integers:
                integers = frozenset()
                continue
            if any(kind in _TEXT_TIMES for kind in wanted.texts.values()):
                texts = {i: "text" if k in _TEXT_TIMES else k for i, k in wanted.texts.items()}
                wanted = replace(wanted, texts=texts)
                continue
            known = header, wanted
            header, wanted = _with_first_obstacle(header, wanted)
            if known != (header, wanted):
                integers = header.integers
                continue
            locate_error(header, wanted)
            raise
    return _numbers(header, wanted, table, 0)


def _with_first_obstacle(header: Header, wanted: Wanted) -> tuple[Header, Wanted]:
    """Return the header with the sign of comments amid the records, or `wanted` for blank records.

    Unchanged where the first line that is no record of numbers is neither.
    """
    sign = _find_comment(header)
    if sign:
        plain = replace(header.plain, comment=sign)
        return replace(header, plain=plain, dialect=plain), wanted
    with stream_of(header) as stream:
        for _, cells in text_lines(header, stream):
            if len(cells) != len(header.raw):
                return header, wanted
            if any(cells[i].strip() in BLANK_CELLS for i in wanted.values):
                blank = all(cells[i].strip() in BLANK_CELLS for i in wanted.values)
                return header, replace(wanted, sparse=wanted.sparse or blank)
    return header, wanted


def _find_comment(header: Header) -> str | None:
    """Return the sign that comments amid the records begin with, found by a search of the bytes."""
    plain = header.plain
    if plain.comment or plain.clean is not None or plain.encoding not in ("utf-8", "utf-8-sig"):
        return None
    with stream_of(header) as stream:
        block = stream.read(_BLOCK)
        for _ in range(header.before):
            _, _, block = block.partition(b"\n")
        while block:
            match = _COMMENT_LINE.search(block)
            if match:
                return match[1].decode()
            rest = block[block.rfind(b"\n") :] if b"\n" in block else b""
            block = stream.read(_BLOCK)
            block = rest + block if block else b""
    return None


def _comment_sign(header: Header, cells: list[str]) -> str | None:
    """Return the sign of a comment that a row begins with, None where comments are known."""
    first = cells[0].strip() if cells else ""
    if header.plain.comment or header.plain.clean is not None:
        return None
    return next((sign for sign in COMMENT_SIGNS if first.startswith(sign)), None)


def load_chunks(
    header: Header, wanted: Wanted, rows: int, first: int
) -> Iterator[tuple[Loaded, float]]:
    """Yield the wanted columns about `rows` records at a time, and the share of the file read."""
    size = max(Path(header.path).stat().st_size, 1)
    read, parse, convert = _options(header, wanted, header.integers)
    read.block_size = max(1 << 16, 20 * rows * len(header.raw))
    done = 0
    with pa.OSFile(header.path, "rb") as raw:
        packed = None if header.kind == "csv" else pa.CompressedInputStream(raw, header.kind)
        stream = raw if packed is None else Limited(packed, header)
        try:
            with pc.open_csv(
                _records_only(stream, header),
                read_options=read,
                parse_options=parse,
                convert_options=convert,
            ) as reader:
                for batch in reader:
                    if done + batch.num_rows > first:
                        table = pa.Table.from_batches([batch])
                        yield _numbers(header, wanted, table, done), raw.tell() / size
                    done += batch.num_rows
        except pa.ArrowInvalid:
            locate_error(header, wanted)
            raise


def _options(header: Header, wanted: Wanted, integers: frozenset[int]) -> tuple[Any, Any, Any]:
    """Return how pyarrow is to read, split and convert the wanted columns."""
    types: dict[str, Any] = {}
    for i in wanted.columns:
        kind = wanted.texts.get(i)
        if kind is None:
            types[str(i)] = pa.int64() if i in integers else pa.float64()
        else:
            types[str(i)] = _TEXT_TIMES.get(kind, pa.string())
    return (
        pc.ReadOptions(
            column_names=[str(i) for i in range(len(header.raw))],
            skip_rows=header.before if header.dialect is None else 0,
        ),
        pc.ParseOptions(
            delimiter=header.plain.delimiter, quote_char='"' if header.plain.quotes else False
        ),
        pc.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=list(BLANK_CELLS) if wanted.sparse else [],
            strings_can_be_null=True,
            check_utf8=False,
            decimal_point=header.plain.decimal,
        ),
    )


def _records_only(stream: Any, header: Header) -> Any:
    """Return the stream as pyarrow can read it: marks checked, and a log in a dialect cleaned."""
    if header.dialect is not None:
        stream = RecordStream(stream, header.dialect, header.before)
    return CheckedStream(stream, header) if header.plain.quotes else stream


def _numbers(header: Header, wanted: Wanted, table: Any, first: int) -> Loaded:
    """Return a table's columns as numbers, without the records that have none of them."""
    kept: NDArray[np.int64] | None = None
    if wanted.sparse:
        empty = np.ones(table.num_rows, dtype=bool)
        for i in wanted.values:
            empty &= table.column(str(i)).is_null().to_numpy(zero_copy_only=False)
        if empty.any():
            kept = np.flatnonzero(~empty)
            table = table.take(pa.array(kept))
    columns = [
        _column(header, wanted, i, table.column(str(i)), kept, first) for i in wanted.columns
    ]
    return Loaded(header, table.num_rows, columns, first, kept)


def _column(
    header: Header,
    wanted: Wanted,
    index: int,
    column: Any,
    kept: NDArray[np.int64] | None,
    first: int,
) -> Chunks:
    if column.null_count:
        bad = int(np.flatnonzero(column.is_null().to_numpy(zero_copy_only=False))[0])
        loaded = Loaded(header, 0, [], first, kept)
        finding = "an empty cell; correct or remove the row"
        raise LogError(header.path, finding, row=loaded.row(bad), column=header.names[index])
    if wanted.texts.get(index) == "text":
        return [parsed_times(header, index, column.to_pylist())]
    if wanted.texts.get(index) == "name":
        return [np.array(column.to_pylist(), dtype=object)]
    return to_chunks(column)


def parsed_times(header: Header, index: int, cells: list[str]) -> NDArray[np.int64]:
    """Return dates and times of unusual forms as ns; raises LogError."""
    try:
        return nanoseconds(cells)
    except ValueError as error:
        finding = f"all time stamps are text such as {cells[0][:40]!r}"
        advice = "write seconds or ISO 8601"
        raise LogError(header.path, f"{finding}; {advice}", column=header.names[index]) from error


def locate_error(header: Header, wanted: Wanted) -> None:
    """Raise LogError for the first cell or row of a text log that is not as it should be."""
    with stream_of(header) as stream:
        rows = text_lines(header, stream)
        for row, cells in rows:
            if len(cells) != len(header.raw):
                _raise_wrong_count(header, row, cells, rows)
            for i in wanted.columns:
                cell = cells[i].strip()
                good = i in wanted.texts or is_number(cell, header.plain.decimal)
                if not good and not (wanted.sparse and cell in BLANK_CELLS):
                    _raise_no_number(header, wanted, i, row, cell, rows)


def _raise_wrong_count(
    header: Header, row: int, cells: list[str], rows: Iterator[tuple[int, list[str]]]
) -> NoReturn:
    """Raise LogError for a row with too few or too many cells, and count the others like it."""
    first = cells[0].strip() if cells else ""
    sign = _comment_sign(header, cells)
    if sign:  # of a log that is read chunk by chunk
        finding = f"a comment line; set [imu] comment = {json.dumps(sign)}"
        raise LogError(header.path, finding, row=row)
    width = len(header.raw)
    more = [len(c) for _, c in itertools.islice(rows, _MAX_COUNTED) if len(c) != width]
    expected = "the header" if header.header_line else "the first record"
    if len(cells) < width and first.strip("\ufffd") == "":
        cause = "zero bytes, the file was not closed"
    elif len(cells) < width:
        cause = "the row is truncated" if len(cells) > 1 else "no record"
    else:
        name = DELIMITER_NAMES.get(header.plain.delimiter, "delimiter")
        cause = f"the row has one {name} too many"
    finding = f"{len(cells)} values, {expected} has {width}: {cause}"
    if more:
        rest = f"{len(more)} later row{'s are' if len(more) > 1 else ' is'}"
        raise LogError(header.path, f"{finding}; correct or remove it. {rest} like it", row=row)
    raise LogError(header.path, f"{finding}; correct or remove it", row=row)


def _raise_no_number(
    header: Header,
    wanted: Wanted,
    index: int,
    row: int,
    cell: str,
    rows: Iterator[tuple[int, list[str]]],
) -> NoReturn:
    """Raise LogError for a cell that is no number, or for a column in which no cell is one."""
    column = header.names[index]
    if not cell:
        raise LogError(
            header.path, "an empty cell; correct or remove the row", row=row, column=column
        )
    later = [c[index].strip() for _, (_, c) in zip(range(_MAX_LOOKED), rows, strict=False)
             if len(c) > index]  # fmt: skip
    numbers = [c for c in later if is_number(c, header.plain.decimal)]
    if len(later) > 1 and not numbers:
        if all(DECIMAL_COMMA.fullmatch(c) for c in (cell, *later)):
            finding = f'the numbers have a decimal comma ({cell!r}); set [imu] decimal = ","'
        else:
            subject, advice = "values", "numbers"
            if index == wanted.columns[0] and index not in wanted.values:
                subject, advice = "time stamps", "seconds or ISO 8601"
            finding = f"all {subject} are text such as {cell[:40]!r}; write {advice}"
        raise LogError(header.path, finding, column=column)
    others = len(later) - len(numbers)
    like = f" ({others} of the next {len(later)} rows are like it)" if others else ""
    finding = f"{cell[:40]!r} is not a number{like}; correct or remove the row"
    raise LogError(header.path, finding, row=row, column=column)
