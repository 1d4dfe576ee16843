"""Columns of numbers out of CSV (plain, gzip, zstd) or Parquet, told apart by content.

`header.open_log` reads the header, `load` the wanted columns in one multithreaded pass. Only when
that pass fails or a number is not finite is the text read again, line by line, to name the row
and column. A row is the line of a CSV file (the header is row 1), or a Parquet record from 1.
"""

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.files.dialect import NUMBER, Cleaned, separator
from rotcli.files.dialect import records as text_records
from rotcli.logs.header import Header, Limited, Progress, faults, stream_of

Array = NDArray[np.float64]
Chunks = list[NDArray[Any]]


@dataclass(frozen=True)
class Loaded:
    """The numbers of the wanted columns, in the chunks they were read in."""

    header: Header
    rows: int
    columns: list[Chunks]
    first: int = 0  # records of the log before these

    def row(self, index: int) -> int:
        """Return the row of record `index` as the user counts."""
        index += self.first
        if self.header.kind == "parquet":
            return index + 1
        with faults(self.header.path), stream_of(self.header) as stream:
            return next(islice(_records(self.header, stream), index, None))[0]

    def fill(self, out: Array, column: int, factor: float) -> None:
        """Write one column times `factor` into out (rows,)."""
        start = 0
        for chunk in self.columns[column]:
            part = out[start : start + len(chunk)]
            if chunk.dtype.kind in "iu" and factor < 1.0:
                per_second = round(1.0 / factor)
                whole = chunk // per_second
                np.multiply(chunk - whole * per_second, factor, out=part)
                part += whole
            else:
                np.multiply(chunk, factor, out=part)
            start += len(chunk)


def load(
    header: Header, wanted: list[int], *, least: int = 2, progress: Progress | None = None
) -> Loaded:
    """Read the columns with the given indices, every number finite, at least `least` rows.

    progress: told how much of a text log (0 to 1) is read.

    Raises LogError that names the row and column of the first fault.
    """
    with faults(header.path):
        if header.kind == "parquet":
            loaded = _load_parquet(header, wanted)
        else:
            loaded = _load_csv(header, wanted, progress)
        header.check_unchanged()
    if loaded.rows < least:
        found = "no rows" if loaded.rows == 0 else f"only {loaded.rows} row"
        what = f"{found} of numbers below the header; at least {least} are needed"
        if header.kind == "parquet":
            what = f"{found} of numbers; at least {least} are needed"
        raise LogError(header.path, what)
    _check_finite(loaded, wanted)
    return loaded


def load_batches(
    header: Header, wanted: list[int], rows: int, first: int = 0
) -> Iterator[tuple[Loaded, float]]:
    """Yield the columns about `rows` records at a time, and the share of the file read so far.

    For logs too long to hold. The first batch is one that holds record `first` or comes before
    it: a Parquet file is entered at its row group. Raises LogError as `load` does.
    """
    batches = _parquet_batches if header.kind == "parquet" else _csv_batches
    held: tuple[Loaded, float] | None = None
    with faults(header.path):
        for loaded, share in batches(header, wanted, rows, first):
            _check_finite(loaded, wanted)
            if held is None:
                held = loaded, share
            elif loaded.rows < rows // 4:  # the end of a row group: with the batch before
                held = _together(held[0], loaded), share
            else:
                yield held
                held = loaded, share
    if held is None or not held[0].rows:
        raise LogError(header.path, "no rows of numbers; a log of some hours is needed")
    yield held


def _together(before: Loaded, after: Loaded) -> Loaded:
    columns = [[*a, *b] for a, b in zip(before.columns, after.columns, strict=True)]
    return replace(before, rows=before.rows + after.rows, columns=columns)


def _parquet_batches(
    header: Header, wanted: list[int], rows: int, first: int
) -> Iterator[tuple[Loaded, float]]:
    import pyarrow.parquet as pq

    with pq.ParquetFile(header.path, buffer_size=1 << 20, pre_buffer=False) as file:
        _check_kinds(header, wanted, file.schema_arrow)
        _check_declared(header, wanted, file)
        total = max(file.metadata.num_rows, 1)
        starts = [0]
        for group in range(file.num_row_groups):
            starts.append(starts[-1] + file.metadata.row_group(group).num_rows)
        groups = [g for g in range(file.num_row_groups) if starts[g + 1] > first]
        read = starts[groups[0]] if groups else 0
        names = [header.raw[i] for i in wanted]
        for batch in file.iter_batches(batch_size=rows, row_groups=groups, columns=names):
            table = pa.Table.from_batches([batch])
            loaded = _parquet_numbers(header, wanted, table, read)
            yield replace(loaded, first=read), (read + len(batch)) / total
            read += len(batch)


