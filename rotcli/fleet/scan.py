"""Scan result files into the table of a fleet, and keep it as a Parquet data set.

Files are read in chunks, so that the same function serves this process and a Dask cluster. The
data set has one folder per parameter; only results of new SHA-256 are appended.
"""

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field
from pathlib import Path
from urllib.parse import quote

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.atomic import atomic_write
from rotcli.files.results.documents import parse_json, write_error
from rotcli.files.text import check_regular
from rotcli.fleet.records import (
    COLUMNS,
    FILE_COLUMNS,
    NUMBER_COLUMNS,
    VALUE_COLUMNS,
    FileRow,
    Folders,
    ValueRow,
    rows_of,
)
from rotcli.lazy import lazily

with lazily():
    import pandas as pd
    import pyarrow as pa
    import pyarrow.dataset as ds
    import pyarrow.parquet as pq


CHUNK_FILES = 500  # results per task: 50 ms of work, far above the cost of a task
MAX_RESULT_BYTES = 64 << 20


@dataclass
class Chunk:
    """Rows of some files, the number of values of each, and a line per file that cannot be used."""

    files: list[FileRow] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    values: list[ValueRow] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    skipped: int = 0


def read_chunk(paths: Sequence[str], folders: Folders, known: frozenset[str]) -> Chunk:
    """Read some result files; a file that is not valid becomes one line of `faults`.

    known: hashes of results that are in the data set already.
    """
    chunk = Chunk()
    for path in paths:
        try:
            check_regular(path)
            with open(path, "rb") as stream:  # noqa: PTH123 (a path object costs as much again)
                # No buffer for the largest file: it costs more than reading a usual one.
                size = os.fstat(stream.fileno()).st_size
                data = stream.read(min(size, MAX_RESULT_BYTES) + 1)
            if len(data) > MAX_RESULT_BYTES:
                chunk.faults.append(f"{path}: larger than {MAX_RESULT_BYTES >> 20} MB; remove it")
                continue
            sha256 = hashlib.sha256(data).hexdigest()
            if sha256 in known:
                chunk.skipped += 1
                continue
            doc = parse_json(data)
            if not isinstance(doc, dict) or "kind" not in doc:
                chunk.skipped += 1  # another program's JSON
                continue
            rows = rows_of(doc, path, sha256, folders)
            if rows is None:
                chunk.skipped += 1
                continue
            chunk.files.append(rows[0])
            chunk.counts.append(len(rows[1]))
            chunk.values += rows[1]
        except ResultError as fault:
            chunk.faults.append(str(fault))
        except OSError as fault:
            chunk.faults.append(f"{path}: cannot be read: {fault.strerror or fault}")
        except (ValueError, RecursionError) as fault:
            chunk.faults.append(f"{path}: not a result file: {str(fault)[:80]}; create it again")
    return chunk


Mapper = Callable[[Callable[[Sequence[str]], Chunk], Iterable[Sequence[str]]], Iterable[Chunk]]


def read_results(
    paths: Sequence[str],
    folders: Folders,
    known: frozenset[str] = frozenset(),
    mapper: Mapper = map,
) -> Chunk:
    """Read all files in chunks by `mapper` (the built-in map, or that of a cluster)."""
    total = Chunk()
    for chunk in mapper(ReadTask(folders, known), _chunks(paths)):
        total.files += chunk.files
        total.counts += chunk.counts
        total.values += chunk.values
        total.faults += chunk.faults
        total.skipped += chunk.skipped
    return total


@dataclass(frozen=True)
class ReadTask:
    """`read_chunk` with its settings, a function of paths that can be sent to a worker."""

    folders: Folders
    known: frozenset[str]

    def __call__(self, paths: Sequence[str]) -> Chunk:
        """Read the files."""
        return read_chunk(paths, self.folders, self.known)


def _chunks(paths: Sequence[str]) -> Iterator[Sequence[str]]:
    for start in range(0, len(paths), CHUNK_FILES):
        yield paths[start : start + CHUNK_FILES]


def to_frame(chunk: Chunk) -> "tuple[pd.DataFrame, int]":
    """Return the rows as a table without copies of one result, and the number of copies.

    Two files are copies when their bytes are the same; the first path remains.
    """
    files = _columns(FILE_COLUMNS, chunk.files)
    first = ~files["sha256"].duplicated().to_numpy()
    index = np.repeat(np.arange(len(files)), chunk.counts)
    frame = _columns(VALUE_COLUMNS, chunk.values)
    wide = pd.concat([files.iloc[index].reset_index(drop=True), frame], axis=1)
    return wide[first[index]].reset_index(drop=True)[list(COLUMNS)], int((~first).sum())


def _columns(names: Sequence[str], rows: Sequence[tuple[object, ...]]) -> "pd.DataFrame":
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(names)
    frame = pd.DataFrame(dict(zip(names, columns, strict=True)))
    numbers = [name for name in names if name in NUMBER_COLUMNS]
    return frame.astype(dict.fromkeys(numbers, float))


def is_dataset(path: str) -> bool:
    """Return whether a folder is a data set of this module."""
    folder = Path(path)
    return folder.is_dir() and any(folder.glob("parameter=*"))


def read_dataset(path: str) -> "pd.DataFrame":
    """Return the table of a data set; raises ResultError for a folder of another kind."""
    try:
        data = ds.dataset(path, format="parquet", partitioning="hive")
        missing = [name for name in COLUMNS if name not in data.schema.names]
        if missing:
            raise ResultError(f"{path}: not a fleet data set: no column {missing[0]}")
        frame: pd.DataFrame = data.to_table(columns=list(COLUMNS)).to_pandas()
    except (OSError, pa.ArrowException) as fault:
        raise ResultError(f"{path}: not a fleet data set: {str(fault)[:80]}") from fault
    frame["parameter"] = frame["parameter"].astype(str)
    return frame.sort_values(["parameter", "path", "sha256"], ignore_index=True)


def append_dataset(path: str, frame: "pd.DataFrame") -> int:
    """Append rows to a data set, one file per parameter; return the number of new results.

    The file's name is the hash of its results, so the same results give the same file.
    """
    for name, rows in frame.groupby("parameter", sort=True, observed=True):
        ordered = rows.sort_values(["path", "sha256"])
        digest = hashlib.sha256("".join(ordered["sha256"]).encode()).hexdigest()[:16]
        folder = Path(path) / f"parameter={quote(str(name), safe='')}"
        target = folder / f"{digest}.parquet"
        table = pa.Table.from_pandas(ordered.drop(columns="parameter"), preserve_index=False)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with atomic_write(target) as stream:
                pq.write_table(table.replace_schema_metadata(None), stream)
        except OSError as fault:
            raise write_error(str(target), fault) from fault
    return int(frame["sha256"].nunique())
