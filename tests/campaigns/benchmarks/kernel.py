"""The strapdown kernel next to other programs: error on error-free rotating input, and time.

`python -m tests.campaigns.benchmarks.kernel WHO FILE.npz` integrates once as a process of its own.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.campaigns.benchmarks import peers
from tests.campaigns.benchmarks.measure import (
    PYTHON,
    Figure,
    Row,
    Run,
    Settings,
    compared,
    process,
    side_by_side,
)

FIVE_MINUTES, THREE_HOURS = 30_000, 1_080_000
_ROTATING = [motion for motion in peers.MOTIONS if "100" in motion]
_SKIPPED = "skipped: not installed"


def errors(settings: Settings) -> Iterator[Row]:
    """Largest distance from the table over 300 s, for every motion and sampling."""
    largest = 0.0
    for motion in _ROTATING:
        for averages in (False, True):
            given = peers.problem(motion, FIVE_MINUTES + 1, averages=averages)
            mine = peers.distance(peers.rotcli(given)())
            largest = max(largest, mine)
            what = f"error in 300 s, {motion}, {'increments' if averages else 'instants'}"
            # inu takes means over intervals, so instants are not its input.
            for name in ("pyins", "inu") if averages else ("pyins",):
                if peers.missing(name):
                    yield Row(what, Figure.of([mine], "m"), name, note=_SKIPPED)
                    continue
                theirs = peers.distance(peers.MECHANIZATIONS[name](given)())
                yield Row(
                    what,
                    Figure.of([mine], "m"),
                    name,
                    Figure.of([theirs], "m"),
                    Figure.of([mine / theirs], ""),
                    at_most=1.0,
                )
    what = "largest error of them all"
    yield Row(what, Figure.of([largest], "m"), at_most=1e-6, bound_on="rotcli")


def coning(settings: Settings) -> Iterator[Row]:
    """Attitude error of 30 s of three-axis coning at 100 Hz, as the tests measure it."""
    from tests.models.test_coning import Coning, coning_error

    expected = Coning.attitude(30.0)
    for averages in (False, True):
        what = f"30 s of three-axis coning, {'increments' if averages else 'instants'}"
        error = coning_error(expected, 0.01, averages)
        yield Row(what, Figure.of([error], "deg"), at_most=1e-7, bound_on="rotcli")


def speed(settings: Settings) -> Iterator[Row]:
    """CPU time of the kernel, everything imported and compiled."""
    sizes = (FIVE_MINUTES,) if settings.quick else (FIVE_MINUTES, THREE_HOURS)
    for size in sizes:
        # Hours at 100 deg/s about x only add up errors of height; the time is the same.
        motion = "100 deg/s about x, horizontal" if size == FIVE_MINUTES else "10 deg/s about z"
        exact = peers.problem(motion, size, averages=False)
        yield from _compare(
            f"integrate {size:,} samples, error-free", exact, settings, with_hold=False
        )
        noisy = peers.with_errors(exact)
        yield from _compare(f"integrate {size:,} samples, noise and biases", noisy, settings)


def _compare(
    what: str, given: peers.Problem, settings: Settings, *, with_hold: bool = True
) -> Iterator[Row]:
    """Yield the rows of one input: against other programs, height free and with height hold."""
    size = len(given.time)
    bounds = {"pyins, core": 0.8}
    if size == FIVE_MINUTES:
        # inu is a loop in Python: at 1.08 million samples it would take minutes a round.
        bounds |= {"pyins": 0.35, "inu": 0.1}
    runs = {name: peers.MECHANIZATIONS[name](given) for name in bounds if not peers.missing(name)}
    slow = runs.pop("inu", None)
    # The floor: the same bytes copied, 6 numbers a sample in and 10 out.
    source, target = np.zeros((16, size)), np.empty((16, size))
    runs |= {"rotcli": peers.rotcli(given), "copy": lambda: np.copyto(target, source)}
    if with_hold:
        runs["hold"] = peers.rotcli(given, hold_height=True)
    found = side_by_side(runs, settings.rounds)
    for name, at_most in bounds.items():
        if name in found:
            yield compared(what, found["rotcli"], name, found[name], at_most=at_most)
        elif peers.missing(name):
            yield Row(what, peer=name, note=_SKIPPED)
    if with_hold and "pyins, core" in found:
        hold_what = f"{what}, height hold"
        yield compared(hold_what, found["hold"], "pyins, core", found["pyins, core"], at_most=1.0)
    floor = "a copy of 128 bytes a sample: the floor of memory; 900 flops are another 30 ns"
    yield compared(what, found["rotcli"], "memory", found["copy"], note=floor)
    if slow is not None:
        pair = side_by_side(
            {"rotcli": runs["rotcli"], "inu": slow}, settings.slow_rounds, warm=False
        )
        yield compared(what, pair["rotcli"], "inu", pair["inu"], at_most=bounds["inu"])
        yield Row(what, peer="ins-nav", note="has no strapdown mechanization to measure")


def cold(settings: Settings) -> Iterator[Row]:
    """Import, load, integrate (pyins compiles first) as processes; their peak memory."""
    for size in (FIVE_MINUTES,) if settings.quick else (FIVE_MINUTES, THREE_HOURS):
        file = settings.folder / f"problem{size}.npz"
        given = peers.problem("10 deg/s about z", size, averages=False)
        np.savez(file, time=given.time, w=given.w_is_s, f=given.f_s)
        what = f"import and integrate {size:,} samples, a process"
        if peers.missing("pyins"):
            yield Row(what, peer="pyins", note=_SKIPPED)
            continue
        commands = {name: _alone(name, file) for name in ("rotcli", "pyins")}
        if size == FIVE_MINUTES:
            found = side_by_side(commands, settings.slow_rounds, warm=False)
        else:  # for the memory: once is enough
            found = {name: Run(*([x] for x in process(c))) for name, c in commands.items()}
        at_most = 0.2 if size == FIVE_MINUTES else None
        yield compared(what, found["rotcli"], "pyins", found["pyins"], at_most=at_most)


def _alone(name: str, file: Path) -> list[str]:
    return [PYTHON, "-m", "tests.campaigns.benchmarks.kernel", name, str(file)]


def main(name: str, file: str) -> None:
    """Integrate the problem of a file once."""
    stored = np.load(file)
    w, f = stored["w"], stored["f"]
    peers.MECHANIZATIONS[name](peers.Problem(stored["time"], w, f, False, (w, f)))()


if __name__ == "__main__":
    main(*sys.argv[1:])
