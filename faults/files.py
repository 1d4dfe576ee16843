"""Writers that are killed, interrupted or refused by the system: the target is old or new.

Every trial returns None when nothing was lost, else what happened.
"""

import contextlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from faults.silent import clean, rotcli, write
from rotcli.logs.write import write_columns

OLD = b"an older result\n"
_ROOT = Path(__file__).parents[1]


def prepare(folder: Path) -> None:
    """Write the small logs and results that the commands read."""
    for name, still in (("run", False), ("still", True)):
        write(clean("nav440", 30.0, 3, still=still), folder / name)
    table = clean("nav440", 30.0, 3).table
    write_columns(folder / "run" / "table.csv", table)
    made = rotcli(["calibrate", "run/imu.parquet", "run/table.parquet", "-o", "c.json"], cwd=folder)
    assert made.returncode == 0, made.stderr


# Command line, and the files that it writes.
WRITERS: dict[str, tuple[list[str], list[str]]] = {
    line.split()[0]: (line.split(), targets)
    for line, targets in (
        (
            "simulate --imu nav440 --rate 20 --static 20 --rotation 20 --navigation 20 --csv "
            "-o made",
            ["made/imu.csv", "made/table.csv", "made/rig.toml", "made/truth.json"],
        ),
        (
            "allan still/imu.parquet -o o.json --plot p.svg --to-rig r.toml",
            ["o.json", "p.svg", "r.toml"],
        ),
        (
            "calibrate run/imu.parquet run/table.parquet -o o.json --report-residuals s.csv",
            ["o.json", "s.csv"],
        ),
        (
            "navigate run/imu.parquet run/table.parquet --calibration c.json -o o.json "
            "--solution s.parquet",
            ["o.json", "s.parquet"],
        ),
        (
            "observe run/imu.parquet run/table.parquet -o o.json --solution s.csv.gz "
            "--save-calibration k.json",
            ["o.json", "s.csv.gz", "k.json"],
        ),
        ("budget --imu nav440 --rate 10 -o o.json", ["o.json"]),
        ("report c.json -o o.html", ["o.html"]),
        ("convert run/imu.parquet -o s.csv", ["s.csv"]),
    )
}


def old_files(folder: Path, command: str) -> dict[str, bytes]:
    """Put older files where a command writes; return what they hold."""
    rig = b"# The rig of a simulated log: older\n"
    held = {}
    for name in WRITERS[command][1]:
        held[name] = rig if name.endswith(".toml") else OLD
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(held[name])
    return held


def new_files(folder: Path, command: str) -> tuple[dict[str, bytes], float]:
    """Run a command undisturbed; return what it wrote and how long it took, s."""
    old_files(folder, command)
    start = time.monotonic()
    done = rotcli(WRITERS[command][0], cwd=folder)
    assert done.returncode == 0, done.stderr
    taken = time.monotonic() - start
    return {name: (folder / name).read_bytes() for name in WRITERS[command][1]}, taken


def litter(folder: Path) -> list[str]:
    """Return the drafts that lie about."""
    return [str(p) for p in folder.rglob(".*.part")]


def damaged(folder: Path, *states: dict[str, bytes]) -> str | None:
    """Return the first file that is neither of the states; one may be gone where it may be."""
    for name in states[0]:
        path = folder / name
        if not path.exists():
            if name.endswith("truth.json"):  # taken away first, written last
                continue
            return f"{name} is gone"
        if path.read_bytes() not in [state[name] for state in states]:
            return f"{name} is neither the old nor the new file"
    return None


def start(args: list[str], folder: Path, **options) -> subprocess.Popen:
    """Start the command line in a process of its own, pipes at its outputs."""
    environment = {**os.environ, "PYTHONPATH": str(_ROOT)}
    program = [sys.executable, "-m", "rotcli", *args]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.Popen(program, cwd=folder, env=environment, **options)


def killed(
    folder: Path, command: str, new: dict[str, bytes], taken: float, rng: random.Random
) -> str | None:
    """Kill -9 a writer: at a random moment, or soon after a draft appears; look at the targets."""
    old = old_files(folder, command)
    process = start(WRITERS[command][0], folder)
    delay = rng.uniform(0.0, 1.1 * taken)
    if rng.random() < 0.5:  # in the midst of writing, at this or a later file
        before = set(litter(folder))
        limit = time.monotonic() + 20.0
        while not set(litter(folder)) - before and process.poll() is None:
            if time.monotonic() > limit:
                break
        delay = rng.choice([0.0, rng.uniform(0.0, 0.02)])
    time.sleep(delay)
    process.kill()
    process.communicate()
    return damaged(folder, old, new)


def cleaned(folder: Path, command: str) -> str | None:
    """Run a command to its end; no draft may remain."""
    done = rotcli(WRITERS[command][0], cwd=folder)
    left = litter(folder)
    return done.stderr if done.returncode else f"left {left}" if left else None


