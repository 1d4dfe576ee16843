"""`rotcli correct`: an IMU log with calibrations applied."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, messages, options
from rotcli.cli import output as delivery
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.files import channels
    from rotcli.run import corrections

if TYPE_CHECKING:
    from rotcli.logs.record import ImuSource
    from rotcli.run.corrections import FloatArray


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
        "rotcli correct run/imu.parquet --calibration run/calibration.json -o run/clean.parquet",
    )
)
@click.argument("imu_log")
@click.option(
    "--calibration",
    "calibrations",
    metavar="FILE",
    multiple=True,
    required=True,
    help="Result of rotcli calibrate, triad, scale or thermal; repeat to apply several.",
)
@options.temperature
@options.max_gap
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
def command(
    imu_log: str,
    calibrations: tuple[str, ...],
    temperature: float | None,
    extrapolate: str | None,
    max_gap: int | None,
    rig_path: str | None,
    output: str,
    quiet: bool,
) -> None:
    """Write an IMU log with calibrations applied: rates and specific forces in SI, sensor frame.

    The equation of each calibration is printed. Increments become means over their interval: the
    rig of the new log is [imu] sampling = "average" then, and no mount.
    """
    delivery.check_outputs([rig_path, *calibrations], {"-o": output}, log=imu_log)
    rig = loading.load_rig(rig_path, imu_log)
    applied = corrections.read_corrections(calibrations, rig.imu.name)
    imu = loading.load_imu(imu_log, rig, max_gap, channels=channels.AXES)
    applied, clamped = loading.bind_corrections(applied, imu, rig, temperature, extrapolate)
    source = corrections.corrected(imu, applied)
    messages.warn([*imu.warnings, *clamped], quiet)
    delivery.write_time_series_chunks(output, _columns(source))
    for correction in applied:
        messages.info(f"{correction.path}: {correction.equation}", quiet)
    needs = '; its rig: [imu] sampling = "average"' if imu.sampling == "average" else ""
    span = units.show_span(imu.time[0], imu.time[-1])
    messages.info(f"{output}: {imu.samples} samples, {span}{needs}", quiet)


def _columns(source: "ImuSource") -> "Iterator[dict[str, FloatArray]]":
    """Yield the columns of the corrected log chunk by chunk."""
    for piece in source.pieces(slice(0, source.samples)):
        gyro = {f"gyro_{a} [rad/s]": piece.gyro[:, k] for k, a in enumerate("xyz")}
        accel = {f"accel_{a} [m/s^2]": piece.accel[:, k] for k, a in enumerate("xyz")}
        yield {"time [s]": piece.time, **gyro, **accel}
