"""`rotcli convert`: a log of any format into plain Parquet or CSV."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, messages, options, output
from rotcli.cli.batch import runs
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.logs import inspect as inspections
    from rotcli.logs import readings
    from rotcli.logs import table as table_logs

if TYPE_CHECKING:
    from rotcli.rig.rig import Rig


@dataclass(frozen=True)
class ConvertCommand(runs.BatchOptions):
    """Options of `rotcli convert`."""

    log: str | None
    format: str | None


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --csv -o run",
        "rotcli convert run/imu.csv -o run/imu.parquet",
    )
)
@click.argument("log", required=False)
@click.option(
    "--format",
    metavar="NAME",
    help="Format of an IMU log, such as xsens or kf-gins [default: from the rig or the file].",
)
@options.max_bytes
@options.rig
@options.messages
@runs.options
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    required=True,
    help="Write here: .parquet, .csv, .csv.gz or .csv.zst; with --batch a folder.",
)
@options.collect(ConvertCommand)
def command(given: ConvertCommand) -> None:
    """Convert an IMU log or a table log into plain Parquet or CSV.

    IMU: time in s and readings in SI, increments as increments, on the axes of the IMU, no gap
    interpolated. Table: time in s and angle in rad, unwrapped or integrated, in the sense of the
    encoder. The new log names its units; the rig keeps its other keys.
    """
    if given.batch:
        runs.run_batch(BATCH, given, (given.log,))
        return
    log, target = runs.require_argument(given.log, "LOG"), str(given.output)
    output.check_outputs([given.rig_path], {"-o": target}, log=log)
    rig = loading.load_rig(given.rig_path, log, {"imu": {"format": given.format}})
    is_table = not given.format and inspections.guess_kind(log, rig) == "table"
    convert = _convert_table if is_table else _convert_imu
    summary, warnings = convert(log, rig, target)
    messages.warn(warnings, given.quiet)
    messages.info(f"{target}: {summary}", given.quiet)


def process_run(
    imu_log: str, table_log: str | None, given: ConvertCommand
) -> "list[runs.WrittenLog]":
    """Convert both logs of one run of a batch."""
    target = Path(str(given.output))
    rig = loading.load_rig(given.rig_path, imu_log, {"imu": {"format": given.format}})
    _, warnings = _convert_imu(imu_log, rig, str(target))
    written = [runs.WrittenLog(list(warnings))]
    if table_log is not None:
        _, warnings = _convert_table(table_log, rig, str(target.with_name("table.parquet")))
        written.append(runs.WrittenLog(list(warnings)))
    return written


def _convert_imu(log: str, rig: "Rig", target: str) -> tuple[str, Sequence[str]]:
    """Write the readings of an IMU log; return a summary and warnings."""
    with messages.progress("reading") as progress:
        found = readings.read_readings(log, rig, progress, **loading.byte_limit())
    output.write_time_series(target, readings.file_columns(found))
    span = units.format_span(found.time[0], found.time[-1])
    return f"{len(found.time)} samples, {span}{loading.required_rig_keys(rig)}", found.warnings


def _convert_table(log: str, rig: "Rig", target: str) -> tuple[str, Sequence[str]]:
    """Write the angle of a table log, in the sense and on the clock of the encoder."""
    plain = rig.override({"table": {"direction": 1, "time_offset": 0.0, "clock_rate": 0.0}})
    table = table_logs.read_table(log, plain, **loading.byte_limit())
    output.write_time_series(target, {"time [s]": table.time, "angle [rad]": table.angle})
    span = units.format_span(table.time[0], table.time[-1])
    return f"{len(table.time)} records, {span}", table.warnings


BATCH = runs.BatchCommand(module=__name__, stem="", imports=("rotcli.logs.readings",))