def _csv_batches(
    header: Header, wanted: list[int], rows: int, first: int
) -> Iterator[tuple[Loaded, float]]:
    import pyarrow.csv as pc

    size = max(Path(header.path).stat().st_size, 1)
    read, parse, convert = _csv_options(header, wanted, header.integers)
    read.block_size = max(1 << 16, 20 * rows * len(header.raw))
    done = 0
    with pa.OSFile(header.path, "rb") as raw:
        plain = header.kind == "csv"
        packed = None if plain else pa.CompressedInputStream(raw, header.kind)
        stream = raw if packed is None else Limited(packed, header)
        text = _records_alone(stream, header)
        try:
            with pc.open_csv(
                text, read_options=read, parse_options=parse, convert_options=convert
            ) as reader:
                for batch in reader:
                    if done + batch.num_rows > first:
                        table = pa.Table.from_batches([batch])
                        columns = [_chunks(table.column(str(i))) for i in wanted]
                        yield Loaded(header, batch.num_rows, columns, done), raw.tell() / size
                    done += batch.num_rows
        except pa.ArrowInvalid:
            _locate(header, wanted)
            raise


def parquet_rows(header: Header) -> int:
    """Return how many records a Parquet file holds."""
    import pyarrow.parquet as pq

    with faults(header.path):
        return int(pq.read_metadata(header.path, memory_map=True).num_rows)


def _check_finite(loaded: Loaded, wanted: list[int]) -> None:
    """Raise LogError for the first number that is not finite."""
    with np.errstate(all="ignore"):
        if all(np.isfinite(chunk.sum()) for chunks in loaded.columns for chunk in chunks):
            return
    faults = []
    for chunks, i in zip(loaded.columns, wanted, strict=True):
        values = np.concatenate(chunks)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            faults.append((int(bad[0]), i, str(values[bad[0]])))
    if faults:
        index, i, value = min(faults)
        what = f"{value} is not a finite number; remove the row (a short gap is bridged)"
        raise LogError(
            loaded.header.path, what, row=loaded.row(index), column=loaded.header.names[i]
        )


def _csv_options(
    header: Header, wanted: list[int], integers: frozenset[int]
) -> tuple[Any, Any, Any]:
    """Return how pyarrow is to read, take apart and convert the wanted columns."""
    import pyarrow.csv as pc

    keys = [str(i) for i in range(len(header.raw))]
    types = {str(i): pa.int64() if i in integers else pa.float64() for i in wanted}
    delimiter = "," if header.dialect is None else header.dialect.delimiter or ","
    return (
        pc.ReadOptions(column_names=keys, skip_rows=int(header.dialect is None)),
        pc.ParseOptions(delimiter=delimiter),
        pc.ConvertOptions(
            column_types=types, include_columns=list(types), null_values=[], check_utf8=False
        ),
    )


def _records_alone(stream: Any, header: Header) -> Any:
    """Return the stream as pyarrow may read it: a log in a dialect cleaned."""
    return stream if header.dialect is None else Cleaned(stream, header.dialect, header.before)


def _load_csv(header: Header, wanted: list[int], progress: Progress | None) -> Loaded:
    import pyarrow.csv as pc

    if header.dialect is not None and not header.first:
        return Loaded(header, 0, [[] for _ in wanted])
    integers = header.integers
    while True:
        read, parse, convert = _csv_options(header, wanted, integers)
        try:
            with stream_of(header, progress) as stream:
                table = pc.read_csv(
                    _records_alone(stream, header),
                    read_options=read,
                    parse_options=parse,
                    convert_options=convert,
                )
            break
        except pa.ArrowInvalid as error:
            if "Could not skip initial" in str(error):  # a header without a line end
                return Loaded(header, 0, [[] for _ in wanted])
            if integers:
                integers = frozenset()
                continue
            _locate(header, wanted)
            raise
    return Loaded(header, table.num_rows, [_chunks(table.column(str(i))) for i in wanted])


