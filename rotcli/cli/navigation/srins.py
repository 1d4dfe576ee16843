"""`rotcli srins`: simulate, calibrate and observe a single-axis rotation INS."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, messages, options, output, values
from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.lazy import lazily

with lazily():
    from rotcli.logs import imu as imu_logs
    from rotcli.logs import table as table_logs
    from rotcli.srins import api
    from rotcli.srins.voyage import document as voyages
    from rotcli.srins.voyage import scenario as scenarios

if TYPE_CHECKING:
    from rotcli.srins.api import SrinsOptions


@click.group()
def command() -> None:
    """Simulate, calibrate and observe a single-axis rotation INS (SRINS) with level damping."""


@dataclass(frozen=True)
class SrinsSimulateCommand:
    """Options of `rotcli srins simulate`."""

    scenario: str
    seed: int | None
    as_csv: bool
    quiet: bool
    output: str


@command.command(
    epilog=options.example("rotcli srins simulate --scenario srins --seed 1 -o voyage")
)
@click.option(
    "--scenario",
    metavar="NAME|FILE",
    default="srins",
    show_default=True,
    help="srins, srins-early, srins-late, srins-follows, or a scenario file.",
)
@click.option("--seed", type=click.IntRange(min=0), help="[default: the scenario's]")
@click.option("--csv", "as_csv", is_flag=True, help="Write CSV logs, not Parquet.")
@options.messages
@click.option("-o", "--output", metavar="DIR", required=True, help="Folder for the logs.")
@options.collect(SrinsSimulateCommand)
def simulate(given: SrinsSimulateCommand) -> None:
    """Simulate the logs of a voyage, with GNSS and a speed log, and save the true values."""
    suffix = "csv" if given.as_csv else "parquet"
    for name in voyages.voyage_files(suffix):
        output.check_outputs([given.scenario], {"-o": str(Path(given.output) / name)})
    scenario = scenarios.read_srins_scenario(given.scenario)
    if given.seed is not None:
        source = {**scenario.source, "seed": given.seed}
        scenario = replace(scenario, seed=given.seed, source=source)
    with messages.progress("simulating") as progress:
        voyages.write_voyage(given.output, scenario, suffix, progress)
    hours = scenario.duration / 3600.0
    messages.info(f"{given.output}: {hours:g} h of SRINS at {scenario.rate:g} Hz", given.quiet)


@dataclass(frozen=True)
class SrinsCalibrateCommand(options.LogOptions):
    """Options of `rotcli srins calibrate`."""

    table_log: str
    reference: str
    speed: str | None
    no_damping: bool
    damping: str | None
    measured_damping_states: bool
    settle: float | None
    filter_interval: float | None
    gnss_sigma: str | None
    speed_sigma: float | None
    stated_drift: float
    uncalibrated: str
    truth: str | None
    solution: str | None
    plot: str | None
    max_gap: int

    def settings(self) -> "SrinsOptions":
        """Return the settings of the capability."""
        network = _positive(self.damping, 4, "--damping") or list(api.DAMPING_NETWORK)
        gnss = _positive(self.gnss_sigma, 2, "--gnss-sigma")
        uncalibrated = values.numbers(self.uncalibrated, 2, "--uncalibrated") or [0.0, 0.0]
        if min(uncalibrated) < 0.0:
            raise click.BadParameter("both must be 0 or more", param_hint="--uncalibrated")
        return api.SrinsOptions(
            damped=not self.no_damping,
            damping=(network[0], network[1], network[2], network[3]),
            measured_damping_states=self.measured_damping_states,
            settle=self.settle,
            filter_interval=self.filter_interval,
            gnss_sigma=None if gnss is None else (gnss[0], gnss[1]),
            speed_sigma=self.speed_sigma,
            stated_drift=self.stated_drift,
            scale=uncalibrated[0],
            installation=uncalibrated[1],
        )


def _positive(text: str | None, count: int, option: str) -> list[float] | None:
    """Return positive numbers of an option; raises BadParameter."""
    numbers = values.numbers(text, count, option)
    if numbers is not None and min(numbers) <= 0.0:
        raise click.BadParameter("every number must be above 0", param_hint=option)
    return numbers


@command.command(
    epilog=options.example(
        "rotcli srins simulate --seed 1 -o voyage",
        "rotcli srins calibrate voyage/imu.parquet voyage/table.parquet "
        "--reference voyage/gnss.parquet --speed voyage/doppler.parquet",
    )
)
@click.argument("imu_log")
@click.argument("table_log")
@options.rig
@click.option(
    "--reference", metavar="GNSS_LOG", required=True, help="Log of position and velocity."
)
@click.option(
    "--speed", metavar="DOPPLER_LOG", help="Speed reference of the damping [default: GNSS]."
)
@click.option("--no-damping", is_flag=True, help="Run without damping.")
@click.option("--damping", metavar="W1,W2,W3,W4", help="Corner frequencies of the network, rad/s.")
@click.option(
    "--measured-damping-states/--estimated-damping-states",
    default=True,
    help="Assume the damping states known [default], or estimate them.",
)
@click.option(
    "--settle",
    type=click.FloatRange(min=0.0),
    metavar="H",
    help="Hours before the filter starts [default: all but the last ten].",
)
@click.option(
    "--filter-interval",
    type=click.FloatRange(min=1.0, max=60.0),
    metavar="S",
    help="Length of a filter step [default: 10].",
)
@click.option("--gnss-sigma", metavar="M/S,M", help="Velocity and position [default: 0.01,10].")
@click.option(
    "--speed-sigma",
    type=click.FloatRange(min=0.0),
    metavar="M/S",
    help="Noise of the speed reference at 1 Hz [default: 0.1; GNSS: its sigma].",
)
@click.option(
    "--stated-drift",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="DEG/H",
    default=0.003,
    show_default=True,
    help="Drift that convergence is measured by.",
)
@click.option(
    "--uncalibrated",
    metavar="PPM,ARCSEC",
    default="10,2",
    show_default=True,
    help="Uncalibrated scale factor and installation errors of the gyros.",
)
@click.option("--truth", metavar="FILE", help="truth.json of a simulation.")
@click.option("--solution", metavar="FILE", help="Write every state and sigma (.parquet or .csv).")
@options.plot("the estimates")
@options.max_gap
@options.max_bytes
@options.output
@options.collect(SrinsCalibrateCommand)
def calibrate(given: SrinsCalibrateCommand) -> None:
    """Estimate the gyro drift along the rotation axis from a voyage of hours.

    The INS runs with its level loops damped by a speed log; the filter compares it with GNSS.
    """
    output.check_outputs(
        [given.table_log, given.rig_path, given.reference, given.speed, given.truth],
        {"-o": given.output, "--solution": given.solution, "--plot": given.plot},
        log=given.imu_log,
    )
    settings, limit = given.settings(), loading.byte_limit()
    rig = loading.load_rig(given.rig_path, given.imu_log)
    table = table_logs.read_table(given.table_log, rig, imu_log=given.imu_log, **limit)
    gnss = imu_logs.read_reference(given.reference, rig.reference, **limit)
    speed = imu_logs.read_reference(given.speed, rig.reference, **limit) if given.speed else None
    truth = api.read_truth(given.truth) if given.truth else None
    imu = loading.load_imu(given.imu_log, rig, given.max_gap, table_log=given.table_log)
    with messages.progress("navigating") as progress:
        result = api.calibrate_voyage(imu, table, gnss, speed, rig, settings, truth, progress)
    if given.solution:
        output.write_time_series(given.solution, result.series)
    if given.plot:
        result.plot(given.plot)
    output.print_or_write(result, given.output, given.quiet)


@dataclass(frozen=True)
class SrinsObserveCommand(options.OutputOptions):
    """Options of `rotcli srins observe`."""

    rig_path: str | None
    latitude: float | None
    rate: float | None
    plot: str | None


@command.command(epilog=options.example("rotcli srins observe --latitude 42.3"))
@options.rig
@click.option(
    "--latitude", type=options.FINITE, metavar="DEG", help="[default: the rig's, else 42.3]"
)
@click.option("--rate", type=options.FINITE, metavar="DEG_S", help="Rotation rate [default: 6].")
@options.plot("the singular values")
@options.output
@options.collect(SrinsObserveCommand)
def observe(given: SrinsObserveCommand) -> None:
    """Show which errors an SRINS on a cruise makes observable, by rotation scheme."""
    output.check_outputs([given.rig_path], {"-o": given.output, "--plot": given.plot})
    rig = loading.load_rig(given.rig_path, None)
    try:
        result = api.analyse_srins(rig, given.latitude, given.rate)
    except ResultError as error:
        option, colon, text = str(error).partition(": ")
        if colon and option in ("latitude", "rate"):
            raise click.BadParameter(text, param_hint=f"--{option}") from error
        raise
    if given.plot:
        result.plot(given.plot)
    output.print_or_write(result, given.output, given.quiet)
