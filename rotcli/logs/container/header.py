"""The header of a log: kind of file, format, names and units of the columns, first records.

It is read once, by `rotcli.logs.container.opening.open_log`. Everything later works on this Header.
"""

import csv
import io
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import field, replace
from typing import Any

import pyarrow as pa

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.dialect import Dialect
from rotcli.files.formats import Head, LogFormat
from rotcli.files.text import file_fingerprint
from rotcli.units import unit_name

Progress = Callable[[float], None]

_BRACKET = re.compile(r"^(.*?)\s*(?:\[\s*(.*?)\s*\]|\(\s*(.*?)\s*\))\s*$")
# Bytes that are read at most: 48 h at 100 Hz are 1 GB of numbers and 1 to 3 GB of text.
MAX_BYTES = 8_000_000_000
_NO_UNIT = ("", "-", "1", "none", "n/a")  # texts in a line of units


@dataclass(frozen=True)
class Header:
    """The head of a log: its kind, column names without unit, units, first records.

    kind: csv, gzip, zstd (compressed text), parquet or bag. raw: names as written; names: without
    a bracket that is a unit; bases: without any bracket. units: of bracket, metadata or unit
    line. brackets: text in a bracket that is no unit. records: cells of the first records of a
    text. dialect: None for a text that a CSV reader takes as it is. before: lines above the
    records. types: of Parquet columns.
    """

    path: str
    kind: str
    raw: tuple[str, ...]
    names: tuple[str, ...] = ()
    bases: tuple[str, ...] = ()
    units: tuple[str | None, ...] = ()
    brackets: tuple[str | None, ...] = ()
    unit_conflicts: tuple[str, ...] = ()
    integers: frozenset[int] = frozenset()  # columns that are read as 64-bit integers
    dialect: Dialect | None = None
    plain: Dialect = field(default_factory=Dialect)
    before: int = 1
    comments: tuple[str, ...] = ()
    values: tuple[tuple[int, list[float]], ...] = ()
    records: tuple[tuple[str, ...], ...] = ()
    header_line: int = 1
    types: tuple[Any, ...] = ()
    form: LogFormat | None = None
    topic: str | None = None
    arrays: tuple[Any, ...] | None = None  # columns of a bag, read with its header
    max_bytes: int = MAX_BYTES
    stamp: tuple[int, int] | None = None  # fingerprint of the file when it was opened

    @property
    def is_text(self) -> bool:
        """Whether the log is a text."""
        return self.kind in ("csv", "gzip", "zstd")

    @property
    def head(self) -> Head:
        """The head as formats see it."""
        return Head(self.path, self.raw, self.comments, self.values, self.records)

    def check_size(self, size: int, subject: str) -> None:
        """Raise LogError when `size` bytes are more than may be read."""
        if size > self.max_bytes:
            raise LogError(
                self.path,
                f"{subject} {size} bytes or more, the limit is {self.max_bytes:.6g}; if the file "
                "is correct, raise the limit",
                code="log-size",
            )

    def check_unchanged(self) -> None:
        """Raise LogError when the file was written to since it was opened."""
        if self.stamp is not None and file_fingerprint(self.path) != self.stamp:
            finding = "the file changed during reading; wait until the recording has ended"
            raise LogError(self.path, finding)

    def find(self, name: str) -> int | None:
        """Return the index of the column called `name` (with or without its bracket), or None.

        Raises LogError when two columns have that name.
        """
        for known in (self.names, self.raw, self.bases):
            found = [i for i, n in enumerate(known) if n == name]
            if len(found) > 1 and known is not self.bases:
                raise LogError(self.path, "two columns have this name; rename one", column=name)
            if len(found) == 1:
                return found[0]
        return None


def _unreadable_name(path: str) -> str:
    """Return why the name of a file cannot be passed on: the system encoding, or the name."""
    try:
        os.fsencode(path).decode("utf-8")
    except UnicodeError:
        return "cannot be read: the path is not UTF-8 text; rename the file or folder"
    where = f"the system encoding ({sys.getfilesystemencoding()}) is not UTF-8"
    return f"cannot be read: {where}; set LC_ALL=C.UTF-8 or PYTHONUTF8=1"


