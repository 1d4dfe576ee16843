"""Try every fault, and write docs/faults.md from what happened."""

import argparse
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import rotcli
from faults import files, hostile, silent
from rotcli.results.tables import Column, Table, to_markdown

PAGE = Path(__file__).parents[1] / "docs" / "faults.md"


@dataclass
class Tally:
    """What a fault came to: how often it was tried, and what went wrong."""

    fault: str
    tried: int = 0
    wrong: list[str] = field(default_factory=list)

    def note(self, outcome: str | None) -> None:
        """Count a trial; None is what should be."""
        self.tried += 1
        if outcome is not None:
            self.wrong.append(outcome)

    @property
    def row(self) -> tuple[str, int, int, str]:
        """The fault as the page shows it."""
        happened = "; ".join(" ".join(text.split())[:80] for text in self.wrong[:2])
        return self.fault, self.tried, len(self.wrong), happened or "as it should"


def _kills(folder: Path, count: int, rng: random.Random) -> Iterator[Tally]:
    """Kill, interrupt and starve every writer."""
    killed = {
        name: Tally(f"kill -9 of {name}, at random and amid writing") for name in files.WRITERS
    }
    swept = Tally("the run after kills: no draft left")
    stopped = Tally("Ctrl-C: 130, one line, files old or new")
    full = Tally("disk full (file size limited to 0, 1, 3, 10 kB)")
    disk = Tally("disk full (a memory disk of 8 kB)")
    locked = Tally("folder that may not be written")
    for name, tally in killed.items():
        new, taken = files.new_files(folder, name)
        for _ in range(count):
            tally.note(files.killed(folder, name, new, taken, rng))
        swept.note(files.cleaned(folder, name))
        for _ in range(max(2, count // 5)):
            stopped.note(files.interrupted(folder, name, new, taken, rng))
        for limit in (0, 1000, 3000, 10_000):
            full.note(files.full(folder, name, limit))
        with files.mounted(folder / "may", "size=64k") as allowed:
            pass
        if allowed:
            disk.note(files.on_small_disk(folder, name, 8))
            locked.note(files.into_read_only(folder, name))
    yield from (*killed.values(), swept, stopped, full, disk, locked)


def _others(folder: Path, count: int, rng: random.Random) -> Iterator[Tally]:
    for fault, trial in (
        ("input that vanishes", lambda: files.vanished(folder, rng)),
        ("input that grows while it is read", lambda: files.growing(folder, rng)),
        ("two processes writing one target", lambda: files.two_writers(folder)),
        ("reader that goes away (a closed pipe)",
         lambda: files.piped(folder, ["allan", "still/imu.parquet"])),
    ):  # fmt: skip
        tally = Tally(fault)
        for _ in range(count):
            tally.note(trial())
        yield tally
    tally = Tally("failed recipes under make -j4: no target left")
    place = folder / "make"
    place.mkdir()
    tally.note(files.failed_recipe(place))
    yield tally


def _hostile(folder: Path) -> Iterator[Tally]:
    for name, (suffix, make, says, options) in hostile.LOGS.items():
        path = folder / f"hostile{suffix}"
        make(path)
        done = silent.rotcli(["allan", str(path), *options])
        told = done.returncode == 1 and done.stderr.count("\n") == 1 and says in done.stderr
        tally = Tally(f"log: {name}")
        tally.note(None if told else f"{done.returncode}: {done.stderr[:200]}")
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
                done = silent.rotcli(line, cwd=folder)
                told = done.returncode == 1 and done.stderr.count("\n") == 1
                tally.note(None if told else f"{done.returncode}: {done.stderr[-200:]}")
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
    def tried(name: str) -> Tally:
        tally = Tally(name)
        for seed in range(seeds):
            place = folder / f"silent-{list(silent.FAULTS).index(name)}-{seed}"
            tally.note(silent.judge(name, seed, place))
            shutil.rmtree(place)
        return tally

    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(tried, silent.FAULTS)


def _clean(folder: Path, seeds: int) -> Tally:
    def alarms(seed: int) -> list[str]:
        place = folder / f"clean-{seed}"
        found = silent.alarms(seed, place)
        shutil.rmtree(place)
        return found

    tally = Tally("clean logs, two IMUs, four rates and still: alarms")
    with ThreadPoolExecutor(2) as pool:
        for found in pool.map(alarms, range(seeds)):
            tally.note("; ".join(found) if found else None)
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
    parser = argparse.ArgumentParser(prog="python -m faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=25, help="of each of the eight writers")
    parser.add_argument("--seeds", type=int, default=5, help="of each silent fault")
    parser.add_argument("--clean", type=int, default=200, help="clean logs")
    parser.add_argument("--page", type=Path, default=PAGE, help="where the page goes")
    given = parser.parse_args()
    start, rng = time.monotonic(), random.Random(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files.prepare(folder)
        made = [
            _table(
                "Nothing lost",
                (
                    *_kills(folder, given.kills, rng),
                    *_others(folder, max(2, given.kills // 2), rng),
                ),
                "Each target holds the older bytes or the whole new ones, byte for byte; a fault "
                "that a program can see is one line and exit status 1; no draft stays.",
            ),
            _table(
                "Hostile files",
                _hostile(folder),
                "Refused in one line with exit status 1, within seconds.",
            ),
            _table(
                "Wrong in silence",
                _silent(folder, given.seeds),
                "A simulated run with one fault put in, by seed; the command must refuse it or "
                "warn, naming the fault.",
            ),
            _table(
                "False alarms",
                (_clean(folder, given.clean) for _ in range(1)),
                "No warning and no error on any of them.",
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
