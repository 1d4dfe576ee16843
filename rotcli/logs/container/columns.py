"""Columns of numbers of a log of any kind: complete (`load`) or in chunks (`load_chunks`).

One call for text, Parquet and bags; the kind is that of the header. Every number is finite. A row
is the line of a text (the header is row 1), or a record counted from 1.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.container.header import Header, Progress, as_log_error, stream_of

FloatArray = NDArray[np.float64]
Chunks = list[NDArray[Any]]

_MIN_CHUNK_SHARE = 0.25  # of the usual chunk; a smaller one joins the chunk before


@dataclass(frozen=True)
class Wanted:
    """Which columns to load.

    values: those whose absence makes a record empty, in a log with blank cells (`sparse`).
    texts: column to `timestamp`, `time of day`, `text` (another time) or `name`.
    """

    columns: tuple[int, ...]
    values: tuple[int, ...] = ()
    texts: dict[int, str] = field(default_factory=dict)
    sparse: bool = False


@dataclass(frozen=True)
class Loaded:
    """The numbers of the wanted columns, in the chunks they were read in.

    first: records of the log before these. kept: which of the records they are, where some were
    left out.
    """

    header: Header
    rows: int
    columns: list[Chunks]
    first: int = 0
    kept: NDArray[np.int64] | None = None

    def row(self, index: int) -> int:
        """Return the row of record `index` as the user counts."""
        index = int(self.kept[index]) if self.kept is not None and len(self.kept) else index
        index += self.first
        if not self.header.is_text:
            return index + 1
        from rotcli.logs.container.csv_file import text_lines

        with as_log_error(self.header.path), stream_of(self.header) as stream:
            return next(islice(text_lines(self.header, stream), index, None))[0]

    def fill(self, out: FloatArray, column: int, factor: float, offset: float = 0.0) -> None:
        """Write (one column - offset) times `factor` into out (rows,)."""
        start = 0
        for chunk in self.columns[column]:
            part = out[start : start + len(chunk)]
            if offset:
                np.subtract(chunk, offset, out=part)
                part *= factor
            elif chunk.dtype.kind in "iu" and _is_decimal_part(factor):
                # Integers beyond float64, such as ns of Unix time, keep their digits.
                per_second = round(1.0 / factor)
                complete = chunk // per_second
                np.multiply(chunk - complete * per_second, factor, out=part)
                part += complete
            else:
                np.multiply(chunk, factor, out=part)
            start += len(chunk)

    def column(self, index: int) -> NDArray[Any]:
        """Return one column as it was read."""
        chunks = self.columns[index]
        return chunks[0] if len(chunks) == 1 else np.concatenate(chunks) if chunks else np.empty(0)

    def select(self, mask: NDArray[np.bool_]) -> "Loaded":
        """Return the records of a mask."""
        kept = np.flatnonzero(mask)
        columns = [[self.column(k)[kept]] for k in range(len(self.columns))]
        before = kept if self.kept is None else self.kept[kept]
        return replace(self, rows=len(kept), columns=columns, kept=before)


def load(
    header: Header, wanted: Wanted, *, min_rows: int = 2, progress: Progress | None = None
) -> Loaded:
    """Read columns, every number finite, at least `min_rows` rows.

    progress: gets the share (0 to 1) of a text log that is read. Raises LogError that names the
    row and column of the first error.
    """
    with as_log_error(header.path):
        loaded = _load(header, wanted, progress)
        finite = _is_finite(loaded, wanted)
        if not finite and not wanted.sparse and _has_empty_records(loaded, wanted):
            loaded = _load(header, replace(wanted, sparse=True), progress)
        header.check_unchanged()
    if loaded.rows < min_rows:
        found = "no data rows" if loaded.rows == 0 else f"only {loaded.rows} data row"
        place = " below the header" if header.is_text and header.header_line else ""
        raise LogError(header.path, f"{found}{place}; at least {min_rows} are needed")
    if not finite:
        _check_finite(loaded, wanted)
    return loaded


def _load(header: Header, wanted: Wanted, progress: Progress | None) -> Loaded:
    from rotcli.logs.container import bag_file, csv_file, parquet_file

    if header.kind == "bag":
        return bag_file.load(header, wanted)
    if header.kind == "parquet":
        return parquet_file.load(header, wanted)
    return csv_file.load(header, wanted, progress)


def _has_empty_records(loaded: Loaded, wanted: Wanted) -> bool:
    """Return whether some records, not all, are NaN in all channels: blanks of another log."""
    places = [wanted.columns.index(i) for i in wanted.values]
    if not places or loaded.header.kind == "bag":
        return False
    empty = np.logical_and.reduce([np.isnan(loaded.column(k)) for k in places])
    return bool(empty.any() and not empty.all())


def load_chunks(
    header: Header, wanted: Wanted, rows: int, first: int = 0
) -> Iterator[tuple[Loaded, float]]:
    """Yield the columns about `rows` records at a time, and the share of the file read so far.

    For logs too long for the memory. The first chunk contains record `first` or comes before it:
    a Parquet file is entered at its row group. Raises LogError as `load` does.
    """
    from rotcli.logs.container import csv_file, parquet_file

    chunks = parquet_file.load_chunks if header.kind == "parquet" else csv_file.load_chunks
    last: tuple[Loaded, float] | None = None
    with as_log_error(header.path):
        for loaded, share in chunks(header, wanted, rows, first):
            _check_finite(loaded, wanted)
            if last is None:
                last = loaded, share
            elif loaded.rows < rows * _MIN_CHUNK_SHARE:  # the end of a row group
                last = _concatenate(last[0], loaded), share
            else:
                yield last
                last = loaded, share
    if last is None or not last[0].rows:
        raise LogError(header.path, "no data rows; at least 2 are needed")
    yield last


def _is_decimal_part(factor: float) -> bool:
    """Return whether a factor is 1 / n for an integer n: ms, us or ns."""
    return 0.0 < factor < 1.0 and abs(round(1.0 / factor) * factor - 1.0) < 1e-12


def _concatenate(before: Loaded, after: Loaded) -> Loaded:
    columns = [[*a, *b] for a, b in zip(before.columns, after.columns, strict=True)]
    return replace(before, rows=before.rows + after.rows, columns=columns)


def _is_finite(loaded: Loaded, wanted: Wanted) -> bool:
    """Return whether every number is finite."""
    with np.errstate(all="ignore"):
        return all(np.isfinite(c.sum()) for chunks, _ in _numeric(loaded, wanted) for c in chunks)


def _numeric(loaded: Loaded, wanted: Wanted) -> list[tuple[Chunks, int]]:
    """Return the chunks and the column of each column of numbers."""
    return [
        (chunks, i)
        for chunks, i in zip(loaded.columns, wanted.columns, strict=True)
        if wanted.texts.get(i) != "name"
    ]


def _check_finite(loaded: Loaded, wanted: Wanted) -> None:
    """Raise LogError for the first number that is not finite."""
    if _is_finite(loaded, wanted):
        return
    found = []
    for chunks, i in _numeric(loaded, wanted):
        values = np.concatenate(chunks)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            found.append((int(bad[0]), i, str(values[bad[0]])))
    if found:
        index, i, value = min(found)
        finding = f"{value} is not a finite number; correct or remove the row"
        raise LogError(
            loaded.header.path, finding, row=loaded.row(index), column=loaded.header.names[i]
        )


def to_chunks(column: Any) -> Chunks:
    """Return the numbers of a column without nulls, as they are in memory.

    Arrow's own `to_numpy` imports pandas, which takes longer than reading the log.
    """
    if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
        column = pa.chunked_array([c.view(pa.int64()) for c in column.chunks], pa.int64())
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
