"""Files that attack: bombs, absurd declarations, wrong types, odd names.

`logs` writes the hostile logs, each with what the refusal must say.
"""

import gzip
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

HEADER = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n"
NAMES = HEADER.strip().split(",")


def _bomb(path: Path) -> None:
    with gzip.open(path, "wb", compresslevel=9) as stream:
        stream.write(HEADER.encode())
        block = b"0,0,0,0,0,0,0\n" * 70_000
        for _ in range(210):  # 206 MB of text in 0.2 MB
            stream.write(block)


def _zstd_bomb(path: Path) -> None:
    with pa.OSFile(str(path), "wb") as raw, pa.CompressedOutputStream(raw, "zstd") as stream:
        stream.write(HEADER.encode())
        block = b"0,0,0,0,0,0,0\n" * 70_000
        for _ in range(210):
            stream.write(block)


def _rows_bomb(path: Path) -> None:
    column = pa.array(np.zeros(30_000_000))
    pq.write_table(pa.table(dict.fromkeys(NAMES, column)), path, compression="zstd")


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


def _long_line(path: Path) -> None:
    path.write_text(HEADER + "1" * 20_000_000)


def _nul(path: Path) -> None:
    path.write_bytes(HEADER.encode() + b"\0" * 1_000_000)


# Name: suffix, maker, what the refusal says, options.
LOGS: dict[str, tuple[str, Callable[[Path], None], str, list[str]]] = {
    "a CSV bomb, gzip": (".csv.gz", _bomb, "raise --max-bytes", ["--max-bytes", "100M"]),
    "a CSV bomb, zstd": (".csv.zst", _zstd_bomb, "raise --max-bytes", ["--max-bytes", "100M"]),
    "a Parquet of 3e7 equal records": (".parquet", _rows_bomb, "repeats the row before", []),
    "a Parquet footer of 2 GB": (".parquet", _absurd_footer, "cannot be read", []),
    "a Parquet of damaged counts": (".parquet", _absurd_rows, "parquet: ", []),
    "a header of 10^6 names": (".csv", _million_names, "more than a million letters", []),
    "a Parquet of 20000 columns": (".parquet", _million_names_parquet, "no such column", []),
    "a line of 20 MB": (".csv", _long_line, "cannot be read", []),
    "a megabyte of NUL": (".csv", _nul, "neither CSV", []),
}  # fmt: skip

TOMLS = {
    "nested arrays": "x = " + "[" * 100_000,
    "closed nested arrays": "x = " + "[" * 5000 + "]" * 5000,
    "nested tables": "x = " + "{a = " * 5000 + "1" + "}" * 5000,
    "a dotted key": ".".join(["a"] * 20_000) + " = 1",
    "a dotted header": "[" + ".".join(["a"] * 20_000) + "]",
    "a long number": "[site]\nlatitude = " + "9" * 100_000,
    "too large": "# " + "x" * 6_000_000,
    "a NUL": "[site]\nlatitude = 1\0",
}
JSONS = {
    "nested arrays": "[" * 100_000,
    "a long number": '{"kind": "calibration", "schema": ' + "1" * 100_000 + "}",
    "NaN": '{"kind": "calibration", "schema": 1, "axis": "z", "rate": {"value": NaN}}',
    "a list": "[]",
    "a string": '"calibration"',
    "a lone surrogate": '{"kind": "calibration", "schema": 1, "axis": "\\ud800"}',
    "too large": '{"kind": "' + "x" * (66 << 20) + '"}',
}
ODD_NAMES = (
    "with space",
    "quo'te\"s",
    "new\nline",
    "Ünïcödé 日本",
    "-dash",
    "%s%n{mode}",
    "<script>alert(1)<∕script>",
    "\\input{secret}",
    "$(touch pwned)",
    "*[a-z]?",
)
