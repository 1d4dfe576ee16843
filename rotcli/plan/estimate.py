"""Make a plan and compare it with the standard sequences of the same duration."""

from collections.abc import Callable, Sequence

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import blocks_of_motion
from rotcli.models.triad.conventions import convert, convert_covariance
from rotcli.models.triad.information import Problem, information_factor, prior_rows
from rotcli.models.triad.leastsquares import covariance_of
from rotcli.models.triad.motion import MotionBuilder, Step, TableMotion
from rotcli.plan.candidates import Candidate, Table, make_candidates, steps_of
from rotcli.plan.optimize import optimize
from rotcli.units import FloatArray

MAX_TRIES = 5  # plans made shorter until slews and all fit the time
_CLOSE = 0.01  # of the budget that a plan may leave unused
_SLACK = 1.0  # s of the budget that a plan may leave or exceed by rounding


@dataclass(frozen=True, eq=False)
class Assessed:
    """A sequence: duration (s), log det, sigma (p_free,), SI, in the convention of the table."""

    name: str
    duration: float
    log_det: float
    sigma: FloatArray

    def efficiency_over(self, other: "Assessed") -> float:
        """Return the D-efficiency exp((log det - other log det) / p)."""
        return float(np.exp((self.log_det - other.log_det) / len(self.sigma)))


@dataclass(frozen=True, eq=False)
class Plan:
    """A plan: its steps, what it gives, the standard sequences next to it."""

    problem: Problem
    table: Table
    steps: list[Step]
    assessed: Assessed
    others: list[Assessed]
    spin_share: float

    @property
    def convention(self) -> str:
        """The convention of the sigmas."""
        return convention_of(self.problem)


def convention_of(problem: Problem) -> str:
    """Return the convention in which a result on this table has values.

    With mountings by hand no motion shows the common rotation of all sensor axes.
    """
    return "accelerometer" if problem.table.mounting_count > 1 else "table"


def assess(name: str, problem: Problem, motion: TableMotion, rate: float) -> Assessed:
    """Return the duration, determinant and sigmas of a motion, slews included."""
    x = np.zeros(p.count(problem.table.mounting_count))
    total = information_factor(problem, x, blocks_of_motion(motion, rate))
    total.add(*prior_rows(problem, x))
    covariance = covariance_of(total.R) * np.outer(problem.size, problem.size)
    D = convert(x, convention_of(problem)).derivative
    sigma = np.sqrt(np.diag(convert_covariance(covariance, problem.free, D))[problem.free])
    determinant = 2.0 * float(np.sum(np.log(np.abs(np.diag(total.R)))))
    return Assessed(name, motion.duration, determinant, sigma)


def make_plan(problem: Problem, table: Table, budget: float, *, rate: float = 100.0) -> Plan | None:
    """Return the plan for a time of `budget` seconds, None where nothing fits; rate: Hz."""
    candidates = make_candidates(problem, table, rate)
    rows, _ = prior_rows(problem, np.zeros(p.count(problem.table.mounting_count)))
    chosen = _fitting(candidates, rows.T @ rows, table, budget)
    if not chosen:
        return None
    steps = steps_of(chosen)
    builder = table.builder()
    builder.play(steps)
    motion = builder.motion()
    moving = sum(c.cost for c in chosen if not _is_hold(c)) / sum(c.cost for c in chosen)
    others = [
        assess(name, problem, scaled(make, budget), rate) for name, make in _standard(table).items()
    ]
    return Plan(problem, table, steps, assess("plan", problem, motion, rate), others, moving)


def _is_hold(candidate: Candidate) -> bool:
    return not hasattr(candidate.action, "rate")


def _fitting(
    candidates: Sequence[Candidate], prior: FloatArray, table: Table, budget: float
) -> list[Candidate]:
    """Return the candidates of a plan whose true duration, with its slews, fits the time."""
    allowed = budget
    best: list[Candidate] = []
    best_time = 0.0
    for _ in range(MAX_TRIES):
        chosen = optimize(candidates, prior, allowed)
        if not chosen:
            break
        builder = table.builder()
        builder.play(steps_of(chosen))
        duration = builder.motion().duration
        if best_time < duration <= budget + _SLACK:
            best, best_time = chosen, duration
        if budget * (1.0 - _CLOSE) < duration <= budget + _SLACK:
            break
        allowed *= budget / duration
    return best


def scaled(make: Callable[[float], MotionBuilder], budget: float) -> TableMotion:
    """Return a standard sequence whose still times and turns are scaled to a duration (s)."""
    low, high = 0.02, 50.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        if make(middle).motion().duration < budget:
            low = middle
        else:
            high = middle
    return make(low).motion()


def _standard(table: Table) -> dict[str, Callable[[float], MotionBuilder]]:
    """Return the standard sequences of a table by name, as functions of their length."""
    if table.axes == 3:
        return {"faces": _faces, "S1": _s1, "S2": _s2}
    if table.axes == 2:
        return {"positions": lambda s: _two_axes(table, s)}
    still_angles = tuple(float(a) for a in range(0, 360, 45))
    top = float(np.rad2deg(min(table.rates[-1], np.deg2rad(60.0))))

    def one_axis(s: float) -> MotionBuilder:
        return sequences.one_axis(table.mountings, still_angles, 20.0 * s, rate=top, turns=10.0 * s)

    return {"positions": one_axis}


def _faces(s: float) -> MotionBuilder:
    b = MotionBuilder(3)
    sequences.faces(b, 60.0 * s, 60.0, 10.0 * s)
    return b


def _s1(s: float) -> MotionBuilder:
    return sequences.s1(10.0 * s, 60.0 * s)


def _s2(s: float) -> MotionBuilder:
    return sequences.s2(s)


def _two_axes(table: Table, s: float) -> MotionBuilder:
    b = MotionBuilder(2, table.acceleration, table.slew_rate)
    top = min(table.rates[-1], float(np.deg2rad(60.0)))
    for inner in range(0, 360, 90):
        b.go(np.deg2rad([0.0, inner]))
        b.hold(20.0 * s)
        b.spin(0, top, 10.0 * s)
    for outer in range(0, 360, 90):
        b.go(np.deg2rad([outer, 0.0]))
        b.hold(20.0 * s)
        b.spin(1, top, 10.0 * s)
    return b
