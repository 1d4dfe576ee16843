"""`rotcli triad`: full calibration on a table of one to three axes, or by hand."""

from dataclasses import replace
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, messages, options, output
from rotcli.cli.batch import runs
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily

with lazily():
    from rotcli.files import channels
    from rotcli.files.results import find
    from rotcli.logs import table_axes
    from rotcli.models.triad import parameters
    from rotcli.triad import api

if TYPE_CHECKING:
    from rotcli.triad.api import TriadCalibration

CONVENTIONS = ("auto", "table", "accelerometer", "z-accelerometer", "symmetric")
GROUP_NAMES = ("N", "d", "G", "Ag", "M", "b", "K2", "Aa", "R", "eps", "table", "tau", "g")


class Groups(click.ParamType):  # type: ignore[type-arg]
    """Groups of parameters: a comma-separated list."""

    name = "N,d,…"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Return the groups with blanks between them."""
        names = [part.strip() for part in str(value).replace(" ", ",").split(",") if part.strip()]
        wrong = [name for name in names if name not in GROUP_NAMES]
        if wrong or not names:
            known = ", ".join(GROUP_NAMES)
            self.fail(f"{wrong[0] if wrong else value!r} must be one of {known}", param, ctx)
        return " ".join(names)


@dataclass(frozen=True)
class TriadCommand(runs.BatchOptions):
    """Options of `rotcli triad`."""

    logs: tuple[str, ...]
    merge: bool
    parameters: str | None
    asymmetry: bool
    convention: str
    no_drift: bool
    residuals: str | None
    plot: str | None
    max_gap: int


@click.command(
    epilog=options.example(
        "rotcli simulate --sequence M5 --imu nav440 --seed 1 -o run",
        "rotcli triad run/imu.parquet run/table.parquet -o run/triad.json",
    )
)
@click.argument("logs", nargs=-1, metavar="IMU_LOG [TABLE_LOG]")
@options.rig
@click.option(
    "--merge",
    is_flag=True,
    help="The arguments (files, folders, patterns) are results of rotcli calibrate about three "
    "axes; merge them into one.",
)
@click.option(
    "--parameters",
    type=Groups(),
    help="Groups to estimate: N d G Ag M b K2 Aa R eps table tau g [default: all but Ag, Aa].",
)
@click.option("--asymmetry", is_flag=True, help="Estimate the asymmetries Ag and Aa as well.")
@click.option(
    "--convention",
    type=click.Choice(CONVENTIONS),
    default="auto",
    show_default=True,
    help="Sensor frame: the table's, or fixed by the accelerometers (Kalibr, PSINS; "
    "z-accelerometer: imu_tk).",
)
@click.option("--no-drift", is_flag=True, help="Constant biases, whatever the rig's noise says.")
@click.option("--residuals", metavar="FILE", help="Write the residuals (.csv or .parquet).")
@options.plot("residuals before and after")
@options.max_gap
@options.max_bytes
@runs.options
@options.output
@options.collect(TriadCommand)
def command(given: TriadCommand) -> None:
    """Calibrate gyros and accelerometers: scale, installation, bias, g-sensitivity and more.

    With TABLE_LOG the angles of one to three table axes; ramps and slews are data. Without it the
    IMU was moved by hand through at least twelve still poses.
    """
    if given.batch:
        if given.merge:
            raise click.UsageError("--merge combines results; not with --batch")
        runs.run_batch(BATCH, given, given.logs)
        return
    if given.merge:
        given = replace(given, logs=find.calibration_paths(given.logs))
    _check_usage(given)
    outputs = {"-o": given.output, "--residuals": given.residuals, "--plot": given.plot}
    output.check_outputs([*given.logs[1:], given.rig_path], outputs, log=given.logs[0])
    output.print_or_write(_measure(given), given.output, given.quiet)


def process_run(
    imu_log: str, table_log: str | None, given: TriadCommand
) -> "list[TriadCalibration]":
    """Calibrate one run of a batch."""
    logs = (imu_log,) if table_log is None else (imu_log, table_log)
    return [_measure(replace(given, logs=logs))]


def _measure(given: TriadCommand) -> "TriadCalibration":
    """Calibrate or merge; write the files that are requested."""
    result = _merge(given) if given.merge else _calibrate(given)
    if given.residuals:
        output.write_time_series(given.residuals, result.estimate.series)
    if given.plot:
        result.plot(given.plot)
    return result


def _check_usage(given: TriadCommand) -> None:
    """Raise UsageError for a wrong number of arguments and for options that exclude each other."""
    if given.merge and len(given.logs) < 3:
        raise click.UsageError("--merge needs three results of rotcli calibrate")
    if given.merge and (given.residuals or given.plot):
        raise click.UsageError("--merge has no residuals; leave out --residuals and --plot")
    if not given.merge and not 1 <= len(given.logs) <= 2:
        raise click.UsageError("give IMU_LOG and, where there is a table, TABLE_LOG")


def _merge(given: TriadCommand) -> "TriadCalibration":
    """Merge single-axis calibrations."""
    return api.merge_calibrations(given.logs)


def _calibrate(given: TriadCommand) -> "TriadCalibration":
    """Calibrate from logs."""
    rig = loading.load_rig(given.rig_path, given.logs[0])
    table = None
    if len(given.logs) > 1:
        limit = loading.byte_limit()
        table = table_axes.read_table_axes(given.logs[1], rig, imu_log=given.logs[0], **limit)
    imu = loading.load_imu(given.logs[0], rig, given.max_gap, channels=channels.AXES)
    groups = parameters.WITH_ASYMMETRY if given.asymmetry else parameters.BASIC
    chosen = api.TriadOptions(
        given.parameters or groups, given.convention, drift=not given.no_drift
    )
    with messages.progress("calibrating") as progress:
        return api.calibrate_triad(imu, table, rig, chosen, progress)


BATCH = runs.BatchCommand(
    module=__name__,
    stem="triad",
    file_options=("residuals", "plot"),
    imports=("rotcli.triad.api",),
)
