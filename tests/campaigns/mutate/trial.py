"""Run tests in child processes, on the original code and on mutants of it.

A child is a fork of this process, in which numpy, scipy and pytest are imported already but nothing
of rotcli; it works in a copy of the tree. A mutant may loop for ever or ask for all memory, so a
child has limits. The limit of CPU time is 5 times the time of the tests on the original code: a
mutant that needs more has failed them.
"""

import importlib
import json
import os
import resource
import shutil
import signal
import sys
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[3]
_PRELOADED = (
    *("numpy", "scipy.linalg", "scipy.signal", "scipy.special", "scipy.stats", "scipy.optimize"),
    *("scipy.interpolate", "scipy.sparse", "pandas", "pyarrow.csv", "pyarrow.parquet", "click"),
    *("tomlkit", "mpmath", "allantools", "pytest"),
)
_SLOWER = 5.0  # times the CPU time of the original: the limit of a mutant
_START = 10.0  # s, added to it
_IDLE = 8.0  # wall time over CPU time, from which a child waits for something that never comes
_MEMORY = 8 << 30  # bytes
_POLL = 0.02  # s


@dataclass
class Tests:
    """Tests of a module: arguments of pytest, seconds per test file, tests that killed a mutant."""

    arguments: list[str]
    seconds: dict[str, float] = field(default_factory=dict)
    killers: list[str] = field(default_factory=list)

    @property
    def total(self) -> float:
        """CPU seconds of all tests on the original code."""
        return sum(self.seconds.values())


class Recorder:
    """A pytest plugin: quick tests first, those that killed a mutant before them all."""

    def __init__(self, tests: Tests) -> None:
        self.tests = tests
        self.seconds: dict[str, float] = {}
        self.failed: list[str] = []
        self._start = 0.0

    def pytest_collection_modifyitems(self, items):
        killers, seconds = self.tests.killers, self.tests.seconds

        def rank(item):
            file = item.nodeid.partition("::")[0]
            return (item.nodeid not in killers, seconds.get(file, 0.0), file)

        items.sort(key=rank)

    def pytest_runtest_logstart(self):
        self._start = time.process_time()

    def pytest_runtest_logfinish(self, nodeid):
        file = nodeid.partition("::")[0]
        spent = time.process_time() - self._start
        self.seconds[file] = self.seconds.get(file, 0.0) + spent

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.failed.append(report.nodeid)


def copy_tree(tree: Path) -> Path:
    """Copy what the tests need, and return the copy."""
    ignored = shutil.ignore_patterns("__pycache__", ".hypothesis")
    for folder in ("rotcli", "tests", "fixtures", "docs"):
        shutil.copytree(ROOT / folder, tree / folder, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "Makefile"):
        shutil.copy(ROOT / name, tree)
    return tree


def preload() -> None:
    """Import libraries once, for all children."""
    for name in _PRELOADED:
        importlib.import_module(name)


class Child:
    """Tests that run in a copy of the tree; `poll` returns whether they passed, once they end."""

    def __init__(self, tree: Path, tests: Tests) -> None:
        self.tree, self.tests = tree, tests
        self._answer = tree / "answer.json"
        self._answer.unlink(missing_ok=True)
        self._limit = _SLOWER * tests.total + _START if tests.seconds else None
        self._end = time.monotonic() + _IDLE * self._limit if self._limit else None
        sys.stdout.flush()
        self._pid = os.fork()
        if self._pid == 0:
            try:
                status = _run(tree, tests, self._limit)
            except BaseException:  # nothing of this process may run on in the child
                traceback.print_exc()
                status = 70
            os._exit(status)

    def poll(self) -> bool | None:
        """Return True if all tests passed, False if not, None while they run."""
        done, status = os.waitpid(self._pid, os.WNOHANG)
        if not done:
            if self._end is None or time.monotonic() < self._end:
                return None
            os.killpg(self._pid, signal.SIGKILL)
            os.waitpid(self._pid, 0)
            return False
        answer = json.loads(self._answer.read_text()) if self._answer.exists() else {}
        for killer in answer.get("failed", []):
            if killer not in self.tests.killers:
                self.tests.killers.append(killer)
        if not self.tests.seconds:
            self.tests.seconds = answer.get("seconds", {})
        return status == 0

    def wait(self) -> bool:
        """Return whether all tests passed, when they end."""
        while (passed := self.poll()) is None:
            time.sleep(_POLL)
        return passed


def _run(tree: Path, tests: Tests, limit: float | None) -> int:
    """Run the tests in this process, write which failed, and return pytest's status."""
    os.setsid()
    output = os.open(tree / "output.txt", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    for stream in range(3):
        os.dup2(output, stream)
    resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY, _MEMORY))
    if limit is not None:
        seconds = int(time.process_time() + limit) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    os.chdir(tree)
    os.environ |= {"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    sys.dont_write_bytecode = True
    sys.path[:] = [str(tree), *(p for p in sys.path if p and Path(p).resolve() != ROOT)]
    for name in [n for n in sys.modules if n.partition(".")[0] in ("rotcli", "tests")]:
        del sys.modules[name]
    import pytest

    recorder = Recorder(tests)
    options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    status = int(pytest.main([*options, *tests.arguments], plugins=[recorder]))
    answer = {"failed": recorder.failed, "seconds": recorder.seconds}
    (tree / "answer.json").write_text(json.dumps(answer))
    return status
