"""`rotcli observe`: observability of a motion, and the ZUPT filter on a log."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import click

from rotcli.cli import loading, messages, options, output, values
from rotcli.cli.batch import runs
from rotcli.cli.navigation.zupt_filter import FilterOptions, filter_options
from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.files.channels import AXES
from rotcli.lazy import lazily

with lazily():
    from rotcli.observe import api
    from rotcli.rig import allan_figures
    from rotcli.run import corrections

if TYPE_CHECKING:
    from rotcli.observe.api import MotionOptions, ObservabilityResult, SweepOptions
    from rotcli.rig.rig import Rig


@dataclass(frozen=True)
class ObserveCommand(FilterOptions, runs.BatchOptions):
    """Options of `rotcli observe`."""

    imu_log: str | None
    table_log: str | None
    axis: str | None
    rate: float | None
    pitch: float | None
    roll: float | None
    azimuth: float | None
    latitude: float | None
    model: Literal["simplified", "full"]
    accelerations: tuple[str, ...]
    sweep: tuple[Literal["roll", "pitch", "rate"], str] | None
    calibration: str | None
    more_calibrations: tuple[str, ...]
    temperature: float | None
    extrapolate: Literal["clamp"] | None
    allan: str | None
    save_calibration: str | None
    solution: str | None
    plot: str | None
    max_gap: int

    @property
    def calibrations(self) -> list[str]:
        """All calibrations in order."""
        return [*([self.calibration] if self.calibration else []), *self.more_calibrations]


# Options that need a log.
_FOR_LOGS = (
    *("calibration", "allan", "window", "estimate_lever_arm", "smooth", "free_azimuth"),
    *("save_calibration", "solution"),
)


@click.command(
    epilog=options.example(
        "rotcli observe --axis z --pitch 30 --rate 10",
        "rotcli observe --axis y --sweep pitch -30:30:5",
        "rotcli simulate --imu mti-g --axis y --pitch 30 --rate 10 -o run",
        "rotcli observe run/imu.parquet run/table.parquet",
    )
)
@options.logs
@options.rig
@click.option(
    "--axis",
    metavar="x|y|z|none|X,Y,Z",
    help="Rotation axis in the body; none is a still table [default: the rig's, else z].",
)
@click.option(
    "--rate", type=options.FINITE, metavar="DEG_S", help="Table rate [default: 10; the log's]."
)
@click.option("--pitch", type=options.FINITE, metavar="DEG", help="Attitude of the still body.")
@click.option("--roll", type=options.FINITE, metavar="DEG", help="[default: the rig's, else 0]")
@click.option("--azimuth", type=options.FINITE, metavar="DEG", help="Clockwise from north.")
@click.option(
    "--latitude", type=options.FINITE, metavar="DEG", help="[default: the rig's, else 51.08]"
)
@click.option(
    "--model",
    type=click.Choice(["simplified", "full"]),
    default="simplified",
    show_default=True,
    help="full: with Earth rate in the attitude errors; its additional states are only weakly "
    "observable.",
)
@click.option(
    "--acceleration",
    "accelerations",
    metavar="E,N[,U]",
    multiple=True,
    help="Vehicle acceleration, m/s^2; repeat once per segment (0,0 is at rest).",
)
@click.option(
    "--sweep",
    type=(click.Choice(["roll", "pitch", "rate"]), str),
    metavar="roll|pitch|rate A:B:STEP",
    help="Rank and degrees along a parameter, deg or deg/s.",
)
@options.calibrations
@click.option("--allan", metavar="FILE", help="Noise figures: a result of rotcli allan.")
@click.option("--window", type=options.WINDOW, help="Window to filter, s [default: the log].")
@click.option(
    "--estimate-lever-arm",
    is_flag=True,
    help="Estimate the lever arm perpendicular to the axis; needs two table rates.",
)
@click.option("--smooth", is_flag=True, help="Add a Rauch-Tung-Striebel pass.")
@click.option("--free-azimuth", is_flag=True, help="Do not slave the azimuth (for comparison).")
@click.option("--save-calibration", metavar="FILE", help="Write the biases for rotcli navigate.")
@filter_options
@click.option("--solution", metavar="FILE", help="Write every state and sigma (.parquet or .csv).")
@options.plot("the estimates or the sweep")
@options.max_gap
@options.max_bytes
@runs.options
@options.output
@options.collect(ObserveCommand)
def command(given: ObserveCommand) -> None:
    """Show which error states a motion makes observable, and estimate them from a log.

    Without logs: rank, observable states, combinations, unobservable states and advice. With
    IMU_LOG (still, or turning with TABLE_LOG): those of the motion of the log, and the sensor
    biases, tilts and azimuth of the ZUPT filter.
    """
    _check_usage(given)
    if given.batch:
        runs.run_batch(BATCH, given, (given.imu_log, given.table_log))
        return
    names = ("solution", "plot", "save_calibration")
    outputs = {f"--{name.replace('_', '-')}": getattr(given, name) for name in names}
    read = [given.table_log, given.rig_path, *given.calibrations, given.allan]
    output.check_outputs(read, {"-o": given.output} | outputs, log=given.imu_log)
    output.print_or_write(_observe(given), given.output, given.quiet)


def process_run(
    imu_log: str, table_log: str | None, given: ObserveCommand
) -> "list[ObservabilityResult]":
    """Filter one run of a batch."""
    return [_observe(replace(given, imu_log=imu_log, table_log=table_log))]


def _observe(given: ObserveCommand) -> "ObservabilityResult":
    """Analyse the motion, or filter the logs; draw it if requested."""
    rig = _rig(given)
    result = _analyse(rig, given) if given.imu_log is None else _filter(given.imu_log, rig, given)
    if given.plot:
        result.plot(given.plot)
    return result


def _check_usage(given: ObserveCommand) -> None:
    """Raise UsageError for options that exclude each other."""
    given.check()
    if given.imu_log is None and not given.batch:
        for name in _FOR_LOGS:
            if getattr(given, name):
                raise click.UsageError(f"--{name.replace('_', '-')} needs an IMU log")
        if given.plot and not given.sweep:
            raise click.UsageError("--plot needs an IMU log or --sweep")
        return
    if given.sweep or given.accelerations:
        raise click.UsageError("--sweep and --acceleration are for the analysis without logs")
    if given.rate is not None:
        raise click.UsageError("--rate: with a log the rate comes from the table log")
    if given.axis == "none" and given.table_log:
        raise click.UsageError("--axis none: omit the table log; the IMU is then assumed still")


def _rig(given: ObserveCommand) -> "Rig":
    overrides: loading.Overrides = {
        "site": {"latitude": given.latitude},
        "attitude": {"pitch": given.pitch, "roll": given.roll, "azimuth": given.azimuth},
        "table": {"axis": None if given.axis == "none" else values.axis(given.axis)},
    }
    return loading.load_rig(given.rig_path, given.imu_log, overrides)


def _motion(given: ObserveCommand) -> "MotionOptions":
    rate = 10.0 if given.rate is None else given.rate
    return api.MotionOptions(
        rate=None if given.axis == "none" else rate,
        model=given.model,
        accelerations=tuple(_acceleration(text) for text in given.accelerations),
    )


def _acceleration(text: str) -> tuple[float, float, float]:
    numbers = values.split_numbers(text)
    if len(numbers) not in (2, 3) or not all(abs(a) < float("inf") for a in numbers):
        raise click.BadParameter(f"{text!r} is not E,N or E,N,U", param_hint="--acceleration")
    return numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 0.0


def _sweep(given: ObserveCommand) -> "SweepOptions | None":
    if not given.sweep:
        return None
    parameter, text = given.sweep
    try:
        start, stop, step = (float(part) for part in text.split(":"))
    except ValueError:
        raise click.BadParameter(f"{text!r} is not A:B:STEP", param_hint="--sweep") from None
    return api.SweepOptions(parameter, start, stop, step)


def _analyse(rig: "Rig", given: ObserveCommand) -> "ObservabilityResult":
    """Analyse a motion; an impossible one comes from the command line, a rig file is valid."""
    try:
        return api.analyse_motion(rig, _motion(given), _sweep(given))
    except RotcliError as error:
        raise click.UsageError(str(error)) from error


def _filter(imu_log: str, rig: "Rig", given: ObserveCommand) -> "ObservabilityResult":
    """Filter a log; write its time series and its calibration."""
    imu, table = loading.load_logs(imu_log, given.table_log, rig, given.max_gap, channels=AXES)
    correction, readings = corrections.split_corrections(given.calibrations, rig.imu.name)
    readings, clamped = loading.bind_corrections(
        readings, imu, rig, given.temperature, given.extrapolate
    )
    messages.warn(clamped, given.quiet)
    imu = corrections.corrected(imu, readings)
    noise_rig = (
        replace(rig, imu=allan_figures.with_allan(given.allan, rig.imu)) if given.allan else None
    )
    writes = given.solution and partial(output.write_time_series_chunks, given.solution)
    with messages.progress("filtering") as progress:
        result = api.filter_logs(
            imu,
            table,
            rig,
            given.settings(),
            _motion(given),
            correction,
            noise_rig,
            progress=progress,
            write_series=writes or None,
            series_is_stream=bool(given.solution)
            and output.is_not_regular_file(str(given.solution)),
        )
    _add_options(result)
    if given.save_calibration:
        excluded = result.save_calibration(given.save_calibration, correction)
        if excluded:
            names = ", ".join(excluded)
            text = f"--save-calibration: not saved, unreliable: {names}"
            result.document["warnings"].append(text)
    return result


# Options that belong to findings of the filter.
_OPTIONS = {
    "lever-arm": "--estimate-lever-arm",
    "prior-accel": "--sigma-accel",
    "prior-gyro": "--sigma-gyro",
    "prior-scale": "--sigma-scale",
}


def _add_options(result: "ObservabilityResult") -> None:
    """Add to each warning of the filter the option that belongs to it."""
    assert result.filtered is not None
    options_of = {
        finding.text: _OPTIONS[finding.code]
        for finding in result.filtered.findings
        if finding.code in _OPTIONS
    }
    warnings = result.document["warnings"]
    warnings[:] = [f"{w} ({options_of[w]})" if w in options_of else w for w in warnings]


BATCH = runs.BatchCommand(
    module=__name__,
    stem="observe",
    file_options=("save_calibration", "solution", "plot"),
    input_options=("allan",),
    imports=("rotcli.observe.api",),
)
