"""`rotcli simulate`: logs whose truth is known."""

from pathlib import Path
from typing import Any

import click

from rotcli.cli import loading, messages, options, values
from rotcli.cli import output as delivery
from rotcli.cli.sharing import simulated_fleet


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
    )
)
@click.option("--imu", metavar="NAME|FILE", help="IMU profile: mti-g, nav440, ideal or a file.")
@click.option(
    "--scenario",
    metavar="FILE",
    help="Play a scenario file: any rate schedule; `srins` or such a file is a voyage of days.",
)
@click.option(
    "--sequence",
    metavar="NAME|FILE",
    help="Play a sequence of a table of one to three axes: S1, S2, M5, faces or a file.",
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
@click.option("--rate", type=options.FINITE, metavar="DEG_S", help="Table rate; 0 keeps it still.")
@click.option("--axis", metavar="x|y|z|X,Y,Z", help="Rotation axis in the body [default: z].")
@click.option("--pitch", type=options.FINITE, metavar="DEG", help="Attitude of the still base.")
@click.option("--roll", type=options.FINITE, metavar="DEG", help="[default: level, facing north]")
@click.option("--azimuth", type=options.FINITE, metavar="DEG", help="Clockwise from north.")
@click.option("--latitude", type=options.FINITE, metavar="DEG", help="[default: 51.08]")
@click.option("--lever-arm", metavar="X,Y,Z", help="From the axis to the IMU, m.")
@click.option("--sampling", type=click.Choice(["instant", "average", "increment"]))
@click.option("--direction", type=click.Choice(["1", "-1"]), help="Sense of the table's angle.")
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
    help="Site, attitude, table axis, sampling and lever arm, as of a rig of your own.",
)
@options.messages
@click.option("-o", "--output", metavar="DIR", required=True, help="Folder for the logs.")
def command(
    output: str,
    as_csv: bool,
    quiet: bool,
    fleet: tuple[int, int, int] | None,
    **given: Any,
) -> None:
    """Make the logs of an IMU on a still or turning table, with the truth beside them.

    Writes imu.parquet (100 Hz), table.parquet (50 Hz), rig.toml and truth.json into DIR. The
    motion is exact; the sensor errors are those of the profile; the seed decides the noise.
    """
    if fleet is not None:
        simulated_fleet.simulate(fleet, output, quiet, given)
        return
    if given["sequence"]:
        _sequence(output, as_csv, quiet, given)
        return
    if given["errors"]:
        raise click.UsageError("--errors needs --sequence")

    from rotcli.cli.navigation import srins

    if srins.is_voyage(given["scenario"]):
        srins.simulate(output, as_csv, quiet, given)
        return

    from rotcli.simulate.document import write_simulation
    from rotcli.simulate.estimate import simulate

    logs = [f"{name}.{'csv' if as_csv else 'parquet'}" for name in ("imu", "table")]
    for name in (*logs, "rig.toml", "truth.json"):
        read = [given["scenario"], given["imu"], given["rig_path"]]
        delivery.check_outputs(read, {"-o": str(Path(output) / name)})
    scenario = _scenario(given)
    with messages.progress("simulating") as told:
        simulation = simulate(scenario, progress=told)
    messages.tell(f"simulated {simulation.imu.rows} samples, stages {dict(simulation.stages)}")
    write_simulation(output, scenario, simulation, "csv" if as_csv else "parquet")
    messages.warn(_clipped(simulation.imu, scenario.profile), quiet)
    seconds = simulation.schedule.duration
    messages.say(f"{output}: {seconds:g} s of {scenario.profile.name}", quiet)


_SEQUENCE_OPTIONS = ("sequence", "errors", "imu", "rig_path", "seed", "encoder_step", "sampling")


