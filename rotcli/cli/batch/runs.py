"""`--batch`: one command over many runs, in a pool of processes or on a Dask cluster.

A run is a folder with `imu.*`, `table.*` (unless the IMU is still), and optionally `rig.toml` and
`calibration.json`, as `rotcli simulate` writes it. The results of a run are those of the command
with its files alone; a run that fails leaves the others unchanged.
"""

import glob
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import click

from rotcli.cli import loading, messages
from rotcli.cli.batch.job import BatchCommand, Job, Outcome, WrittenLog
from rotcli.cli.options import OutputOptions
from rotcli.cli.output import check_outputs
from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.lazy import lazily

with lazily():
    from rotcli.cli.batch import engines

__all__ = [
    "BatchCommand",
    "BatchOptions",
    "WrittenLog",
    "options",
    "require_argument",
    "run_batch",
]

Function = TypeVar("Function", bound=Callable[..., object])

_SUFFIXES = (".parquet", ".csv", ".csv.gz", ".csv.zst")
_NEW_TABLE = "table.parquet"  # next to imu.parquet, of commands that write logs


@dataclass(frozen=True)
class BatchOptions(OutputOptions):
    """Options of every command that `--batch` runs: rig, batch, output."""

    rig_path: str | None
    batch: str | None
    jobs: int | None
    scheduler: str | None


def options(function: Function) -> Function:
    """Add `--batch`, `--jobs` and `--scheduler`."""
    function = click.option(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help="Run --batch on this Dask cluster (pip install rotcli[dask]).",
    )(function)
    function = click.option(
        "--jobs",
        metavar="N",
        type=click.IntRange(min=1),
        help="Processes for --batch [default: one per core].",
    )(function)
    return click.option(
        "--batch",
        metavar="DIR|GLOB",
        help="Process all run folders (imu.*, table.*, rig.toml) below DIR or matching GLOB; "
        "results go to the run folders or below -o.",
    )(function)


def require_argument(log: str | None, name: str) -> str:
    """Return a log argument of a single run; raises UsageError if it is missing."""
    if log is None:
        raise click.UsageError(f"Missing argument '{name}' (or --batch DIR).")
    return log


def run_batch(command: BatchCommand, given: BatchOptions, logs: Sequence[str | None]) -> None:
    """Run a command over every run of `--batch`; raises RotcliError when one failed.

    logs: arguments of the command that name logs; there must be none.
    """
    if any(logs):
        raise click.UsageError("--batch finds the logs itself: omit IMU_LOG and TABLE_LOG")
    if given.output == "-":
        raise click.UsageError("-o: --batch writes one result per run: use a folder")
    if not command.stem and not given.output:
        raise click.UsageError("-o: name the folder for the new logs of --batch")
    if given.scheduler and given.jobs:
        raise click.UsageError("--jobs: --scheduler uses the workers of its cluster")
    jobs = _jobs(command, given)
    count = min(given.jobs or len(os.sched_getaffinity(0)), len(jobs))
    outcomes: dict[str, Outcome] = {}
    with _bar(len(jobs), given.quiet) as step, engines.engine(jobs, count, given.scheduler) as done:
        for outcome in done:
            outcomes.setdefault(outcome.output_dir, outcome)
            step(1)
    messages.warn([text for job in jobs for text in outcomes[job.output_dir].texts], given.quiet)
    failed = [outcomes[job.output_dir] for job in jobs if outcomes[job.output_dir].error]
    for outcome in failed:
        messages.error_line(f"rotcli: error: {outcome.error}")
    if failed:
        done_count = len(jobs) - len(failed)
        others = f"; the other {done_count} are done" if done_count else ""
        raise RotcliError(f"{len(failed)} of {len(jobs)} runs failed{others}")
    if not given.quiet:
        warned = sum(1 for outcome in outcomes.values() if outcome.warnings)
        with_warnings = f", {warned} with warnings (in the results)" if warned else ""
        plural = "s" * (len(jobs) > 1)
        messages.error_line(f"rotcli: {len(jobs)} run{plural} done{with_warnings}")


def _jobs(command: BatchCommand, given: BatchOptions) -> list[Job]:
    """Return the jobs of all runs, in the order of the folder names."""
    folders, top = _run_folders(str(given.batch))
    jobs = []
    for folder in sorted(folders):
        imu = _log(folder, "imu")
        if imu is not None:
            jobs.append(_job(command, given, folder, imu, top))
    if not jobs:
        raise RotcliError(
            f"{given.batch}: no run found: a run is a folder with imu.parquet or imu.csv; "
            "use the folder above them, or a pattern in quotes"
        )
    return jobs


