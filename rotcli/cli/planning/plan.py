"""`rotcli plan`: the sequence that calibrates best in a given time."""

import click

from rotcli.cli import loading, messages, options, output
from rotcli.cli.measure.triad import Groups
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily

with lazily():
    from rotcli.models.triad import parameters as triad_parameters
    from rotcli.plan import api

_MAX_MINUTES = 24.0 * 60.0


@dataclass(frozen=True)
class PlanCommand(options.OutputOptions):
    """Options of `rotcli plan`."""

    axes: int
    minutes: float
    max_rate: float
    acceleration: float
    slew_rate: float
    parameters: str | None
    sequence: str | None
    steps: str | None
    plot: str | None
    rig_path: str | None


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
@options.plot("the navigation errors to expect")
@options.rig
@options.output
@options.collect(PlanCommand)
def command(given: PlanCommand) -> None:
    """Plan positions and spins that calibrate both triads best in the time (D-optimal).

    Compares the predicted sigmas with those of the standard sequences of the same duration. The
    noise is the rig's. A single axis should lie horizontally; the IMU then has three mountings.
    """
    outputs = {
        "-o": given.output,
        "--sequence": given.sequence,
        "--steps": given.steps,
        "--plot": given.plot,
    }
    output.check_outputs([given.rig_path], outputs)
    rig = loading.load_rig(given.rig_path, None)
    if rig.table.axes and len(rig.table.axes) != given.axes:
        raise click.UsageError(f"--table {given.axes}: the rig has {len(rig.table.axes)} axes")
    chosen = api.PlanOptions(
        given.axes,
        60.0 * given.minutes,
        given.max_rate,
        given.acceleration,
        given.slew_rate,
        given.parameters or triad_parameters.BASIC,
    )
    with messages.progress("planning"):
        result = api.plan_sequence(rig, chosen)
    for path, write in (
        (given.sequence, result.write_sequence),
        (given.steps, result.write_steps),
        (given.plot, result.plot),
    ):
        if path:
            write(path)
            if path == given.plot:
                messages.verbose(f"{path}: written")
            else:
                messages.info(f"{path}: {len(result.plan.steps)} steps", given.quiet)
    output.print_or_write(result, given.output, given.quiet)
