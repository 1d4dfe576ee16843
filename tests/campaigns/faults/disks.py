"""Full disks, folders that may not be written: the target is old or new.

Every trial returns None when nothing was lost, else a description.
"""

import contextlib
import re
import resource
import subprocess
from collections.abc import Iterator
from pathlib import Path

from tests.campaigns.faults.runs import rotcli
from tests.campaigns.faults.writers import (
    WRITERS,
    damaged,
    litter,
    old_files,
    old_rig,
    start,
)


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
            older["small/r.toml"] = old_rig("r.toml")
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


def onto_full_disk(folder: Path, line: str) -> str | None:
    """Send standard output to a disk that has no room."""
    with Path("/dev/full").open("wb") as full_disk:
        process = start(line.split(), folder, stdout=full_disk)
        err = process.communicate()[1].decode()
    reported = [text for text in err.splitlines() if not text.startswith("rotcli: warning: ")]
    says = "rotcli: error: standard output: cannot be written: No space left on device"
    ok = process.returncode == 1 and len(reported) == 1 and reported[0].startswith(says)
    return None if ok else f"{process.returncode}: {err[-300:]}"
