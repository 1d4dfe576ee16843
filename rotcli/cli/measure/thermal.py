"""`rotcli thermal`: bias and scale factor over temperature, and warm-up."""

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import click

from rotcli.cli import loading, messages, options, output
from rotcli.cli.batch import runs
from rotcli.cli.measure import turn_ons
from rotcli.cli.values import split_numbers
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.run.laboratory import blocks, turn_on
    from rotcli.thermal import api

if TYPE_CHECKING:
    from rotcli.files.results.result import Result


class Orders(click.ParamType):  # type: ignore[type-arg]
    """Orders of the polynomials of bias and scale factor."""

    name = "P[,Q]"

    def convert(
        self, value: str | tuple[int, int], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Return the two orders; the scale factor has the order of the bias, at most 3."""
        if isinstance(value, tuple):
            return value
        parts = value.split(",")
        if not 1 <= len(parts) <= 2 or not all(part.strip().isdigit() for part in parts):
            self.fail(f"{value!r} is not one or two orders such as 3,2", param, ctx)
        orders = [int(part) for part in parts]
        if orders[0] > 5 or orders[-1] > 5:
            self.fail(f"{value!r}: orders up to 5 are allowed", param, ctx)
        return orders[0], orders[1] if len(orders) == 2 else min(orders[0], 3)


class Knots(click.ParamType):  # type: ignore[type-arg]
    """Rising temperatures, degC."""

    name = "T,T,…"

    def convert(
        self,
        value: str | tuple[float, ...],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[float, ...]:
        """Return the temperatures."""
        if isinstance(value, tuple):
            return value
        knots = tuple(split_numbers(value))
        if (
            not all(abs(knot) <= 1e4 for knot in knots)
            or len(knots) < 2
            or any(b <= a for a, b in pairwise(knots))
        ):
            self.fail(f"{value!r} is not a list of rising temperatures such as 0,20,40", param, ctx)
        return knots


@dataclass(frozen=True)
class ThermalCommand(runs.BatchOptions):
    """Options of `rotcli thermal`."""

    logs: tuple[str, ...]
    temperature_log: str | None
    order: tuple[int, int] | None
    knots: tuple[float, ...] | None
    reference: float | None
    horizon: options.Span | None
    block: float | None
    earth_rate: Literal["compensate", "ignore"]
    warm_up: bool
    power_on: float | None
    limit: float | None
    plot: str | None
    max_gap: int | None


@click.command(
    epilog=options.example(
        "rotcli simulate --scenario thermal-test --seed 1 -o run",
        "rotcli thermal run/imu.parquet run/table.parquet -o run/thermal.json",
    )
)
@click.argument("logs", nargs=-1, metavar="IMU_LOG [TABLE_LOG] …")
@options.rig
@click.option(
    "--temperature-log",
    metavar="FILE",
    help="Temperature from this log (time, temperature) [default: a column of the IMU log].",
)
@click.option(
    "--order", type=Orders(), help="Orders of bias and scale factor [default: smallest BIC]."
)
@click.option(
    "--knots",
    type=Knots(),
    help="Straight lines between these temperatures instead of a polynomial, degC.",
)
@click.option(
    "--reference",
    type=options.FINITE,
    metavar="DEG_C",
    help="Temperature of the coefficients [default: middle of the range].",
)
@options.horizon
@click.option(
    "--block",
    type=options.NOT_NEGATIVE,
    metavar="S",
    help="Length of the blocks [default: 60, with --warm-up 10].",
)
@options.earth_rate
@click.option("--warm-up", is_flag=True, help="Fit the warm-up of one still log from power-on.")
@click.option(
    "--power-on", type=options.FINITE, metavar="S", help="Power-on [default: first sample]."
)
@click.option(
    "--limit",
    type=options.NOT_NEGATIVE,
    metavar="DEG_H",
    help="Bias change that ends the warm-up [default: smallest Allan deviation].",
)
@options.plot("the curves")
@options.max_gap
@options.max_bytes
@runs.options
@options.output
@options.collect(ThermalCommand)
def command(given: ThermalCommand) -> None:
    """Measure bias and scale factor over temperature, lag and warm-up.

    The IMU log contains the temperature. Soaks and ramps, heating and cooling, still and turning
    segments enter one fit; several pairs of logs are several turn-ons. One IMU log alone is still.
    """
    _check_options(given)
    if given.batch:
        if given.temperature_log:
            raise click.UsageError("--temperature-log belongs to one turn-on; not with --batch")
        runs.run_batch(BATCH, given, given.logs)
        return
    if not given.logs:
        raise click.UsageError("Missing argument 'IMU_LOG' (or --batch DIR).")
    inputs = [*given.logs[1:], given.rig_path, given.temperature_log]
    output.check_outputs(inputs, {"-o": given.output, "--plot": given.plot}, log=given.logs[0])
    output.print_or_write(_measure(given), given.output, given.quiet)


def process_run(imu_log: str, table_log: str | None, given: ThermalCommand) -> "list[Result]":
    """Measure one run of a batch, which is one turn-on."""
    logs = (imu_log,) if table_log is None else (imu_log, table_log)
    return [_measure(replace(given, logs=logs))]


def _measure(given: ThermalCommand) -> "Result":
    """Measure all turn-ons, or one warm-up; draw it if requested."""
    result = _warm_up(given) if given.warm_up else _thermal(given)
    if given.plot:
        result.plot(given.plot)
    return result


def _check_options(given: ThermalCommand) -> None:
    """Raise UsageError for options that do not belong together."""
    unused = (
        {"--order": given.order, "--knots": given.knots, "--reference": given.reference}
        if given.warm_up
        else {"--power-on": given.power_on, "--limit": given.limit}
    )
    for option, value in unused.items():
        if value is not None:
            other = "not for --warm-up" if given.warm_up else "needs --warm-up"
            raise click.UsageError(f"{option}: {other}; remove this option")
    if given.order and given.knots:
        raise click.UsageError("--order and --knots exclude each other")
    if given.warm_up and len(given.logs) > 2:
        raise click.UsageError("--warm-up takes one IMU log (and its table log)")
    if given.temperature_log and len(given.logs) > 2:
        raise click.UsageError("--temperature-log belongs to one turn-on; give one pair of logs")


def _thermal(given: ThermalCommand) -> "Result":
    loaded = turn_ons.load_turn_ons(given.logs, given.rig_path, given.max_gap)
    loaded = [turn_ons.with_temperature(run, given.temperature_log) for run in loaded]
    settings = api.ThermalOptions(
        given.order,
        given.reference,
        given.horizon,
        given.block or blocks.TEMPERATURE_BLOCK,
        given.knots,
        given.earth_rate,
    )
    with messages.progress("averaging") as progress:
        return api.thermal_logs(loaded, settings, progress)


def _warm_up(given: ThermalCommand) -> "Result":
    rig = loading.load_rig(given.rig_path, given.logs[0])
    table_log = given.logs[1] if len(given.logs) > 1 else None
    imu, table = loading.load_logs(given.logs[0], table_log, rig, given.max_gap)
    run = turn_ons.with_temperature(turn_on.TurnOn(imu, table, rig), given.temperature_log)
    settings = api.WarmUpOptions(
        given.power_on,
        units.DEG_PER_HOUR * given.limit if given.limit else None,
        given.horizon,
        given.block or api.WARM_UP_BLOCK,
        given.earth_rate,
    )
    with messages.progress("averaging") as progress:
        return api.warm_up_log(run, settings, progress)


BATCH = runs.BatchCommand(
    module=__name__, stem="thermal", file_options=("plot",), imports=("rotcli.thermal.api",)
)
