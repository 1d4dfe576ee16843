"""`rotcli simulate`: logs with known true values."""

from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, messages, options, output, values
from rotcli.cli.planning import sequence
from rotcli.cli.sharing import simulated_fleet
from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.simulate import api

if TYPE_CHECKING:
    from rotcli.rig.scenario import Scenario


@dataclass(frozen=True)
class SimulateCommand:
    """Options of `rotcli simulate`."""

    imu: str | None
    scenario: str | None
    sequence: str | None
    errors: str | None
    fleet: tuple[int, int, int] | None
    rate: float | None
    axis: str | None
    pitch: float | None
    roll: float | None
    azimuth: float | None
    latitude: float | None
    lever_arm: str | None
    sampling: str | None
    direction: str | None
    static: float | None
    rotation: float | None
    navigation: float | None
    ramp: float | None
    encoder_step: float | None
    seed: int | None
    as_csv: bool
    rig_path: str | None
    quiet: bool
    output: str


@click.command(
    epilog=options.example("rotcli simulate --imu nav440 --rate 10 --seed 1 -o run"),
)
@click.option("--imu", metavar="NAME|FILE", help="IMU profile: mti-g, nav440, ideal or a file.")
@click.option("--scenario", metavar="FILE", help="Simulate the rate schedule of a scenario file.")
@click.option(
    "--sequence",
    metavar="NAME|FILE",
    help="Simulate a sequence of a table of one to three axes: S1, S2, M5, faces or a file.",
)
@click.option(
    "--errors",
    metavar="typical|FILE",
    help="With --sequence: errors drawn by the seed, or those of a TOML file [default: profile].",
)
@click.option(
    "--fleet",
    type=simulated_fleet.Size(),
    help="Make calibration results of many units with known variance components, no logs.",
)
@click.option("--rate", type=options.FINITE, metavar="DEG_S", help="Table rate; 0: still.")
@click.option("--axis", metavar="x|y|z|X,Y,Z", help="Rotation axis in the body [default: z].")
@click.option("--pitch", type=options.FINITE, metavar="DEG", help="Attitude of the fixed base.")
@click.option("--roll", type=options.FINITE, metavar="DEG", help="[default: level, facing north]")
@click.option("--azimuth", type=options.FINITE, metavar="DEG", help="Clockwise from north.")
@click.option("--latitude", type=options.FINITE, metavar="DEG", help="[default: 51.08]")
@click.option("--lever-arm", metavar="X,Y,Z", help="From the axis to the IMU, m.")
@click.option("--sampling", type=click.Choice(["instant", "average", "increment"]))
@click.option("--direction", type=click.Choice(["1", "-1"]), help="Sense of the table angle.")
@click.option("--static", type=options.NOT_NEGATIVE, metavar="S", help="[default: 60]")
@click.option("--rotation", type=options.NOT_NEGATIVE, metavar="S", help="[default: 60]")
@click.option("--navigation", type=options.NOT_NEGATIVE, metavar="S", help="[default: 300]")
@click.option("--ramp", type=options.NOT_NEGATIVE, metavar="S", help="[default: 1]")
@click.option("--encoder-step", type=options.NOT_NEGATIVE, metavar="DEG", help="[1e-5]")
@click.option("--seed", type=click.IntRange(min=0), help="[default: 0]")
@click.option("--csv", "as_csv", is_flag=True, help="Write CSV logs, not Parquet.")
@click.option(
    "--rig",
    "rig_path",
    metavar="FILE",
    help="Site, attitude, table axis, sampling and lever arm from a rig.",
)
@options.messages
@click.option("-o", "--output", metavar="DIR", required=True, help="Folder for the logs.")
@options.collect(SimulateCommand)
def command(given: SimulateCommand) -> None:
    """Simulate the logs of an IMU on a still or turning table, and save the true values.

    Writes imu.parquet (100 Hz), table.parquet (50 Hz), rig.toml and truth.json into DIR. The
    motion is exact; the sensor errors are those of the profile; the seed sets the noise.
    """
    if given.fleet is not None:
        _reject_other_options(given, ("fleet", "seed"), "--fleet makes results, not logs")
        simulated_fleet.simulate(given.fleet, given.output, given.seed, given.quiet)
        return
    if given.sequence:
        _reject_other_options(given, _SEQUENCE_OPTIONS, "--sequence takes it from the rig (--rig)")
        _simulate_sequence(given.sequence, given)
        return
    if given.errors:
        raise click.UsageError("--errors needs --sequence")

    suffix = "csv" if given.as_csv else "parquet"
    for name in (f"imu.{suffix}", f"table.{suffix}", "rig.toml", "truth.json"):
        read = [given.scenario, given.imu, given.rig_path]
        output.check_outputs(read, {"-o": str(Path(given.output) / name)})
    scenario = _scenario(given)
    with messages.progress("simulating") as progress:
        run = api.simulate_run(scenario, progress)
    run.write(given.output, "csv" if given.as_csv else "parquet")
    messages.warn(run.warnings, given.quiet)
    seconds = run.simulation.schedule.duration
    messages.info(f"{given.output}: {seconds:g} s of {scenario.profile.name}", given.quiet)


