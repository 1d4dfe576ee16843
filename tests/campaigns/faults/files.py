"""Writers that are killed, interrupted or refused by the system: the target is old or new.

Every trial returns None when nothing was lost, else what happened.
"""

import contextlib
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rotcli.files.columns import write_columns
from tests.campaigns.faults.silent import clean, rotcli, write

OLD = b"an older result\n"
INTERRUPTED = "rotcli: interrupted; no partial files remain"
_ROOT = Path(__file__).parents[3]


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
_SEA = "sea/imu.parquet sea/table.parquet --reference sea/gnss.parquet --settle 0.3"
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
            f"srins calibrate {_SEA} -o o.json --solution s.parquet",
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


def _old_rig(name: str) -> bytes:
    of_voyage = "voyage" if "cruise" in name else "log"
    return _RIG.format(mark=f"The rig of a simulated {of_voyage}").encode()


def old_files(folder: Path, command: str) -> dict[str, bytes]:
    """Put older files where a command writes; return their content."""
    older = {}
    for name in WRITERS[command].targets:
        rig = name.endswith("rig.toml") or name == "r.toml"
        older[name] = _old_rig(name) if rig else OLD
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
    environment = {**os.environ, "PYTHONPATH": str(_ROOT)}
    program = [sys.executable, "-m", "rotcli", *args]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.Popen(program, cwd=folder, env=environment, **options)


def _wait(process: subprocess.Popen, delay: float) -> None:
    """Let a process run for a while (s), or to its end where that comes sooner."""
    limit = time.monotonic() + delay
    while process.poll() is None and time.monotonic() < limit:
        time.sleep(min(0.005, max(limit - time.monotonic(), 0.0)))


def _end(process: subprocess.Popen) -> None:
    """Wait for the end of a killed process and of those that it started; raises TimeoutError."""
    process.wait()
    limit = time.monotonic() + 10.0
    while time.monotonic() < limit:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            process.communicate()
            return
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    raise TimeoutError("processes live on after their parent was killed")


def killed(
    folder: Path, command: str, new: dict[str, bytes], taken: float, rng: random.Random
) -> str | None:
    """Kill -9 a writer: at a random moment, or soon after a draft appears; look at the targets."""
    old = old_files(folder, command)
    process = start(WRITERS[command].args, folder, start_new_session=True)
    delay = rng.uniform(0.0, 1.1 * taken)
    if rng.random() < 0.6:  # in the midst of writing, at this or a later file
        before = set(litter(folder))
        limit = time.monotonic() + 20.0
        while not set(litter(folder)) - before and process.poll() is None:
            if time.monotonic() > limit:
                break
        delay = rng.choice([0.0, rng.uniform(0.0, 0.02), rng.uniform(0.0, 0.3 * taken)])
    _wait(process, delay)
    if WRITERS[command].several and process.poll() is None and rng.random() < 0.5:
        os.killpg(process.pid, signal.SIGKILL)  # with its workers
    else:
        process.kill()
    _end(process)
    return damaged(folder, old, new)


def cleaned(folder: Path, command: str, new: dict[str, bytes]) -> str | None:
    """Run a command to its end: every file is the new one, and no draft remains."""
    done = rotcli(WRITERS[command].args, cwd=folder)
    left = litter(folder)
    if done.returncode or left:
        return done.stderr if done.returncode else f"left {left}"
    return damaged(folder, new)


