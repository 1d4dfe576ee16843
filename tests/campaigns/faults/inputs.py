"""Inputs that vanish, grow or are the output too; two processes with one target.

Every trial returns None when nothing was lost, else a description.
"""

import json
import random
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

from rotcli.files.columns import write_columns
from tests.campaigns.faults.runs import clean, rotcli
from tests.campaigns.faults.writers import OLD, SEA, litter, start


def vanished(folder: Path, rng: random.Random) -> str | None:
    """Take the input away at a random moment."""
    (folder / "o.json").write_bytes(OLD)
    log = folder / "gone.parquet"
    shutil.copy(folder / "run" / "imu.parquet", log)
    args = ["calibrate", "gone.parquet", "run/table.parquet", "--rig", "run/rig.toml"]
    process = start([*args, "-o", "o.json"], folder)
    time.sleep(rng.uniform(0.0, 0.6))
    log.unlink()
    return _one_line(folder, process, "cannot be read")


def growing(folder: Path, rng: random.Random) -> str | None:
    """Append to the input while it is read; the result is of one state of it, or refused."""
    (folder / "o.json").write_bytes(OLD)
    log = folder / "growing.csv"
    write_columns(log, clean("nav440", 30.0, 3).imu)
    last = log.read_text().splitlines()[-1].split(",")
    args = ["calibrate", "growing.csv", "run/table.parquet", "--rig", "run/rig.toml"]
    process = start([*args, "-o", "o.json"], folder)
    stop = time.monotonic() + rng.uniform(0.2, 0.9)
    time.sleep(rng.uniform(0.0, 0.3))
    with log.open("a") as stream:
        k = 1
        while time.monotonic() < stop and process.poll() is None:
            row = [repr(float(last[0]) + 0.01 * k), *last[1:]]
            stream.write(",".join(row) + "\n")
            stream.flush()
            k += 1
            time.sleep(0.002)
    return _one_line(folder, process, "changed|values where|not a number|lies outside|spans")


def _one_line(folder: Path, process: subprocess.Popen, expected: str) -> str | None:
    err = process.communicate()[1].decode()
    target = (folder / "o.json").read_bytes()
    if process.returncode == 0:
        return None if json.loads(target)["kind"] == "calibration" else "no complete result"
    ok = process.returncode == 1 and err.count("error:") == 1 and target == OLD
    return None if ok and re.search(expected, err) and not litter(folder) else err[-400:]


def two_writers(folder: Path) -> str | None:
    """Let two processes write one target; it is the one's or the other's."""
    target = folder / "s.csv"
    states = []
    lines = [f"convert {log}/imu.parquet -o s.csv".split() for log in ("run", "still")]
    for args in lines:
        assert rotcli(args, cwd=folder).returncode == 0
        states.append(target.read_bytes())
    target.write_bytes(OLD)
    processes = [start(args, folder) for args in lines]
    codes = [(p.communicate()[1].decode(), p.returncode) for p in processes]
    if any(code for _, code in codes):
        return str(codes)
    if target.read_bytes() not in states:
        return "neither the one's result nor the other's"
    return "left a draft" if litter(folder) else None


def two_simulations(folder: Path) -> str | None:
    """Let two simulations write into one folder: one is refused, or the files are of one of them.

    Seeds differ, so that a mixture shows.
    """
    shutil.rmtree(folder / "both", ignore_errors=True)
    line = "simulate --imu nav440 --rate 20 --static 20 --rotation 20 --navigation 20 -o"
    states = []
    for seed in ("1", "2"):
        assert rotcli([*line.split(), "both", "--seed", seed], cwd=folder).returncode == 0
        states.append({p.name: p.read_bytes() for p in (folder / "both").iterdir()})
    processes = [start([*line.split(), "both", "--seed", s], folder) for s in ("1", "2")]
    done = [(p.communicate()[1].decode(), p.returncode) for p in processes]
    for err, code in done:
        if code and (code != 1 or "another simulation writes here" not in err):
            return err[-400:]
    if {p.name: p.read_bytes() for p in (folder / "both").iterdir()} not in states:
        return f"a mixture of two simulations: {done}"
    return "left a draft" if litter(folder) else None


# Command lines without their outputs, the options that write, and the files that are read.
READERS: dict[str, tuple[str, str, str]] = {
    "allan": ("allan still/imu.parquet", "-o --plot", "still/imu.parquet still/rig.toml"),
    "allan --to-rig": ("allan still/imu.parquet", "--to-rig", "still/imu.parquet"),
    "calibrate": (
        "calibrate run/imu.parquet run/table.parquet",
        "-o --report-residuals",
        "run/imu.parquet run/table.parquet run/rig.toml",
    ),
    "calibrate, a voyage": (
        f"srins calibrate {SEA} --speed sea/doppler.parquet --truth sea/truth.json",
        "-o --solution --plot",
        " ".join(f"sea/{name}.parquet" for name in ("imu", "table", "gnss", "doppler"))
        + " sea/rig.toml sea/truth.json",
    ),
    "navigate": (
        "navigate run/imu.parquet run/table.parquet --calibration c.json",
        "-o --solution --plot",
        "run/imu.parquet run/table.parquet run/rig.toml c.json",
    ),
    "observe": (
        "observe run/imu.parquet run/table.parquet --calibration c.json",
        "-o --solution --plot --save-calibration",
        "run/imu.parquet run/table.parquet run/rig.toml c.json",
    ),
    "observe, a voyage": ("srins observe --rig sea/rig.toml", "-o", "sea/rig.toml"),
    "budget": (
        "budget --calibration c.json --rig run/rig.toml --rate 30",
        "-o --plot",
        "c.json run/rig.toml",
    ),
    "report": ("report c.json", "-o", "c.json"),
    "convert": ("convert run/imu.parquet", "-o", "run/imu.parquet run/rig.toml"),
}


def over_input(folder: Path, command: str) -> Iterator[str | None]:
    """Name each input as each output, by its path, a link and a detour: refused, and untouched."""
    line, options, inputs = READERS[command]
    link = folder / "link"
    for option in options.split():
        for name in inputs.split():
            older = (folder / name).read_bytes()
            link.unlink(missing_ok=True)
            link.symlink_to(name)
            for target in (name, "link", f"run/../{name}"):
                done = rotcli([*line.split(), option, target], cwd=folder)
                if (folder / name).read_bytes() != older:
                    (folder / name).write_bytes(older)
                    yield f"{option} {target}: the input is lost"
                elif done.returncode not in (1, 2) or "Traceback" in done.stderr:
                    yield f"{option} {target}: {done.returncode}: {done.stderr[-200:]}"
                else:
                    yield None