_SEQUENCE_OPTIONS = ("sequence", "errors", "imu", "rig_path", "seed", "encoder_step", "sampling")
_ALWAYS = ("output", "quiet", "as_csv")


def _reject_other_options(given: SimulateCommand, allowed: tuple[str, ...], reason: str) -> None:
    """Raise UsageError for an option that has no effect."""
    for field in fields(given):
        unused = field.name not in (*allowed, *_ALWAYS) and getattr(given, field.name) is not None
        if unused:
            option = f"--{field.name.removesuffix('_path').replace('_', '-')}"
            raise click.UsageError(f"{option}: {reason}; remove this option")


def _simulate_sequence(name: str, given: SimulateCommand) -> None:
    sequence.simulate(
        given.output,
        sequence=name,
        imu=given.imu,
        errors=given.errors,
        rig_path=given.rig_path,
        seed=given.seed,
        sampling=given.sampling,
        encoder_noise=given.encoder_step,
        as_csv=given.as_csv,
        quiet=given.quiet,
    )


def _scenario(given: SimulateCommand) -> "Scenario":
    """Return the scenario of a file or of the options; options override the file."""
    legs = ("rate", "static", "rotation", "navigation")
    if given.scenario:
        named = [f"--{leg}" for leg in legs if getattr(given, leg) is not None]
        if named:
            raise click.UsageError(f"{', '.join(named)}: the legs come from --scenario")
        if given.rig_path:
            raise click.UsageError("--rig: the set-up comes from --scenario")
        return _with_overrides(api.scenario_from_file(given.scenario, given.imu), given)
    if not given.imu or given.rate is None:
        raise click.UsageError("--imu and --rate are needed, or --scenario")
    durations = {leg: getattr(given, leg) for leg in legs[1:] if getattr(given, leg) is not None}
    rig = loading.load_rig(given.rig_path, None)
    chosen = api.SimulateOptions(
        given.imu, given.rate, **durations, ramp=given.ramp, encoder_step=given.encoder_step
    )
    try:
        scenario = api.scenario_from_options(chosen, rig)
    except RigError as error:
        place, _, text = str(error).partition(": ")
        if place == "simulate":
            raise click.UsageError("--" + text.replace("encoder_step", "encoder-step")) from error
        if place == "static, rotation and navigation":
            raise click.UsageError(str(error)) from error
        raise
    return _with_overrides(scenario, given)


def _with_overrides(scenario: "Scenario", given: SimulateCommand) -> "Scenario":
    """Return the scenario with the options in place of its values."""
    overrides: loading.Overrides = {
        "site": {"latitude": given.latitude},
        "attitude": {"pitch": given.pitch, "roll": given.roll, "azimuth": given.azimuth},
        "table": {
            "axis": values.axis(given.axis),
            "direction": int(given.direction) if given.direction else None,
        },
        "imu": {
            "sampling": given.sampling,
            "lever_arm": values.vector(given.lever_arm, "--lever-arm"),
        },
    }
    step = None if given.encoder_step is None else given.encoder_step * units.DEG
    scenario = replace(scenario, rig=loading.apply_overrides(scenario.rig, overrides))
    return api.change_scenario(scenario, ramp=given.ramp, seed=given.seed, encoder_step=step)
