"""The logs that are measured on, made afresh for each run."""

import subprocess
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rotcli.files.columns import write_columns
from tests.campaigns.benchmarks.measure import ROTCLI

COLUMNS = [f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"]


def words(line: str) -> list[str]:
    """Return the words of a command line."""
    return line.split()


def simulate(folder: Path, *options: str) -> Path:
    """Play `rotcli simulate` into a folder and return it; an existing one is kept."""
    if not (folder / "imu.parquet").exists():
        command = [*ROTCLI, "simulate", *options, "--quiet", "-o", str(folder)]
        subprocess.run(command, check=True)
    return folder


def scenario(folder: Path, text: str) -> Path:
    """Play a scenario into a folder and return it."""
    file = folder.with_suffix(".toml")
    file.write_text(text, encoding="utf-8")
    return simulate(folder, "--scenario", str(file))


def still_log(path: Path, hours: float, rate: float = 100.0) -> int:
    """Write a still log of white noise as Parquet, whatever its length; return its rows."""
    n = round(hours * 3600 * rate)
    schema = pa.schema([(name, pa.float64()) for name in ("time", *COLUMNS)])
    rng = np.random.default_rng(0)
    with pq.ParquetWriter(path, schema, compression="zstd", compression_level=1) as writer:
        for first in range(0, n, 1_000_000):
            k = min(1_000_000, n - first)
            columns = [np.arange(first, first + k) / rate]
            columns += [1e-3 * rng.standard_normal(k) for _ in COLUMNS]
            columns[1 + COLUMNS.index("accel_z")] += 9.8  # gravity
            writer.write_table(pa.table(dict(zip(schema.names, columns, strict=True)), schema))
    return n


def plain_log(folder: Path, rows: int) -> tuple[Path, Path]:
    """Write one still IMU log as CSV and as Parquet, with the six decimals a logger writes."""
    rng = np.random.default_rng(0)
    columns = {"time": np.round(0.01 * np.arange(rows), 2)}
    columns |= {name: np.round(rng.normal(scale=0.1, size=rows), 6) for name in COLUMNS}
    columns["accel_z"] += 9.8
    columns["accel_z"] = np.round(columns["accel_z"], 6)
    csv, parquet = folder / "plain.csv", folder / "plain.parquet"
    write_columns(csv, columns)
    write_columns(parquet, columns)
    return csv, parquet
