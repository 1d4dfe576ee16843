"""Reading an IMU log of three hours, 1.08 million rows of 7 columns, beside plain readers.

rotcli checks every number and the clock on the way and hands over SI arrays; the others stop at
their table. `python -m tests.campaigns.benchmarks.reading WHO FILE` reads once, for the
peak memory of a process.
"""

import importlib.util
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from tests.campaigns.benchmarks.logs import plain_log
from tests.campaigns.benchmarks.measure import PYTHON, Row, Settings, beside, process, side_by_side

THREE_HOURS = 1_080_000


def _rotcli(file: str) -> Any:
    from rotcli.logs.imu import read_imu
    from rotcli.rig.rig import default_rig

    return read_imu(file, default_rig())


def _pyarrow(file: str) -> Any:
    if file.endswith(".csv"):
        import pyarrow.csv

        return pyarrow.csv.read_csv(file)
    import pyarrow.parquet

    return pyarrow.parquet.read_table(file)


def _pandas(engine: str) -> Callable[[str], Any]:
    def read(file: str) -> Any:
        import pandas as pd

        csv = file.endswith(".csv")
        return pd.read_csv(file, engine=engine) if csv else pd.read_parquet(file, engine=engine)

    return read


READERS = {
    "rotcli": _rotcli,
    "pyarrow": _pyarrow,
    "pandas, engine c": _pandas("c"),
    "pandas, engine pyarrow": _pandas("pyarrow"),
    "pandas, engine fastparquet": _pandas("fastparquet"),
}
_NAMES = {"csv": "CSV", "parquet": "Parquet"}
PEERS = {
    "csv": ("pyarrow", "pandas, engine c", "pandas, engine pyarrow"),
    "parquet": ("pyarrow", "pandas, engine pyarrow", "pandas, engine fastparquet"),
}
# "In about the time pyarrow itself needs" of CSV: half as much again.
_AT_MOST = {("csv", "pyarrow"): 1.5}


def rows(settings: Settings) -> Iterator[Row]:
    """CSV and Parquet, beside pyarrow and both engines of pandas."""
    size = THREE_HOURS // 10 if settings.quick else THREE_HOURS
    for file in plain_log(settings.folder, size):
        kind = file.suffix[1:]
        there = [
            peer
            for peer in PEERS[kind]
            if "fastparquet" not in peer or importlib.util.find_spec("fastparquet")
        ]
        found = side_by_side(
            {name: partial(READERS[name], str(file)) for name in ("rotcli", *there)},
            settings.rounds,
        )
        for name, run in found.items():
            run.peaks = _peaks(name, file, 1 if settings.quick else 3)
        for peer in PEERS[kind]:
            what = f"read {size:,} rows of {_NAMES[kind]}"
            if peer not in found:
                yield Row(what, peer=peer, note="skipped: not installed")
                continue
            at_most = None if settings.quick else _AT_MOST.get((kind, peer))
            yield beside(what, found["rotcli"], peer, found[peer], at_most=at_most)


def _peaks(name: str, file: Path, count: int) -> list[float]:
    command = [PYTHON, "-m", "tests.campaigns.benchmarks.reading", name, str(file)]
    return [median(process(command)[1] for _ in range(count))]


if __name__ == "__main__":
    READERS[sys.argv[1]](sys.argv[2])
