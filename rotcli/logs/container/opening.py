"""Open a log: find the kind of file, its format, and the names and units of its columns."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from rotcli.errors import LogError
from rotcli.files.formats import FORMATS, LogFormat, find_format
from rotcli.files.text import check_regular, file_fingerprint
from rotcli.lazy import lazily
from rotcli.logs.container.header import MAX_BYTES, Header, as_log_error, stream_of, with_names
from rotcli.rig.rig import LogSettings

with lazily():
    from pyarrow import parquet as pq

    from rotcli.logs.container import bag_file, text_head
    from rotcli.logs.container import encoding as encodings

_MAGIC = {b"PAR1": "parquet", b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd"}
# Integers that a float64 may round: nanoseconds of Unix time.
_BEYOND_FLOAT = re.compile(r"[+-]?[0-9]{16,19}")
_HEAD_BYTES = 1 << 16
_HEADER_LIMIT = 1 << 20
# A first line that names rotcli's columns needs no search for the format.
_PLAIN_NAMES = re.compile(r"\s*#?\s*\"?time\b[^,\n]*,.*\b(gyro_x|angle)\b")


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
            text_head.reject_other_files(name, head)
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
    encoding = settings.encoding or encodings.find_encoding(head)
    text = encodings.decode(path, head, encoding)
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
    given = text_head.Given(
        settings.delimiter or rig.get("delimiter"),
        settings.decimal or rig.get("decimal"),
        settings.comment or rig.get("comment"),
        rig.get("skip") if settings.skip is None else settings.skip,
        encoding,
    )
    found = text_head.read_head(path, complete, given, form)
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


def _parquet_header(path: str) -> Header:
    """Return the header of a Parquet log: units from brackets, metadata or time types."""
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
    return replace(bag_file.bag_header(path, settings), max_bytes=max_bytes)
