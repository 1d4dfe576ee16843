"""Logs that attack (`LOGS`, refused), and odd ones that are sound (`SOUND`, understood)."""

import gzip
import os
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

Array = NDArray[np.float64]


Maker = Callable[[Path], None]


HEADER = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n"


NAMES = HEADER.strip().split(",")


_ROWS = b"0,0,0,0,0,0,0\n" * 70_000
_TIMES = 210  # 206 MB of text in 0.2 MB


def _bomb(path: Path) -> None:
    """Write a stream of gzip whose equal blocks are compressed once, behind each other."""
    squeezer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    head = squeezer.compress(HEADER.encode()) + squeezer.flush(zlib.Z_FULL_FLUSH)
    block = squeezer.compress(_ROWS) + squeezer.flush(zlib.Z_FULL_FLUSH)
    check = zlib.crc32(HEADER.encode())
    for _ in range(_TIMES):
        check = zlib.crc32(_ROWS, check)
    size = len(HEADER) + _TIMES * len(_ROWS)
    start = b"\x1f\x8b\x08" + bytes(7)
    end = squeezer.flush() + struct.pack("<II", check, size)
    path.write_bytes(start + head + _TIMES * block + end)


def _zstd_bomb(path: Path) -> None:
    head, block = (pa.compress(data, "zstd", asbytes=True) for data in (HEADER.encode(), _ROWS))
    path.write_bytes(head + _TIMES * block)


def _rows_bomb(rows: int) -> Maker:
    def make(path: Path) -> None:
        column = pa.array(np.zeros(rows))
        pq.write_table(pa.table(dict.fromkeys(NAMES, column)), path, compression="zstd")

    return make


def _absurd_footer(path: Path) -> None:
    pq.write_table(pa.table({name: [0.0, 1.0] for name in NAMES}), path)
    data = bytearray(path.read_bytes())
    data[-8:-4] = struct.pack("<I", 0x7FFFFFFF)  # a footer of 2 GB in a file of 3 kB
    path.write_bytes(bytes(data))


def _absurd_rows(path: Path) -> None:
    pq.write_table(pa.table({name: [0.0, 1.0] for name in NAMES}), path, compression="none")
    data = path.read_bytes()
    footer = struct.unpack("<I", data[-8:-4])[0]
    start = len(data) - 8 - footer
    head = data[start : start + 400]
    # num_rows of the footer, zigzag varint 2 -> 4, after the schema: all of its places.
    at = head.rfind(b"\x16\x04")
    broken = bytearray(data)
    broken[start + max(at, 0) + 1] = 0x7E
    path.write_bytes(bytes(broken))


def _million_names(path: Path) -> None:
    path.write_text(",".join(f"column_{k}" for k in range(1_000_000)) + "\n1,2\n")


def _million_names_parquet(path: Path) -> None:
    one = pa.array([0.0, 1.0])
    table = pa.table([one] * 20_000, names=[f"column_{k}" for k in range(20_000)])
    pq.write_table(table, path)


def _many_names(path: Path) -> None:
    path.write_text(",".join(f"column_{k}" for k in range(70_000)) + "\n1,2\n")


def _long_line(path: Path) -> None:
    path.write_text(HEADER + "1" * 20_000_000)


def _nul(path: Path) -> None:
    path.write_bytes(HEADER.encode() + b"\0" * 1_000_000)


def _plain() -> dict[str, Array]:
    """Return the columns of a small sound log, integer nanoseconds of time."""
    rng = np.random.default_rng(1)
    values = [rng.normal(size=400) for _ in NAMES[1:]]
    return dict(zip(NAMES, [0.01 * np.arange(400), *values], strict=True))


def plain_text() -> list[str]:
    """Return its lines as CSV."""
    content = _plain()
    rows = zip(*(column.tolist() for column in content.values()), strict=True)
    return [",".join(content), *(",".join(map(repr, row)) for row in rows)]


def _text(change: Callable[[list[str]], list[str] | str | bytes]) -> Maker:
    def make(path: Path) -> None:
        made = change(plain_text())
        made = "\n".join(made) + "\n" if isinstance(made, list) else made
        path.write_bytes(made if isinstance(made, bytes) else made.encode())

    return make


def _cell(row: int, column: int, value: str) -> Maker:
    def change(lines: list[str]) -> list[str]:
        cells = lines[row].split(",")
        lines[row] = ",".join([*cells[:column], value, *cells[column + 1 :]])
        return lines

    return _text(change)


def _each(change: Callable[[str], str]) -> Maker:
    return _text(lambda lines: [lines[0], *map(change, lines[1:])])


def _parquet(name: str, change: Callable[[Array], pa.Array]) -> Maker:
    def make(path: Path) -> None:
        content = {key: pa.array(column) for key, column in _plain().items()}
        content[name] = change(_plain()[name])
        pq.write_table(pa.table(content), path)

    return make


