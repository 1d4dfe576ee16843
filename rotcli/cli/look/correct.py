"""`rotcli correct`: an IMU log with calibrations applied."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal

import click

from rotcli.cli import loading, messages, options, output
from rotcli.cli.batch import runs
from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.files import channels
    from rotcli.run import corrections

if TYPE_CHECKING:
    from rotcli.logs.record import ImuSource
    from rotcli.units import FloatArray


@dataclass(frozen=True)
class CorrectCommand(runs.BatchOptions):
    """Options of `rotcli correct`."""

    imu_log: str | None
    calibration: str | None
    more_calibrations: tuple[str, ...]
    temperature: float | None
    extrapolate: Literal["clamp"] | None
    max_gap: int | None

    @property
    def calibrations(self) -> list[str]:
        """All calibrations in order."""
        return [*([self.calibration] if self.calibration else []), *self.more_calibrations]


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
        "rotcli correct run/imu.parquet --calibration run/calibration.json -o run/clean.parquet",
    )
)
@click.argument("imu_log", required=False)
@options.calibrations
@options.max_gap
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
@options.collect(CorrectCommand)
def command(given: CorrectCommand) -> None:
    """Write an IMU log with calibrations applied: rates and specific forces in SI, sensor frame.

    The equation of each calibration is printed. Increments become means over their interval: the
    rig of the new log is [imu] sampling = "average" then, and no mount. --batch uses
    calibration.json of each run folder unless --calibration names one.
    """
    if given.batch:
        runs.run_batch(BATCH, given, (given.imu_log,))
        return
    imu_log = runs.require_argument(given.imu_log, "IMU_LOG")
    if not given.calibrations:
        raise click.UsageError("--calibration is missing: which corrections are to be applied?")
    read = [given.rig_path, *given.calibrations]
    output.check_outputs(read, {"-o": given.output}, log=imu_log)
    lines, warnings = _correct(imu_log, given)
    messages.warn(warnings, given.quiet)
    for line in lines:
        messages.info(line, given.quiet)


def process_run(imu_log: str, _: str | None, given: CorrectCommand) -> "list[runs.WrittenLog]":
    """Correct the IMU log of one run of a batch."""
    if not given.calibrations:
        raise RotcliError(
            f"{imu_log}: no calibration.json in its folder; calibrate first, or use --calibration"
        )
    return [runs.WrittenLog(_correct(imu_log, given)[1])]


def _correct(imu_log: str, given: CorrectCommand) -> tuple[list[str], list[str]]:
    """Write the corrected log; return the lines about it, and warnings."""
    rig = loading.load_rig(given.rig_path, imu_log)
    applied = corrections.read_corrections(given.calibrations, rig.imu.name)
    imu = loading.load_imu(imu_log, rig, given.max_gap, channels=channels.AXES)
    applied, clamped = loading.bind_corrections(
        applied, imu, rig, given.temperature, given.extrapolate
    )
    output.write_time_series_chunks(
        str(given.output), _columns(corrections.corrected(imu, applied))
    )
    needs = '; its rig: [imu] sampling = "average"' if imu.sampling == "average" else ""
    span = units.format_span(imu.time[0], imu.time[-1])
    lines = [f"{correction.path}: {correction.equation}" for correction in applied]
    lines.append(f"{given.output}: {imu.samples} samples, {span}{needs}")
    return lines, [*imu.warnings, *clamped]


def _columns(source: "ImuSource") -> "Iterator[dict[str, FloatArray]]":
    """Yield the columns of the corrected log chunk by chunk."""
    for piece in source.chunks(slice(0, source.samples)):
        gyro = {f"gyro_{a} [rad/s]": piece.gyro[:, k] for k, a in enumerate("xyz")}
        accel = {f"accel_{a} [m/s^2]": piece.accel[:, k] for k, a in enumerate("xyz")}
        yield {"time [s]": piece.time, **gyro, **accel}


BATCH = runs.BatchCommand(
    module=__name__, stem="", uses_calibration=True, imports=("rotcli.run.corrections",)
)
