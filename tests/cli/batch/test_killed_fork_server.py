"""A batch whose fork server is killed: a new one takes its place."""

import os
import signal
from multiprocessing import forkserver

import pytest

from rotcli.cli.batch import pool


def test_a_worker_starts_after_its_fork_server_was_killed():
    context = pool._context([])
    forkserver.ensure_running()
    first = forkserver._forkserver._forkserver_pid
    os.kill(first, signal.SIGKILL)
    workers = object.__new__(pool.Pool)
    workers._context = context
    worker = workers._start()
    assert worker.process.is_alive()
    worker.pipe.close()
    worker.process.join(20)
    assert worker.process.exitcode == 0


def test_a_fork_server_that_always_ends_is_reported():
    class Process:
        def __init__(self, **_):
            pass

        def start(self):
            raise EOFError

    class Context:
        Pipe = staticmethod(pool._context([]).Pipe)

    Context.Process = Process
    workers = object.__new__(pool.Pool)
    workers._context = Context()
    with pytest.raises(OSError, match="the process that starts them ended"):
        workers._start()