def _run_folders(pattern: str) -> tuple[set[Path], Path]:
    """Return the folders below a folder, or matching a pattern, and the folder above all.

    Of several names of one folder, some of them links, one remains.
    """
    top = Path(pattern)
    if top.is_dir():
        return _folders_below(top), top
    found = [Path(name) for name in glob.glob(pattern, recursive=True)]  # noqa: PTH207
    named = {path if path.is_dir() else path.parent for path in found}
    folders: dict[str, Path] = {}
    for folder in sorted(named, key=lambda path: (path.is_symlink(), path)):
        folders.setdefault(os.path.realpath(folder), folder)
    above = Path(os.path.commonpath([f.parent for f in named])) if named else top
    return set(folders.values()), above


def _folders_below(top: Path) -> set[Path]:
    """Return a folder and all below it; links are followed, by name, where they lead to new ones.

    So a folder keeps the name without a link, and a cycle of links ends.
    """
    folders: dict[str, Path] = {}
    waiting = [top]
    while waiting:
        links = []
        for place, below, _ in os.walk(waiting.pop(0)):
            real = os.path.realpath(place)
            if real in folders:
                below.clear()
                continue
            folders[real] = Path(place)
            links += [path for name in below if (path := Path(place, name)).is_symlink()]
        waiting += sorted(links)
    return set(folders.values())


def _check_inside(option: str, name: str) -> None:
    """Raise UsageError for an output name that all runs share, or that leaves their folder."""
    path = Path(name)
    if path.is_absolute() or ".." in path.parts:
        raise click.UsageError(
            f"--{option.replace('_', '-')} {name}: with --batch use a name inside the run folders"
        )


def _job(command: BatchCommand, given: BatchOptions, folder: Path, imu: Path, top: Path) -> Job:
    """Return the job of one run folder; raises UsageError for an output over an input."""
    output_dir = Path(given.output) / os.path.relpath(folder, top) if given.output else folder
    if given.scheduler:
        folder, output_dir = folder.resolve(), output_dir.resolve()
        imu = folder / imu.name
    changes: dict[str, object] = {}
    candidate = folder / "calibration.json"
    calibration = getattr(given, "calibration", None)
    if command.uses_calibration and not calibration and candidate.is_file():
        changes["calibration"] = str(candidate)
    for option in command.file_options:
        name = getattr(given, option)
        if name:
            _check_inside(option, name)
            changes[option] = str(output_dir / name)
    table = _log(folder, "table")
    read = [str(changes.get("calibration", "")), str(table) if table else None]
    shared: tuple[str, ...] = ("rig_path", "calibration", *command.input_options)
    for option in shared:
        name = getattr(given, option, None)
        read.append(name)
        if name and given.scheduler:
            changes.setdefault(option, str(Path(name).resolve()))
    more: tuple[str, ...] = getattr(given, "more_calibrations", ())
    if more and given.scheduler:
        changes["more_calibrations"] = tuple(str(Path(name).resolve()) for name in more)
    written = {f"--{o.replace('_', '-')}": str(changes.get(o, "")) for o in command.file_options}
    if not command.stem:
        changes["output"] = str(output_dir / "imu.parquet")
        written |= {"-o": str(changes["output"]), "-o of the table": str(output_dir / _NEW_TABLE)}
    check_outputs([*read, *more], written, log=str(imu))
    chosen = replace(given, **changes)  # type: ignore[arg-type]
    path = str(table) if table else None
    return Job(command, str(imu), path, str(output_dir), chosen, loading.byte_limit())


def _log(folder: Path, stem: str) -> Path | None:
    """Return the log of a run; raises RotcliError where there are two."""
    present = [path for suffix in _SUFFIXES if (path := folder / f"{stem}{suffix}").is_file()]
    if len(present) > 1:
        names = " and ".join(path.name for path in present)
        raise RotcliError(f"{folder}: {names} both exist; remove one of them")
    return present[0] if present else None


@contextmanager
def _bar(length: int, quiet: bool) -> Iterator[Callable[[int], object]]:
    if quiet or not sys.stderr.isatty():
        yield lambda steps: None
        return
    with click.progressbar(length=length, label="runs", file=sys.stderr, show_pos=True) as bar:
        yield bar.update