def _twice(path: Path) -> None:
    arrays = [pa.array(column) for column in _plain().values()]
    pq.write_table(pa.Table.from_arrays([*arrays, arrays[1]], names=[*NAMES, NAMES[1]]), path)


def _self(path: Path) -> None:
    path.symlink_to(path)


def _cut(path: Path) -> None:
    path.write_bytes(gzip.compress("\n".join(plain_text()).encode())[:3000])


@dataclass(frozen=True)
class Log:
    """A log that must be refused: how it is made, what is said, with which options."""

    suffix: str
    make: Maker
    says: str
    options: tuple[str, ...] = ()


_SMALL = ("--max-bytes", "50M")


LOGS: dict[str, Log] = {
    "a CSV bomb, gzip": Log(".csv.gz", _bomb, "raise the limit .*--max-bytes", _SMALL),
    "a CSV bomb, zstd": Log(".csv.zst", _zstd_bomb, "raise the limit .*--max-bytes", _SMALL),
    "a Parquet of 3e7 equal records": Log(".parquet", _rows_bomb(30_000_000), "time stamps are"),
    "a Parquet of 3e7 records beyond the limit": Log(
        ".parquet",
        _rows_bomb(30_000_000),
        "its 30000000 records need .* raise the limit .*--max-bytes",
        _SMALL,
    ),
    "a Parquet of 2e6 records beyond the limit": Log(
        ".parquet",
        _rows_bomb(2_000_000),
        "its 2000000 records need .* raise the limit .*--max-bytes",
        ("--max-bytes", "20M"),
    ),
    "a Parquet footer of 2 GB": Log(".parquet", _absurd_footer, "cannot be read"),
    "a Parquet of damaged counts": Log(".parquet", _absurd_rows, "parquet: "),
    "a header of 10^6 names": Log(".csv", _million_names, "more than a million letters"),
    "a header of 10^5 names": Log(".csv", _many_names, "no column"),
    "a Parquet of 20000 columns": Log(".parquet", _million_names_parquet, "no column"),
    "a line of 20 MB": Log(".csv", _long_line, "cannot be read"),
    "a megabyte of NUL": Log(".csv", _nul, "neither CSV"),
    "two columns of one name": Log(
        ".csv",
        _text(lambda lines: [lines[0] + ",gyro_x", *(x + ",0" for x in lines[1:])]),
        "gyro_x: two columns have this name",
    ),
    "two Parquet columns of one name": Log(".parquet", _twice, "gyro_x: two columns have"),
    "stamps that go back": Log(
        ".csv", _text(lambda x: [*x[:50], *x[20:]]), "row 51: time: time goes back by 0.29 s"
    ),
    "minus signs of typesetting": Log(
        ".csv", _each(lambda x: x.replace("-", "\u2212")), "'\u2212.* is not a number"
    ),
    "digits of another script": Log(".csv", _cell(9, 3, "٣"), "row 10: .*'٣' is not a number"),
    "a number in hexadecimal": Log(".csv", _cell(9, 3, "0x1p3"), "row 10: gyro_z: '0x1p3'"),
    "a burst of NaN": Log(
        ".csv",
        _text(
            lambda x: [*x[:60], *(f"{y.split(',')[0]},nan,0,0,0,0,0" for y in x[60:70]), *x[70:]]
        ),
        "row 61: gyro_x: nan is not a finite number; correct or remove",
    ),
    "an infinite reading": Log(".csv", _cell(9, 6, "-inf"), "row 10: accel_z: -inf is not"),
    "a reading of 1e200": Log(
        ".csv", _cell(9, 2, "1e200"), "row 10: gyro_y: 1e.200 rad/s is impossible"
    ),
    "readings of 1.7e308, both signs": Log(
        ".csv",
        _text(
            lambda x: [
                x[0],
                *(
                    f"{y.split(',')[0]}" + 6 * f",{'-' * (k % 2)}1.7e308"
                    for k, y in enumerate(x[1:])
                ),
            ]
        ),
        "row 2: gyro_x: 1.7e.308 rad/s is impossible",
    ),
    "a first stamp of -1e17 s": Log(
        ".csv",
        _text(lambda x: [x[0].replace("time", "time [s]"), "-1e17" + x[1][3:], *x[2:]]),
        "row 2: time: -1e.17 s is not a time of a clock",
    ),
    "a last stamp of 1e300 s": Log(
        ".csv", _cell(400, 0, "1e300"), "row 401: time: 1e.300 is .* not a time of a clock"
    ),
    "stamps of 1e-320 s": Log(
        ".csv",
        _text(
            lambda x: [
                x[0].replace("time", "time [s]"),
                *(f"{k}e-320," + y.split(",", 1)[1] for k, y in enumerate(x[1:], 1)),
            ]
        ),
        "inf records per second, expected 1 to 20000",
    ),
    "a second line of units": Log(
        ".csv", _text(lambda x: [x[0], "s" + 6 * ",x", *x[1:]]), "unknown unit 'x'"
    ),
    "the header twice": Log(
        ".csv", _text(lambda x: [*x[:9], x[0], *x[9:]]), "row 10: time: 'time' is not a number"
    ),
    "a last row cut off": Log(
        ".csv", _text(lambda x: "\n".join(x)[:-60]), "row 401: . values, the header has 7"
    ),
    "no rows": Log(".csv", _text(lambda x: x[:1]), "no data rows"),
    "one row": Log(".csv", _text(lambda x: x[:2]), "only 1 data row"),
    "two rows": Log(".csv", _text(lambda x: x[:3]), "2 samples in the log"),
    "an empty file": Log(".csv", _text(lambda _: b""), "the file is empty"),
    "a page of the web": Log(
        ".csv", _text(lambda _: "<html><body>404</body></html>"), "no header line"
    ),
    "a gzip cut off": Log(".csv.gz", _cut, "the compressed file is truncated"),
    "a Parquet of lists": Log(
        ".parquet",
        _parquet("gyro_x", lambda x: pa.array([[v] for v in x])),
        "gyro_x: contains list",
    ),
    "a Parquet of structures": Log(
        ".parquet", _parquet("gyro_x", lambda x: pa.array([{"a": v} for v in x])), "contains struct"
    ),
    "a Parquet of text": Log(
        ".parquet", _parquet("gyro_x", lambda x: pa.array([str(v) for v in x])), "contains string"
    ),
    "a Parquet of truth values": Log(
        ".parquet", _parquet("accel_z", lambda x: pa.array(x > 0.0)), "accel_z: contains bool"
    ),
    "a Parquet column of nothing": Log(
        ".parquet", _parquet("gyro_y", lambda x: pa.nulls(len(x))), "gyro_y: contains null"
    ),
    "a Parquet with a burst of nulls": Log(
        ".parquet",
        _parquet("gyro_y", lambda x: pa.array(x, mask=(x > 0.0) & (np.arange(400) > 99))),
        "gyro_y: an empty cell .null.; correct or remove",
    ),
    "a folder": Log(".csv", Path.mkdir, "Is a directory"),
    "a pipe": Log(".csv", os.mkfifo, "a pipe or device, not a file"),
    "a link to itself": Log(".csv", _self, "Too many levels of symbolic links"),
    "a link to nothing": Log(".csv", lambda p: p.symlink_to("nowhere"), "No such file"),
    "a device": Log(".csv", lambda p: p.symlink_to("/dev/zero"), "a pipe or device, not a file"),
}


