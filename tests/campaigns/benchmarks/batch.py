"""Many logs at once: a batch on two cores next to the same batch on one."""

import json
import os
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.campaigns.benchmarks.logs import simulate, words
from tests.campaigns.benchmarks.measure import (
    PYTHON,
    ROTCLI,
    Row,
    Run,
    Settings,
    compared,
    one,
    process,
    side_by_side,
)
from tests.campaigns.benchmarks.scripts.batch_parts import ASKED, OF_THE_LOG

_RUNS = 1000
_SEEDS = 10  # different logs among the runs of a batch
_SPEED_UP = 1.8
_MOST_PARTS = 1.3  # CPU time of a run in a batch, less its checks and assessment, over its parts
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
    _link([log], runs, count)
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
    """CPU time of a run in a batch of one process next to its parts, each measured alone.

    The parts are those of `batch_parts`: reading, kernel and writing, next to a run less its checks
    and its assessment, and next to all that a run does. The logs are of ten seeds, at one rate, so
    that they share the covariances of one plan, as those of a campaign do.
    """
    options = words("--imu nav440 --rate 20 --static 60 --rotation 0 --navigation 300")
    logs = [
        simulate(settings.folder / f"part {seed}", *options, "--seed", str(seed))
        for seed in range(_SEEDS)
    ]
    count = 20 if settings.quick else 300
    runs = settings.folder / "runs of parts"
    _link(logs, runs, count)
    chosen = ["--mode", "conventional", "--jobs", "1", "--quiet"]
    command = [*ROTCLI, "navigate", "-o", str(settings.folder / "parts out"), *chosen, "--batch"]
    alone = Run()
    per_part: dict[str, Run] = {}
    ours, bare = Run(), Run()
    for _ in range(settings.slow_rounds):
        (many, _), (first, _) = process([*command, str(runs)]), process([*command, f"{runs}/0000"])
        ours.seconds.append((many - first) / (count - 1))
        found = measured_parts(logs, settings.folder)
        for name, seconds in found.items():
            per_part.setdefault(name, Run()).seconds.append(seconds)
        alone.seconds.append(sum(found[name] for name in ASKED))
        bare.seconds.append(ours.seconds[-1] - sum(found[name] for name in OF_THE_LOG))
    what = f"rotcli navigate --batch, CPU time of a run, {count} runs"
    at_most = None if settings.quick else _MOST_PARTS
    note = "less the checks of the log and the errors to expect, which have bounds of their own"
    peer = "reading, kernel and writing alone"
    yield compared(what, bare, peer, alone, at_most=at_most, note=note)
    yield compared(what, ours, peer, alone)
    every = Run(
        [sum(seconds) for seconds in zip(*(p.seconds for p in per_part.values()), strict=True)]
    )
    yield compared(what, ours, "all that a run does, each part alone", every)
    for name, run in per_part.items():
        yield one(f"of a run: {name}", run)


def _link(logs: Sequence[Path], runs: Path, count: int) -> None:
    """Make run folders with links to the logs, one after the other."""
    for k in range(count):
        folder = runs / f"{k:04d}"
        folder.mkdir(parents=True)
        for name in ("imu.parquet", "table.parquet", "rig.toml"):
            os.link(logs[k % len(logs)] / name, folder / name)


def measured_parts(logs: Sequence[Path], folder: Path) -> dict[str, float]:
    """Return the CPU time (s) of each part, measured in a process of its own."""
    module = "tests.campaigns.benchmarks.scripts.batch_parts"
    command = [PYTHON, "-m", module, str(folder / "part.json"), *map(str, logs)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found
