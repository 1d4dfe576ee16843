"""Worker processes of a batch: each runs one job at a time and reports its outcome.

A worker that dies costs only the job it was running: the job is reported, and a new worker takes
its place. Workers are forked from a process that has imported everything once. They use one core,
ignore interrupts between jobs, and end with their parent.
"""

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from types import FrameType

from rotcli.cli.batch.job import Job, Outcome, run_job
from rotcli.cli.batch.process import prepare_for_many_runs
from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.lazy import lazily

with lazily():
    import multiprocessing
    from multiprocessing import connection, forkserver

    import pyarrow as pa

_BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_ATTEMPTS = 3  # to start a worker
_RETRY_TIME = 0.2  # s; a killed process is still there for a moment
_END_TIME = 10.0  # s that a worker has to end after an interrupt


@dataclass
class _Worker:
    """A worker process, the pipe to it, and the job that it runs."""

    process: BaseProcess
    pipe: Connection
    job: Job | None = None


class Pool:
    """Worker processes; `outcomes` yields the outcomes of all jobs as they come."""

    def __init__(self, jobs: list[Job], count: int) -> None:
        """Start the workers; raises OSError if none can be started."""
        self._context = _context(["rotcli.cli.batch.imports", *jobs[0].command.imports])
        self._waiting = list(reversed(jobs))
        self._workers: list[_Worker] = []
        try:
            with _defer_interrupt():
                for _ in range(count):
                    self._workers.append(self._start())
        except BaseException:
            self.close(interrupt=True)
            raise

    def _start(self) -> _Worker:
        """Start a worker; the process that it is forked from may have been killed."""
        for attempt in range(_ATTEMPTS):
            ours, theirs = self._context.Pipe()
            process = self._context.Process(target=_serve, args=(theirs,))  # type: ignore[attr-defined]
            try:
                process.start()
            except (EOFError, ConnectionError) as error:
                ours.close()
                theirs.close()
                if attempt + 1 == _ATTEMPTS:
                    raise OSError(f"the process that starts them ended: {error!r}") from error
                time.sleep(_RETRY_TIME)
                continue
            theirs.close()  # so that the end of the worker is the end of the pipe
            return _Worker(process, ours)
        raise AssertionError

    def outcomes(self) -> Iterator[Outcome]:
        """Yield the outcome of each job."""
        for worker in self._workers:
            self._give_job(worker)
        while any(worker.job for worker in self._workers):
            for pipe in connection.wait([worker.pipe for worker in self._workers if worker.job]):
                worker = next(w for w in self._workers if w.pipe is pipe)
                yield self._receive(worker)

    def _receive(self, worker: _Worker) -> Outcome:
        """Return the outcome of a worker's job, and give it or its successor the next one."""
        job = worker.job
        assert job is not None
        try:
            outcome: Outcome = worker.pipe.recv()
        except (EOFError, OSError):
            text = "its process was killed (out of memory?); try again with fewer --jobs"
            outcome = Outcome(job.output_dir, f"{job.imu}: {text}")
            worker.pipe.close()
            worker.process.join()
            with _defer_interrupt():
                successor = self._start()
            worker.process, worker.pipe = successor.process, successor.pipe
        self._give_job(worker)
        return outcome

    def _give_job(self, worker: _Worker) -> None:
        worker.job = self._waiting.pop() if self._waiting else None
        if worker.job is not None:
            with suppress(BrokenPipeError):  # a worker that has just died: `_receive` reports it
                worker.pipe.send(worker.job)

    def close(self, *, interrupt: bool) -> None:
        """End the workers; with `interrupt` also the jobs that they run."""
        for worker in self._workers:
            if interrupt and worker.process.pid is not None and worker.process.is_alive():
                with suppress(ProcessLookupError):  # it may have ended since
                    os.kill(worker.process.pid, signal.SIGINT)
            worker.pipe.close()
        for worker in self._workers:
            worker.process.join(_END_TIME if interrupt else None)
            if worker.process.is_alive():
                worker.process.terminate()


@contextmanager
def pool(jobs: list[Job], count: int) -> Iterator[Iterator[Outcome]]:
    """Give the outcomes of jobs in `count` processes; raises RotcliError if none can be started."""
    for name in _BLAS_THREADS:  # every core has one run
        os.environ.setdefault(name, "1")
    with _end_cleanly_on_sigterm():
        try:
            workers = Pool(jobs, count)
        except OSError as error:
            text = f"no processes can be started: {error.strerror or error}; use --jobs 1"
            raise RotcliError(f"--jobs {count}: {text}") from error
        done = False
        try:
            yield workers.outcomes()
            done = True
        finally:
            workers.close(interrupt=not done)


@contextmanager
def _end_cleanly_on_sigterm() -> Iterator[None]:
    """Make SIGTERM a SystemExit: workers end and no temporary files remain."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one must not stop the cleaning
        raise SystemExit(128 + number)

    handler = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, handler)


def _context(imports: list[str]) -> BaseContext:
    kinds = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in kinds else "spawn")
    if "forkserver" in kinds:
        context.set_forkserver_preload(imports)
        _start_forkserver_without_sigint()
    return context


@contextmanager
def _defer_interrupt() -> Iterator[None]:
    """Defer an interrupt to the end, so that no process is half-started."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if received:
        raise KeyboardInterrupt


def _start_forkserver_without_sigint() -> None:
    """Start the process that workers are forked from; it ignores interrupts."""
    if threading.current_thread() is not threading.main_thread():
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        forkserver.ensure_running()
    finally:
        signal.signal(signal.SIGINT, handler)


def _serve(pipe: Connection) -> None:
    """Run the jobs that come through the pipe; end with it, or with the parent."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pa.set_cpu_count(1)
    prepare_for_many_runs()
    with suppress(KeyboardInterrupt):
        _run_jobs(pipe)


def _run_jobs(pipe: Connection) -> None:
    while True:
        try:
            job = pipe.recv()
            pipe.send(_interruptible(job))
        except (EOFError, OSError):
            return


def _end_with_parent() -> None:
    """End a worker whose parent was killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _interrupt_once(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt; a second one, of the parent, must not stop the cleaning."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise KeyboardInterrupt


def _interruptible(job: Job) -> Outcome:
    """Run one job; an interrupt ends it, and the parent reports it."""
    try:
        signal.signal(signal.SIGINT, _interrupt_once)
        try:
            return run_job(job)
        finally:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        return Outcome(job.output_dir, f"{job.imu}: interrupted")
