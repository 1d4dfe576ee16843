"""Columns of numbers into CSV or Parquet, by atomic writes, the same bytes every time."""

import csv
import io
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotcli.errors import ResultError
from rotcli.files.atomic import atomic_write
from rotcli.lazy import lazily

with lazily():
    from pyarrow import csv as csv_format
    from pyarrow import parquet as pq

_COMPRESSION = {".gz": "gzip", ".zst": "zstd"}


def write_columns(target: str | Path | BinaryIO, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write named columns of equal length; the name carries the unit, as in `time [s]`.

    The suffix says how: .parquet (zstd), .csv, .csv.gz, .csv.zst. A binary stream gets CSV.
    Numbers keep their full precision.

    Raises ResultError when the suffix is unknown or the file cannot be written.
    """
    if not isinstance(target, str | Path):
        _write_csv(target, [_table(columns)])
        return
    write_column_chunks(target, [columns])


def write_column_chunks(target: str | Path, parts: Iterable[Mapping[str, NDArray[Any]]]) -> None:
    """Write a file as `write_columns` does, from parts that follow one another (one at least)."""
    path = Path(target)
    suffixes = [s.lower() for s in path.suffixes]
    packed = _COMPRESSION.get(suffixes[-1]) if suffixes else None
    parquet = suffixes[-1:] == [".parquet"]
    if not parquet and suffixes[(-2 if packed else -1) :][:1] != [".csv"]:
        what = "unknown kind of file; name it .parquet, .csv, .csv.gz or .csv.zst"
        raise ResultError(f"{target}: {what}")
    tables = map(_table, parts)
    try:
        with atomic_write(path) as stream:
            if parquet:
                first = next(tables)
                with _parquet(stream, first.schema) as writer:
                    writer.write_table(first)
                    for table in tables:
                        writer.write_table(table)
            elif packed:
                with pa.CompressedOutputStream(stream, packed) as out:
                    _write_csv(out, tables)
            else:
                _write_csv(stream, tables)
    except OSError as error:
        raise ResultError(f"{target}: cannot be written: {error.strerror or error}") from error


def _parquet(stream: Any, schema: Any) -> Any:
    """Return a writer; a dictionary is built of columns only whose values may repeat.

    Readings do not: without a dictionary they are written three times faster, and a tenth smaller.
    """
    repeating = [field.name for field in schema if not pa.types.is_floating(field.type)]
    return pq.ParquetWriter(stream, schema, compression="zstd", use_dictionary=repeating or False)


def _table(columns: Mapping[str, NDArray[Any]]) -> Any:
    return pa.table({name: _arrow(column) for name, column in columns.items()})


def _arrow(column: NDArray[Any]) -> Any:
    """Return an Arrow array on the column's own memory.

    Arrow's own conversion imports pandas, which costs more than writing the file.
    """
    column = np.ascontiguousarray(column)
    kind = pa.from_numpy_dtype(column.dtype)
    return pa.Array.from_buffers(kind, len(column), [None, pa.py_buffer(column)])


def _write_csv(stream: Any, tables: Iterable[Any]) -> None:
    for k, table in enumerate(tables):
        if k == 0:
            header = io.StringIO()
            csv.writer(header, lineterminator="\n").writerow(table.column_names)
            stream.write(header.getvalue().encode())
        csv_format.write_csv(table, stream, csv_format.WriteOptions(include_header=False))
