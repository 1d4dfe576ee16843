"""The SRINS parts of `simulate`, `calibrate` and `observe`, loaded when one of them asks."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import click

from rotcli.cli import loading, messages, values
from rotcli.cli import output as delivery

# Options of a turntable's simulation or calibration that mean nothing to a voyage.
_NOT_FOR_VOYAGES = (
    *("imu", "axis", "pitch", "roll", "azimuth", "latitude", "lever_arm", "sampling", "rate"),
    *("direction", "static", "rotation", "navigation", "ramp", "encoder_step", "rig_path"),
)

# Options of `observe` that mean nothing to a cruise.
_NOT_FOR_CRUISES = (
    *("axis", "pitch", "roll", "azimuth", "accelerations", "sweep", "calibration", "allan"),
    *("window", "save_calibration", "solution", "plot"),
)


def simulate(output: str, as_csv: bool, quiet: bool, given: dict[str, Any]) -> None:
    """Make the logs of a voyage."""
    from dataclasses import replace

    from rotcli.srins.scenario import read_srins_scenario
    from rotcli.srins.simulation_document import voyage_files, write_voyage

    refuse(given, _NOT_FOR_VOYAGES, "is for turntables; write it in the scenario file")
    suffix = "csv" if as_csv else "parquet"
    for name in voyage_files(suffix):
        delivery.check_outputs([given["scenario"]], {"-o": str(Path(output) / name)})
    scenario = read_srins_scenario(given["scenario"])
    if given["seed"] is not None:
        scenario = replace(
            scenario, seed=given["seed"], source={**scenario.source, "seed": given["seed"]}
        )
    with messages.progress("simulating") as progress:
        write_voyage(output, scenario, suffix, progress)
    hours = scenario.duration / 3600.0
    messages.say(f"{output}: {hours:g} h of SRINS at {scenario.rate:g} Hz", quiet)


def refuse(given: dict[str, Any], names: Iterable[str], why: str) -> None:
    """Refuse options that were given and mean nothing here."""
    for name in names:
        if given.get(name) not in (None, (), False):
            raise click.UsageError(f"--{name.replace('_', '-')} {why}")


def calibrate(
    imu_log: str, table_log: str, output: str | None, quiet: bool, given: dict[str, Any]
) -> None:
    """Run the damped mechanization over a long log, then the filter, and deliver."""
    from rotcli.files.documents import document
    from rotcli.logs.imu import read_reference
    from rotcli.logs.stream import open_imu
    from rotcli.logs.table import read_table
    from rotcli.srins import document as results
    from rotcli.srins import estimate, navigate

    refuse(given, ("static", "rotation", "report_residuals"), "is not for --method srins")
    if not given["reference"]:
        raise click.UsageError("--method srins needs --reference GNSS_LOG")
    delivery.check_outputs(
        [table_log, *(given[name] for name in ("rig_path", "reference", "speed", "truth"))],
        {"-o": output, "--solution": given["solution"], "--plot": given["plot"]},
        log=imu_log,
    )
    limit = loading.byte_limit()
    rig = loading.load_rig(given["rig_path"], imu_log)
    attitude = _attitude(rig)
    table = read_table(table_log, rig, imu_log=imu_log, **limit)
    gnss = read_reference(given["reference"], **limit)
    speed = read_reference(given["speed"], **limit) if given["speed"] else None
    imu = open_imu(imu_log, rig, max_gap=given["max_gap"], table_log=table_log, **limit)
    felt = navigate.check_start(imu, table, attitude, gnss, time_offset=rig.table.time_offset)
    settings, told = _settings(rig, given, speed is not None)
    with messages.progress("navigating") as progress:
        averages = rig.imu.sampling != "instant"
        pieces = _told(imu, progress)
        increments, start = navigate.sum_up(pieces, averages=averages)
    run = navigate.navigate_level(increments, start, table, attitude, gnss, speed, settings.damping)
    sums, epochs = navigate.gnss_differences(run, gnss)
    error = results.ins_error(run, sums, epochs)
    begin = _filter_start(run, given["settle"])
    part = run.since(begin)
    skipped = len(run.time) - len(part.time)
    found = estimate.calibrate(
        part.solution, sums[:, skipped:], epochs[skipped:], run.block, settings, start=begin
    )
    logs: list[Any] = [imu, table, gnss, *([speed] if speed else [])]
    warnings = [text for log in logs for text in log.warnings]
    own = results.fields(
        found,
        part,
        float(part.time[0]),
        settings,
        error,
        **_stated(given),
        truth=read_truth(given["truth"]),
    )
    own["warnings"] = [*warnings, *felt, *told, *run.warnings, *found.warnings]
    doc = document(results.KIND, logs, rig.effective(), own)
    if given["solution"]:
        latitude = float(part.solution.latitude[0])
        series = results.series(found, float(part.time[0]), latitude)
        delivery.write_series(given["solution"], series)
    if given["plot"]:
        from rotcli.files.figures import save_figure
        from rotcli.srins.plot import drifts_figure

        save_figure(drifts_figure(doc, alone=True), given["plot"])
    delivery.deliver(doc, results.table(doc), output, quiet)


def _told(imu: Any, progress: messages.Progress | None) -> Iterator[Any]:
    done = 0
    for piece in imu.pieces(slice(0, imu.samples)):
        yield piece
        done += piece.samples
        if progress:
            progress(done / imu.samples)


def _attitude(rig: Any) -> tuple[float, float, float]:
    """Return pitch, roll, azimuth of the body at the start; the rig must say the azimuth."""
    from rotcli.errors import RigError

    where = rig.path or "no rig.toml"
    if rig.attitude.azimuth is None:
        raise RigError(f"{where}: [attitude] azimuth: missing; give the heading at the start, deg")
    if rig.table.axis_name != "z":
        raise RigError(f"{where}: [table] axis: a single-axis rotation INS turns about z, up")
    return rig.attitude.pitch or 0.0, rig.attitude.roll or 0.0, rig.attitude.azimuth


def _numbers(text: str | None, count: int, option: str) -> tuple[float, ...] | None:
    if text is None:
        return None
    numbers = tuple(values.split_numbers(text))
    if len(numbers) != count or not all(0.0 <= x < float("inf") for x in numbers):
        raise click.BadParameter(f"{text!r} is not {count} numbers from 0", param_hint=option)
    return numbers


def _settings(rig: Any, given: dict[str, Any], doppler: bool) -> tuple[Any, list[str]]:
    """Return the filter's settings from rig and options, and what was assumed."""
    from rotcli.srins.filter import FilterSettings
    from rotcli.srins.model import Damping

    default, told = FilterSettings(), []
    w1, w2, w3, w4 = _numbers(given["damping"], 4, "--damping") or (
        8.5e-4,
        8.0e-3,
        1.0e-2,
        9.412e-2,
    )
    if min(w1, w2, w3, w4) <= 0.0:
        raise click.BadParameter("every frequency must be above 0", param_hint="--damping")
    damped = not given["no_damping"]
    velocity, position = _numbers(given["gnss_sigma"], 2, "--gnss-sigma") or (
        default.gnss_velocity,
        default.gnss_position,
    )
    if min(velocity, position) <= 0.0:
        raise click.BadParameter("both must be above 0", param_hint="--gnss-sigma")
    white = {}
    for key, name, fallback in (
        ("angle_random_walk", "gyro_white", default.gyro_white),
        ("velocity_random_walk", "accel_white", default.accel_white),
    ):
        figure = rig.imu.figure(key)
        if figure is None or not figure.any():
            told.append(f"{rig.path or 'no rig.toml'}: [imu] {key}: missing; the paper's was taken")
        white[name] = fallback if figure is None or not figure.any() else float(figure.max())
    speed_sigma = given["speed_sigma"]
    if speed_sigma is None:
        speed_sigma = default.reference_white if doppler else velocity
    measured = given["measured_damping_states"]
    return FilterSettings(
        damping=Damping(w1, w2, w3, w4, enabled=1.0 if damped else 0.0),
        measured_damping=damped and (measured is None or measured),
        interval=given["filter_interval"] or default.interval,
        reference_white=speed_sigma,
        gnss_velocity=velocity,
        gnss_position=position,
        **white,
    ), told


