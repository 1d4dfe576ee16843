"""`rotcli convert`: an IMU log of any known format into plain Parquet or CSV."""

import click

from rotcli.cli import options


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --csv -o run",
        "rotcli convert run/imu.csv -o run/imu.parquet",
    )
)
@click.argument("imu_log")
@click.option(
    "--format",
    "form",
    metavar="NAME",
    help="xsens, euroc, kf-gins or psins [default: the rig's; its own columns, delimiter, comment "
    "and skip describe any other].",
)
@options.rig
@options.messages
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    required=True,
    help="Write here: .parquet, .csv, .csv.gz or .csv.zst.",
)
def command(imu_log: str, form: str | None, rig_path: str | None, output: str, quiet: bool) -> None:
    """Turn a vendor's IMU log into plain Parquet or CSV, the readings as they are.

    Time in s and readings in SI, increments as increments, on the IMU's own axes, no gap bridged:
    with the same rig both files give the same results.
    """
    from rotcli.logs.readings import file_columns, read_readings
    from rotcli.units import show_span

    rig = options.load_rig(rig_path, imu_log, {"imu": {"format": form}})
    with options.progress("reading") as told:
        found = read_readings(imu_log, rig, told)
    options.warn(found.warnings, quiet)
    options.write_series(output, file_columns(found))
    span = show_span(found.time[0], found.time[-1])
    options.say(f"{output}: {len(found.time)} samples, {span}{options.rig_needs(rig)}", quiet)
