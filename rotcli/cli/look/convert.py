"""`rotcli convert`: an IMU log of any known format into plain Parquet or CSV."""

from dataclasses import dataclass

import click

from rotcli.cli import loading, messages, options, output


@dataclass(frozen=True)
class ConvertCommand:
    """Options of `rotcli convert`."""

    imu_log: str
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
@click.argument("imu_log")
@click.option(
    "--format",
    metavar="NAME",
    help="xsens, euroc, kf-gins or psins [default: the rig's; its columns, delimiter, comment "
    "and skip describe any other].",
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
    """Convert an IMU log into plain Parquet or CSV, without changing the readings.

    Time in s and readings in SI, increments as increments, on the axes of the IMU, no gap
    interpolated: with the same rig both files give the same results.
    """
    from rotcli.logs.readings import file_columns, read_readings
    from rotcli.units import show_span

    output.check_outputs([given.rig_path], {"-o": given.output}, log=given.imu_log)
    rig = loading.load_rig(given.rig_path, given.imu_log, {"imu": {"format": given.format}})
    with messages.progress("reading") as progress:
        found = read_readings(given.imu_log, rig, progress, **loading.byte_limit())
    messages.warn(found.warnings, given.quiet)
    output.write_time_series(given.output, file_columns(found))
    span = show_span(found.time[0], found.time[-1])
    needs = loading.required_rig_keys(rig)
    messages.info(f"{given.output}: {len(found.time)} samples, {span}{needs}", given.quiet)
