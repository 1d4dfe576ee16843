"""The header of a log: CSV (plain, gzip, zstd), text in a dialect, or Parquet, told by content."""

import csv
import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from rotcli.errors import LogError
from rotcli.files.dialect import NUMBER, Dialect, open_text
from rotcli.files.text import check_regular, file_stamp
from rotcli.logs.formats import hint

Progress = Callable[[float], None]

_MAGIC = {b"PAR1": "parquet", b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd"}
_NAME = re.compile(r"^(.*?)\s*\[\s*(.*?)\s*\]$")
_BEYOND_FLOAT = re.compile(
    r"[+-]?[0-9]{16,19}"
)  # integers a float64 may round: nanoseconds of Unix
_HEADER_LIMIT = 1 << 20
# What is read at most: 48 h at 100 Hz are 1 GB of numbers and 1 to 3 GB of text.
MAX_BYTES = 8_000_000_000
_OWN = re.compile(rb"(?:\xef\xbb\xbf)?[\s#]*\"?time\b[^,\n]*,[^\n]*gyro_x\b")
_NO_TEXT = "neither CSV (UTF-8 text with a header line) nor Parquet; is this the right file?"


@dataclass(frozen=True)
class Header:
    """What stands at the head of a log: its kind, column names without unit, units.

    Of a text log that is not plain CSV also its dialect, how many lines come before the records,
    the comments and figures among them, and the cells of the first record.
    """

    path: str
    kind: str  # csv, gzip, zstd (compressed CSV), parquet
    raw: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    integers: frozenset[int] = frozenset()  # columns to be read as 64-bit integers
    dialect: Dialect | None = None
    before: int = 1
    comments: tuple[str, ...] = ()
    figures: tuple[tuple[int, list[float]], ...] = ()
    first: tuple[str, ...] = ()
    max_bytes: int = MAX_BYTES
    stamp: tuple[int, int] | None = None  # the file's when it was opened

    def check_size(self, size: int, what: str) -> None:
        """Raise LogError when `size` bytes are more than may be read."""
        if size > self.max_bytes:
            raise LogError(
                self.path,
                f"{what} more than the {self.max_bytes:.6g} bytes that are read at most; if the "
                "log is sound, raise --max-bytes",
            )

    def check_unchanged(self) -> None:
        """Raise LogError when the file was written to since it was opened."""
        if self.stamp is not None and file_stamp(self.path) != self.stamp:
            what = "changed while it was read; wait until the logger is done, and run again"
            raise LogError(self.path, what)

    def find(self, name: str) -> int | None:
        """Return the index of the column called `name` (with or without its bracket), or None.

        Raises LogError when two columns have that name.
        """
        found = [i for i, n in enumerate(self.names) if n == name]
        found = found or [i for i, n in enumerate(self.raw) if n == name]
        if len(found) > 1:
            raise LogError(self.path, "two columns have this name; rename one", column=name)
        return found[0] if found else None


@contextmanager
def faults(path: str) -> Iterator[None]:
    """Turn what the file system and pyarrow raise into one LogError line."""
    try:
        yield
    except (OSError, pa.ArrowException, UnicodeError, csv.Error) as error:
        text = str(error)
        if isinstance(error, UnicodeEncodeError):
            what = "cannot be read: the path is no UTF-8 text; rename what is not"
        elif "Truncated compressed stream" in text:
            what = "the compressed file is cut off; copy it again, or decompress what there is"
        elif isinstance(error, OSError) and error.errno is not None and error.strerror:
            check = "the file's permissions" if isinstance(error, PermissionError) else "the path"
            what = f"cannot be read: {error.strerror}; check {check}"
        else:
            what = f"cannot be read: {' '.join(text.split())[:160]}; the file may be damaged"
        raise LogError(path, what) from error


class _Watched(io.RawIOBase):
    """A file that tells how much of it (0 to 1) has been read."""

    def __init__(self, raw: Any, progress: Progress) -> None:
        self._raw, self._size, self._progress = raw, max(raw.size(), 1), progress

    def readable(self) -> bool:
        """Tell that it can be read."""
        return True

    def read(self, size: int = -1) -> Any:
        """Read on, and tell."""
        part = self._raw.read(None if size < 0 else size)
        self._progress(self._raw.tell() / self._size)
        return part


class Limited(io.RawIOBase):
    """A decompressed stream that ends where more than a log may hold has been read."""

    def __init__(self, stream: Any, header: Header) -> None:
        self._stream, self._header, self._read = stream, header, 0

    def readable(self) -> bool:
        """Tell that it can be read."""
        return True

    def check(self) -> None:
        """Raise LogError when more was read than may be."""
        self._header.check_size(self._read, "decompressed it holds")

    def read(self, size: int = -1) -> Any:
        """Read on; raises LogError past the limit."""
        self.check()
        most = self._header.max_bytes - self._read + 1
        part = self._stream.read(most if size < 0 else min(size, most))
        self._read += len(part)
        self.check()
        return part


@contextmanager
def stream_of(header: Header, progress: Progress | None = None) -> Iterator[Any]:
    """Open the text of a log, decompressed; `progress` is told how much of the file is read."""
    with pa.OSFile(header.path, "rb") as raw:
        watched = raw if progress is None else pa.PythonFile(_Watched(raw, progress), mode="r")
        if header.kind == "csv":
            header.check_size(raw.size(), "the file holds")
            yield watched
        else:
            with pa.CompressedInputStream(watched, header.kind) as stream:
                limited = Limited(stream, header)
                yield limited
                limited.check()


def open_log(
    path: str | Path, dialect: Dialect | None = None, max_bytes: int = MAX_BYTES
) -> Header:
    """Read the header of a log; `dialect` says how its text is written if not as plain CSV.

    A log in rotcli's own columns is plain whatever the dialect. max_bytes: of text, decompressed,
    or of numbers in a Parquet file, that may be read. Raises LogError when the file
    cannot be read, is empty or is not a log.
    """
    name = str(path)
    with faults(name):
        check_regular(path)
        stamp = file_stamp(path)
        with Path(path).open("rb") as stream:
            start = stream.read(4)
        kind = next((k for magic, k in _MAGIC.items() if start.startswith(magic)), "csv")
        if kind == "parquet":
            return replace(_parquet_header(name), max_bytes=max_bytes, stamp=stamp)
        with stream_of(Header(name, kind, (), (), (), max_bytes=max_bytes)) as stream:
            head = stream.read(1 << 16)
            while len(head) < _HEADER_LIMIT and head.count(b"\n") < 2:
                more = stream.read(1 << 16)
                if not more:
                    break
                head += more
    with faults(name):
        if dialect is not None and not _OWN.match(head):
            header = _text_header(name, kind, head, dialect)
        else:
            header = _csv_header(name, kind, head)
    return replace(header, max_bytes=max_bytes, stamp=stamp)


def _text_header(path: str, kind: str, head: bytes, dialect: Dialect) -> Header:
    """Return the header of a log in a dialect."""
    text = _text(path, head)
    whole = text if len(head) < 1 << 16 else text[: text.rfind("\n") + 1] or text
    opened = open_text(path, whole, dialect)
    raw = opened.names or [str(k + 1) for k in range(len(opened.first))]
    integers = {i for i, cell in enumerate(opened.first) if _BEYOND_FLOAT.fullmatch(cell)}
    return Header(
        path,
        kind,
        tuple(raw),
        *_names(raw),
        integers=frozenset(integers),
        dialect=opened.dialect,
        before=opened.before,
        comments=tuple(opened.comments),
        figures=tuple(opened.figures),
        first=tuple(opened.first),
    )


def _text(path: str, head: bytes) -> str:
    """Return the head of a text log as text; raises LogError where it is none."""
    if not head.strip(b"\xef\xbb\xbf \t\r\n"):
        raise LogError(path, "the file is empty; a header line and rows of numbers are expected")
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise LogError(path, "UTF-16 text; save it as UTF-8")
    if b"\0" in head:
        raise LogError(path, _NO_TEXT)
    if len(re.split(rb"[\r\n]", head, maxsplit=1)[0]) >= _HEADER_LIMIT:
        what = "the first line has more than a million letters; it should name some ten columns"
        raise LogError(path, what, row=1)
    # Half a letter may stand at the end; vendors' comments may be in an older encoding.
    return head.decode("utf-8-sig", "replace")


def _names(raw: list[str]) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    found = [_NAME.match(name) for name in raw]
    names = tuple(m[1] if m else name for m, name in zip(found, raw, strict=True))
    return names, tuple(m[2] or None if m else None for m in found)


def _csv_header(path: str, kind: str, head: bytes) -> Header:
    text = _text(path, head)
    line, second, *_ = [*re.split(rb"\r\n|\r|\n", head, maxsplit=2), b""]
    try:
        text = line.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise LogError(path, _NO_TEXT) from error
    advice = hint(head[:4096].decode("utf-8-sig", "replace"))
    if advice:
        raise LogError(path, f"no header line of plain CSV; {advice}")
    text = text.strip().removeprefix("#").strip()
    raw = [n.strip() for n in next(csv.reader([text], skipinitialspace=True), [""])]
    if all(NUMBER.fullmatch(n) for n in raw):
        what = "numbers where the column names belong; put a header line on top: time [s],… or "
        what += "count them in the rig: [imu] columns = { time = 1, gyro_x = 2, … }"
        raise LogError(path, what, row=1)
    if len(raw) == 1:
        found = [w for c, w in ((";", "semicolons"), ("\t", "tabs")) if c in text]
        found += ["spaces"] if len(text.split()) > 3 else []
        if found:
            what = (
                f"columns separated by {found[0]}; comma expected: save the file with commas, or "
            )
            what += "name the sign in the rig: [imu] delimiter"
            raise LogError(path, what, row=1)
    first = next(csv.reader([second.decode("latin-1").strip()]), [])
    integers = {i for i, cell in enumerate(first) if _BEYOND_FLOAT.fullmatch(cell.strip())}
    return Header(path, kind, tuple(raw), *_names(raw), frozenset(integers))


def _parquet_header(path: str) -> Header:
    import pyarrow.parquet as pq

    schema = pq.read_schema(path, memory_map=False)
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
