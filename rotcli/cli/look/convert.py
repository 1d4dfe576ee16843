"""`rotcli convert`: a log of any format into plain Parquet or CSV."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, messages, options, output
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.logs import inspect as inspections
    from rotcli.logs import readings
    from rotcli.logs import table as table_logs

if TYPE_CHECKING:
    from rotcli.rig.rig import Rig


@dataclass(frozen=True)
class ConvertCommand:
    """Options of `rotcli convert`."""

    log: str
    format: str | None
    rig_path: str | None
    quiet: bool
    output: str


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --csv -o run",
        "rotcli convert run/imu.csv -o run/imu.parquet",
    )
)
@click.argument("log")
@click.option(
    "--format",
    metavar="NAME",
    help="Format of an IMU log, such as xsens or kf-gins [default: from the rig or the file].",
)
@options.max_bytes
@options.rig
@options.messages
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    required=True,
    help="Write here: .parquet, .csv, .csv.gz or .csv.zst.",
)
@options.collect(ConvertCommand)
def command(given: ConvertCommand) -> None:
    """Convert an IMU log or a table log into plain Parquet or CSV.

    IMU: time in s and readings in SI, increments as increments, on the axes of the IMU, no gap
    interpolated. Table: time in s and angle in rad, unwrapped or integrated, in the sense of the
    encoder. The new log names its units; the rig keeps its other keys.
    """
    output.check_outputs([given.rig_path], {"-o": given.output}, log=given.log)
    rig = loading.load_rig(given.rig_path, given.log, {"imu": {"format": given.format}})
    if not given.format and inspections.guess_kind(given.log, rig) == "table":
        _convert_table(given, rig)
        return
    with messages.progress("reading") as progress:
        found = readings.read_readings(given.log, rig, progress, **loading.byte_limit())
    messages.warn(found.warnings, given.quiet)
    output.write_time_series(given.output, readings.file_columns(found))
    span = units.show_span(found.time[0], found.time[-1])
    needs = loading.required_rig_keys(rig)
    messages.info(f"{given.output}: {len(found.time)} samples, {span}{needs}", given.quiet)


def _convert_table(given: ConvertCommand, rig: "Rig") -> None:
    """Write the angle of a table log, in the sense and on the clock of the encoder."""
    plain = rig.override({"table": {"direction": 1, "time_offset": 0.0, "clock_rate": 0.0}})
    table = table_logs.read_table(given.log, plain, **loading.byte_limit())
    messages.warn(table.warnings, given.quiet)
    output.write_time_series(given.output, {"time [s]": table.time, "angle [rad]": table.angle})
    span = units.show_span(table.time[0], table.time[-1])
    messages.info(f"{given.output}: {len(table.time)} records, {span}", given.quiet)