def interrupted(
    folder: Path, command: str, new: dict[str, bytes], taken: float, rng: random.Random
) -> str | None:
    """Interrupt a writer (Ctrl-C) at a random moment once it runs."""
    old = old_files(folder, command)
    process = start(WRITERS[command][0], folder)
    time.sleep(rng.uniform(0.15, 1.0) * taken)
    process.send_signal(signal.SIGINT)
    err = process.communicate()[1].decode()
    lost = damaged(folder, old, new) or (litter(folder) and "left a draft")
    if lost or process.returncode == 0:
        return lost or None
    lines = [line for line in err.splitlines() if "warning" not in line]
    # Before the program's first line runs the interpreter itself answers.
    early = process.returncode == -signal.SIGINT or ("rotcli/cli" not in err and "site" in err)
    if process.returncode == 130 and len(lines) == 1 and "rotcli: interrupted" in lines[0]:
        return None
    return None if early else f"{process.returncode}: {err[-400:]}"


def full(folder: Path, command: str, limit: int) -> str | None:
    """Run a writer that may write no file past `limit` bytes."""
    old = old_files(folder, command)
    whole = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)

    def restrict() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, whole[1]))

    done = rotcli(WRITERS[command][0], cwd=folder, preexec_fn=restrict)
    if done.returncode == 0:
        return None if not litter(folder) else "left a draft"
    return _refused(folder, done, old)


def _refused(folder: Path, done, old: dict[str, bytes]) -> str | None:
    """Tell what is wrong with a refusal: one line, exit 1, no litter, every file old or whole."""
    lines = [line for line in done.stderr.splitlines() if "error:" in line]
    if done.returncode != 1 or len(lines) != 1 or "Traceback" in done.stderr:
        return f"{done.returncode}: {done.stderr[-400:]}"
    if "cannot be written" not in lines[0]:
        return lines[0]
    for name, content in old.items():
        path = folder / name
        if path.exists() and path.read_bytes() != content and not path.stat().st_size:
            return f"{name} is empty"
    return "left a draft" if litter(folder) else None


@contextlib.contextmanager
def mounted(folder: Path, options: str) -> Iterator[bool]:
    """Mount a small memory file system on a folder; gives False where that is not allowed."""
    folder.mkdir(parents=True, exist_ok=True)
    program = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    try:
        done = subprocess.run(program, capture_output=True, check=False)
    except OSError:
        yield False
        return
    try:
        yield done.returncode == 0
    finally:
        if done.returncode == 0:
            subprocess.run(["umount", str(folder)], check=False)


def on_small_disk(folder: Path, command: str, kilobytes: int) -> str | None:
    """Run a writer on a disk of some kilobytes; None as well where none can be mounted."""
    place = folder / "small"
    with mounted(place, f"size={kilobytes}k") as there:
        if not there:
            return None
        done = rotcli(_into(command, "small"), cwd=folder)
        left = litter(place)
        if done.returncode == 0:
            return "left a draft" if left else None
        ok = done.returncode == 1 and done.stderr.count("error:") == 1 and not left
        return None if ok and "Traceback" not in done.stderr else done.stderr[-400:]


def into_read_only(folder: Path, command: str) -> str | None:
    """Run a writer into a folder that may not be written; None where none can be made."""
    place = folder / "locked"
    with mounted(place, "ro,size=64k") as there:
        if not there:
            return None
        done = rotcli(_into(command, "locked"), cwd=folder)
        ok = done.returncode == 1 and done.stderr.count("error:") == 1
        ok = ok and "cannot be written: Read-only" in done.stderr
        return None if ok else f"{done.returncode}: {done.stderr[-400:]}"


def _into(command: str, place: str) -> list[str]:
    args, targets = WRITERS[command]
    names = {*targets, *(name.split("/")[0] for name in targets)}
    return [f"{place}/{arg}" if arg in names else arg for arg in args]


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
    import re

    err = process.communicate()[1].decode()
    target = (folder / "o.json").read_bytes()
    if process.returncode == 0:
        return None if json.loads(target)["kind"] == "calibration" else "no whole result"
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


def piped(folder: Path, args: list[str]) -> str | None:
    """Close standard output while a command writes to it, as `| head` does."""
    read, write_end = os.pipe()
    process = start(args, folder, stdout=write_end)
    os.close(write_end)
    os.close(read)
    err = process.communicate()[1].decode()
    quiet = "Traceback" not in err and "Exception" not in err and "error" not in err
    return None if quiet and process.returncode in (0, 141) else f"{process.returncode}: {err}"


def failed_recipe(folder: Path) -> str | None:
    """Run make -j with a rotcli that writes half and fails; no target may look done."""
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(_ROOT / name, folder)
    (folder / "venv").mkdir()
    (folder / "venv" / "installed").touch()
    fake = folder / "fake"
    fake.write_text(
        '#!/bin/sh\nwhile [ $# -gt 0 ]; do [ "$1" = -o ] && out=$2; shift; done\n'
        'case "$out" in *.json) echo half > "$out";; *) mkdir -p "$out"; '
        'for f in imu.parquet table.parquet rig.toml; do echo half > "$out/$f"; done;; esac\n'
        "sleep 0.02; exit 1\n"
    )
    fake.chmod(0o755)
    program = ["make", "-k", "-j4", f"ROTCLI={fake}", f"VENV={folder}/venv", "campaign"]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")}
    done = subprocess.run(program, cwd=folder, capture_output=True, check=False, env=environment)
    # make may take a sibling of a failed target for older; without its truth a run is not done.
    left = [str(p) for p in (folder / "campaign").rglob("*.json")]
    return f"left {left[:5]}" if left or done.returncode == 0 else None