# What is odd and means what the plain log means.
SOUND: dict[str, tuple[str, Maker]] = {
    "semicolons and decimal commas": (
        ".csv", _text(lambda lines: [x.replace(",", ";").replace(".", ",") for x in lines]),
    ),
    "decimal commas in quotes": (
        ".csv", _each(lambda x: ",".join(f'"{c.replace(".", ",")}"' for c in x.split(","))),
    ),
    "UTF-16": (".csv", _text(lambda x: "\n".join(x).encode("utf-16"))),
    "a record twice": (".csv", _text(lambda x: [*x[:50], x[49], *x[50:]])),
    "a byte order mark": (".csv", _text(lambda x: "\ufeff" + "\n".join(x))),
    "line ends of Windows": (".csv", _text(lambda x: "\r\n".join(x) + "\r\n")),
    "line ends of old Macs": (".csv", _text(lambda x: "\r".join(x) + "\r")),
    "no line end at the end": (".csv", _text(lambda x: "\n".join(x))),
    "numbers in quotes": (
        ".csv", _each(lambda x: ",".join(f'"{cell}"' for cell in x.split(","))),
    ),
    "blank lines": (".csv", _text(lambda x: [*x[:9], "", *x[9:], "", ""])),
    "a comma after each row": (".csv", _text(lambda x: [y + "," for y in x])),
    "a Parquet named .csv": (".csv", _parquet("time", pa.array)),
    "a CSV named .parquet": (".parquet", _text(lambda x: x)),
    "a dictionary in Parquet": (
        ".parquet", _parquet("gyro_x", lambda x: pa.array(x).dictionary_encode()),
    ),
    "durations in Parquet": (
        ".parquet",
        _parquet("time", lambda x: pa.array(np.arange(400) * 10_000_000, pa.duration("ns"))),
    ),
    "integer milliseconds in Parquet": (".parquet", lambda path: _milliseconds(path)),
}  # fmt: skip


def _milliseconds(path: Path) -> None:
    content = {name: pa.array(column) for name, column in _plain().items() if name != "time"}
    pq.write_table(
        pa.table({"time [ms]": pa.array(range(0, 4000, 10), pa.int16()), **content}), path
    )
