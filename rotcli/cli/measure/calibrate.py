"""`rotcli calibrate`: gyro biases, scale factor and installation errors about one axis."""

from typing import TYPE_CHECKING, Literal

import click

from rotcli.cli import loading, messages, options, output
from rotcli.cli.batch import runs
from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.lazy import lazily

with lazily():
    from rotcli.calibrate import api

if TYPE_CHECKING:
    from rotcli.calibrate.api import CalibrationResult


@dataclass(frozen=True)
class CalibrateCommand(runs.BatchOptions):
    """Options of `rotcli calibrate`."""

    imu_log: str | None
    table_log: str | None
    static: tuple[options.Span, ...]
    rotation: tuple[options.Span, ...]
    earth_rate: Literal["compensate", "ignore"]
    report_residuals: str | None
    plot: str | None
    warm_up: str | None
    max_gap: int


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
    )
)
@options.logs
@options.rig
@click.option(
    "--static",
    type=options.WINDOW,
    multiple=True,
    help="Still segment, s; repeat for several [default: the rig's, else the first found].",
)
@click.option(
    "--rotation",
    type=options.WINDOW,
    multiple=True,
    help="Turning segment, s; repeat for several [default: the rig's, else all found].",
)
@options.earth_rate
@click.option(
    "--report-residuals", metavar="FILE", help="Write the residuals of the fit (CSV or Parquet)."
)
@options.plot("the residuals against time and table angle")
@click.option(
    "--warm-up", metavar="FILE", help="Result of rotcli thermal --warm-up; warn of its segments."
)
@options.max_gap
@options.max_bytes
@runs.options
@options.output
@options.collect(CalibrateCommand)
def command(given: CalibrateCommand) -> None:
    """Estimate gyro biases, scale factor and installation errors from a log.

    IMU_LOG and TABLE_LOG contain a still segment and one or more segments at a constant table
    rate about one axis. Use the rate of the later navigation: MEMS gyros are not linear.
    """
    if given.batch:
        runs.run_batch(BATCH, given, (given.imu_log, given.table_log))
        return
    imu_log = runs.require_argument(given.imu_log, "IMU_LOG")
    table_log = runs.require_argument(given.table_log, "TABLE_LOG")
    output.check_outputs(
        [table_log, given.rig_path, given.warm_up],
        {
            "-o": given.output,
            "--report-residuals": given.report_residuals,
            "--plot": given.plot,
        },
        log=imu_log,
    )
    output.print_or_write(process(imu_log, table_log, given), given.output, given.quiet)


def process(imu_log: str, table_log: str | None, given: CalibrateCommand) -> "CalibrationResult":
    """Calibrate one run; write or draw its residuals if requested."""
    if table_log is None:
        raise RotcliError(f"{imu_log}: no table.parquet or table.csv in its folder; add it")
    rig = loading.load_rig(given.rig_path, imu_log)
    imu, table = loading.load_run(imu_log, table_log, rig, given.max_gap)
    settings = api.CalibrateOptions(given.static, given.rotation, given.earth_rate, given.warm_up)
    with messages.progress("calibrating") as progress:
        result = api.calibrate_logs(imu, table, rig, settings, progress)
    if given.report_residuals:
        output.write_time_series_chunks(given.report_residuals, result.residuals())
    if given.plot:
        result.plot(given.plot)
    return result


def process_run(
    imu_log: str, table_log: str | None, given: CalibrateCommand
) -> "list[CalibrationResult]":
    """Calibrate one run of a batch."""
    return [process(imu_log, table_log, given)]


BATCH = runs.BatchCommand(
    module=__name__,
    stem="calibration",
    file_options=("report_residuals", "plot"),
    input_options=("warm_up",),
    imports=("rotcli.calibrate.api",),
)
