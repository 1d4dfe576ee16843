"""Run the groups, print the table, write it, judge its bounds."""

import os

# One process at a time is measured; a linear algebra library's threads would blur it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
# The peers were compiled when they were installed; let rotcli keep its bytecode as well.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.campaigns.benchmarks import (
    batch,
    campaign,
    filters,
    growth,
    kernel,
    noise,
    older,
    page,
    processes,
    reading,
    startup,
)
from tests.campaigns.benchmarks.measure import Row, Settings

# To add rows, write a function that yields them and name it here.
GROUPS: dict[str, tuple[Callable[[Settings], Iterator[Row]], ...]] = {
    "Start-up": (startup.help_text, startup.commands, startup.six_minutes),
    "Reading a log": (reading.rows, reading.dialect_rows),
    "Strapdown integration": (kernel.errors, kernel.coning, kernel.speed, kernel.cold),
    "Process, a log of 6 minutes": (processes.rows, processes.expected),
    "Allan deviation": (noise.rows,),
    "Filters": (filters.zero_velocity, filters.voyage),
    "Long logs next to an older version": (older.rows,),
    "Many logs": (batch.rows, batch.parts),
    "Campaign": (campaign.rows,),
    "Growth with the length of the log": (growth.rows,),
}


def kept(folder: Path, word: str) -> list[Row]:
    """Return the rows of an earlier run whose groups are not measured again."""
    earlier = folder / "bench.json"
    if not word or not earlier.exists():
        return []
    rows = page.rows_of(earlier.read_text(encoding="utf-8"))
    return [row for row in rows if word.lower() not in row.group.lower()]


def write(rows: list[Row], about: dict[str, Any], folder: Path) -> None:
    """Write bench.json and bench.md."""
    order = list(GROUPS)
    rows = sorted(rows, key=lambda row: order.index(row.group))
    (folder / "bench.json").write_text(page.as_json(rows, about), encoding="utf-8")
    (folder / "bench.md").write_text(page.markdown(rows, about), encoding="utf-8")


def main() -> int:
    """Run what was asked for; return 1 when a bound does not hold."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.campaigns.benchmarks", description=__doc__
    )
    parser.add_argument("--quick", action="store_true", help="fewer rounds, smaller logs: a glance")
    parser.add_argument(
        "--only",
        metavar="WORD",
        default="",
        help="groups whose name contains WORD; the page keeps the others of the run before",
    )
    parser.add_argument("--rounds", type=int, metavar="N", help="[default: 7; with --quick 3]")
    parser.add_argument("-o", metavar="DIR", type=Path, default=Path("build"), dest="output")
    given = parser.parse_args()
    rounds = given.rounds or (3 if given.quick else 7)

    given.output.mkdir(parents=True, exist_ok=True)
    about = page.machine()
    rows: list[Row] = []
    others = kept(given.output, given.only)
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="rotcli-bench-") as folder:
        settings = Settings(Path(folder), rounds, given.quick)
        for group, functions in GROUPS.items():
            if given.only.lower() not in group.lower():
                continue
            print(group, flush=True)
            for function in functions:
                for row in function(settings):
                    rows.append(replace(row, group=group))
                    print(page.text(rows[-1]), flush=True)
                    # Row by row: an interrupted run keeps what it has.
                    write([*others, *rows], about, given.output)
    failed = [row.what for row in rows if row.kept is False]
    seconds = time.perf_counter() - begin
    print(
        f"{len(rows)} rows in {seconds:.0f} s: {given.output}/bench.json, {given.output}/bench.md"
    )
    for what in failed:
        print(f"bound fails: {what}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
