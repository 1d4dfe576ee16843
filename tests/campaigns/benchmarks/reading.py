"""Reading an IMU log of three hours, 1.08 million rows of 7 columns, next to plain readers.

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
from tests.campaigns.benchmarks.measure import (
    PYTHON,
    Row,
    Settings,
    compared,
    process,
    side_by_side,
)

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
_DIALECT_AT_MOST = 3.0  # times pyarrow's reading of the same numbers as plain CSV


def rows(settings: Settings) -> Iterator[Row]:
    """CSV and Parquet, next to pyarrow and both engines of pandas."""
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
            yield compared(what, found["rotcli"], peer, found[peer], at_most=at_most)


def dialect_rows(settings: Settings) -> Iterator[Row]:
    """Text of other dialects, next to pyarrow's reading of the same numbers as plain CSV."""
    size = 1_000_000 // 10 if settings.quick else 1_000_000
    plain = next(file for file in plain_log(settings.folder, size) if file.suffix == ".csv")
    for name, file in _dialects(plain).items():
        found = side_by_side(
            {"rotcli": partial(_rotcli, str(file)), "pyarrow": partial(_pyarrow, str(plain))},
            settings.rounds,
        )
        at_most = None if settings.quick else _DIALECT_AT_MOST
        what = f"read {size:,} rows of CSV with {name}"
        yield compared(what, found["rotcli"], "pyarrow, plain", found["pyarrow"], at_most=at_most)


def _dialects(plain: Path) -> dict[str, Path]:
    """Write a plain log in other dialects; return the files by what is odd about them."""
    head, _, body = plain.read_text(encoding="utf-8").partition("\n")
    names = [name.partition(" ")[0] for name in head.split(",")]
    texts = {
        "semicolons and decimal commas": f"{head.replace(',', ';')}\n"
        + body.replace(",", ";").replace(".", ","),
        "blanks and a preamble": f"# logger 3\n{' '.join(names)}\n" + body.replace(",", "  "),
        "comments amid the records": f"{head}\n# begin\n{body}# end\n",
    }
    files = {}
    for k, (name, text) in enumerate(texts.items()):
        files[name] = plain.with_name(f"dialect-{k}.txt")
        files[name].write_text(text, encoding="utf-8")
    return files


def _peaks(name: str, file: Path, count: int) -> list[float]:
    command = [PYTHON, "-m", "tests.campaigns.benchmarks.reading", name, str(file)]
    return [median(process(command)[1] for _ in range(count))]


if __name__ == "__main__":
    READERS[sys.argv[1]](sys.argv[2])
