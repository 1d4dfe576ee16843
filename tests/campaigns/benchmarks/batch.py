"""Many logs at once: a batch on two cores beside the same batch on one."""

import os
from collections.abc import Iterator

from tests.campaigns.benchmarks.logs import simulate, words
from tests.campaigns.benchmarks.measure import PYTHON, ROTCLI, Row, Settings, beside, side_by_side

_RUNS = 1000
_SPEED_UP = 1.8
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
    )
    what = f"rotcli navigate --batch, {count} logs of six minutes, two cores"
    at_most = None if settings.quick else 1.0 / _SPEED_UP
    yield beside(what, found["two"], "the same on one core", found["one"], at_most=at_most)
