"""`rotcli scale`: scale factor over rates."""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import click

from rotcli.cli import messages, options, output
from rotcli.cli.batch import runs
from rotcli.cli.measure import turn_ons
from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.scale import api

if TYPE_CHECKING:
    from rotcli.scale.api import ScaleTest

MODELS = ("line", "asym", "quad", "odd", "cubic", "asym+odd", "table")


@dataclass(frozen=True)
class ScaleCommand(runs.BatchOptions):
    """Options of `rotcli scale`."""

    logs: tuple[str, ...]
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
@click.argument("logs", nargs=-1, metavar="IMU_LOG TABLE_LOG …")
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
@options.plot("error and residuals")
@options.max_gap
@options.max_bytes
@runs.options
@options.output
@options.collect(ScaleCommand)
def command(given: ScaleCommand) -> None:
    """Measure scale factor, asymmetry, nonlinearity and hysteresis over rates.

    Each pair of logs contains segments at many constant rates about one axis; alternate the
    signs. Several pairs are several turn-ons of one IMU and give the repeatability.
    """
    if given.batch:
        runs.run_batch(BATCH, given, given.logs)
        return
    if len(given.logs) < 2:
        raise click.UsageError("give pairs of logs, IMU_LOG TABLE_LOG, one per turn-on")
    outputs = {"-o": given.output, "--plot": given.plot}
    output.check_outputs([*given.logs[1:], given.rig_path], outputs, log=given.logs[0])
    output.print_or_write(_measure(given), given.output, given.quiet)


def process_run(imu_log: str, table_log: str | None, given: ScaleCommand) -> "list[ScaleTest]":
    """Measure one run of a batch, which is one turn-on."""
    if table_log is None:
        raise RotcliError(f"{imu_log}: no table.parquet or table.csv in its folder; add it")
    return [_measure(replace(given, logs=(imu_log, table_log)))]


def _measure(given: ScaleCommand) -> "ScaleTest":
    """Measure the scale factor from all turn-ons; draw it if requested."""
    loaded = turn_ons.load_turn_ons(given.logs, given.rig_path, given.max_gap)
    full_scale = units.DEG * given.full_scale if given.full_scale else None
    settings = api.ScaleOptions(
        given.model, full_scale, given.horizon, given.block or None, given.earth_rate
    )
    with messages.progress("averaging") as progress:
        result = api.scale_logs(loaded, settings, progress)
    if given.plot:
        result.plot(given.plot)
    return result


BATCH = runs.BatchCommand(
    module=__name__, stem="scale", file_options=("plot",), imports=("rotcli.scale.api",)
)
