"""What a row of the table is, and how its figures are taken: turn and turn about, in one run.

Ratios are rotcli over the other, taken within each round and then the median: below 1 rotcli is
ahead, and a machine that is busy for a while slows both alike.
"""

import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median, quantiles
from typing import Any, Literal

PYTHON = sys.executable
ROTCLI = (PYTHON, "-m", "rotcli")
_LAUNCH = str(Path(__file__).with_name("launch.py"))


@dataclass(frozen=True)
class Settings:
    """What a run was asked for. folder: scratch space, removed at the end."""

    folder: Path
    rounds: int = 7
    quick: bool = False

    @property
    def slow_rounds(self) -> int:
        """Rounds of what takes seconds each."""
        return min(self.rounds, 2) if self.quick else self.rounds


@dataclass(frozen=True)
class Figure:
    """Median and quartiles of repeated measurements, in `unit`."""

    median: float
    low: float
    high: float
    count: int
    unit: str

    @classmethod
    def of(cls, values: Sequence[float], unit: str) -> "Figure":
        """Return the figure of some measurements."""
        low, middle, high = (
            quantiles(values, n=4, method="inclusive") if len(values) > 1 else 3 * [values[0]]
        )
        return cls(middle, low, high, len(values), unit)


@dataclass(frozen=True)
class Row:
    """One line of the table.

    at_most: the bound, on the ratio or on rotcli's own figure. peak, peer_peak: bytes of memory
    of the processes. note: what a reader must know, or why a figure is missing.
    """

    what: str
    ours: Figure | None = None
    peer: str = ""
    theirs: Figure | None = None
    ratio: Figure | None = None
    at_most: float | None = None
    bound_on: Literal["ratio", "rotcli"] = "ratio"
    peak: float | None = None
    peer_peak: float | None = None
    note: str = ""
    group: str = ""

    @property
    def kept(self) -> bool | None:
        """Whether the bound is kept; None where there is none."""
        judged = self.ratio if self.bound_on == "ratio" else self.ours
        if self.at_most is None:
            return None
        return judged is not None and bool(judged.median <= self.at_most)


@dataclass
class Run:
    """Repeated measurements of one candidate: seconds, and peak bytes of its processes."""

    seconds: list[float] = field(default_factory=list)
    peaks: list[float] = field(default_factory=list)

    @property
    def peak(self) -> float | None:
        """Median peak memory, bytes."""
        return median(self.peaks) if self.peaks else None


def one(what: str, run: Run, **given: Any) -> Row:
    """Return the row of rotcli alone."""
    return Row(what, Figure.of(run.seconds, "s"), peak=run.peak, bound_on="rotcli", **given)


def compared(what: str, ours: Run, peer: str, theirs: Run, **given: Any) -> Row:
    """Return the row of rotcli next to a peer measured in the same rounds."""
    ratios = [mine / other for mine, other in zip(ours.seconds, theirs.seconds, strict=True)]
    return Row(
        what,
        Figure.of(ours.seconds, "s"),
        peer,
        Figure.of(theirs.seconds, "s"),
        Figure.of(ratios, ""),
        peak=ours.peak,
        peer_peak=theirs.peak,
        **given,
    )


Candidate = Callable[[], Any] | Sequence[str]
# Seconds of the turn of a function: it is called until they have passed. The first call finds the
# caches filled by another candidate, and the clock's steps are a part of a short one.
_TURN = 0.1


def side_by_side(
    candidates: Mapping[str, Candidate],
    rounds: int,
    *,
    warm: bool = True,
    clock: Literal["cpu", "wall"] = "cpu",
) -> dict[str, Run]:
    """Measure candidates turn and turn about: a function in this process, or a command in its own.

    Each round starts with another one. `warm` adds one round that is not counted, so that files
    are in the page cache and what is compiled on first use is compiled; it also gives the calls of
    a function that fill its turn. clock: CPU time, which a busy machine changes least, or the time
    of a clock, for commands of several processes.
    """
    runs = {name: Run() for name in candidates}
    calls = dict.fromkeys(candidates, 1)
    names = list(candidates)
    for number in range(-1 if warm else 0, rounds):
        turn = number % len(names)
        for name in names[turn:] + names[:turn]:
            candidate = candidates[name]
            if callable(candidate):
                seconds, peak = _turn(candidate, calls[name]), None
                if number < 0:
                    calls[name] = max(1, round(_TURN / max(seconds, 1e-6)))
            else:
                seconds, peak = process(candidate, clock)
            if number >= 0:
                runs[name].seconds.append(seconds)
                runs[name].peaks += [] if peak is None else [peak]
    return runs


def _turn(function: Callable[[], Any], calls: int) -> float:
    """Return the CPU seconds of a call, the mean of some without garbage collection (`timeit`)."""
    gc.collect()
    gc.disable()
    try:
        start = time.process_time()
        for _ in range(calls):
            function()
        return (time.process_time() - start) / calls
    finally:
        gc.enable()


def process(command: Sequence[str], clock: Literal["cpu", "wall"] = "cpu") -> tuple[float, float]:
    """Run a command that must succeed; return its seconds and its peak memory in bytes."""
    done = subprocess.run(
        [PYTHON, "-I", "-S", _LAUNCH, *command], capture_output=True, text=True, check=False
    )
    found = json.loads(done.stdout) if done.stdout else {"status": done.returncode}
    if found["status"] != 0:
        raise RuntimeError(f"{' '.join(command)} ended with {found['status']}: {done.stderr}")
    return found["cpu" if clock == "cpu" else "seconds"], found["peak"]
