"""Dask clusters without workers, of another version, whose scheduler or worker dies, near code.

Every trial returns None when the command does the right thing, else what happened.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tests.campaigns.faults import runs, writers

COUNT = 40  # runs of a batch
_PROGRAM = (sys.executable, "-m", "dask")
_LOCAL = ("--host", "127.0.0.1", "--no-dashboard")


def no_worker(folder: Path) -> str | None:
    """Start a batch on a scheduler without a worker: reported within seconds."""
    with _scheduler() as (_, address):
        start = time.monotonic()
        done = _batch(folder, address)
        if time.monotonic() - start > 30.0:
            return "waited for more than 30 s"
    return _one_line(done, "no worker is connected after 10 s; start one with dask worker")


def another_version(folder: Path) -> str | None:
    """Start a batch on a worker with another version of rotcli: refused."""
    other = folder / "other"
    shutil.copytree(writers.ROOT / "rotcli", other / "rotcli", dirs_exist_ok=True)
    (other / "rotcli" / "version.py").write_text('__version__ = "0.0.1"\n')
    with _scheduler() as (_, address), _worker(address, other, PYTHONPATH=str(other)):
        done = _batch(folder, address)
    return _one_line(done, "has rotcli 0.0.1, this is rotcli")


def scheduler_killed(folder: Path) -> str | None:
    """Kill -9 the scheduler when some runs are done: one line, and their results are kept."""
    with _scheduler() as (scheduler, address), _worker(address):
        batch = _start_batch(folder, address)
        scheduler.kill()
        out, err = batch.communicate(timeout=60.0)
    done = subprocess.CompletedProcess(batch.args, batch.returncode, out, err)
    if not 0 < len(_results(folder)) < COUNT:
        return f"{len(_results(folder))} results of {COUNT}"
    return _one_line(done, "the scheduler was lost; finished runs are kept, run the others again")


def worker_killed(folder: Path) -> str | None:
    """Kill -9 one of two workers: its runs go to the other one, and every run is done."""
    with _scheduler() as (_, address), _worker(address) as first, _worker(address):
        batch = _start_batch(folder, address)
        os.killpg(first.pid, signal.SIGKILL)
        _, err = batch.communicate(timeout=120.0)
    right = batch.returncode == 0 and len(_results(folder)) == COUNT
    return None if right else f"{batch.returncode}, {len(_results(folder))} results: {err[-200:]}"


def planted_code(folder: Path) -> str | None:
    """Start a worker and a batch in a folder with modules: none of them is executed."""
    place = folder / "planted"
    place.mkdir(exist_ok=True)
    for name in ("click", "selectors", "socket", "pyarrow"):
        (place / f"{name}.py").write_text(f"open({str(place / 'executed')!r}, 'w')\n")
    with _scheduler() as (_, address), _worker(address, place, PYTHONSAFEPATH="1"):
        done = _batch(folder, address, place)
    if (place / "executed").exists():
        return "a module of the folder was executed"
    return None if done.returncode == 0 else f"{done.returncode}: {done.stderr[-200:]}"


TRIALS: dict[str, Callable[[Path], str | None]] = {
    "cluster without a worker: reported after 10 s": no_worker,
    "cluster with another version of rotcli: refused": another_version,
    "cluster whose scheduler is killed amid a batch: one line": scheduler_killed,
    "cluster of which a worker is killed amid a batch: every run done": worker_killed,
    "cluster and batch in a folder with planted modules: not executed": planted_code,
}


@contextmanager
def _process(command: list[str], **options) -> Iterator[subprocess.Popen]:
    """Start a process in a group of its own; all of the group are killed at the end."""
    process = subprocess.Popen(command, start_new_session=True, text=True, **options)
    try:
        yield process
    finally:
        os.killpg(process.pid, signal.SIGKILL) if process.poll() is None else None
        process.wait()


@contextmanager
def _scheduler() -> Iterator[tuple[subprocess.Popen, str]]:
    """Start a scheduler; yield it and its address."""
    command = [*_PROGRAM, "scheduler", *_LOCAL, "--port", "0"]
    with _process(command, stderr=subprocess.PIPE) as scheduler:
        assert scheduler.stderr is not None
        for line in scheduler.stderr:
            if match := re.search(r"Scheduler at:\s+(tcp://\S+)", line):
                break
        else:
            raise RuntimeError("no scheduler starts")
        threading.Thread(target=scheduler.stderr.read, daemon=True).start()
        yield scheduler, match[1]


@contextmanager
def _worker(address: str, place: Path | None = None, **variables) -> Iterator[subprocess.Popen]:
    """Start a worker of one thread, in a folder, with more environment variables."""
    command = [*_PROGRAM, "worker", address, *_LOCAL, "--nworkers", "1", "--nthreads", "1"]
    environment = {**os.environ, "PYTHONPATH": str(writers.ROOT), **variables}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with ExitStack() as stack:
        if place is not None:  # `python -m` imports from there before it reads the variable
            command[:1] = [sys.executable, "-P"]
        yield stack.enter_context(_process(command, cwd=place, env=environment, **quiet))


def _arguments(folder: Path, address: str) -> list[str]:
    """Make the runs where they are missing; return a command line for all of them."""
    for k in range(COUNT):
        place = folder / "cluster" / f"r{k}"
        place.mkdir(parents=True, exist_ok=True)
        for name in ("imu.parquet", "table.parquet", "rig.toml"):
            shutil.copy(folder / "run" / name, place)
    shutil.rmtree(folder / "clustered", ignore_errors=True)
    target = str(folder / "clustered")
    return ["calibrate", "--batch", str(folder / "cluster"), "--scheduler", address, "-o", target]


def _batch(folder: Path, address: str, place: Path | None = None) -> subprocess.CompletedProcess:
    return runs.rotcli(_arguments(folder, address), cwd=place)


def _start_batch(folder: Path, address: str) -> subprocess.Popen:
    """Start a batch; return it when its first results are there."""
    batch = writers.start(_arguments(folder, address), folder, text=True)
    limit = time.monotonic() + 60.0
    while len(_results(folder)) < 3 and batch.poll() is None and time.monotonic() < limit:
        time.sleep(0.01)
    return batch


def _results(folder: Path) -> list[Path]:
    return list((folder / "clustered").rglob("calibration.json"))


def _one_line(done: subprocess.CompletedProcess, said: str) -> str | None:
    """Return None for an error in one line that contains a text."""
    right = done.returncode == 1 and done.stderr.count("\n") == 1 and said in done.stderr
    return None if right else f"{done.returncode}: {done.stderr[-300:]}"
