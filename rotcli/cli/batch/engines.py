"""Engines of a batch: this process, a pool of processes, or a Dask cluster.

An interrupt ends a batch without a traceback; a killed batch leaves no worker behind.
"""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rotcli.cli.batch.job import Job, Outcome, run_job
from rotcli.errors import RotcliError

if TYPE_CHECKING:
    import distributed

_BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def engine(jobs: list[Job], count: int, scheduler: str | None) -> Iterator[Iterator[Outcome]]:
    """Give an iterator over the outcomes as they come."""
    if scheduler:
        with _cluster(jobs, scheduler) as done:
            yield done
    elif count == 1:
        yield map(run_job, jobs)
    else:
        with _pool(jobs, count) as done:
            yield done


@contextmanager
def _pool(jobs: list[Job], count: int) -> Iterator[Iterator[Outcome]]:
    """Run jobs in processes that are forked from one that has imported everything once."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool

    for name in _BLAS_THREADS:  # every core has one run
        os.environ.setdefault(name, "1")
    kinds = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in kinds else "spawn")
    pool = None
    try:
        try:
            if "forkserver" in kinds:
                context.set_forkserver_preload(["rotcli.cli.batch.imports"])
                _start_forkserver_without_sigint()
            with _defer_interrupt():
                pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin)
                running = {pool.submit(_interruptible, job): job for job in jobs}
        except OSError as fault:
            what = f"no processes can be started: {fault.strerror or fault}; use --jobs 1"
            raise RotcliError(f"--jobs {count}: {what}") from fault

        def outcomes() -> Iterator[Outcome]:
            for future in as_completed(running):
                try:
                    yield future.result()
                except BrokenProcessPool:
                    what = "its process died (out of memory?); try again with fewer --jobs"
                    yield Outcome(running[future].output_dir, f"{running[future].imu}: {what}")

        yield outcomes()
    finally:
        if pool is not None:
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _defer_interrupt() -> Iterator[None]:
    """Defer an interrupt to the end, so that no process is half-started."""
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


def _start_forkserver_without_sigint() -> None:
    """Start the process that workers are forked from; it ignores interrupts."""
    from multiprocessing import forkserver

    if threading.current_thread() is not threading.main_thread():
        return
    held = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        forkserver.ensure_running()
    finally:
        signal.signal(signal.SIGINT, held)


def _begin() -> None:
    """Set a worker up: no interrupts between runs, one core, ends with its parent."""
    import pyarrow as pa

    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pa.set_cpu_count(1)


def _end_with_parent() -> None:
    """End a worker whose parent was killed."""
    from multiprocessing import connection, parent_process

    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _interruptible(job: Job) -> Outcome:
    """Run one job; an interrupt ends it, and the parent reports it."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return run_job(job)
    except KeyboardInterrupt:
        return Outcome(job.output_dir, f"{job.imu}: interrupted")
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def connect(scheduler: str) -> "distributed.Client":
    """Return a client of a Dask scheduler; raises RotcliError when none answers."""
    try:
        import distributed
    except ImportError as missing:
        what = "--scheduler needs Dask: pip install rotcli[dask]"
        raise RotcliError(what) from missing
    try:
        return distributed.Client(scheduler, timeout=20, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as fault:
        raise RotcliError(
            f"{scheduler}: no Dask scheduler answers: {' '.join(str(fault).split())}; "
            "check the address, as dask scheduler printed it"
        ) from fault


@contextmanager
def _cluster(jobs: list[Job], scheduler: str) -> Iterator[Iterator[Outcome]]:
    """Run jobs on a Dask cluster that can read the same files; it repeats runs of a dead worker."""
    client = connect(scheduler)
    import distributed

    with client:
        running = {client.submit(run_job, job, pure=False, retries=2): job for job in jobs}

        def outcomes() -> Iterator[Outcome]:
            for future in distributed.as_completed(running, loop=client.loop):
                error = future.exception()
                if error is None:
                    yield future.result()
                else:
                    what = f"the cluster gave up: {type(error).__name__}: {error}"
                    yield Outcome(running[future].output_dir, f"{running[future].imu}: {what}")

        try:
            yield outcomes()
        except BaseException:
            client.cancel(list(running))
            raise
