"""`rotcli allan`: noise figures of a still log."""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import click

from rotcli.cli import loading, messages, options, output
from rotcli.cli.batch import runs
from rotcli.cli.values import split_numbers
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily

with lazily():
    from rotcli.allan import api
    from rotcli.files import figures
    from rotcli.run import corrections

if TYPE_CHECKING:
    from rotcli.allan.api import AllanResult

# The analysis is faster on a log in memory; two million records still fit easily.
_IN_MEMORY_FACTOR = 10.0
_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


class Axes(click.ParamType):  # type: ignore[type-arg]
    """Axes to analyse: a comma-separated list of column names."""

    name = "gyro_x,…"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        """Return the axes in the order of the log."""
        if isinstance(value, tuple):
            return value
        names = {part.strip() for part in str(value).split(",")}
        wrong = sorted(names - set(_AXES))
        if wrong:
            self.fail(f"{wrong[0]!r} must be one of {', '.join(_AXES)}", param, ctx)
        return tuple(name for name in _AXES if name in names)


class Taus(click.ParamType):  # type: ignore[type-arg]
    """Cluster times: `octave`, `decade`, `all`, or a comma-separated list of seconds."""

    name = "octave|decade|all|LIST"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | tuple[float, ...]:
        """Return the word or the times."""
        if isinstance(value, tuple):
            return value
        text = str(value)
        if text in ("octave", "decade", "all"):
            return text
        times = tuple(split_numbers(text))
        if not times or not all(0.0 < time < 1e9 for time in times):
            self.fail(f"{value!r} is not octave, decade, all or times in seconds", param, ctx)
        return times


@dataclass(frozen=True)
class AllanCommand(runs.BatchOptions):
    """Options of `rotcli allan`."""

    imu_log: str | None
    more_logs: tuple[str, ...]
    window: options.Span | None
    axes: tuple[str, ...]
    taus: str | tuple[float, ...] | None
    estimator: Literal["oadev", "adev", "mdev", "totdev"]
    despike: bool
    plot: str | None
    psd: bool
    autocorrelation: bool
    published: bool
    to_rig: str | None
    calibration: str | None
    more_calibrations: tuple[str, ...]
    temperature: float | None
    extrapolate: Literal["clamp"] | None

    @property
    def calibrations(self) -> list[str]:
        """All calibrations in order."""
        return [*([self.calibration] if self.calibration else []), *self.more_calibrations]

    @property
    def panels(self) -> tuple[str, ...]:
        """Panels next to the Allan deviation."""
        wanted = {"psd": self.psd, "autocorrelation": self.autocorrelation}
        return tuple(name for name, is_wanted in wanted.items() if is_wanted)


@click.command(
    epilog=options.example(
        "rotcli simulate --imu mti-g --rate 0 --static 3600 --navigation 0 --seed 1 -o still",
        "rotcli allan still/imu.parquet -o still/allan.json --plot still/allan.png --psd",
    )
)
@click.argument("imu_log", required=False)
@click.argument("more_logs", nargs=-1, metavar="[IMU_LOG]...")
@click.option("--window", type=options.WINDOW, help="Use only this part of the log, s.")
@click.option("--axes", type=Axes(), default=",".join(_AXES), help="[default: all six]")
@click.option("--taus", type=Taus(), help="Cluster times [default: 15 a decade].")
@click.option(
    "--estimator",
    type=click.Choice(["oadev", "adev", "mdev", "totdev"]),
    default="oadev",
    show_default=True,
    help="Deviation of the curve; the figures are always those of oadev.",
)
@click.option("--despike", is_flag=True, help="Interpolate isolated readings of 8 sigma and more.")
@options.calibrations
@options.plot("the curves")
@click.option("--psd", is_flag=True, help="Also draw the power spectral density (Welch).")
@click.option(
    "--autocorrelation",
    is_flag=True,
    help="Also draw the autocorrelation with the fitted exponential (O17 section 4).",
)
@click.option(
    "--published",
    is_flag=True,
    help="Several logs: mark the lowest deviations of R16 figure 6 (MTi-G, NAV440).",
)
@click.option("--to-rig", metavar="RIG", help="Write the figures into [imu] of this rig.")
@options.max_bytes
@options.rig
@runs.options
@options.output
@options.collect(AllanCommand)
def command(given: AllanCommand) -> None:
    """Measure the noise of a still log: Allan deviation, coefficients, Gauss-Markov figures.

    All clean still segments are used. Coefficients that are not significant are omitted, with the
    reason and an upper limit. Several logs are compared in one table and one figure.
    """
    _check_plot_options(given)
    if given.batch:
        if given.more_logs:
            raise click.UsageError("--batch: give folders, not several logs")
        if given.to_rig:
            raise click.UsageError("--to-rig: one rig is written; not with --batch")
        runs.run_batch(BATCH, given, (given.imu_log,))
        return
    imu_log = runs.require_argument(given.imu_log, "IMU_LOG")
    # --to-rig changes a rig, which may be the one that is read.
    outputs = {"-o": given.output, "--plot": given.plot}
    read = [given.rig_path, given.to_rig, *given.calibrations]
    if given.more_logs:
        output.check_outputs([*read, imu_log, *given.more_logs], {"--plot": given.plot})
        _compare([imu_log, *given.more_logs], given)
        return
    output.check_outputs(read, outputs, log=imu_log)
    result = _analyse(imu_log, given)
    if given.plot:
        messages.info(f"{given.plot}: curves drawn", given.quiet)
    output.print_or_write(result, given.output, given.quiet)


