"""`rotcli navigate`: inertial navigation of a log on a fixed base."""

from typing import TYPE_CHECKING, Literal

import click

from rotcli.cli import loading, messages, options, output
from rotcli.cli.batch import runs
from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.files.channels import AXES
from rotcli.lazy import lazily

with lazily():
    from rotcli.files import figures
    from rotcli.navigate import api, plot
    from rotcli.run import corrections

if TYPE_CHECKING:
    from rotcli.navigate.api import Mode, NavigationResult, PreparedNavigation

MODES = ("conventional", "partial", "full")


@dataclass(frozen=True)
class NavigateCommand(runs.BatchOptions):
    """Options of `rotcli navigate`."""

    imu_log: str | None
    table_log: str | None
    modes: "tuple[Mode, ...]"
    calibration: str | None
    more_calibrations: tuple[str, ...]
    temperature: float | None
    extrapolate: Literal["clamp"] | None
    allow_other_rate: bool
    window: options.Span | None
    static: options.Span | None
    height: Literal["free", "hold"]
    solution: str | None
    plot: str | None
    max_gap: int

    @property
    def calibrations(self) -> list[str]:
        """All calibrations in order."""
        return [*([self.calibration] if self.calibration else []), *self.more_calibrations]

    @property
    def joint_plot(self) -> bool:
        """Whether one figure shows all modes."""
        return len(self.modes) > 1 and self.plot is not None and "{mode}" not in self.plot

    def outputs(self, mode: str) -> dict[str, str | None]:
        """Return option and file of each output in one mode."""
        names = {"-o": self.output, "--solution": self.solution, "--plot": self.plot}
        return {option: name and name.replace("{mode}", mode) for option, name in names.items()}


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
        "rotcli navigate run/imu.parquet run/table.parquet --calibration run/calibration.json",
    )
)
@options.logs
@options.rig
@click.option(
    "--mode",
    "modes",
    type=click.Choice(MODES),
    multiple=True,
    help="conventional: biases from the still segment; partial: biases from the calibration; full: "
    "also its scale factor and installation errors. Repeat for several modes; file names then "
    "need {mode}. [default: full with --calibration, else conventional]",
)
@options.calibrations
@click.option(
    "--allow-other-rate", is_flag=True, help="Accept a calibration made at another table rate."
)
@click.option(
    "--window", type=options.WINDOW, help="Window to navigate, s [default: from the rig]."
)
@click.option(
    "--static",
    type=options.WINDOW,
    help="Still segment for the biases of conventional, s [default: the rig's, else found].",
)
@click.option(
    "--height",
    type=click.Choice(["free", "hold"]),
    default="free",
    show_default=True,
    help="free: unaided vertical channel, as in the papers; hold: keep the initial height.",
)
@click.option("--solution", metavar="FILE", help="Write the time series (.parquet or .csv).")
@options.plot(
    "the errors against time",
    "several modes in one figure, or in one each if the name contains {mode}",
)
@options.max_gap
@options.max_bytes
@runs.options
@options.output
@options.collect(NavigateCommand)
def command(given: NavigateCommand) -> None:
    """Run inertial navigation on a log and report the errors relative to the fixed base.

    Without TABLE_LOG the IMU is assumed to be still. The RMS errors over the window are printed;
    -o writes them as JSON.
    """
    _check_mode_names(given)
    if given.batch:
        runs.run_batch(BATCH, given, (given.imu_log, given.table_log))
        return
    if not given.calibration and set(given.modes) - {"conventional"}:
        raise click.UsageError("partial and full need --calibration (see rotcli calibrate)")
    imu_log = runs.require_argument(given.imu_log, "IMU_LOG")
    for mode in given.modes or ("full",):
        read = [given.table_log, given.rig_path, *given.calibrations]
        output.check_outputs(read, given.outputs(mode), log=imu_log)
    output.print_or_write(process_run(imu_log, given.table_log, given), given.output, given.quiet)


def _check_mode_names(given: NavigateCommand) -> None:
    """Raise UsageError for several modes whose files have one name."""
    for option, name in given.outputs("{mode}").items():
        one_file = given.joint_plot if option == "--plot" else option == "-o" and given.batch
        several = len(given.modes) > 1 and not one_file
        if several and name not in (None, "-") and "{mode}" not in str(name):
            raise click.UsageError(f"{option}: several modes need {{mode}} in the name")


def process_run(
    imu_log: str, table_log: str | None, given: NavigateCommand
) -> "list[NavigationResult]":
    """Navigate one run in every mode; write time series and figures if requested."""
    if set(given.modes) - {"conventional"} and not given.calibration:
        raise RotcliError(
            f"{imu_log}: no calibration.json in its folder, which partial and full need; "
            "calibrate first, or use --calibration"
        )
    rig = loading.load_rig(given.rig_path, imu_log)
    imu, table = loading.load_logs(imu_log, table_log, rig, given.max_gap, channels=AXES)
    correction, others = corrections.split_corrections(given.calibrations, rig.imu.name)
    readings, clamped = loading.bind_corrections(
        others, imu, rig, given.temperature, given.extrapolate
    )
    messages.warn(clamped, given.quiet)
    settings = api.NavigateOptions(
        given.modes, given.window, given.static, given.height, given.allow_other_rate
    )
    prepared = api.prepare_navigation(imu, table, rig, correction, settings, readings)
    results = [_navigate(prepared, mode, given) for mode in prepared.errors]
    if given.plot and given.joint_plot:
        figures.save_figure(plot.modes_figure(results), given.plot)
    return results


def _navigate(
    prepared: "PreparedNavigation", mode: "Mode", given: NavigateCommand
) -> "NavigationResult":
    """Navigate in one mode."""
    files = given.outputs(mode)
    solution, picture = files["--solution"], files["--plot"]
    with messages.progress(f"navigating {mode}") as progress:
        navigating = prepared.navigate(mode, progress, keep_series=picture is not None)
        if solution:
            output.write_time_series_chunks(solution, navigating.chunks())
        result = navigating.finish()
    if picture and not given.joint_plot:
        result.plot(picture)
    return result


BATCH = runs.BatchCommand(
    module=__name__,
    stem="navigation",
    file_options=("solution", "plot"),
    uses_calibration=True,
    imports=("rotcli.navigate.api",),
)