def _listen() -> None:
    """Have an interrupt reach a process whose parent, in the background of a shell, is deaf."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def interrupted(
    folder: Path, command: str, new: dict[str, bytes], taken: float, rng: random.Random
) -> str | None:
    """Interrupt a writer (Ctrl-C) at a random moment once it runs: 130, one line, nothing lost.

    A moment at which the interpreter has not yet come to the program, or the program is done, is
    drawn again: it is no trial.
    """
    for _ in range(20):
        old = old_files(folder, command)
        options = {"start_new_session": True, "preexec_fn": _listen}
        process = start(WRITERS[command].args, folder, **options)
        _wait(process, rng.uniform(0.15, 1.0) * taken)
        with contextlib.suppress(ProcessLookupError):  # it was done
            os.killpg(process.pid, signal.SIGINT)
        err = process.communicate()[1].decode()
        lost = damaged(folder, old, new) or (litter(folder) and "left a draft")
        if lost:
            return lost
        early = process.returncode == -signal.SIGINT or (
            process.returncode == 1 and "/rotcli/" not in err
        )
        if process.returncode == 0 or early:
            taken *= 0.8 if process.returncode == 0 else 1.0
            continue
        lines = [line for line in err.splitlines() if not line.startswith("rotcli: warning: ")]
        lines = [line for line in lines if not re.fullmatch(r"rotcli: \S+: .*", line)]
        if process.returncode == 130 and lines == [INTERRUPTED]:
            return None
        return f"{process.returncode}: {err[-400:]}"
    return "was never caught at work"


def full(folder: Path, command: str, new: dict[str, bytes], limit: int) -> str | None:
    """Run a writer that may write no file past `limit` bytes."""
    old = old_files(folder, command)
    unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)

    def restrict() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, unlimited[1]))

    done = rotcli(WRITERS[command].args, cwd=folder, preexec_fn=restrict)
    if done.returncode == 0:
        return damaged(folder, new) or ("left a draft" if litter(folder) else None)
    return _refused(folder, command, done, "cannot be written") or damaged(folder, old, new)


def limits(new: dict[str, bytes]) -> list[int]:
    """Return sizes (bytes) that cut the files of a writer off: at nothing, amid, before the end."""
    greatest = max(len(content) for content in new.values())
    least = min(len(content) for content in new.values())
    return [0, least - 1, greatest // 2, greatest - 1]


def _refused(folder: Path, command: str, done: subprocess.CompletedProcess, says: str):
    """Return what is wrong with an error: one line, exit 1, no litter; a line for each run."""
    lines = [line for line in done.stderr.splitlines() if "error:" in line]
    if len(lines) == 1 and "no processes can be started" in lines[0]:
        return "left a draft" if litter(folder) else None
    reported = lines[:-1] if WRITERS[command].several else lines
    if WRITERS[command].several and lines and not re.search(r"\d of 2 runs failed", lines[-1]):
        return f"no summary: {lines[-1]}"
    if done.returncode != 1 or not reported or (len(reported) > 1 and not WRITERS[command].several):
        return f"{done.returncode}: {done.stderr[-400:]}"
    if "Traceback" in done.stderr or not all(re.search(says, line) for line in reported):
        return done.stderr[-400:]
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


def on_small_disk(folder: Path, command: str, new: dict[str, bytes], kilobytes: int) -> str | None:
    """Run a writer on a disk of some kilobytes, which must be there to be mounted."""
    place = folder / "small"
    with mounted(place, f"size={kilobytes}k") as there:
        assert there
        older = {}
        if "r.toml" in new:  # a rig that gets figures is there before
            older["small/r.toml"] = _old_rig("r.toml")
            (place / "r.toml").write_bytes(older["small/r.toml"])
        done = rotcli(_into(command, "small"), cwd=folder)
        _below(place, command)
        states = {f"small/{name}": content for name, content in new.items()}
        lost = damaged(folder, {name: older.get(name, b"") for name in states}, states)
        if done.returncode == 0:
            return lost or damaged(folder, states) or ("left a draft" if litter(place) else None)
        return lost or _refused(folder, command, done, "cannot be written|No space left")


def into_read_only(folder: Path, command: str) -> str | None:
    """Run a writer into a folder that may not be written, by anybody: it must be mounted so."""
    place = folder / "locked"
    with mounted(place, "ro,size=64k") as there:
        assert there
        done = rotcli(_into(command, "locked"), cwd=folder)
        left = list(place.iterdir())
        return _refused(folder, command, done, "cannot be (written|made): Read-only") or (
            f"left {left}" if left else None
        )


def _below(place: Path, command: str) -> None:
    """Make the folders in which a target may be missing."""
    for name in WRITERS[command].targets:
        (place / name).parent.mkdir(parents=True, exist_ok=True)


def _into(command: str, place: str) -> list[str]:
    writer = WRITERS[command]
    names = {"out", "made", "cruise", *writer.targets}
    names |= {arg for arg in writer.args if "{mode}" in arg}
    if writer.several:  # the files next to a result go with it
        names -= {"s.parquet"}
    return [f"{place}/{arg}" if arg in names else arg for arg in writer.args]


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
        f"srins calibrate {_SEA} --speed sea/doppler.parquet --truth sea/truth.json",
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


# Command lines that write to standard output, which may have no reader.
PIPED = [
    "allan still/imu.parquet",
    "allan still/imu.parquet -o -",
    "calibrate run/imu.parquet run/table.parquet",
    f"srins calibrate {_SEA} -o -",
    "navigate run/imu.parquet run/table.parquet --calibration c.json -o -",
    "observe run/imu.parquet run/table.parquet -o -",
    "srins observe",
    "budget --imu nav440 --rate 10 -o -",
    "report c.json",
    "report c.json -o -",
    "--help",
]


def headed(folder: Path, line: str) -> str | None:
    """Read one line of a command's output and go away, as `| head -n 1` does."""
    process = start(line.split(), folder)
    assert process.stdout is not None
    first = process.stdout.readline()
    process.stdout.close()
    assert process.stderr is not None
    err = process.stderr.read().decode()
    process.stderr.close()
    code = process.wait()
    quiet = all(x.startswith("rotcli: warning: ") for x in err.splitlines())
    return None if first and quiet and code in (0, 141) else f"{code}: {err[-300:]}"


def onto_full_disk(folder: Path, line: str) -> str | None:
    """Send standard output to a disk that has no room."""
    with Path("/dev/full").open("wb") as full_disk:
        process = start(line.split(), folder, stdout=full_disk)
        err = process.communicate()[1].decode()
    reported = [text for text in err.splitlines() if not text.startswith("rotcli: warning: ")]
    says = "rotcli: error: standard output: cannot be written: No space left on device"
    ok = process.returncode == 1 and len(reported) == 1 and reported[0].startswith(says)
    return None if ok else f"{process.returncode}: {err[-300:]}"


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
        'for f in imu.parquet table.parquet rig.toml; do echo half > "$out/$f"; done;; '
        "esac\n"
        "sleep 0.02; exit 1\n"
    )
    fake.chmod(0o755)
    program = ["make", "-k", "-j4", f"ROTCLI={fake}", f"VENV={folder}/venv"]
    program += ["campaign", "observe", "srins"]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")}
    done = subprocess.run(program, cwd=folder, capture_output=True, check=False, env=environment)
    # make may take a sibling of a failed target for older; without its truth a run is not done.
    left = [str(p) for p in folder.rglob("*.json")]
    return f"left {left[:5]}" if left or done.returncode == 0 else None