def _check_plot_options(given: AllanCommand) -> None:
    """Raise UsageError for an option of a figure that is not drawn, or of another kind."""
    if given.panels and (given.plot is None or given.more_logs):
        raise click.UsageError(f"--{given.panels[0]}: needs --plot FILE and a single log")
    if given.published and (given.plot is None or not given.more_logs):
        raise click.UsageError("--published: needs --plot FILE and several logs")
    if given.more_logs and (given.output or given.to_rig):
        option = "-o" if given.output else "--to-rig"
        raise click.UsageError(f"{option}: of one log; call rotcli allan for each log")


def _compare(logs: list[str], given: AllanCommand) -> None:
    """Analyse several logs, print one table, draw one figure."""
    single = replace(given, plot=None)
    results = [_analyse(log, single) for log in logs]
    output.print_or_write(results, None, given.quiet)
    if given.plot:
        figures.save_figure(api.comparison_figure(results, marks=given.published), given.plot)
        messages.info(f"{given.plot}: curves of {len(logs)} logs drawn", given.quiet)


def process_run(imu_log: str, _: str | None, given: AllanCommand) -> "list[AllanResult]":
    """Analyse the IMU log of one run of a batch."""
    return [_analyse(imu_log, given)]


def _analyse(imu_log: str, given: AllanCommand) -> "AllanResult":
    """Analyse one log; write the files that are requested."""
    rig = loading.load_rig(given.rig_path, imu_log)
    wanted = given.axes if given.axes != _AXES else None
    log = loading.load_imu(imu_log, rig, in_memory_factor=_IN_MEMORY_FACTOR, channels=wanted)
    axes = tuple(name for name in given.axes if name in log.channels)
    if given.calibrations:
        readings, clamped = loading.bind_corrections(
            corrections.read_corrections(given.calibrations, rig.imu.name),
            log,
            rig,
            given.temperature,
            given.extrapolate,
        )
        messages.warn(clamped, given.quiet)
        log = corrections.corrected(log, readings)
        for reading in readings:
            messages.info(f"{reading.path}: applied first: {reading.equation}", given.quiet)
    settings = api.AllanOptions(
        given.window, axes, given.taus, given.estimator, given.despike, given.panels
    )
    with messages.progress("analysing") as progress:
        result = api.allan_log(log, rig, settings, progress)
    _write_files(result, given)
    if not given.despike and any(f["code"] == "spikes" for f in result.findings):
        messages.info("the option --despike interpolates spikes", given.quiet)
    return result


def _write_files(result: "AllanResult", given: AllanCommand) -> None:
    """Write the figure, and the figures into a rig."""
    if given.plot:
        result.plot(given.plot)
    if given.to_rig:
        keys = result.write_to_rig(given.to_rig)
        messages.info(f"{given.to_rig}: [imu] {', '.join(keys) or 'nothing'} written", given.quiet)


BATCH = runs.BatchCommand(
    module=__name__, stem="allan", file_options=("plot",), imports=("rotcli.allan.api",)
)
