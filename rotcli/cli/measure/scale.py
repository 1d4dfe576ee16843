"""`rotcli scale`: scale factor over rates."""

from dataclasses import dataclass
from typing import Literal

import click

from rotcli.cli import messages, options, output
from rotcli.cli.measure import turn_ons
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.scale import api

MODELS = ("line", "asym", "quad", "odd", "cubic", "asym+odd", "table")


@dataclass(frozen=True)
class ScaleCommand(options.OutputOptions):
    """Options of `rotcli scale`."""

    logs: tuple[str, ...]
    rig_path: str | None
    model: str | None
    full_scale: float | None
    horizon: options.Span | None
    block: float | None
    earth_rate: Literal["compensate", "ignore"]
    plot: str | None
    max_gap: int | None


@click.command(
    epilog=options.example(
        "rotcli simulate --scenario scale-test --seed 1 -o run",
        "rotcli scale run/imu.parquet run/table.parquet -o run/scale.json",
    )
)
@click.argument("logs", nargs=-1, required=True, metavar="IMU_LOG TABLE_LOG …")
@options.rig
@click.option("--model", type=click.Choice(MODELS), help="Error curve [default: chosen by test].")
@click.option(
    "--full-scale",
    type=options.NOT_NEGATIVE,
    metavar="DEG_S",
    help="Rate for ppm of full scale [default: gyro_range of the rig, else the largest rate].",
)
@options.horizon
@click.option(
    "--block",
    type=options.NOT_NEGATIVE,
    metavar="S",
    help="Divide segments into blocks of this length [default: complete segments].",
)
@options.earth_rate
@click.option("--plot", metavar="FILE", help="Draw error and residuals (.png, .svg, .pdf).")
@options.max_gap
@options.max_bytes
@options.output
@options.collect(ScaleCommand)
def command(given: ScaleCommand) -> None:
    """Measure scale factor, asymmetry, nonlinearity and hysteresis over rates.

    Each pair of logs contains segments at many constant rates about one axis; alternate the
    signs. Several pairs are several turn-ons of one IMU and give the repeatability.
    """
    if len(given.logs) < 2:
        raise click.UsageError("give pairs of logs, IMU_LOG TABLE_LOG, one per turn-on")
    outputs = {"-o": given.output, "--plot": given.plot}
    output.check_outputs([*given.logs[1:], given.rig_path], outputs, log=given.logs[0])
    runs = turn_ons.load_turn_ons(given.logs, given.rig_path, given.max_gap)
    full_scale = units.DEG * given.full_scale if given.full_scale else None
    settings = api.ScaleOptions(
        given.model, full_scale, given.horizon, given.block or None, given.earth_rate
    )
    with messages.progress("averaging") as progress:
        result = api.scale_logs(runs, settings, progress)
    if given.plot:
        result.plot(given.plot)
    output.deliver(result, given.output, given.quiet)
