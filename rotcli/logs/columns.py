"""Columns of numbers out of CSV (plain, gzip, zstd) or Parquet, told apart by content.

`open_log` reads the header, `load` the wanted columns in one multithreaded pass. Only when that
pass fails or a number is not finite is the text read again, line by line, to name the row and
column. A row is the line of a CSV file (the header is row 1), or a Parquet record from 1.
"""

import csv
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotcli.errors import LogError

Array = NDArray[np.float64]
Chunks = list[NDArray[Any]]

_MAGIC = {b"PAR1": "parquet", b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd"}
_NAME = re.compile(r"^(.*?)\s*\[\s*(.*?)\s*\]$")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_BEYOND_FLOAT = re.compile(r"[+-]?\d{16,19}")  # integers a float64 may round: nanoseconds of Unix
_HEADER_LIMIT = 1 << 20


@dataclass(frozen=True)
class Header:
    """What stands at the head of a log: its kind, column names without unit, units."""

    path: str
    kind: str  # csv, gzip, zstd (compressed CSV), parquet
    raw: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    integers: frozenset[int] = frozenset()  # columns to be read as 64-bit integers

    def find(self, name: str) -> int | None:
        """Return the index of the column called `name` (with or without its bracket), or None.

        Raises LogError when two columns have that name.
        """
        found = [i for i, n in enumerate(self.names) if n == name]
        found = found or [i for i, n in enumerate(self.raw) if n == name]
        if len(found) > 1:
            raise LogError(self.path, "two columns have this name; rename one", column=name)
        return found[0] if found else None


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
        with _faults(self.header.path), _stream(self.header) as stream:
            return next(islice(_records(stream), index + 1, None))[0]

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


@contextmanager
def _faults(path: str) -> Iterator[None]:
    """Turn what the file system and pyarrow raise into one LogError line."""
    try:
        yield
    except (OSError, pa.ArrowException, UnicodeError, csv.Error) as error:
        text = str(error)
        if "Truncated compressed stream" in text:
            what = "the compressed file is cut off; copy it again, or decompress what there is"
        elif isinstance(error, OSError) and error.errno is not None and error.strerror:
            what = f"cannot be read: {error.strerror}; check the path and its permissions"
        else:
            what = f"cannot be read: {' '.join(text.split())[:160]}; the file may be damaged"
        raise LogError(path, what) from error


@contextmanager
def _stream(header: Header) -> Iterator[Any]:
    with pa.OSFile(header.path, "rb") as raw:
        if header.kind == "csv":
            yield raw
        else:
            with pa.CompressedInputStream(raw, header.kind) as stream:
                yield stream


def open_log(path: str | Path) -> Header:
    """Read the header of a log.

    Raises LogError when the file cannot be read, is empty or is not a log.
    """
    name = str(path)
    with _faults(name):
        with Path(path).open("rb") as stream:
            start = stream.read(4)
        kind = next((k for magic, k in _MAGIC.items() if start.startswith(magic)), "csv")
        if kind == "parquet":
            return _parquet_header(name)
        with _stream(Header(name, kind, (), (), ())) as stream:
            head = stream.read(1 << 16)
            while len(head) < _HEADER_LIMIT and head.count(b"\n") < 2:
                more = stream.read(1 << 16)
                if not more:
                    break
                head += more
    return _csv_header(name, kind, head)


def _names(raw: list[str]) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    found = [_NAME.match(name) for name in raw]
    names = tuple(m[1] if m else name for m, name in zip(found, raw, strict=True))
    return names, tuple(m[2] or None if m else None for m in found)


def _csv_header(path: str, kind: str, head: bytes) -> Header:
    if not head.strip(b"\xef\xbb\xbf \t\r\n"):
        raise LogError(path, "the file is empty; a header line and rows of numbers are expected")
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise LogError(path, "UTF-16 text; save it as UTF-8")
    line, second, *_ = [*re.split(rb"\r\n|\r|\n", head, maxsplit=2), b""]
    try:
        text = line.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = "\0" if error else ""
    if "\0" in text or b"\0" in head or len(line) >= _HEADER_LIMIT:
        what = "neither CSV (UTF-8 text with a header line) nor Parquet; is this the right file?"
        raise LogError(path, what)
    text = text.strip().removeprefix("#").strip()
    raw = [n.strip() for n in next(csv.reader([text], skipinitialspace=True), [""])]
    if all(_NUMBER.fullmatch(n) for n in raw):
        what = "numbers where the column names belong; put a header line on top: time [s],…"
        raise LogError(path, what, row=1)
    if len(raw) == 1:
        found = [w for c, w in ((";", "semicolons"), ("\t", "tabs")) if c in text]
        found += ["spaces"] if len(text.split()) > 3 else []
        if found:
            what = f"columns separated by {found[0]}; comma expected: save the file with commas"
            raise LogError(path, what, row=1)
    first = next(csv.reader([second.decode("latin-1").strip()]), [])
    integers = {i for i, cell in enumerate(first) if _BEYOND_FLOAT.fullmatch(cell.strip())}
    return Header(path, kind, tuple(raw), *_names(raw), frozenset(integers))


def _parquet_header(path: str) -> Header:
    import pyarrow.parquet as pq

    schema = pq.read_schema(path, memory_map=True)
    names, units = _names(schema.names)
    metadata = [(schema.field(i).metadata or {}).get(b"unit") for i in range(len(names))]
    units = tuple(
        unit or (meta.decode("utf-8", "replace").strip() if meta else None)
        for unit, meta in zip(units, metadata, strict=True)
    )
    stamps = {}
    for i in range(len(names)):
        kind = schema.field(i).type
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            stamps[i] = kind.unit
    units = tuple(stamps.get(i, unit) for i, unit in enumerate(units))
    return Header(path, "parquet", tuple(schema.names), names, units)


def load(header: Header, wanted: list[int], *, least: int = 2) -> Loaded:
    """Read the columns with the given indices, every number finite, at least `least` rows.

    Raises LogError that names the row and column of the first fault.
    """
    with _faults(header.path):
        loaded = (_load_parquet if header.kind == "parquet" else _load_csv)(header, wanted)
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
    with _faults(header.path):
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
    read, options = _csv_options(header, wanted, header.integers)
    read.block_size = max(1 << 16, 20 * rows * len(header.raw))
    done = 0
    with pa.OSFile(header.path, "rb") as raw:
        plain = header.kind == "csv"
        stream = raw if plain else pa.CompressedInputStream(raw, header.kind)
        try:
            with pc.open_csv(stream, read_options=read, convert_options=options) as reader:
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

    with _faults(header.path):
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


def _csv_options(header: Header, wanted: list[int], integers: frozenset[int]) -> tuple[Any, Any]:
    """Return how pyarrow is to read and convert the wanted columns."""
    import pyarrow.csv as pc

    keys = [str(i) for i in range(len(header.raw))]
    types = {str(i): pa.int64() if i in integers else pa.float64() for i in wanted}
    return pc.ReadOptions(column_names=keys, skip_rows=1), pc.ConvertOptions(
        column_types=types, include_columns=list(types), null_values=[], check_utf8=False
    )


def _load_csv(header: Header, wanted: list[int]) -> Loaded:
    import pyarrow.csv as pc

    integers = header.integers
    while True:
        read, convert = _csv_options(header, wanted, integers)
        try:
            with _stream(header) as stream:
                table = pc.read_csv(stream, read_options=read, convert_options=convert)
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


def _records(stream: Any) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number, cells) of every line that is not empty, the header first."""
    text = io.TextIOWrapper(stream, encoding="utf-8-sig", errors="replace", newline="")
    reader = csv.reader(line.replace("\0", "�") for line in text)
    for cells in reader:
        if cells:
            yield reader.line_num, cells


def _locate(header: Header, wanted: list[int]) -> None:
    """Raise LogError for the first cell or row of a CSV file that is at fault."""
    with _stream(header) as stream:
        records = _records(stream)
        next(records)
        for row, cells in records:
            if len(cells) != len(header.raw):
                how = "is cut off or " if len(cells) < len(header.raw) else ""
                what = (
                    f"{len(cells)} values where the header has {len(header.raw)} columns; "
                    f"the row {how}has a stray comma: correct or remove it"
                )
                raise LogError(header.path, what, row=row)
            for i in wanted:
                cell = cells[i].strip()
                if not _NUMBER.fullmatch(cell):
                    what = f"{cell[:40]!r} is not a number" if cell else "an empty cell"
                    what += "; correct it or remove the row (a short gap is bridged)"
                    raise LogError(header.path, what, row=row, column=header.names[i])


def _check_kinds(header: Header, wanted: list[int], schema: Any) -> None:
    """Raise LogError for a column that holds no numbers."""
    for i in wanted:
        kind = schema.field(i).type
        numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind)
        if not (numeric or pa.types.is_timestamp(kind) or pa.types.is_duration(kind)):
            what = f"holds {kind} where numbers belong; write the column as float64"
            raise LogError(header.path, what, column=header.names[i])


def _load_parquet(header: Header, wanted: list[int]) -> Loaded:
    import pyarrow.parquet as pq

    with pq.ParquetFile(header.path, memory_map=True) as file:
        _check_kinds(header, wanted, file.schema_arrow)
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
