"""Columns of numbers from Parquet logs, complete or chunk by chunk."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.lazy import lazily
from rotcli.logs.container.columns import Loaded, Wanted, to_chunks
from rotcli.logs.container.header import Header, as_log_error

with lazily():
    from pyarrow import parquet as pq

    from rotcli.logs.container import csv_file


# Records of one page of numbers: their first records cannot be decoded without the others.
_PAGE_RECORDS = 1 << 17
_MAX_READ_AHEAD = 64_000_000  # bytes
# The short file whose first records were read last, complete, until it is loaded.
_read_ahead: dict[tuple[str, tuple[int, int]], Any] = {}


def first_records(path: str, stamp: tuple[int, int] | None, count: int) -> Any:
    """Return the first `count` records of a Parquet file, None where it has none.

    A short file is decoded once, for `load` as well.
    """
    with as_log_error(path):
        table = None if stamp is None else _short_table(path)
        if table is not None and stamp is not None:
            _read_ahead.clear()
            _read_ahead[path, stamp] = table
            return next(iter(table.slice(0, count).to_batches()), None)
        # In small parts, not all columns of the first row group.
        with pq.ParquetFile(path, buffer_size=1 << 16, pre_buffer=False) as file:
            return next(file.iter_batches(batch_size=count), None)


def _short_table(path: str) -> Any:
    """Return all columns of a short file, None for a long one or where some cannot be read."""
    with pq.ParquetFile(path) as file:
        rows = file.metadata.num_rows
        size = sum(file.metadata.row_group(k).total_byte_size for k in range(file.num_row_groups))
        if rows > _PAGE_RECORDS or max(size, 8 * rows * len(file.schema)) > _MAX_READ_AHEAD:
            return None
        try:
            return file.read()
        except (OSError, pa.ArrowException):  # perhaps a column that is not wanted
            return None


def load(header: Header, wanted: Wanted) -> Loaded:
    """Return the wanted columns of a Parquet log."""
    names = [header.raw[i] for i in wanted.columns]
    table = None if header.stamp is None else _read_ahead.pop((header.path, header.stamp), None)
    if table is not None:
        _check_types(header, wanted, table.schema)
        _check_declared(header, wanted, table.num_rows)
        return _numbers(header, wanted, table.select(list(wanted.columns)), 0)
    with pq.ParquetFile(header.path) as file:
        _check_types(header, wanted, file.schema_arrow)
        _check_declared(header, wanted, _declared_rows(file))
        table = file.read(columns=names)
    return _numbers(header, wanted, table, 0)


def load_chunks(
    header: Header, wanted: Wanted, rows: int, first: int
) -> Iterator[tuple[Loaded, float]]:
    """Yield the wanted columns `rows` records at a time, and the share of the file read.

    The file is entered at the row group of record `first`.
    """
    with pq.ParquetFile(header.path, buffer_size=1 << 17, pre_buffer=False) as file:
        _check_types(header, wanted, file.schema_arrow)
        _check_declared(header, wanted, _declared_rows(file))
        total = max(file.metadata.num_rows, 1)
        starts = [0]
        for group in range(file.num_row_groups):
            starts.append(starts[-1] + file.metadata.row_group(group).num_rows)
        groups = [g for g in range(file.num_row_groups) if starts[g + 1] > first]
        read = starts[groups[0]] if groups else 0
        names = [header.raw[i] for i in wanted.columns]
        for batch in file.iter_batches(batch_size=rows, row_groups=groups, columns=names):
            table = pa.Table.from_batches([batch])
            loaded = _numbers(header, wanted, table, read)
            yield replace(loaded, first=read), (read + len(batch)) / total
            read += len(batch)
    # Otherwise it keeps 30 to 50 MB, which the arrays of a long log need on top.
    pa.default_memory_pool().release_unused()


def count_rows(header: Header) -> int:
    """Return how many records a Parquet file contains."""
    with as_log_error(header.path):
        return int(pq.read_metadata(header.path, memory_map=True).num_rows)


def _check_types(header: Header, wanted: Wanted, schema: Any) -> None:
    """Raise LogError for a column that contains no numbers."""
    for i in wanted.columns:
        kind = schema.field(i).type
        numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind)
        timed = pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind)
        if not (numeric or timed or i in wanted.texts):
            finding = f"contains {kind}, not numbers; write the column as float64"
            raise LogError(header.path, finding, column=header.names[i])


def _declared_rows(file: Any) -> int:
    """Return how many records a file declares, before any is read.

    The declarations of single columns are not checked: pyarrow ends the process where they are
    damaged.
    """
    rows = sum(file.metadata.row_group(g).num_rows for g in range(file.num_row_groups))
    return int(max(rows, file.metadata.num_rows))


def _check_declared(header: Header, wanted: Wanted, rows: int) -> None:
    """Raise LogError when a file declares more numbers than may be read."""
    header.check_size(8 * len(wanted.columns) * rows, f"its {rows} records need")


def _numbers(header: Header, wanted: Wanted, table: Any, before: int) -> Loaded:
    """Return a table's columns as numbers; `before` records came before it."""
    kept: NDArray[np.int64] | None = None
    nulls = any(table.column(header.raw[i]).null_count for i in wanted.values)
    if wanted.values and (wanted.sparse or nulls):
        empty = np.ones(table.num_rows, dtype=bool)
        for i in wanted.values:
            column = table.column(header.raw[i])
            if pa.types.is_integer(column.type) or pa.types.is_floating(column.type):
                empty &= column.is_null(nan_is_null=True).to_numpy(zero_copy_only=False)
        if empty.any() and not empty.all():
            kept = np.flatnonzero(~empty)
            table = table.take(pa.array(kept))
    columns = []
    for i in wanted.columns:
        column = table.column(header.raw[i])
        if column.null_count:
            bad = int(np.flatnonzero(column.is_null().to_numpy(zero_copy_only=False))[0])
            row = Loaded(header, 0, [], before, kept).row(bad)
            finding = "an empty cell (null); correct or remove the record"
            raise LogError(header.path, finding, row=row, column=header.names[i])
        if wanted.texts.get(i) == "name":
            columns.append([np.array(column.to_pylist(), dtype=object)])
            continue
        if wanted.texts.get(i) in ("timestamp", "timestamp utc", "time of day", "text"):
            columns.append([csv_file.parsed_times(header, i, [str(v) for v in column.to_pylist()])])
            continue
        if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
            short = pa.types.is_time32(column.type)
            chunks = [chunk.view(pa.int32() if short else pa.int64()) for chunk in column.chunks]
            column = pa.chunked_array(chunks, pa.int32() if short else pa.int64())
        columns.append(to_chunks(column))
    return Loaded(header, table.num_rows, columns, before, kept)
