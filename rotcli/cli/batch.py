"""`--batch`: one command over many runs, in a pool of processes or on a Dask cluster.

A run is a folder that holds `imu.*` and, but for still ones, `table.*`, and if need be `rig.toml`
and `calibration.json`, as `rotcli simulate` makes them. Every run's results are those of the
command given its files alone; a run that fails leaves the others as they are.
"""

import glob
import importlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

from rotcli.cli.delivery import check_outputs
from rotcli.errors import RotcliError

Function = TypeVar("Function", bound=Callable[..., Any])

_SUFFIXES = (".parquet", ".csv", ".csv.gz", ".csv.zst")
_RESULTS = {"calibrate": "calibration", "navigate": "navigation"}
_FILES = ("solution", "plot", "report_residuals")  # options that name files beside the result
_BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Job:
    """One run: what to call with which files, and the folder that takes the results."""

    command: str
    imu: str
    table: str | None
    into: str
    given: dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What became of a run: the error, if any, and how many warnings its results hold."""

    run: str
    error: str | None = None
    warnings: int = 0


def options(function: Function) -> Function:
    """Add `--batch`, `--jobs` and `--scheduler`."""
    function = click.option(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help="Hand the runs of --batch to this Dask cluster (pip install rotcli[dask]).",
    )(function)
    function = click.option(
        "--jobs",
        metavar="N",
        type=click.IntRange(min=1),
        help="Processes for --batch [default: one for each core].",
    )(function)
    return click.option(
        "--batch",
        metavar="DIR|GLOB",
        help="Work on every run (a folder with imu.*, table.*, rig.toml) below DIR or matching "
        "GLOB instead of one log; results go beside the logs, or below the folder -o.",
    )(function)


def needed(log: str | None, name: str) -> str:
    """Return a log argument of a single run, which must be there."""
    if log is None:
        raise click.UsageError(f"Missing argument '{name}' (or --batch DIR).")
    return log


def run(
    command: str,
    logs: Sequence[str | None],
    output: str | None,
    quiet: bool,
    given: dict[str, Any],
) -> None:
    """Run a command over every run of `--batch`; exit 1 when one failed."""
    if any(logs):
        raise click.UsageError("--batch takes its logs from the runs: leave out IMU_LOG, TABLE_LOG")
    if output == "-":
        raise click.UsageError("-o: --batch writes one result for each run: name a folder")
    far = given["scheduler"]
    jobs = _jobs(command, output, given)
    if far and given["jobs"]:
        raise click.UsageError("--jobs: the cluster of --scheduler has workers of its own")
    count = min(given["jobs"] or len(os.sched_getaffinity(0)), len(jobs))
    outcomes: dict[str, Outcome] = {}
    with _bar(len(jobs), quiet) as told, _engine(jobs, count, far) as done:
        for outcome in done:
            outcomes.setdefault(outcome.run, outcome)
            told(1)
    failed = [outcomes[job.into] for job in jobs if outcomes[job.into].error]
    for outcome in failed:
        click.echo(f"rotcli: error: {outcome.error}", err=True)
    if failed:
        others = (
            f"; the other {len(jobs) - len(failed)} are done" if len(failed) < len(jobs) else ""
        )
        raise RotcliError(f"{len(failed)} of {len(jobs)} runs failed{others}")
    if not quiet:
        warned = sum(1 for outcome in outcomes.values() if outcome.warnings)
        told_of = f", {warned} with warnings (in the results)" if warned else ""
        click.echo(f"rotcli: {len(jobs)} run{'s' * (len(jobs) > 1)} done{told_of}", err=True)


def _jobs(command: str, output: str | None, given: dict[str, Any]) -> list[Job]:
    """Return the jobs of all runs, in the order of their folders' names."""
    pattern, far = given["batch"], given["scheduler"]
    top = Path(pattern)
    if top.is_dir():
        folders = {Path(place) for place, _, _ in os.walk(top)}
    else:
        found = [Path(name) for name in glob.glob(pattern, recursive=True)]  # noqa: PTH207
        folders = {path if path.is_dir() else path.parent for path in found}
        top = Path(os.path.commonpath([f.parent for f in folders])) if folders else top
    jobs = []
    for folder in sorted(folders):
        imu = _log(folder, "imu")
        if imu is None:
            continue
        named = {**given}
        into = Path(output) / (os.path.relpath(folder, top)) if output else folder
        if far:
            folder, into = folder.resolve(), into.resolve()
            imu = folder / imu.name
        own = folder / "calibration.json"
        if command == "navigate" and not given["calibration"] and own.is_file():
            named["calibration"] = str(own)
        for option in _FILES:
            if given.get(option):
                named[option] = str(into / given[option])
        for option in ("calibration", "rig_path") if far else ():
            named[option] = named.get(option) and str(Path(named[option]).resolve())
        table = _log(folder, "table")
        named_table = None if table is None else str(table)
        check_outputs(
            [named_table, named.get("rig_path"), named.get("calibration")],
            {f"--{o.replace('_', '-')}": named.get(o) for o in _FILES},
            log=str(imu),
        )
        jobs.append(Job(command, str(imu), named_table, str(into), named))
    if not jobs:
        raise RotcliError(
            f"{pattern}: no run found: a run is a folder with imu.parquet or imu.csv; "
            "name the folder above them, or a pattern in quotes"
        )
    return jobs


def _log(folder: Path, stem: str) -> Path | None:
    """Return the log of a run; raises RotcliError where there are two, for either may be meant."""
    there = [path for suffix in _SUFFIXES if (path := folder / f"{stem}{suffix}").is_file()]
    if len(there) > 1:
        names = " and ".join(path.name for path in there)
        raise RotcliError(f"{folder}: {names} are both there: take one of them away")
    return there[0] if there else None