def _stated(given: dict[str, Any]) -> dict[str, float]:
    """Return what the user states of the sensors, SI."""
    from rotcli.units import DEG_PER_HOUR, PPM, UNITS

    scale, installation = _numbers(given["uncalibrated"], 2, "--uncalibrated") or (10.0, 2.0)
    return {
        "drift": (given["stated_drift"] or 0.003) * DEG_PER_HOUR,
        "scale": scale * PPM,
        "installation": installation * UNITS["angle"]["arcsec"],
    }


def _filter_start(run: Any, settle: float | None) -> float:
    """Return the filter's start, s on the log's clock: ten hours before the end, or as told."""
    from rotcli.errors import LogError

    span = float(run.time[-1] - run.time[0])
    settled = max(0.0, span - 36000.0) if settle is None else settle * 3600.0
    if settled > span - 600.0:
        raise LogError(
            "--settle",
            f"{settled / 3600.0:.4g} h of {span / 3600.0:.4g} h leave no time for the filter; "
            "give fewer hours",
        )
    return float(run.time[0]) + settled


def read_truth(path: str | None) -> dict[str, float] | None:
    """Return the true sensor errors of a simulation's truth.json, by the filter's names."""
    if path is None:
        return None
    from rotcli.errors import ResultError
    from rotcli.files.documents import number, read_result

    held = read_result(path, "simulation").get("sensor_errors")
    if not isinstance(held, dict):
        raise ResultError(f"{path}: no sensor_errors; give the truth.json of an SRINS simulation")
    return {str(name): number(held, path, name) for name in held}


