"""One run of a batch: the command and its files, its execution, and its outcome."""

import importlib
from collections.abc import Callable
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING

from rotcli.cli import loading
from rotcli.cli.findings import with_option
from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.lazy import lazily

with lazily():
    from rotcli.files.results import documents

if TYPE_CHECKING:
    from rotcli.cli.options import OutputOptions
    from rotcli.files.results.result import Result


@dataclass(frozen=True)
class BatchCommand:
    """A command that `--batch` can run.

    module: contains `process_run(imu_log, table_log, options)`, which returns the results of one
    run. stem: name of the result file; empty where `process_run` writes logs to the file of `-o`
    and returns `WrittenLog`. file_options: options that name files of a run's output.
    input_options: options that name a file which all runs read. uses_calibration: take
    `calibration.json` of the run folder where no calibration is given. imports: modules that every
    run needs.
    """

    module: str
    stem: str
    file_options: tuple[str, ...] = ()
    input_options: tuple[str, ...] = ()
    uses_calibration: bool = False
    imports: tuple[str, ...] = ()


@dataclass(frozen=True)
class Job:
    """One run: the command, its logs and options, and the folder of its results."""

    command: BatchCommand
    imu: str
    table: str | None
    output_dir: str
    options: "OutputOptions"
    limit: loading.ByteLimit = field(default_factory=loading.ByteLimit)


@dataclass(frozen=True)
class WrittenLog:
    """A log that a run wrote in place of a result, with warnings for the terminal."""

    warnings: list[str]


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run: its error, if any, and the number of warnings in its results.

    texts: warnings that no result contains.
    """

    output_dir: str
    error: str | None = None
    warnings: int = 0
    texts: tuple[str, ...] = ()


def run_job(job: Job) -> Outcome:
    """Process one run and write its results; an expected error comes back as text."""
    try:
        return _run(job)
    except RotcliError as error:
        return Outcome(job.output_dir, " ".join(with_option(error).split()))
    except Exception as error:  # a defect of rotcli must not cost the other runs
        kind = type(error).__name__
        text = f"{job.imu}: unexpected {kind}: {' '.join(str(error).split())}"
        return Outcome(job.output_dir, text)


def _run(job: Job) -> Outcome:
    module = importlib.import_module(job.command.module)
    process: Callable[..., list[Result | WrittenLog]] = module.process_run
    try:
        Path(job.output_dir).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise documents.write_error(job.output_dir, error) from error
    with loading.max_bytes_of(job.limit):
        written = process(job.imu, job.table, job.options)
    texts = [text for log in written if isinstance(log, WrittenLog) for text in log.warnings]
    results = [result for result in written if not isinstance(result, WrittenLog)]
    for result in results:
        mode = f"-{result.document['mode']}" if len(results) > 1 else ""
        result.write(str(Path(job.output_dir) / f"{job.command.stem}{mode}.json"))
    count = sum(len(result.warnings) for result in results)
    return Outcome(job.output_dir, warnings=count, texts=tuple(dict.fromkeys(texts)))