def work(job: Job) -> Outcome:
    """Do one run and write its results; an expected error comes back as text."""
    try:
        return _work(job)
    except RotcliError as error:
        return Outcome(job.into, " ".join(str(error).split()))
    except Exception as fault:  # a fault of ours must not cost the other runs
        kind = type(fault).__name__
        return Outcome(job.into, f"{job.imu}: unexpected {kind}: {' '.join(str(fault).split())}")


def _work(job: Job) -> Outcome:
    from rotcli.results.files import unwritable, write_result

    module = importlib.import_module(f"rotcli.cli.{job.command}")
    if job.command == "calibrate" and job.table is None:
        raise RotcliError(f"{Path(job.imu).parent}: no table.parquet or table.csv beside the log")
    if set(job.given.get("modes", ())) - {"conventional"} and not job.given["calibration"]:
        raise RotcliError(
            f"{Path(job.imu).parent}: no calibration.json: partial and full need one; "
            "calibrate first, or name one with --calibration"
        )
    try:
        Path(job.into).mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise unwritable(job.into, fault) from fault
    docs = module.documents(job.imu, job.table, job.given)
    stem = _RESULTS[job.command]
    for doc in docs:
        name = f"{stem}-{doc['mode']}.json" if len(docs) > 1 else f"{stem}.json"
        write_result(str(Path(job.into) / name), doc)
    return Outcome(job.into, warnings=sum(len(doc["warnings"]) for doc in docs))


@contextmanager
def _bar(length: int, quiet: bool) -> Iterator[Callable[[int], Any]]:
    if quiet or not sys.stderr.isatty():
        yield lambda steps: None
        return
    with click.progressbar(length=length, label="runs", file=sys.stderr, show_pos=True) as bar:
        yield bar.update


@contextmanager
def _engine(jobs: list[Job], count: int, scheduler: str | None) -> Iterator[Iterator[Outcome]]:
    """Give the outcomes as they come, whatever does the work."""
    if scheduler:
        with _cluster(jobs, scheduler) as done:
            yield done
    elif count == 1:
        yield map(work, jobs)
    else:
        with _pool(jobs, count) as done:
            yield done


@contextmanager
def _pool(jobs: list[Job], count: int) -> Iterator[Iterator[Outcome]]:
    """Work in processes that are forked from one that has imported everything once."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool

    for name in _BLAS:  # every core has a run of its own
        os.environ.setdefault(name, "1")
    kinds = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in kinds else "spawn")
    pool = None
    try:
        try:
            if "forkserver" in kinds:
                context.set_forkserver_preload(["rotcli.cli.batch_imports"])
                _start_deaf_server()
            with _interrupt_later():
                pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin)
                running = {pool.submit(_interruptible, job): job for job in jobs}
        except OSError as fault:
            what = f"no processes can be started: {fault.strerror or fault}; say --jobs 1"
            raise RotcliError(f"--jobs {count}: {what}") from fault

        def outcomes() -> Iterator[Outcome]:
            for future in as_completed(running):
                try:
                    yield future.result()
                except BrokenProcessPool:
                    what = "its process died (out of memory?); try again with fewer --jobs"
                    yield Outcome(running[future].into, f"{running[future].imu}: {what}")

        yield outcomes()
    finally:
        if pool is not None:
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _interrupt_later() -> Iterator[None]:
    """Hold an interrupt back to the end: processes are not left half-started."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    come: list[int] = []
    held = signal.signal(signal.SIGINT, lambda number, _: come.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, held)
    if come:
        raise KeyboardInterrupt


def _start_deaf_server() -> None:
    """Start the process that workers are forked from; an interrupt is none of its business."""
    from multiprocessing import forkserver

    if threading.current_thread() is not threading.main_thread():
        return
    held = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        forkserver.ensure_running()
    finally:
        signal.signal(signal.SIGINT, held)


def _begin() -> None:
    """Make a worker deaf to interrupts between runs, mortal, and leave it one core."""
    import pyarrow as pa

    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pa.set_cpu_count(1)


def _end_with_parent() -> None:
    """End a worker whose parent was killed: nobody would ever give it work, or stop it."""
    from multiprocessing import connection, parent_process

    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _interruptible(job: Job) -> Outcome:
    """Do one run; an interrupt ends it without a trace, and the parent says so."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return work(job)
    except KeyboardInterrupt:
        return Outcome(job.into, f"{job.imu}: interrupted")
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _cluster(jobs: list[Job], scheduler: str) -> Iterator[Iterator[Outcome]]:
    """Work on a Dask cluster that sees the same files; a dead worker's runs go to the others."""
    try:
        import distributed
    except ImportError as missing:
        what = "--scheduler needs Dask: pip install rotcli[dask]"
        raise RotcliError(what) from missing
    try:
        client = distributed.Client(scheduler, timeout=20, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as fault:
        raise RotcliError(
            f"{scheduler}: no Dask scheduler answers: {' '.join(str(fault).split())}; "
            "check the address, as dask scheduler printed it"
        ) from fault
    with client:
        running = {client.submit(work, job, pure=False, retries=2): job for job in jobs}

        def outcomes() -> Iterator[Outcome]:
            for future in distributed.as_completed(running, loop=client.loop):
                error = future.exception()
                if error is None:
                    yield future.result()
                else:
                    what = f"the cluster gave up: {type(error).__name__}: {error}"
                    yield Outcome(running[future].into, f"{running[future].imu}: {what}")

        try:
            yield outcomes()
        except BaseException:
            client.cancel(list(running))
            raise
