"""Compare the results of two installations of rotcli on the same logs, number by number.

`python -m tests.campaigns.compare_installations OLD NEW` takes two source trees (or two folders
that contain the package `rotcli`). OLD simulates the logs once; both process them; every number of
every JSON result is compared. The largest relative difference per command is printed, and each
place beyond `--tolerance`. Texts, warnings and provenance are not compared.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Two IMUs, turning and still runs about three axes, and the voyage of a single-axis rotation INS.
RUNS = {
    **{
        f"{imu}-{axis}-{rate}": ["--imu", imu, "--axis", axis, "--rate", rate, "--seed", seed]
        for imu, seed in (("mti-g", "5"), ("nav440", "6"))
        for axis, rate in (("z", "10"), ("z", "100"), ("x", "50"), ("y", "-30"))
    },
    **{f"{imu}-still": ["--imu", imu, "--rate", "0", "--seed", "7"] for imu in ("mti-g", "nav440")},
}
VOYAGE = ["--scenario", "srins", "--seed", "1"]
# Keys whose values describe the program or its files, not the measurement.
SKIPPED = {"rotcli", "inputs", "rig", "warnings", "findings", "schema", "unit"}
# Below this fraction of the largest number of its list or quantity a number is rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Difference:
    """One number that differs: the place in the document, both values, relative difference."""

    place: str
    old: float
    new: float
    relative: float


def rotcli(tree: Path, folder: Path, *args: str) -> None:
    """Run a command of one installation in a folder; its warnings are dropped."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-P", "-m", "rotcli", *args, "--quiet"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{tree}: rotcli {' '.join(args)}: {done.stderr.strip()}")


def _has_srins(tree: Path) -> bool:
    """Return whether an installation has the group of commands `rotcli srins`."""
    return '"srins":' in (tree / "rotcli/cli/main.py").read_text(encoding="utf-8")


def process(tree: Path, folder: Path, name: str) -> None:
    """Process one run's logs in a folder; results are named NAME.json."""
    if name == "voyage":
        first = ["srins", "calibrate"] if _has_srins(tree) else ["calibrate", "--method", "srins"]
        logs = ["imu.parquet", "table.parquet", "--reference", "gnss.parquet"]
        more = ["--speed", "doppler.parquet", "--truth", "truth.json"]
        rotcli(tree, folder, *first, *logs, *more, "-o", "srins.json")
        return
    logs = ["imu.parquet", "table.parquet"]
    if "still" in name:
        rotcli(tree, folder, "navigate", *logs, "--mode", "conventional", "-o", "still.json")
        rotcli(tree, folder, "allan", "imu.parquet", "-o", "allan.json")
        return
    rotcli(tree, folder, "calibrate", *logs, "-o", "calibration.json")
    calibration = ["--calibration", "calibration.json"]
    modes = ["--mode", "partial", "--mode", "full"]
    rotcli(tree, folder, "navigate", *logs, *modes, *calibration, "-o", "{mode}.json")
    rotcli(tree, folder, "observe", *logs, *calibration, "-o", "observe.json")


def numbers(value: object, place: str = "") -> Iterator[tuple[str, float, float]]:
    """Yield (place, number, scale) of a document; scale is the largest number of its list."""
    if isinstance(value, dict):
        scale = max((abs(v) for v in value.values() if isinstance(v, float)), default=0.0)
        for key, item in value.items():
            if key in SKIPPED and "/" not in place.strip("/"):
                continue
            if isinstance(item, float):
                yield (
                    f"{place}/{key}",
                    item,
                    scale if place.endswith(("rms", "max", "final")) else abs(item),
                )
            else:
                yield from numbers(item, f"{place}/{key}")
    elif isinstance(value, list):
        scale = max((abs(v) for v in value if isinstance(v, float)), default=0.0)
        for k, item in enumerate(value):
            if isinstance(item, float):
                yield f"{place}/{k}", item, scale
            else:
                yield from numbers(item, f"{place}/{k}")


def differences(old: object, new: object) -> list[Difference]:
    """Return the numbers that both documents contain, with their relative differences.

    Raises SystemExit for a number that only the old document contains.
    """
    after = {place: value for place, value, _ in numbers(new)}
    found = []
    for place, before, scale in numbers(old):
        if place not in after:
            raise SystemExit(f"{place}: missing in the new result")
        gap = abs(after[place] - before)
        relative = gap / max(abs(before), ROUNDING * scale, 1e-300)
        found.append(Difference(place, before, after[place], relative))
    return found


def main() -> None:
    """Compare two installations and print what differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--tolerance", type=float, default=1e-12)
    options = parser.parse_args()
    trees = options.old.resolve(), options.new.resolve()
    beyond = 0
    with tempfile.TemporaryDirectory() as base:
        for name, words in {**RUNS, "voyage": VOYAGE}.items():
            folders = [Path(base) / side / name for side in ("old", "new")]
            folders[0].parent.mkdir(exist_ok=True)
            command = ["simulate"]
            if name == "voyage" and _has_srins(trees[0]):
                command = ["srins", "simulate"]
            rotcli(trees[0], Path(base), *command, *words, "-o", str(folders[0]))
            folders[1].mkdir(parents=True)
            for file in folders[0].iterdir():
                (folders[1] / file.name).symlink_to(file)
            for tree, folder in zip(trees, folders, strict=True):
                process(tree, folder, name)
            for result in sorted(folders[0].glob("*.json")):
                if result.name == "truth.json":
                    continue
                pair = [json.loads((f / result.name).read_text()) for f in folders]
                found = differences(*pair)
                worst = max(found, key=lambda d: d.relative)
                print(f"{name}/{result.name}: {len(found)} numbers, worst {worst.relative:.1e}")
                for place in (d for d in found if d.relative > options.tolerance):
                    beyond += 1
                    print(f"  {place.place}: {place.old!r} -> {place.new!r} ({place.relative:.1e})")
    print(f"{beyond} numbers beyond {options.tolerance:g}")
    sys.exit(beyond > 0)


if __name__ == "__main__":
    main()
