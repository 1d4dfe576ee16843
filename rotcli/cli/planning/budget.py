"""`rotcli budget`: the error after one turn about each axis."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, messages, options, output, values
from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.lazy import lazily

with lazily():
    from rotcli.budget import api
    from rotcli.cli.planning import scale_design
    from rotcli.files.results import documents, find
    from rotcli.files.tables import writers

if TYPE_CHECKING:
    from rotcli.budget.api import BudgetOptions, BudgetResult


@dataclass(frozen=True)
class BudgetCommand(options.OutputOptions):
    """Options of `rotcli budget`."""

    axes: tuple[str, ...]
    rate: float | None
    calibration: str | None
    imu: str | None
    accel_bias: str | None
    gyro_bias: str | None
    gyro_scale: str | None
    gyro_installation: str | None
    angle_random_walk: float | None
    bias_instability: float | None
    rate_random_walk: float | None
    latitude: float | None
    duration: float
    within_turn: bool
    rig_path: str | None
    plot: str | None
    scale: str | None
    segment: float
    change: float

    def settings(self) -> "BudgetOptions":
        """Return the settings of the capability."""
        noise = ("angle_random_walk", "bias_instability", "rate_random_walk")
        return api.BudgetOptions(
            axes=self.axes,
            rate=self.rate,
            calibration=self.calibration,
            imu=self.imu,
            accel_bias=values.numbers(self.accel_bias, 3, "--accel-bias"),
            gyro_bias=values.numbers(self.gyro_bias, 3, "--gyro-bias"),
            gyro_scale=values.numbers(self.gyro_scale, 3, "--gyro-scale"),
            gyro_installation=values.numbers(self.gyro_installation, 6, "--gyro-installation"),
            noise={name: getattr(self, name) for name in noise},
            duration=self.duration,
            within_turn=self.within_turn,
        )


@click.command(
    epilog=options.example("rotcli budget --imu nav440 --rate 10 --gyro-bias 0,0,0 -o budget.md")
)
@click.option(
    "--axis",
    "axes",
    type=click.Choice(["x", "y", "z"]),
    multiple=True,
    help="Only this rotation axis; repeat for several [default: x, y and z].",
)
@click.option(
    "--rate",
    type=options.FINITE,
    metavar="DEG_S",
    help="Table rate [default: the calibration's, else 10].",
)
@click.option(
    "--calibration", metavar="FILE|DIR|GLOB", help="Sensor errors of rotcli calibrate or triad."
)
@click.option("--imu", metavar="NAME|FILE", help="IMU profile: mti-g, nav440, ideal or a file.")
@click.option("--accel-bias", metavar="X,Y,Z", help="m/s^2.")
@click.option("--gyro-bias", metavar="X,Y,Z", help="deg/h.")
@click.option("--gyro-scale", metavar="X,Y,Z", help="Kgx, Kgy, Kgz, ppm.")
@click.option("--gyro-installation", metavar="XY,XZ,YX,YZ,ZX,ZY", help="Kgxy, Kgxz, Kgyx ..., ppm.")
@click.option("--angle-random-walk", metavar="X", type=click.FloatRange(min=0), help="deg/sqrt(h).")
@click.option("--bias-instability", metavar="X", type=click.FloatRange(min=0), help="deg/h.")
@click.option(
    "--rate-random-walk", metavar="X", type=click.FloatRange(min=0), help="deg/h/sqrt(s)."
)
@click.option(
    "--latitude", type=options.FINITE, metavar="DEG", help="[default: the rig's, else 51.08]"
)
@click.option(
    "--duration",
    metavar="S",
    type=click.FloatRange(min=1, max=3600),
    default=300.0,
    show_default=True,
    help="Duration of the error growth, up to 3600 s; after that the unaided height error "
    "dominates.",
)
@click.option(
    "--within-turn",
    is_flag=True,
    help="Add each source's error in East, North, Up against the table angle; --plot draws it.",
)
@click.option("--rig", "rig_path", metavar="FILE", help="[default: the calibration's, if any]")
@click.option(
    "--scale",
    metavar="RATES",
    help="Predict instead the sigmas of a scale factor test at these rates, deg/s, in this order "
    "(0,10,-10,...); needs the noise figures of --imu, --rig or options.",
)
@click.option("--segment", type=options.NOT_NEGATIVE, metavar="S", default=60.0, show_default=True)
@click.option("--change", type=options.NOT_NEGATIVE, metavar="S", default=4.0, show_default=True)
@options.plot("the budget")
@options.output_as(".md", ".tex", ".csv", ".txt")
@options.collect(BudgetCommand)
def command(given: BudgetCommand) -> None:
    """Predict the error after one turn per axis and source, and recommend an axis.

    The sensor errors come from a profile (--imu), a calibration, or the options, each overriding
    the former; values that none of them contains are zero. With --gyro-bias 0,0,0 the budget is
    that of calibrated gyro biases. -o takes .json, .md, .tex, .csv or .txt.
    """
    if given.scale is not None:
        scale_design.run(given.scale, given)
        return

    given = _with_one_calibration(given)
    read = [given.calibration, given.rig_path, given.imu]
    output.check_outputs(read, {"-o": given.output, "--plot": given.plot})
    settings = given.settings()
    known_rig = given.rig_path or not given.calibration
    rig = loading.load_rig(given.rig_path, None) if known_rig else None
    try:
        errors = api.gather_sensor_errors(settings, rig)
    except ResultError as error:
        if str(error).startswith(("no sensor errors", "rate:")):
            raise click.UsageError(_with_options(str(error))) from error
        raise
    overrides: loading.Overrides = {
        "site": {"latitude": given.latitude},
        "imu": {"name": errors.name},
    }
    errors = replace(errors, rig=loading.apply_overrides(errors.rig, overrides))
    result = api.budget_of(errors, settings)
    if given.plot:
        result.plot(given.plot)
        messages.verbose(f"{given.plot}: written")
    _deliver(result, given)


def _with_one_calibration(given: BudgetCommand) -> BudgetCommand:
    """Return the options with the path of the only calibration of a folder or a pattern."""
    if given.calibration is None:
        return given
    paths = find.calibration_paths([given.calibration])
    if len(paths) > 1:
        raise ResultError(f"{given.calibration}: {len(paths)} calibrations; name one of them")
    return replace(given, calibration=paths[0])


def _with_options(text: str) -> str:
    """Return a message of the capability with the options that solve it."""
    if text.startswith("rate:"):
        return "--rate must not be 0"
    return "no sensor errors: use --imu, --calibration, or figures such as --gyro-bias"


def _deliver(result: "BudgetResult", given: BudgetCommand) -> None:
    """Print the tables, or write them or the document by the suffix of the output."""
    name = given.output
    suffix = ".txt" if name is None else Path(name).suffix.lower()
    if suffix not in writers.WRITERS:
        output.print_or_write(result, name, given.quiet)
        return
    messages.warn(result.warnings, given.quiet)
    documents.write_text(name or "-", writers.WRITERS[suffix](result.tables()))
    if name is not None:
        messages.info(f"{name}: {result.one_line_summary()}", given.quiet)
