"""Engines of a batch: this process, a pool of processes, or a Dask cluster.

An interrupt ends a batch without a traceback; a killed batch leaves no worker behind.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from rotcli.cli.batch.job import Job, Outcome, run_job
from rotcli.cli.batch.pool import pool
from rotcli.cli.batch.process import prepare_for_many_runs
from rotcli.errors import RotcliError
from rotcli.lazy import lazily
from rotcli.version import __version__

with lazily():
    from concurrent import futures

    import distributed

_WORKER_TIME = 10.0  # s that a cluster has to show a worker
_CONNECT_TIME = 20.0  # s that a scheduler has to answer
_CLOSE_TIME = 2.0  # s


@contextmanager
def engine(jobs: list[Job], count: int, scheduler: str | None) -> Iterator[Iterator[Outcome]]:
    """Give an iterator over the outcomes as they come."""
    if scheduler:
        with _cluster(jobs, scheduler) as done:
            yield done
    elif count == 1:
        prepare_for_many_runs()
        yield map(run_job, jobs)
    else:
        with pool(jobs, count) as done:
            yield done


def connect(scheduler: str) -> "distributed.Client":
    """Return a client of a Dask cluster with workers of this version of rotcli.

    Raises RotcliError when no scheduler answers, no worker is connected, or versions differ.
    """
    try:
        client_of = distributed.Client
    except ImportError as missing:
        text = "--scheduler needs Dask: pip install rotcli[dask]"
        raise RotcliError(text) from missing
    for name in ("distributed", "distributed.client", "distributed.core"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported here, in one line
    try:
        client = client_of(scheduler, timeout=_CONNECT_TIME, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise RotcliError(
            f"{scheduler}: no Dask scheduler answers: {' '.join(str(error).split())}; "
            "check the address, as dask scheduler printed it"
        ) from error
    try:
        client.wait_for_workers(1, timeout=_WORKER_TIME)
        _check_versions(client, scheduler)
    except (TimeoutError, OSError) as error:
        client.close(timeout=_CLOSE_TIME)
        text = f"no worker is connected after {_WORKER_TIME:.0f} s; start one with dask worker"
        raise RotcliError(f"{scheduler}: {text}") from error
    except BaseException:
        client.close(timeout=_CLOSE_TIME)
        raise
    return client


def installed_version() -> str:
    """Return the version of rotcli; runs on the workers of a cluster."""
    return __version__


def _check_versions(client: "distributed.Client", scheduler: str) -> None:
    """Raise RotcliError if a worker has another version of rotcli, or none."""
    ours = installed_version()
    try:
        versions: dict[str, str] = client.run(installed_version)
    except (ImportError, AttributeError) as error:
        text = f"{scheduler}: a worker has no rotcli {ours}: {error}; install it there"
        raise RotcliError(text) from error
    others = {worker: found for worker, found in versions.items() if found != ours}
    for worker, found in others.items():
        raise RotcliError(
            f"{scheduler}: worker {worker} has rotcli {found}, this is rotcli {ours}; "
            "install the same version on every worker"
        )


@contextmanager
def _cluster(jobs: list[Job], scheduler: str) -> Iterator[Iterator[Outcome]]:
    """Run jobs on a Dask cluster that can read the same files; it repeats runs of a dead worker."""
    client = connect(scheduler)
    running = {client.submit(run_job, job, pure=False, retries=2): job for job in jobs}

    def outcomes() -> Iterator[Outcome]:
        for future in distributed.as_completed(running, loop=client.loop):
            error = future.exception()
            if error is None:
                yield future.result()
            elif isinstance(error, futures.CancelledError):
                raise error
            else:
                text = f"the cluster failed: {type(error).__name__}: {error}"
                yield Outcome(running[future].output_dir, f"{running[future].imu}: {text}")

    try:
        yield outcomes()
    except (futures.CancelledError, OSError, TimeoutError) as error:
        raise RotcliError(
            f"{scheduler}: the scheduler was lost; finished runs are kept, run the others again"
        ) from error
    except BaseException:
        client.cancel(list(running))
        raise
    finally:
        client.close(timeout=_CLOSE_TIME)
