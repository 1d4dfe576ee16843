"""Commands that write files, and the state of their files before and after."""

import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from rotcli.files.columns import write_columns
from tests.campaigns.faults.runs import clean, rotcli, write

OLD = b"an older result\n"


ROOT = Path(__file__).parents[3]


def prepare(folder: Path) -> None:
    """Write the small logs and results that the commands read."""
    for name, motion in (("run", "turning"), ("still", "still")):
        write(clean("nav440", 30.0, 3, motion=motion), folder / name)
        write(clean("nav440", 30.0, 3, motion=motion), folder / "runs" / name)
    shutil.rmtree(folder / "runs" / "still")
    write(clean("nav440", 30.0, 4), folder / "runs" / "other")
    write_columns(folder / "run" / "table.csv", clean("nav440", 30.0, 3).table)
    (folder / "voyage.toml").write_text(
        "scenario = 'srins'\nseed = 1\nduration = 0.6\nrate = 5.0\n"
    )
    lines = [
        ["calibrate", "run/imu.parquet", "run/table.parquet", "-o", "c.json"],
        ["srins", "simulate", "--scenario", "voyage.toml", "-o", "sea"],
    ]
    for k in ("run", "other"):
        line = f"calibrate runs/{k}/imu.parquet runs/{k}/table.parquet -o runs/{k}/calibration.json"
        lines.append(line.split())
    for line in lines:
        made = rotcli(line, cwd=folder)
        assert made.returncode == 0, made.stderr


@dataclass(frozen=True)
class Writer:
    """A command line and the files that it writes; one run in several processes has `several`."""

    args: list[str]
    targets: list[str]
    several: bool = False


_VOYAGE = ("imu", "table", "gnss", "doppler", "truth")


SEA = "sea/imu.parquet sea/table.parquet --reference sea/gnss.parquet --settle 0.3"


WRITERS: dict[str, Writer] = {
    name: Writer(line.split(), targets.split(), several="--batch" in line)
    for name, line, targets in (
        (
            "simulate",
            "simulate --imu nav440 --rate 20 --static 20 --rotation 20 --navigation 20 --csv "
            "-o made",
            "made/imu.csv made/table.csv made/rig.toml made/truth.json",
        ),
        (
            "simulate, a voyage",
            "srins simulate --scenario voyage.toml -o cruise",
            " ".join(f"cruise/{name}.parquet" for name in _VOYAGE)
            + " cruise/rig.toml cruise/scenario.toml cruise/truth.json",
        ),
        (
            "allan",
            "allan still/imu.parquet --axes gyro_z -o o.json --plot p.svg --to-rig r.toml",
            "o.json p.svg r.toml",
        ),
        (
            "calibrate",
            "calibrate run/imu.parquet run/table.parquet -o o.json --report-residuals s.csv",
            "o.json s.csv",
        ),
        (
            "calibrate, a voyage",
            f"srins calibrate {SEA} -o o.json --solution s.parquet",
            "o.json s.parquet",
        ),
        (
            "calibrate, a batch",
            "calibrate --batch runs --jobs 2 -o out --report-residuals s.parquet",
            "out/run/calibration.json out/run/s.parquet out/other/calibration.json "
            "out/other/s.parquet",
        ),
        (
            "navigate",
            "navigate run/imu.parquet run/table.parquet --calibration c.json --mode full "
            "--mode partial -o {mode}.json --solution {mode}.csv",
            "full.json full.csv partial.json partial.csv",
        ),
        (
            "navigate, a batch",
            "navigate --batch runs --jobs 2 -o out --solution s.parquet",
            "out/run/navigation.json out/run/s.parquet out/other/navigation.json "
            "out/other/s.parquet",
        ),
        (
            "observe",
            "observe run/imu.parquet run/table.parquet -o o.json --solution s.csv.gz "
            "--save-calibration k.json",
            "o.json s.csv.gz k.json",
        ),
        ("observe, a voyage", "srins observe -o o.json", "o.json"),
        ("budget", "budget --imu nav440 --rate 10 -o o.json --plot p.svg", "o.json p.svg"),
        ("report", "report c.json -o o.html", "o.html"),
        ("convert", "convert run/imu.parquet -o s.csv.zst", "s.csv.zst"),
    )
}


# A rig as its user wrote it: what --to-rig must keep, comment by comment.
_RIG = (
    "# {mark}: of mine, written by hand\n[site]  # the roof\nlatitude = 51.08\n\n"
    '[imu]\nname = "mine"  # number 7\n# was 3.0\nangle_random_walk = 9.0 # to be measured\n'
    "[table]\naxis = 'z'\n"
)


def old_rig(name: str) -> bytes:
    of_voyage = "voyage" if "cruise" in name else "log"
    return _RIG.format(mark=f"The rig of a simulated {of_voyage}").encode()


def old_files(folder: Path, command: str) -> dict[str, bytes]:
    """Put older files where a command writes; return their content."""
    older = {}
    for name in WRITERS[command].targets:
        rig = name.endswith("rig.toml") or name == "r.toml"
        older[name] = old_rig(name) if rig else OLD
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(older[name])
    return older


def new_files(folder: Path, command: str) -> tuple[dict[str, bytes], float]:
    """Run a command undisturbed; return what it wrote and how long it took, s.

    What it wrote is complete by the reader of its kind, no matter what it is.
    """
    older = old_files(folder, command)
    start = time.monotonic()
    done = rotcli(WRITERS[command].args, cwd=folder)
    assert done.returncode == 0, done.stderr
    taken = time.monotonic() - start
    made = {name: (folder / name).read_bytes() for name in WRITERS[command].targets}
    assert all(made[name] != older[name] for name in made), command
    if "r.toml" in made:
        kept = [line for line in older["r.toml"].decode().splitlines() if "random_walk" not in line]
        lines = made["r.toml"].decode().splitlines()
        assert all(line in lines for line in kept), made["r.toml"]
        assert "# to be measured" in made["r.toml"].decode()
    return made, taken


def litter(folder: Path) -> list[str]:
    """Return the drafts that lie about."""
    return [str(p) for p in folder.rglob(".*.part")]


def damaged(folder: Path, *states: dict[str, bytes]) -> str | None:
    """Return the first file that is in neither of the states; b"" there is for none."""
    for name in states[0]:
        path = folder / name
        older = path.read_bytes() if path.exists() else b""
        allowed = [state[name] for state in states]
        if name.endswith("/truth.json"):  # taken away first, written last
            allowed.append(b"")
        if older not in allowed:
            return f"{name} is gone" if not older else f"{name} is neither the old nor the new file"
    return None


def start(args: list[str], folder: Path, **options) -> subprocess.Popen:
    """Start the command line in a process of its own, pipes at its outputs."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    program = [sys.executable, "-m", "rotcli", *args]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.Popen(program, cwd=folder, env=environment, **options)
