"""`rotcli convert`: an IMU log of any known format into plain Parquet or CSV."""

import click

from rotcli.cli import loading, messages, options
from rotcli.cli import output as delivery


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
def command(imu_log: str, form: str | None, rig_path: str | None, output: str, quiet: bool) -> None:
    """Turn a vendor's IMU log into plain Parquet or CSV, the readings as they are.

    Time in s and readings in SI, increments as increments, on the IMU's own axes, no gap bridged:
    with the same rig both files give the same results.
    """
    from rotcli.logs.readings import file_columns, read_readings
    from rotcli.units import show_span

    delivery.check_outputs([rig_path], {"-o": output}, log=imu_log)
    rig = loading.load_rig(rig_path, imu_log, {"imu": {"format": form}})
    with messages.progress("reading") as told:
        found = read_readings(imu_log, rig, told, **loading.byte_limit())
    messages.warn(found.warnings, quiet)
    delivery.write_series(output, file_columns(found))
    span = show_span(found.time[0], found.time[-1])
    messages.say(f"{output}: {len(found.time)} samples, {span}{loading.rig_needs(rig)}", quiet)
