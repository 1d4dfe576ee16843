"""The header of a log: CSV (plain, gzip, zstd), other text, Parquet or a ROS bag, by content.

It is read once: `open_log` finds the kind of file, its format, how its text is written, the names
and units of its columns and the first records. Everything later works on this Header.
"""

import csv
import io
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from rotcli.errors import LogError
from rotcli.files.dialect import Dialect
from rotcli.files.formats import FORMATS, Head, LogFormat, find_format
from rotcli.files.text import check_regular, file_fingerprint
from rotcli.logs.container.encoding import decode, find_encoding
from rotcli.logs.container.text_head import Given, read_head, reject_result
from rotcli.rig.rig import LogSettings
from rotcli.units import unit_name

Progress = Callable[[float], None]

_MAGIC = {b"PAR1": "parquet", b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd"}
_BRACKET = re.compile(r"^(.*?)\s*(?:\[\s*(.*?)\s*\]|\(\s*(.*?)\s*\))\s*$")
# Integers that a float64 may round: nanoseconds of Unix time.
_BEYOND_FLOAT = re.compile(r"[+-]?[0-9]{16,19}")
_HEAD_BYTES = 1 << 16
_HEADER_LIMIT = 1 << 20
# Bytes that are read at most: 48 h at 100 Hz are 1 GB of numbers and 1 to 3 GB of text.
MAX_BYTES = 8_000_000_000
_NO_UNIT = ("", "-", "1", "none", "n/a")  # texts in a line of units
# A first line that names rotcli's columns needs no search for the format.
_PLAIN_NAMES = re.compile(r"\s*#?\s*\"?time\b[^,\n]*,.*\b(gyro_x|angle)\b")


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
                "is correct, raise --max-bytes",
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


def open_log(
    path: str | Path, settings: LogSettings | None = None, max_bytes: int = MAX_BYTES
) -> Header:
    """Read the header of a log; `settings` may name its format and how its text is written.

    max_bytes: of text, decompressed, or of numbers in a Parquet file, that may be read. Raises
    LogError when the file cannot be read, is empty or is not a log.
    """
    settings = settings or LogSettings()
    name = str(path)
    if Path(name).is_dir() and (Path(name) / "metadata.yaml").is_file():
        return _bag_header(name, settings, max_bytes)
    with as_log_error(name):
        check_regular(path)
        stamp = file_fingerprint(path)
        with Path(path).open("rb") as stream:
            start = stream.read(13)
        kind = next((k for magic, k in _MAGIC.items() if start.startswith(magic)), "csv")
        if start.startswith((b"#ROSBAG V", b"SQLite format", b"\x89MCAP0")):
            return replace(_bag_header(name, settings, max_bytes), stamp=stamp)
        if kind == "parquet":
            return replace(_parquet_header(name), max_bytes=max_bytes, stamp=stamp)
        with stream_of(Header(name, kind, (), max_bytes=max_bytes)) as stream:
            head = _read_on(stream, b"", _HEAD_BYTES, lines=2)
            reject_result(name, head)
            try:
                header = _text_header(name, kind, head, settings)
            except LogError:  # the records may begin below a long preamble
                longer = _read_on(stream, head, _HEADER_LIMIT, lines=0)
                if len(longer) == len(head):
                    raise
                header = _text_header(name, kind, longer, settings)
    return replace(header, max_bytes=max_bytes, stamp=stamp)


def _read_on(stream: Any, head: bytes, size: int, lines: int) -> bytes:
    """Return the head of a text of a size at least, and of some lines, as far as there are any."""
    while len(head) < size or (head.count(b"\n") < lines and len(head) < _HEADER_LIMIT):
        more = stream.read(_HEAD_BYTES)
        if not more:
            break
        head += more
    return head


def _text_header(path: str, kind: str, head: bytes, settings: LogSettings) -> Header:
    """Return the header of a text log."""
    encoding = settings.encoding or find_encoding(head)
    text = decode(path, head, encoding)
    complete = text if len(head) < _HEAD_BYTES else text[: text.rfind("\n") + 1] or text
    plain_names = _PLAIN_NAMES.match(complete.partition("\n")[0]) is not None
    form = None
    if not plain_names and settings.format:
        form = FORMATS[settings.format]
    elif not plain_names:
        form = find_format(complete[:_HEAD_BYTES])
        cleans = form is not None and type(form).clean is not LogFormat.clean
        if settings.columns and not cleans:  # the rig describes the log itself
            form = None
    rig = form.rig if form else {}
    given = Given(
        settings.delimiter or rig.get("delimiter"),
        settings.decimal or rig.get("decimal"),
        settings.comment or rig.get("comment"),
        rig.get("skip") if settings.skip is None else settings.skip,
        encoding,
    )
    found = read_head(path, complete, given, form)
    if not found.records and len(head) >= _HEADER_LIMIT:
        finding = "cannot be read: a line has more than a million letters"
        raise LogError(path, f"{finding}; is this the right file?")
    first = found.records[0] if found.records else ()
    raw = found.names or tuple(str(k + 1) for k in range(len(first)))
    dialect = found.dialect
    header = with_names(Header(path, kind, raw), found.units)
    return replace(
        header,
        integers=frozenset(i for i, cell in enumerate(first) if _BEYOND_FLOAT.fullmatch(cell)),
        dialect=None if dialect.is_plain else dialect,
        plain=dialect,
        before=found.before,
        comments=found.comments,
        values=found.values,
        records=found.records,
        header_line=found.header_line,
        form=form,
    )


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


def _parquet_header(path: str) -> Header:
    """Return the header of a Parquet log: units from brackets, metadata or time types."""
    import pyarrow.parquet as pq

    schema = pq.read_schema(path, memory_map=False)
    fields = [schema.field(i) for i in range(len(schema.names))]
    units = []
    for column in fields:
        timed = (pa.types.is_timestamp, pa.types.is_duration, pa.types.is_time)
        if any(check(column.type) for check in timed):
            units.append(column.type.unit)
        else:
            units.append(
                (column.metadata or {}).get(b"unit", b"").decode("utf-8", "replace").strip()
            )
    header = with_names(Header(path, "parquet", tuple(schema.names)), tuple(units))
    return replace(header, types=tuple(column.type for column in fields))


def _bag_header(path: str, settings: LogSettings, max_bytes: int) -> Header:
    """Return the header of a ROS bag: one topic's message as columns."""
    from rotcli.logs.container.bag_file import bag_header

    return replace(bag_header(path, settings), max_bytes=max_bytes)