def _chunks(column: Any) -> Chunks:
    """Return the numbers of a column without nulls, as they lie in memory.

    Arrow's own `to_numpy` imports pandas, which costs more than reading the log.
    """
    letter = (
        "f"
        if pa.types.is_floating(column.type)
        else "iu"[pa.types.is_unsigned_integer(column.type)]
    )
    dtype = np.dtype(f"{letter}{column.type.bit_width // 8}")
    return [
        np.frombuffer(chunk.buffers()[1], dtype, len(chunk), chunk.offset * dtype.itemsize)
        for chunk in column.chunks
        if len(chunk)
    ]


def _records(header: Header, stream: Any) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number, cells) of every line below the header that is not empty."""
    if header.dialect is not None:
        yield from text_records(stream, header.dialect, header.before)
        return
    text = io.TextIOWrapper(stream, encoding="utf-8-sig", errors="replace", newline="")
    reader = csv.reader(line.replace("\0", "�") for line in text)
    filled = ((reader.line_num, cells) for cells in reader if cells)
    next(filled, None)
    yield from filled


def _locate(header: Header, wanted: list[int]) -> None:
    """Raise LogError for the first cell or row of a text log that is at fault."""
    with stream_of(header) as stream:
        for row, cells in _records(header, stream):
            if len(cells) != len(header.raw):
                raise LogError(header.path, _miscounted(header, len(cells)), row=row)
            for i in wanted:
                cell = cells[i].strip()
                if not NUMBER.fullmatch(cell):
                    what = f"{cell[:40]!r} is not a number" if cell else "an empty cell"
                    what += "; correct it or remove the row (a short gap is bridged)"
                    raise LogError(header.path, what, row=row, column=header.names[i])


def _miscounted(header: Header, count: int) -> str:
    columns = f"the header has {len(header.raw)} columns"
    if header.dialect is not None and "1" in header.raw:
        columns = f"the first record has {len(header.raw)}"
    how = "is cut off or " if count < len(header.raw) else ""
    sign = separator(header.dialect).removesuffix("s")
    return f"{count} values where {columns}; the row {how}has a stray {sign}: correct or remove it"


def _check_kinds(header: Header, wanted: list[int], schema: Any) -> None:
    """Raise LogError for a column that holds no numbers."""
    for i in wanted:
        kind = schema.field(i).type
        numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind)
        if not (numeric or pa.types.is_timestamp(kind) or pa.types.is_duration(kind)):
            what = f"holds {kind} where numbers belong; write the column as float64"
            raise LogError(header.path, what, column=header.names[i])


def _check_declared(header: Header, wanted: list[int], file: Any) -> None:
    """Raise LogError when the file declares more numbers than may be read, before any is.

    What it declares of single columns is left alone: pyarrow ends the process where that is
    damaged.
    """
    rows = sum(file.metadata.row_group(g).num_rows for g in range(file.num_row_groups))
    rows = max(rows, file.metadata.num_rows)
    header.check_size(8 * len(wanted) * rows, f"its {rows} records would fill")


def _load_parquet(header: Header, wanted: list[int]) -> Loaded:
    import pyarrow.parquet as pq

    with pq.ParquetFile(header.path) as file:
        _check_kinds(header, wanted, file.schema_arrow)
        _check_declared(header, wanted, file)
        table = file.read(columns=[header.raw[i] for i in wanted])
    return _parquet_numbers(header, wanted, table, 0)


def _parquet_numbers(header: Header, wanted: list[int], table: Any, before: int) -> Loaded:
    """Return a table's columns as numbers; `before` records came before it."""
    columns = []
    for i in wanted:
        column = table.column(header.raw[i])
        if column.null_count:
            bad = before + int(np.flatnonzero(column.is_null().to_numpy())[0])
            what = "an empty cell (null); fill it in or remove the record (a short gap is bridged)"
            raise LogError(header.path, what, row=bad + 1, column=header.names[i])
        if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
            chunks = [chunk.view(pa.int64()) for chunk in column.chunks]
            column = pa.chunked_array(chunks, pa.int64())
        columns.append(_chunks(column))
    return Loaded(header, table.num_rows, columns)
