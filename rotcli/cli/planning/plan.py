"""`rotcli plan`: the sequence that calibrates best in a given time."""

from typing import TYPE_CHECKING, Any

import click

from rotcli.cli import loading, messages, options
from rotcli.cli import output as delivery
from rotcli.cli.measure.triad import Groups

if TYPE_CHECKING:
    from rotcli.plan.estimate import Plan
    from rotcli.rig.sequence import TableSequence

_DEFAULT_AXES = {1: ("x",), 2: ("x", "z"), 3: ("z", "x", "y")}
# deg/sqrt(h) and m/s/sqrt(h): a MEMS IMU of tactical grade, where the rig has no figures.
_DEFAULT_NOISE = {"angle_random_walk": 0.4, "velocity_random_walk": 0.05}
_SLOWER = (0.3, 0.6, 1.0)  # shares of the largest rate that a plan may use
_MAX_MINUTES = 24.0 * 60.0


@click.command(
    epilog=options.example(
        "rotcli plan --table 3 --minutes 15 --sequence plan.toml --steps plan.md",
        "rotcli simulate --sequence plan.toml --imu nav440 --seed 1 -o planned",
    )
)
@click.option("--table", "axes", type=click.IntRange(1, 3), required=True, help="Number of axes.")
@click.option(
    "--minutes", type=click.FloatRange(1.0, _MAX_MINUTES), required=True, help="Time there is."
)
@click.option(
    "--max-rate",
    type=click.FloatRange(1.0, 2000.0),
    default=100.0,
    show_default=True,
    metavar="DEG_S",
    help="Largest rate of the table and of the gyros.",
)
@click.option(
    "--acceleration",
    type=click.FloatRange(0.1, 1e4),
    default=20.0,
    show_default=True,
    metavar="DEG_S2",
    help="Of ramps and slews.",
)
@click.option("--slew-rate", type=click.FloatRange(0.1, 2000.0), default=20.0, show_default=True)
@click.option("--parameters", type=Groups(), help="Groups to estimate [default: all but Ag, Aa].")
@click.option("--sequence", metavar="FILE", help="Write the sequence (TOML) for simulate.")
@click.option("--steps", metavar="FILE", help="Write the numbered steps for the operator (.md).")
@options.rig
@options.output
def command(
    axes: int,
    minutes: float,
    max_rate: float,
    acceleration: float,
    slew_rate: float,
    parameters: str | None,
    sequence: str | None,
    steps: str | None,
    rig_path: str | None,
    output: str | None,
    quiet: bool,
) -> None:
    """Plan positions and spins that calibrate both triads best in the time (D-optimal).

    Compares the predicted sigmas with those of the standard sequences of the same duration. The
    noise is the rig's. A single axis should lie horizontally; the IMU then has three mountings.
    """
    from rotcli.files.documents import document, write_text
    from rotcli.plan.document import KIND, comparison_table, fields, headline, step_list
    from rotcli.plan.estimate import make_plan
    from rotcli.rig.sequence import sequence_text

    outputs = {"-o": output, "--sequence": sequence, "--steps": steps}
    delivery.check_outputs([rig_path], outputs)
    rig = loading.load_rig(rig_path, None)
    problem, table, drawn = _set_up(rig, axes, max_rate, acceleration, slew_rate, parameters)
    plan = make_plan(problem, table, 60.0 * minutes)
    if not plan.steps:
        raise click.UsageError("--minutes: too short for one hold and one spin")
    doc = document(KIND, [], rig.effective(), fields(plan))
    if sequence:
        remark = f"rotcli plan --table {axes} --minutes {minutes:g}"
        write_text(sequence, sequence_text(_sequence(plan, drawn), remark))
        messages.say(f"{sequence}: {len(plan.steps)} steps", quiet)
    if steps:
        write_text(steps, step_list(plan))
        messages.say(f"{steps}: {len(plan.steps)} steps", quiet)
    delivery.deliver(doc, comparison_table(doc), output, quiet, headline)


def _set_up(
    rig: Any,
    axes: int,
    max_rate: float,
    acceleration: float,
    slew_rate: float,
    parameters: str | None,
) -> tuple[Any, Any, Any]:
    """Return the problem, the table's limits and the nominal table."""
    import numpy as np

    from rotcli.models.earth import gravity_at
    from rotcli.models.rotation import attitude_matrix, axis_rotation
    from rotcli.models.triad import parameters as p
    from rotcli.models.triad.information import Problem
    from rotcli.models.triad.kinematics import table as nominal_table
    from rotcli.plan.candidates import Table
    from rotcli.rig.rig import LABORATORY
    from rotcli.units import DEG

    if rig.table.axes and len(rig.table.axes) != axes:
        raise click.UsageError(f"--table {axes}: the rig has {len(rig.table.axes)} axes")
    site, held = rig.site or LABORATORY, rig.attitude
    x, y, z = np.eye(3)
    mounts = [np.eye(3)]
    if axes == 1:  # quarter turns that bring each sensor axis to the table axis x
        mounts += [axis_rotation(z, 0.5 * np.pi), axis_rotation(y, 0.5 * np.pi)]
    nominal = nominal_table(
        [tuple(a) for a in rig.table.axes] or _DEFAULT_AXES[axes],
        latitude=site.latitude,
        gravity=gravity_at(site.latitude, site.height, site.gravity),
        C_nb=attitude_matrix(held.pitch or 0.0, held.roll or 0.0, held.azimuth or 0.0),
        mountings=mounts,
    )
    noise = rig.override({"imu": _missing_noise(rig)}).imu
    white = [noise.figure(name) for name in _DEFAULT_NOISE]
    sigma = np.concatenate(white) * 10.0  # one sample at 100 Hz
    groups = parameters or p.BASIC
    free = p.select(groups, axes, mountings=len(mounts))
    problem = Problem(nominal, free, p.weak_priors(len(mounts)), sigma)
    rates = tuple(share * max_rate * DEG for share in _SLOWER)
    table = Table(axes, rates, acceleration * DEG, slew_rate * DEG, len(mounts))
    return problem, table, nominal


def _missing_noise(rig: Any) -> dict[str, float]:
    """Return default noise figures where the rig has none."""
    return {name: v for name, v in _DEFAULT_NOISE.items() if rig.imu.figure(name) is None}


def _sequence(plan: "Plan", nominal: Any) -> "TableSequence":
    """Return the plan as a sequence."""
    from rotcli.rig.sequence import TableSequence

    return TableSequence(
        "plan", nominal.axes, plan.table.acceleration, plan.table.slew_rate, tuple(plan.steps),
        nominal.mountings,
    )  # fmt: skip