def _sequence(output: str, as_csv: bool, quiet: bool, given: dict[str, Any]) -> None:
    """Play a sequence; reject the options of a single axis."""
    from rotcli.cli.planning import sequence

    other = [name for name, value in given.items() if value is not None]
    other = [name for name in other if name not in _SEQUENCE_OPTIONS]
    if other:
        named = ", ".join("--" + name.replace("_", "-") for name in other)
        raise click.UsageError(f"{named}: not for --sequence; set it in the rig (--rig)")
    sequence.simulate(
        output,
        sequence=given["sequence"],
        imu=given["imu"],
        errors=given["errors"],
        rig_path=given["rig_path"],
        seed=given["seed"],
        sampling=given["sampling"],
        encoder_noise=given["encoder_step"],
        as_csv=as_csv,
        quiet=quiet,
    )


def _clipped(imu: Any, profile: Any) -> list[str]:
    """Return a warning where the gyros reach the end of their range."""
    from rotcli.units import DEG

    limit = profile.gyro.range
    count = 0 if limit is None else int((abs(imu.gyro) >= limit).any(axis=1).sum())
    if not count:
        return []
    shown = f"{profile.name}, {limit / DEG:.6g} deg/s"
    return [f"{count} samples are cut off at the gyro range of {shown}"]


def _scenario(given: dict[str, Any]) -> Any:
    """Return the scenario of a file or of the options; what both say, the options decide."""
    from dataclasses import replace

    from rotcli.rig.profile import read_profile
    from rotcli.rig.scenario import Scenario, read_scenario

    legs = {key: given[key] for key in ("rate", "static", "rotation", "navigation")}
    if given["scenario"]:
        named = [f"--{key}" for key, value in legs.items() if value is not None]
        if named:
            raise click.UsageError(f"{', '.join(named)}: the legs come from --scenario")
        scenario = read_scenario(given["scenario"])
        if given["rig_path"]:
            raise click.UsageError("--rig: the set-up comes from --scenario")
        if given["imu"]:
            scenario = replace(scenario, profile=read_profile(given["imu"]))
    else:
        if not given["imu"] or legs["rate"] is None:
            raise click.UsageError("--imu and --rate are needed, or --scenario")
        scenario = Scenario(
            read_profile(given["imu"]), _legs(**legs), rig=loading.load_rig(given["rig_path"], None)
        )
    return _with_options(scenario, given)


def _legs(
    rate: float, static: float | None, rotation: float | None, navigation: float | None
) -> Any:
    """Return the papers' run: still, turning, and navigation at the same rate."""
    from rotcli.rig.scenario import Leg
    from rotcli.units import DEG

    times = {
        "static": 60.0 if static is None else static,
        "rotation": (60.0 if rotation is None else rotation) if rate else 0.0,
        "navigation": 300.0 if navigation is None else navigation,
    }
    legs = tuple(
        Leg(duration, 0.0 if stage == "static" else rate * DEG, stage=stage)
        for stage, duration in times.items()
        if duration > 0.0
    )
    if not legs:
        raise click.UsageError("--static, --rotation and --navigation leave no time at all")
    return legs


def _with_options(scenario: Any, given: dict[str, Any]) -> Any:
    """Return the scenario with the options that were given laid over it."""
    from dataclasses import replace

    from rotcli.units import DEG

    attitude = {key: given[key] for key in ("pitch", "roll", "azimuth")}
    changes = {
        "site": {"latitude": given["latitude"]},
        "attitude": attitude,
        "table": {
            "axis": values.axis(given["axis"]),
            "direction": int(given["direction"]) if given["direction"] else None,
        },
        "imu": {
            "sampling": given["sampling"],
            "lever_arm": values.vector(given["lever_arm"], "--lever-arm"),
        },
    }
    plain = {
        "ramp": given["ramp"],
        "seed": given["seed"],
        "encoder_step": None if given["encoder_step"] is None else given["encoder_step"] * DEG,
    }
    return replace(
        scenario,
        rig=loading.lay_over(scenario.rig, changes),
        **{key: value for key, value in plain.items() if value is not None},
    )
