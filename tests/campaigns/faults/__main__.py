"""Try every fault, and write docs/evidence/faults.md from what happened."""

import argparse
import random
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from scipy.stats import binom

import rotcli
from rotcli.files.tables import Column, Table
from rotcli.files.tables.markup import to_markdown
from tests.campaigns.faults import (
    cluster,
    disks,
    hostile,
    hostile_logs,
    inputs,
    kills,
    pipes,
    runs,
    silent,
    voyage,
    writers,
)

_WARNING_BY_CHANCE = 0.01  # of clean logs: ten tests at p < 1e-3
_STATISTICAL = re.compile(r"warning: .*(\bsigma\b|\(p \d)")  # a warning that names its chance
PAGE = Path(__file__).parents[3] / "docs" / "evidence" / "faults.md"


@dataclass
class Tally:
    """What a fault came to: how often it was tried, and what went wrong."""

    fault: str
    tried: int = 0
    wrong: list[str] = field(default_factory=list)
    remark: str = ""

    def note(self, outcome: str | None) -> None:
        """Count a trial; None is what should be."""
        self.tried += 1
        if outcome is not None:
            self.wrong.append(outcome)

    @property
    def row(self) -> tuple[str, int, int, str]:
        """The fault as the page shows it."""
        if not self.tried:
            return self.fault, 0, 0, "cannot be tried on this system"
        happened = "; ".join(" ".join(text.split())[:80] for text in self.wrong[:2])
        return self.fault, self.tried, len(self.wrong), happened or self.remark or "as it should"