@contextmanager
def as_log_error(path: str) -> Iterator[None]:
    """Turn the errors of the file system and pyarrow into one LogError line."""
    try:
        yield
    except (OSError, pa.ArrowException, UnicodeError, csv.Error) as error:
        text = str(error)
        if isinstance(error, UnicodeEncodeError):
            finding = _unreadable_name(path)
        elif isinstance(error, csv.Error):
            finding = "a quotation mark is not closed; remove it"
        elif "Truncated compressed stream" in text:
            finding = "the compressed file is truncated; copy it again, or decompress the rest"
        elif isinstance(error, OSError) and error.errno is not None and error.strerror:
            check = "the file's permissions" if isinstance(error, PermissionError) else "the path"
            finding = f"cannot be read: {error.strerror}; check {check}"
        else:
            finding = f"cannot be read: {' '.join(text.split())[:160]}; the file may be damaged"
        raise LogError(path, finding) from error


class _Watched(io.RawIOBase):
    """A file that reports the share (0 to 1) that has been read."""

    def __init__(self, raw: Any, progress: Progress) -> None:
        self._raw, self._size, self._progress = raw, max(raw.size(), 1), progress

    def readable(self) -> bool:
        """Return True: it can be read."""
        return True

    def read(self, size: int = -1) -> Any:
        """Read on, and report."""
        chunk = self._raw.read(None if size < 0 else size)
        self._progress(self._raw.tell() / self._size)
        return chunk


class Limited(io.RawIOBase):
    """A decompressed stream that ends where the size limit of a log is reached."""

    def __init__(self, stream: Any, header: Header) -> None:
        self._stream, self._header, self._read = stream, header, 0

    def readable(self) -> bool:
        """Return True: it can be read."""
        return True

    def check(self) -> None:
        """Raise LogError when more was read than the limit."""
        self._header.check_size(self._read, "the decompressed log has")

    def read(self, size: int = -1) -> Any:
        """Read on; raises LogError past the limit."""
        self.check()
        most = self._header.max_bytes - self._read + 1
        chunk = self._stream.read(most if size < 0 else min(size, most))
        self._read += len(chunk)
        self.check()
        return chunk


@contextmanager
def stream_of(header: Header, progress: Progress | None = None) -> Iterator[Any]:
    """Open the text of a log, decompressed; `progress` gets the share of the file that is read."""
    with pa.OSFile(header.path, "rb") as raw:
        watched = raw if progress is None else pa.PythonFile(_Watched(raw, progress), mode="r")
        if header.kind == "csv":
            header.check_size(raw.size(), "the file has")
            yield watched
        else:
            with pa.CompressedInputStream(watched, header.kind) as stream:
                limited = Limited(stream, header)
                yield limited
                limited.check()


def with_names(header: Header, units: tuple[str, ...] = ()) -> Header:
    """Return a header with the names, units and other brackets of its raw column names.

    units: of a line or of metadata, used where the name has none.
    """
    names, bases, own, brackets, conflicts = [], [], [], [], []
    for k, raw in enumerate(header.raw):
        match = _BRACKET.match(raw)
        inside = None if match is None else match[2] or match[3] or ""
        unit = unit_name(inside) if inside else None
        base = raw if match is None else match[1]
        other = units[k] if k < len(units) and units[k].lower() not in _NO_UNIT else None
        if unit and other and unit_name(other) not in (None, unit):
            conflicts.append(f"{base}: the name says {unit}, its metadata {other}")
        names.append(base if unit or inside == "" else raw)
        bases.append(base)
        own.append(unit or (other and (unit_name(other) or other)))
        brackets.append(None if unit else inside or None)
    return replace(
        header,
        names=tuple(names),
        bases=tuple(bases),
        units=tuple(own),
        brackets=tuple(brackets),
        unit_conflicts=tuple(conflicts),
    )
