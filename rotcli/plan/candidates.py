"""Candidates of a plan: still positions and spins from some attitudes, with their information.

One axis: positions every 45 deg, spins at each rate, in every mounting. Two axes: a grid of 45 deg
of both. Three axes: 30 attitudes of middle and inner axis (faces, edges, body diagonals) with the
outer axis still at four angles or spinning, and spins of the middle and the inner axis.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import Blocks, blocks_of_motion, concatenate
from rotcli.models.triad.information import CHUNK_BLOCKS, Problem, weighted_rows
from rotcli.models.triad.motion import Go, Hold, MotionBuilder, Mount, Spin, Step
from rotcli.models.triad.sequences import DIAGONAL
from rotcli.units import DEG, FloatArray

HOLD = 30.0  # s of one still position
SPIN_TIME = 15.0  # s of one spin each way
SLEW_COST = 8.0  # s, mean time to reach the next attitude at 20 deg/s
STEP = 45.0  # deg between positions


@dataclass(frozen=True)
class Table:
    """What the table can do: axes, its rates (rad/s, ascending), ramps, slews, mountings."""

    axes: int
    rates: tuple[float, ...]
    acceleration: float
    slew_rate: float
    mountings: int = 1

    def builder(self) -> MotionBuilder:
        """Return a builder with the table's limits."""
        return MotionBuilder(self.axes, self.acceleration, self.slew_rate)


@dataclass(frozen=True, eq=False)
class Candidate:
    """One action from one attitude, its cost (s) and information (p, p), scaled."""

    mounting: int
    attitude: tuple[float, ...]
    action: Hold | Spin
    cost: float
    information: FloatArray

    @property
    def steps(self) -> list[Step]:
        """The steps of the sequence."""
        return [Mount(self.mounting), Go(self.attitude), self.action]


def _turns(rate: float) -> float:
    """Return the number of complete turns that take about SPIN_TIME."""
    return float(max(1, round(rate * SPIN_TIME / (2.0 * np.pi))))


def _attitudes(axes: int) -> list[tuple[float, ...]]:
    """Return attitudes (deg) of all axes behind the outermost."""
    if axes == 1:
        return [()]
    ring = [float(a) for a in np.arange(-135.0, 181.0, STEP)]
    if axes == 2:
        return [(a,) for a in ring]
    found: list[tuple[float, ...]] = [(m, a) for m in (0.0, STEP, -STEP) for a in ring]
    found += [(90.0, 0.0), (-90.0, 0.0)]
    return found + [(s * DIAGONAL, a) for s in (1.0, -1.0) for a in (STEP, -STEP)]


def _actions(table: Table) -> list[tuple[tuple[float, ...], Hold | Spin]]:
    """Return attitudes (deg, all axes) and what to do there."""
    outer_angles = np.arange(0.0, 360.0, 90.0 if table.axes == 3 else STEP)
    found: list[tuple[tuple[float, ...], Hold | Spin]] = []
    for inner in _attitudes(table.axes):
        found += [((float(o), *inner), Hold(HOLD)) for o in outer_angles]
        found += [((0.0, *inner), Spin(0, r, _turns(r))) for r in table.rates]
    for r in table.rates if table.axes == 2 else ():
        found += [((float(o), 0.0), Spin(1, r, _turns(r))) for o in outer_angles]
    for r in table.rates if table.axes == 3 else ():
        quarter = (0.0, 45.0, 90.0, 135.0)
        found += [((0.0, 0.0, i), Spin(1, r, _turns(r))) for i in quarter]
        found += [((0.0, m, 0.0), Spin(2, r, _turns(r))) for m in quarter]
    return found


def make_candidates(problem: Problem, table: Table, rate: float) -> list[Candidate]:
    """Return all candidates with their information; rate: Hz of the IMU."""
    places, parts, cost = [], [], []
    for mounting in range(table.mountings):
        for degrees, action in _actions(table):
            builder = table.builder()
            attitude = tuple(a * DEG for a in degrees)
            builder.angles[:] = attitude
            builder.mounting = mounting
            builder.play([action])
            motion = builder.motion()
            places.append((mounting, attitude, action))
            parts.append(blocks_of_motion(motion, rate))
            cost.append(motion.duration + SLEW_COST)
    return [
        Candidate(*place, seconds, information)
        for place, seconds, information in zip(
            places, cost, _information(problem, parts), strict=True
        )
    ]


def _information(problem: Problem, parts: Sequence[Blocks]) -> Iterator[FloatArray]:
    """Yield the information (p, p) of each part; the rows of many parts are computed at once."""
    x = np.zeros(p.count(problem.table.mounting_count))
    ends = np.cumsum([len(part) for part in parts])
    first = 0
    while first < len(parts):
        begin = ends[first] - len(parts[first])
        last = max(first + 1, int(np.searchsorted(ends, begin + CHUNK_BLOCKS, side="right")))
        rows = weighted_rows(problem, x, concatenate(list(parts[first:last])))
        for part in np.split(rows, ends[first : last - 1] - begin, axis=1):
            A = part.reshape(-1, part.shape[2])
            yield A.T @ A
        first = last


def ordered(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates in an order with short ways: by mounting, middle and inner, outer."""
    return sorted(
        candidates, key=lambda c: (c.mounting, c.attitude[1:], c.attitude[0], str(c.action))
    )


def _repeats(candidates: Sequence[Candidate]) -> list[list[Candidate]]:
    """Return runs of the same candidate."""
    groups: list[list[Candidate]] = []
    for c in candidates:
        if groups and groups[-1][0] is c:
            groups[-1].append(c)
        else:
            groups.append([c])
    return groups


def _repeated(action: Hold | Spin, times: int) -> Hold | Spin:
    """Return an action several times as long; a spin so saves its ramps."""
    if isinstance(action, Hold):
        return Hold(action.duration * times)
    return Spin(action.axis, action.rate, action.turns * times, action.both)


def steps_of(candidates: Sequence[Candidate]) -> list[Step]:
    """Return the steps of candidates in order; repeats become one longer hold or spin."""
    steps: list[Step] = []
    mounting, attitude = 0, None
    for group in _repeats(ordered(candidates)):
        c = group[0]
        if c.mounting != mounting:
            steps.append(Mount(c.mounting))
        if c.attitude != attitude or c.mounting != mounting:
            steps.append(Go(c.attitude))
        steps.append(_repeated(c.action, len(group)))
        mounting, attitude = c.mounting, c.attitude
    return steps