def _kills(folder: Path, count: int, rng: random.Random) -> Iterator[Tally]:
    """Kill, interrupt and starve every writer."""
    swept = Tally("the run after kills: every file new, no draft left")
    stopped = Tally("Ctrl-C: 130, one line, files old or new")
    full = Tally("disk full: no file past 0 bytes, amid, a byte before its end")
    disk = Tally("disk full: a memory disk of 8 and 40 kB")
    locked = Tally("folder that may not be written by anybody")
    with disks.mounted(folder / "may", "size=64k") as allowed:
        pass
    for name in writers.WRITERS:
        tally = Tally(f"kill -9 of {name}: at random and amid writing")
        new, taken = writers.new_files(folder, name)
        for _ in range(count):
            tally.note(kills.killed(folder, name, new, taken, rng))
        yield tally
        swept.note(kills.cleaned(folder, name, new))
        for _ in range(max(2, count // 4)):
            stopped.note(kills.interrupted(folder, name, new, taken, rng))
        for limit in disks.limits(new):
            full.note(disks.full(folder, name, new, limit))
        if allowed:
            for kilobytes in (8, 40):
                disk.note(disks.on_small_disk(folder, name, new, kilobytes))
            locked.note(disks.into_read_only(folder, name))
    yield from (swept, stopped, full, disk, locked)


def _others(folder: Path, count: int, rng: random.Random) -> Iterator[Tally]:
    for fault, trial in (
        ("input that vanishes", lambda: inputs.vanished(folder, rng)),
        ("input that grows while it is read", lambda: inputs.growing(folder, rng)),
        ("two processes writing one target", lambda: inputs.two_writers(folder)),
        ("two simulations writing one folder", lambda: inputs.two_simulations(folder)),
    ):
        tally = Tally(fault)
        for _ in range(count):
            tally.note(trial())
        yield tally
    gone, head = Tally("reader that is not there (a closed pipe)"), Tally("reader of a line (head)")
    room = Tally("standard output on a full disk: one line")
    for line in pipes.PIPED:
        gone.note(pipes.piped(folder, line.split()))
        head.note(pipes.headed(folder, line))
        if Path("/dev/full").exists():
            room.note(disks.onto_full_disk(folder, line))
    yield from (gone, head, room)
    same = Tally("output that is an input, by path, link or detour: refused")
    for command in inputs.READERS:
        for outcome in inputs.over_input(folder, command):
            same.note(outcome)
    yield same
    tally = Tally("failed recipes under make -j4: no target left")
    place = folder / "make"
    place.mkdir()
    tally.note(pipes.failed_recipe(place))
    yield tally


def _clusters(folder: Path) -> Iterator[Tally]:
    for fault, trial in cluster.TRIALS.items():
        tally = Tally(fault)
        tally.note(trial(folder))
        yield tally


def _hostile(folder: Path) -> Iterator[Tally]:
    for name, log in hostile_logs.LOGS.items():
        tally = Tally(f"log: {name}")
        tally.note(hostile.refused(log, folder / "hostile" / f"log{log.suffix}", runs.rotcli))
        yield tally
    tally = Tally("hostile logs: memory within 300 MB and six times what may be read")
    for log in hostile_logs.LOGS.values():
        tally.note(hostile.within_memory(log, folder / "hostile" / f"log{log.suffix}"))
    equal = hostile_logs.LOGS["a Parquet of 3e7 equal records"]
    tally.note(hostile.within_memory(equal, folder / "hostile" / "log.parquet", "inspect"))
    yield tally
    for name, (suffix, make) in hostile_logs.SOUND.items():
        tally = Tally(f"odd but sound log: {name}, read as it is meant")
        tally.note(hostile.understood(make, folder / "odd" / f"log{suffix}", runs.rotcli))
        yield tally
    for what, texts, lines in (
        ("rig, scenario or profile: hostile TOML", hostile.TOMLS, _toml_lines),
        ("result: hostile JSON", hostile.JSONS, _json_lines),
    ):
        tally = Tally(what)
        for text in texts.values():
            path = folder / "hostile.txt"
            path.write_text(text)
            for line in lines(str(path)):
                done = runs.rotcli(line, cwd=folder)
                reported = done.returncode == 1 and done.stderr.count("\n") == 1
                tally.note(None if reported else f"{done.returncode}: {done.stderr[-200:]}")
        yield tally


def _toml_lines(path: str) -> list[list[str]]:
    return [
        ["navigate", "still/imu.parquet", "--rig", path],
        ["simulate", "--scenario", path, "-o", "hostile"],
        ["simulate", "--imu", path, "--rate", "1", "-o", "hostile"],
    ]


def _json_lines(path: str) -> list[list[str]]:
    logs = ["run/imu.parquet", "run/table.parquet"]
    return [
        ["report", path],
        ["navigate", *logs, "--calibration", path],
        ["budget", "--calibration", path],
        ["observe", *logs, "--calibration", path],
        ["observe", *logs, "--allan", path],
    ]


def _silent(folder: Path, seeds: int) -> Iterator[Tally]:
    def tried(case: tuple[str, str]) -> Tally:
        name, command = case
        tally = Tally(f"{name}: {command}")
        for seed in range(seeds):
            place = folder / f"silent-{silent.CASES.index(case)}-{seed}"
            tally.note(silent.judge(name, command, seed, place))
            shutil.rmtree(place)
        return tally

    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(tried, silent.CASES)
    for name in voyage.FAULTS:
        tally = Tally(f"{name}: calibrate, a voyage")
        tally.note(voyage.judge(name, folder / "sea"))
        yield tally


def _clean(folder: Path, seeds: int) -> Tally:
    """Run clean logs; a warning is wrong where more logs warn than chance explains.

    The statistical tests warn at p < 1e-3, and a log has some ten of them; other warnings and
    errors are wrong.
    """

    def alarms(seed: int) -> list[str]:
        place = folder / f"clean-{seed}"
        found = silent.alarms(seed, place)
        shutil.rmtree(place)
        return found

    tally = Tally("clean logs of every kind: alarms")
    warned = []
    with ThreadPoolExecutor(2) as pool:
        for found in pool.map(alarms, range(seeds)):
            beyond = [line for line in found if not _STATISTICAL.search(line)]
            warned += ["; ".join(found)] if found and not beyond else []
            tally.note("; ".join(beyond) or None)
    most = int(binom.ppf(0.999, seeds, _WARNING_BY_CHANCE))
    if len(warned) > most:
        tally.wrong += warned
    for text in warned:
        print(f"            by chance: {' '.join(text.split())[:300]}", flush=True)
    tally.remark = f"{len(warned)} with a warning; chance makes {most} at most"
    return tally


def _table(title: str, tallies: Iterable[Tally], note: str) -> Table:
    columns = (Column("fault"), Column("tried", "d"), Column("wrong", "d"), Column("what happened"))
    rows = []
    for tally in tallies:
        rows.append(tally.row)
        print(f"  {tally.tried:4d} {len(tally.wrong):3d}  {tally.fault}", flush=True)
        for text in tally.wrong[:3]:
            print(f"            {' '.join(text.split())[:300]}", flush=True)
    return Table(title, columns, rows, note)


def main() -> None:
    """Run the campaign and write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=16, help="of each of the 13 writers")
    parser.add_argument("--seeds", type=int, default=2, help="of each silent fault and command")
    parser.add_argument("--clean", type=int, default=200, help="clean logs")
    parser.add_argument("--page", type=Path, default=PAGE, help="where the page goes")
    given = parser.parse_args()
    start, rng = time.monotonic(), random.Random(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        writers.prepare(folder)
        made = [
            _table(
                "Nothing lost",
                chain(
                    _kills(folder, given.kills, rng),
                    _others(folder, max(2, given.kills // 2), rng),
                    _clusters(folder),
                ),
                "Each target has the older bytes or all the new ones, byte for byte; a fault "
                "that a program can see is one line and exit status 1; no draft stays.",
            ),
            _table(
                "Hostile files",
                _hostile(folder),
                "Refused in one line with exit status 1, within seconds; what is odd but sound is "
                "converted into the same numbers as the plain log.",
            ),
            _table(
                "Wrong in silence",
                _silent(folder, given.seeds),
                "A simulated run with one fault put in, by seed, as Parquet and as CSV in turn; "
                "the command must refuse it or warn, naming the fault and what to do. `still` is "
                "a run without a table log, `swing` a navigation at a varying rate.",
            ),
            _table(
                "False alarms",
                (_clean(folder, given.clean) for _ in range(1)),
                "No error on any of them, and no more warnings than tests at p < 1e-3 give by "
                "chance (a hundredth of the logs; limit at 99.9 %): two IMUs, three axes, five "
                "rates, tilted and not, instants, means and increments, with lever arm and "
                "without; still, at one rate, at two, swinging; Parquet, CSV, gzip; every command "
                "that reads them.",
            ),
        ]
    wrong = sum(row[2] for table in made for row in table.rows)
    tried = sum(row[1] for table in made for row in table.rows)
    head = (
        f"# Faults\n\nMade by `make faults` with rotcli {rotcli.__version__}: {tried} trials, "
        f"{wrong} of them wrong. Not written by hand.\n"
    )
    given.page.parent.mkdir(exist_ok=True)
    given.page.write_text("\n".join([head, *map(to_markdown, made)]))
    print(f"{given.page}: {tried} trials, {wrong} wrong, {time.monotonic() - start:.0f} s")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
