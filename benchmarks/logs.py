"""The logs that are measured on, made afresh for each run."""

import subprocess
from pathlib import Path

import numpy as np

from benchmarks.measure import ROTCLI
from rotcli.logs.write import write_columns

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
