"""`rotcli navigate`: inertial navigation of a log on a still table."""

from typing import Any

import click

from rotcli.cli import options

MODES = ("conventional", "partial", "full")


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
        "rotcli navigate run/imu.parquet run/table.parquet --calibration run/calibration.json",
    )
)
@click.argument("imu_log")
@click.argument("table_log", required=False)
@options.rig
@click.option(
    "--mode",
    "modes",
    type=click.Choice(MODES),
    multiple=True,
    help="conventional: biases from the still minute; partial: a calibration's biases; full: its "
    "scale factor and installation errors too. May be given more than once: then -o, --solution "
    "and --plot take {mode} in the name. [default: full with --calibration, else conventional]",
)
@click.option("--calibration", metavar="FILE", help="Result of rotcli calibrate.")
@click.option(
    "--allow-other-rate", is_flag=True, help="Accept a calibration made at another table rate."
)
@click.option("--window", type=options.WINDOW, help="What to navigate, s [default: the rig's].")
@click.option(
    "--static",
    type=options.WINDOW,
    help="Still stretch for the biases of conventional, s [default: the rig's, else found].",
)
@click.option(
    "--height",
    type=click.Choice(["free", "hold"]),
    default="free",
    show_default=True,
    help="Let height diverge as in the papers, or hold it.",
)
@click.option("--solution", metavar="FILE", help="Write the time series (.parquet or .csv).")
@click.option("--plot", metavar="FILE", help="Draw the errors against time (.png, .svg, .pdf).")
@options.max_gap
@options.max_bytes
@options.output
def command(
    imu_log: str, table_log: str | None, output: str | None, quiet: bool, **given: Any
) -> None:
    """Navigate a log and take the errors against the still table.

    Without TABLE_LOG the IMU is taken as still. The RMS errors over the window are printed;
    -o writes them as JSON.
    """
    modes = given["modes"] or ("full" if given["calibration"] else "conventional",)
    for option, name in (
        ("-o", output),
        ("--solution", given["solution"]),
        ("--plot", given["plot"]),
    ):
        if len(modes) > 1 and name not in (None, "-") and "{mode}" not in str(name):
            raise click.UsageError(f"{option}: with several modes put {{mode}} in the name")
    if not given["calibration"] and set(modes) - {"conventional"}:
        raise click.UsageError("partial and full need --calibration (see rotcli calibrate)")
    outputs = {"-o": output, "--solution": given["solution"], "--plot": given["plot"]}
    for mode in modes:
        options.check_outputs(
            [table_log, given["rig_path"], given["calibration"]],
            {key: name and name.replace("{mode}", mode) for key, name in outputs.items()},
            log=imu_log,
        )
    rig = options.load_rig(given["rig_path"], imu_log)
    rig = options.lay_over(
        rig, {"stages": {"static": given["static"], "navigation": given["window"]}}
    )
    imu, table = options.load_logs(imu_log, table_log, rig, given["max_gap"])
    results = _navigate(imu, table, rig, modes, given)
    _deliver(results, [log for log in (imu, table) if log], rig, given, output, quiet)


def _navigate(
    imu: Any, table: Any, rig: Any, modes: tuple[str, ...], given: dict[str, Any]
) -> list[tuple[Any, list[str]]]:
    """Return the navigation of every mode with its warnings."""
    from rotcli.errors import ResultError
    from rotcli.models.sensors import TriadErrors
    from rotcli.results.calibration import read_correction
    from rotcli.stages.navigate import check_correction, navigate, prepare, static_errors

    correction = read_correction(given["calibration"]) if given["calibration"] else None
    if correction:
        correction.check_unit(rig.imu.name)
    run = prepare(imu, table, rig, need_static="conventional" in modes)
    mismatch = correction and correction.check_applies(run.axis, run.rate, steady=run.steady)
    if mismatch and set(modes) - {"conventional"} and not given["allow_other_rate"]:
        raise ResultError(f"{mismatch}; calibrate at that rate, or say --allow-other-rate")
    results = []
    for mode in modes:
        warnings = list(run.warnings)
        accel_errors = None
        if correction is None or mode == "conventional":
            gyro_errors = static_errors(run)
            if run.rate or not run.steady:
                warnings.append("the table turns in the window: not a conventional run")
        else:
            gyro_errors = correction.gyro_errors(full=mode == "full")
            accel_errors = TriadErrors(bias=correction.accel_bias)
            warnings += [mismatch] if mismatch else []
            warnings += check_correction(run, gyro_errors) if mode == "full" else []
            if given["static"] and run.static is None:
                warnings.append(f"--static: of no effect, {mode} takes the calibration's biases")
            if correction.left_out:
                lacks = ", ".join(correction.left_out)
                warnings.append(f"{correction.path}: holds no {lacks}: not corrected")
        hold = given["height"] == "hold"
        options.tell(_told(run, mode))
        with options.progress(f"navigating {mode}") as told:
            result = navigate(
                run, gyro_errors, accel_errors, mode=mode, hold_height=hold, progress=told
            )
        results.append((result, warnings))
    return results


def _told(run: Any, mode: str) -> str:
    """Return what --verbose says of a run."""
    from rotcli.units import DEG, show_span

    parts = [f"navigating {mode}, table at {run.rate / DEG:.6g} deg/s"]
    for name, held in (("still", run.static), ("window", run.window)):
        if held is not None:
            time = run.imu.time[held]
            parts.append(f"{name} {show_span(time[0], time[-1])}")
    return ", ".join(parts)


def _deliver(
    results: list[tuple[Any, list[str]]],
    logs: list[Any],
    rig: Any,
    given: dict[str, Any],
    output: str | None,
    quiet: bool,
) -> None:
    """Write what was asked for, mode by mode, and print the rest as one table."""
    from rotcli.results import navigation
    from rotcli.results.files import document

    docs = [
        document(
            navigation.KIND,
            logs,
            rig.effective(),
            {**navigation.fields(result), "warnings": warnings},
        )
        for result, warnings in results
    ]
    for result, _ in results:
        if given["solution"]:
            name = given["solution"].replace("{mode}", result.mode)
            options.write_series(name, navigation.solution(result))
        if given["plot"]:
            from rotcli.results.plots import navigation_errors, save_figure

            name = given["plot"].replace("{mode}", result.mode)
            save_figure(navigation_errors(navigation.solution(result), result.mode), name)
    options.deliver(docs, navigation.table(docs), output, quiet)
