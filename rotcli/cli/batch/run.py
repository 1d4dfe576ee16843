"""`--batch`: one command over many runs, in a pool of processes or on a Dask cluster.

A run is a folder that holds `imu.*` and, but for still ones, `table.*`, and if need be `rig.toml`
and `calibration.json`, as `rotcli simulate` makes them. Every run's results are those of the
command given its files alone; a run that fails leaves the others as they are.
"""

import glob
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import click

from rotcli.cli.batch.job import Job, Outcome
from rotcli.cli.output import check_outputs
from rotcli.errors import RotcliError

Function = TypeVar("Function", bound=Callable[..., Any])

_SUFFIXES = (".parquet", ".csv", ".csv.gz", ".csv.zst")
_FILES = ("solution", "plot", "report_residuals")  # options that name files beside the result
_BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


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
    from rotcli.cli.batch.engines import engine

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
    with _bar(len(jobs), quiet) as told, engine(jobs, count, far) as done:
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


@contextmanager
def _bar(length: int, quiet: bool) -> Iterator[Callable[[int], Any]]:
    if quiet or not sys.stderr.isatty():
        yield lambda steps: None
        return
    with click.progressbar(length=length, label="runs", file=sys.stderr, show_pos=True) as bar:
        yield bar.update
