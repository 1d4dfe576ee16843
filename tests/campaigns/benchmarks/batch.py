"""Many logs at once: a batch on two cores next to the same batch on one."""

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from tests.campaigns.benchmarks.logs import simulate, words
from tests.campaigns.benchmarks.measure import (
    PYTHON,
    ROTCLI,
    Row,
    Run,
    Settings,
    compared,
    side_by_side,
)

_RUNS = 1000
_SPEED_UP = 1.8
_MOST_PARTS = 1.3  # CPU time of a run in a batch over that of its parts
# Keeps a command, and whatever threads it starts, to one core.
_ONE_CORE = (
    "import os, sys; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))}); "
    "os.execv(sys.argv[1], sys.argv[1:])"
)


def rows(settings: Settings) -> Iterator[Row]:
    """`rotcli navigate --batch` over a thousand six-minute logs, each in a folder of its own."""
    if not hasattr(os, "sched_setaffinity") or len(os.sched_getaffinity(0)) < 2:
        return
    log = simulate(
        settings.folder / "one",
        *words("--imu nav440 --rate 20 --static 60 --rotation 60 --navigation 240 --seed 1"),
    )
    runs = settings.folder / "runs"
    count = 40 if settings.quick else _RUNS
    for k in range(count):
        folder = runs / f"{k:04d}"
        folder.mkdir(parents=True)
        for name in ("imu.parquet", "table.parquet", "rig.toml"):
            os.link(log / name, folder / name)
    command = [*ROTCLI, "navigate", "--batch", str(runs), "--mode", "conventional", "--quiet"]
    alone = [PYTHON, "-c", _ONE_CORE]
    found = side_by_side(
        {
            "two": [*command, "--jobs", "2", "-o", str(settings.folder / "two")],
            "one": [*alone, *command, "--jobs", "1", "-o", str(settings.folder / "alone")],
        },
        1,
        warm=False,
        clock="wall",
    )
    what = f"rotcli navigate --batch, {count} logs of six minutes, two cores"
    at_most = None if settings.quick else 1.0 / _SPEED_UP
    yield compared(what, found["two"], "the same on one core", found["one"], at_most=at_most)


def parts(settings: Settings) -> Iterator[Row]:
    """CPU time of a run in a batch of one process next to reading, kernel and writing alone."""
    log = simulate(
        settings.folder / "parts",
        *words("--imu nav440 --rate 20 --static 60 --rotation 0 --navigation 300 --seed 1"),
    )
    count = 20 if settings.quick else 300
    runs = settings.folder / "runs of parts"
    for k in range(count):
        folder = runs / f"{k:04d}"
        folder.mkdir(parents=True)
        for name in ("imu.parquet", "table.parquet", "rig.toml"):
            os.link(log / name, folder / name)
    options = ["--mode", "conventional", "--jobs", "1", "--quiet"]
    command = [*ROTCLI, "navigate", "-o", str(settings.folder / "parts out"), *options, "--batch"]
    found = side_by_side(
        {"all": [*command, str(runs)], "one": [*command, str(runs / "0000")]},
        settings.slow_rounds,
        warm=False,
    )
    per_run = [
        (many - one) / (count - 1)
        for many, one in zip(found["all"].seconds, found["one"].seconds, strict=True)
    ]
    alone = side_by_side({"parts": _parts(log, settings.folder)}, settings.rounds)["parts"]
    ours = Run(per_run[: len(alone.seconds)])
    theirs = Run(alone.seconds[: len(ours.seconds)])
    what = f"rotcli navigate --batch, CPU time of a run, {count} runs"
    peer = "reading, kernel and writing alone"
    at_most = None if settings.quick else _MOST_PARTS
    yield compared(what, ours, peer, theirs, at_most=at_most)


def _parts(log: Path, folder: Path) -> Callable[[], None]:
    """Return a function that reads the logs, integrates the window and writes a result."""
    from rotcli.files.results.documents import read_result, write_result
    from rotcli.logs.imu import read_imu
    from rotcli.logs.table import read_table
    from rotcli.models.strapdown import InitialState, mechanize_log
    from rotcli.rig.rig import read_rig

    logs = [str(log / "imu.parquet"), str(log / "table.parquet")]
    done = [*ROTCLI, "navigate", *logs, "--mode", "conventional", "-o", str(log / "n.json")]
    subprocess.run([*done, "--quiet"], check=True)
    document = read_result(str(log / "n.json"))

    def run() -> None:
        rig = read_rig(log / "rig.toml")
        imu = read_imu(logs[0], rig)
        read_table(logs[1], rig)
        start = InitialState(0.9, 0.0, 1100.0, np.zeros(3), np.eye(3))
        window = slice(6000, None)
        mechanize_log(imu.gyro[window], imu.accel[window], imu.interval, start)
        write_result(str(folder / "part.json"), document)

    return run
