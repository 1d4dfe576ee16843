"""Writers that are killed or interrupted: the target is old or new.

Every trial returns None when nothing was lost, else what happened.
"""

import contextlib
import os
import random
import re
import signal
import subprocess
import time
from pathlib import Path

from tests.campaigns.faults.runs import rotcli
from tests.campaigns.faults.writers import (
    WRITERS,
    damaged,
    litter,
    old_files,
    start,
)

INTERRUPTED = "rotcli: interrupted; no partial files remain"


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