def observe(output: str | None, quiet: bool, given: dict[str, Any]) -> None:
    """Tell what an SRINS observes: singular values, ranks, degrees by rotation scheme."""
    from rotcli.files.documents import document
    from rotcli.files.tables import to_text
    from rotcli.srins import observability
    from rotcli.srins import observability_document as results
    from rotcli.srins.filter import FilterSettings
    from rotcli.srins.model import VehicleMotion
    from rotcli.srins.reciprocation import Reciprocation
    from rotcli.units import DEG

    refuse(given, _NOT_FOR_CRUISES, "is not for --model srins")
    delivery.check_outputs([given["rig_path"]], {"-o": output})
    rig = loading.load_rig(given["rig_path"], None)
    if given["latitude"] is not None:
        latitude = given["latitude"] * DEG
    else:
        latitude = 42.3 * DEG if rig.site is None else rig.site.latitude
    if not 1.0 * DEG < abs(latitude) < 85.0 * DEG:
        raise click.BadParameter("give 1 to 85 deg north or south", param_hint="--latitude")
    rate = 6.0 if given["rate"] is None else given["rate"]
    if not 0.0 < abs(rate) < 1000.0:
        raise click.BadParameter("give a rate above 0 deg/s", param_hint="--rate")
    motion, rotation = VehicleMotion(latitude, v_east=1.0), Reciprocation(abs(rate) * DEG)
    result = observability.observe(motion, FilterSettings(), rotation)
    doc = document(results.KIND, [], rig.effective(), results.fields(result, motion, rotation))
    if output is None:
        click.echo(to_text(results.singular_table(doc)))
    delivery.deliver(doc, results.table(doc), output, quiet)


def calibrate_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of `calibrate --method srins`."""
    for option in reversed(_CALIBRATE):
        function = option(function)
    return function


_CALIBRATE = (
    click.option(
        "--method",
        type=click.Choice(["turntable", "srins"]),
        default="turntable",
        show_default=True,
        help="srins: long-run filter of the drift along the rotation axis, in level damping.",
    ),
    click.option("--reference", metavar="GNSS_LOG", help="srins: position and velocity."),
    click.option(
        "--speed", metavar="DOPPLER_LOG", help="srins: reference of the damping [default: GNSS]."
    ),
    click.option("--no-damping", is_flag=True, help="srins: run undamped."),
    click.option("--damping", metavar="W1,W2,W3,W4", help="srins: the network, rad/s."),
    click.option(
        "--measured-damping-states/--estimated-damping-states",
        default=None,
        help="srins: take the damping states as known [default], or estimate them.",
    ),
    click.option(
        "--settle",
        type=click.FloatRange(min=0.0),
        metavar="H",
        help="srins: hours before the filter starts [default: all but the last ten].",
    ),
    click.option(
        "--filter-interval",
        type=click.FloatRange(min=1.0, max=60.0),
        metavar="S",
        help="srins: length of a filter step [default: 10].",
    ),
    click.option(
        "--gnss-sigma", metavar="M/S,M", help="srins: velocity and position [default: 0.01,10]."
    ),
    click.option(
        "--speed-sigma",
        type=click.FloatRange(min=0.0),
        metavar="M/S",
        help="srins: noise of the speed reference at 1 Hz [default: 0.1; GNSS: its own].",
    ),
    click.option(
        "--stated-drift",
        type=click.FloatRange(min=0.0, min_open=True),
        metavar="DEG/H",
        help="srins: drift that convergence is measured by [default: 0.003].",
    ),
    click.option(
        "--uncalibrated",
        metavar="PPM,ARCSEC",
        help="srins: scale factor and installation errors left in the gyros [default: 10,2].",
    ),
    click.option("--truth", metavar="FILE", help="srins: truth.json of a simulation."),
    click.option("--solution", metavar="FILE", help="srins: write every state and sigma."),
    click.option("--plot", metavar="FILE", help="srins: draw the drifts (.png, .svg, .pdf)."),
)
# What must be left alone without --method srins.
CALIBRATE_NAMES = (
    *("reference", "speed", "no_damping", "damping", "measured_damping_states", "settle"),
    *("filter_interval", "gnss_sigma", "speed_sigma", "stated_drift", "uncalibrated", "truth"),
    *("solution", "plot"),
)


def is_voyage(scenario: str | None) -> bool:
    """Return whether `simulate --scenario` asks for a voyage, without loading more than TOML."""
    if scenario is None or scenario == "srins":
        return scenario == "srins"
    if not Path(scenario).is_file():
        return False
    from rotcli.srins.scenario import is_srins

    return is_srins(scenario)
