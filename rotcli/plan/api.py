"""Plan a calibration: rig and settings in, a result with its document, sequence and steps out."""

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.files.results.documents import document as result_document
from rotcli.files.results.documents import write_text
from rotcli.files.results.expected_runs import expected_fields, expected_table
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import attitude_matrix, axis_rotation
from rotcli.models.triad import parameters as p
from rotcli.models.triad.information import Problem
from rotcli.models.triad.kinematics import table as nominal_table
from rotcli.plan import document
from rotcli.plan.candidates import Table as TableLimits
from rotcli.plan.estimate import Plan, make_plan
from rotcli.plan.expected import plan_expectation
from rotcli.rig.rig import DEFAULT_SITE, Rig
from rotcli.rig.sequence import TableSequence, sequence_text
from rotcli.units import DEG

with lazily():
    from rotcli.plan import plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table

_DEFAULT_AXES = {1: ("x",), 2: ("x", "z"), 3: ("z", "x", "y")}
# deg/sqrt(h), m/s/sqrt(h): a MEMS IMU of tactical grade, where the rig has no figures.
_DEFAULT_NOISE = {"angle_random_walk": 0.4, "velocity_random_walk": 0.05}
_RATE_SHARES = (0.3, 0.6, 1.0)  # of the largest rate that a plan may use
IMU_RATE = 100.0  # Hz; the sigmas of a plan depend on the random walks alone


@dataclass(frozen=True)
class PlanOptions:
    """Settings of a plan: number of axes, time (s), limits in deg and s, parameter groups."""

    axes: int
    time: float
    max_rate: float = 100.0
    acceleration: float = 20.0
    slew_rate: float = 20.0
    groups: str = p.BASIC


@dataclass(frozen=True, eq=False)
class PlanResult(Result):
    """A plan: its document, and the steps."""

    plan: Plan

    kind: ClassVar[str] = document.KIND

    def tables(self) -> "list[Table]":
        """Return the comparison with the standard sequences."""
        expected = self.document["expected"]
        tables = [document.comparison_table(self.document)]
        return [*tables, expected_table(expected)] if expected["runs"] else tables

    def figure(self) -> "Figure":
        """Return the figure of the expected errors; raises ResultError without noise figures."""
        return plot.plan_figure(self.document)

    def one_line_summary(self) -> str:
        """Return duration and D-efficiencies in one line."""
        return document.headline(self.document)

    def write_sequence(self, path: str) -> None:
        """Write the sequence file that `simulate` plays; raises ResultError."""
        plan = self.plan
        sequence = TableSequence(
            "plan",
            plan.problem.table.axes,
            plan.table.acceleration,
            plan.table.slew_rate,
            tuple(plan.steps),
            plan.problem.table.mountings,
        )
        write_text(path, sequence_text(sequence, self.one_line_summary()))

    def write_steps(self, path: str) -> None:
        """Write the numbered steps for the operator in Markdown; raises ResultError."""
        write_text(path, document.step_list(self.plan))


def plan_sequence(rig: Rig, options: PlanOptions) -> PlanResult:
    """Return the D-optimal plan; raises RotcliError when the time is too short for any step."""
    problem = _problem(rig, options)
    rates = tuple(share * options.max_rate * DEG for share in _RATE_SHARES)
    limits = TableLimits(
        options.axes,
        rates,
        options.acceleration * DEG,
        options.slew_rate * DEG,
        problem.table.mounting_count,
    )
    plan = make_plan(problem, limits, options.time, rate=IMU_RATE)
    if plan is None:
        raise RotcliError(f"{options.time:g} s are too short for one hold or one spin; plan longer")
    expected = {
        "rate_dps": options.max_rate,
        **expected_fields(plan_expectation(rig, options.max_rate)),
    }
    fields = {**document.fields(plan), "expected": expected}
    doc = result_document(document.KIND, [], rig.effective(), fields)
    return PlanResult(doc, plan)


def _problem(rig: Rig, options: PlanOptions) -> Problem:
    """Return table, parameters, priors and noise of a plan."""
    site, attitude = rig.site or DEFAULT_SITE, rig.attitude
    _, y, z = np.eye(3)
    mounts = [np.eye(3)]
    if options.axes == 1:  # quarter turns that bring each sensor axis to the table axis x
        quarter_turns = [axis_rotation(axis, 0.5 * np.pi) for axis in (z, y)]
        mounts += [np.round(turn) + 0.0 for turn in quarter_turns]
    nominal = nominal_table(
        [tuple(a) for a in rig.table.axes] or _DEFAULT_AXES[options.axes],
        latitude=site.latitude,
        gravity=gravity_at(site.latitude, site.height, site.gravity),
        C_nb=attitude_matrix(attitude.pitch or 0.0, attitude.roll or 0.0, attitude.azimuth or 0.0),
        mountings=mounts,
    )
    missing = {name: v for name, v in _DEFAULT_NOISE.items() if rig.imu.figure(name) is None}
    imu = (rig.override({"imu": missing}) if missing else rig).imu
    white = [imu.figure(name) for name in _DEFAULT_NOISE]
    sigma = np.concatenate([w for w in white if w is not None]) * np.sqrt(IMU_RATE)
    count = len(mounts)
    priors = p.weak_priors(count)
    if site.gravity_sigma is not None:
        priors[p.GRAVITY] = site.gravity_sigma
    return Problem(nominal, p.select(options.groups, options.axes, mountings=count), priors, sigma)
