"""One run of a batch: what is to be done, doing it, and what became of it."""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rotcli.cli.main import COMMANDS
from rotcli.errors import RotcliError

_RESULTS = {"calibrate": "calibration", "navigate": "navigation"}


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
    from rotcli.files.documents import unwritable, write_result

    module = importlib.import_module(f"rotcli.cli.{COMMANDS[job.command][0]}")
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
