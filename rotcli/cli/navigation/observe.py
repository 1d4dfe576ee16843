"""`rotcli observe`: what a motion reveals, and what a log on the table reveals."""

from typing import Any

import click

from rotcli.cli import loading, messages, options, values
from rotcli.cli import output as delivery
from rotcli.cli.navigation import zupt_filter


@click.command(
    epilog=options.example(
        "rotcli observe --axis z --pitch 30 --rate 10",
        "rotcli observe --axis y --sweep pitch -30:30:5",
        "rotcli simulate --imu mti-g --axis y --pitch 30 --rate 10 -o run",
        "rotcli observe run/imu.parquet run/table.parquet",
    )
)
@click.argument("imu_log", required=False)
@click.argument("table_log", required=False)
@options.rig
@click.option(
    "--axis",
    metavar="x|y|z|none|X,Y,Z",
    help="Rotation axis in the body; none is a still table [default: the rig's, else z].",
)
@click.option("--rate", type=float, metavar="DEG_S", help="Table rate [default: 10; the log's].")
@click.option("--pitch", type=float, metavar="DEG", help="Attitude of the still body.")
@click.option("--roll", type=float, metavar="DEG", help="[default: the rig's, else 0]")
@click.option("--azimuth", type=float, metavar="DEG", help="Clockwise from north.")
@click.option("--latitude", type=float, metavar="DEG", help="[default: the rig's, else 51.08]")
@click.option(
    "--model",
    type=click.Choice(["simplified", "full", "srins"]),
    default="simplified",
    show_default=True,
    help="full keeps Earth rate in the attitude errors; its last ranks are formal. srins: the "
    "damped single-axis rotation INS on a cruise.",
)
@click.option(
    "--acceleration",
    "accelerations",
    metavar="E,N[,U]",
    multiple=True,
    help="Acceleration of the site, m/s^2; once per segment (0,0 is rest).",
)
@click.option(
    "--sweep",
    nargs=2,
    metavar="roll|pitch|rate A:B:STEP",
    help="Rank and degrees along a parameter, deg or deg/s.",
)
@click.option("--calibration", metavar="FILE", help="Applied first: a result of rotcli calibrate.")
@click.option("--allan", metavar="FILE", help="Noise figures: a result of rotcli allan.")
@click.option("--window", type=options.WINDOW, help="What to filter, s [default: the whole log].")
@click.option(
    "--estimate-lever-arm", is_flag=True, help="Estimate it across the axis; needs two rates."
)
@click.option("--smooth", is_flag=True, help="Add a Rauch-Tung-Striebel pass.")
@click.option("--free-azimuth", is_flag=True, help="Do not slave the azimuth (for comparison).")
@click.option("--save-calibration", metavar="FILE", help="Write the biases for rotcli navigate.")
@zupt_filter.figures
@click.option("--solution", metavar="FILE", help="Write every state and sigma (.parquet or .csv).")
@click.option("--plot", metavar="FILE", help="Draw the estimates or the sweep (.png, .svg, .pdf).")
@options.max_gap
@options.max_bytes
@options.output
def command(
    imu_log: str | None, table_log: str | None, output: str | None, quiet: bool, **given: Any
) -> None:
    """Tell which error states a motion reveals; with logs, estimate them.

    Without logs: rank, states that stand alone, combinations, hidden states and advice. With
    IMU_LOG (still, or turning with TABLE_LOG): that of the log's motion, and the
    zero-velocity-update filter's sensor biases, tilts and azimuth.
    """
    if given["model"] == "srins":
        from rotcli.cli.navigation import srins

        if imu_log is not None:
            raise click.UsageError("--model srins takes no logs; see calibrate --method srins")
        srins.observe(output, quiet, given)
        return
    _check_usage(imu_log, table_log, given)
    delivery.check_outputs(
        [table_log, given["rig_path"], given["calibration"], given["allan"]],
        {"-o": output}
        | {f"--{n.replace('_', '-')}": given[n] for n in ("solution", "plot", "save_calibration")},
        log=imu_log,
    )
    rig = _rig(imu_log, given)
    logs: list[Any] = []
    if imu_log is None:
        own = _analyse(rig, given)
    else:
        imu, table = loading.load_logs(imu_log, table_log, rig, given["max_gap"])
        logs = [log for log in (imu, table) if log]
        own = _filter(imu, table, rig, given, logs)
    _deliver(own, logs, rig, given, output, quiet)


_FOR_LOGS = (
    *("calibration", "allan", "window", "estimate_lever_arm", "smooth", "free_azimuth"),
    *("save_calibration", "solution"),
)


def _check_usage(imu_log: str | None, table_log: str | None, given: dict[str, Any]) -> None:
    """Refuse options that do not go together."""
    zupt_filter.check_figures(given)
    if imu_log is None:
        for name in _FOR_LOGS:
            if given[name]:
                raise click.UsageError(f"--{name.replace('_', '-')} needs an IMU log")
        if given["plot"] and not given["sweep"]:
            raise click.UsageError("--plot needs an IMU log or --sweep")
        return
    if given["sweep"] or given["accelerations"]:
        raise click.UsageError("--sweep and --acceleration are for the analysis without logs")
    if given["rate"] is not None:
        raise click.UsageError("--rate: with a log the rate comes from the table log")
    if given["axis"] == "none" and table_log:
        raise click.UsageError("--axis none: leave the table log out to take the IMU as still")


def _rig(imu_log: str | None, given: dict[str, Any]) -> Any:
    axis = None if given["axis"] == "none" else values.axis(given["axis"])
    return loading.load_rig(
        given["rig_path"],
        imu_log,
        {
            "site": {"latitude": given["latitude"]},
            "attitude": {name: given[name] for name in ("pitch", "roll", "azimuth")},
            "table": {"axis": axis},
        },
    )


def _motion(rig: Any, given: dict[str, Any], rate: float | None) -> Any:
    """Return the motion that the rig and the options describe; rate in rad/s, None when still."""
    from rotcli.models.earth import gravity_at
    from rotcli.observe.observability import Motion
    from rotcli.rig.rig import LABORATORY

    site, u = rig.site or LABORATORY, rig.table.axis
    return Motion(
        axis=None if rate is None else (float(u[0]), float(u[1]), float(u[2])),
        rate=rate or 0.0,
        pitch=rig.attitude.pitch or 0.0,
        roll=rig.attitude.roll or 0.0,
        azimuth=rig.attitude.azimuth or 0.0,
        latitude=site.latitude,
        gravity=gravity_at(site.latitude, site.height, site.gravity),
        model=given["model"],
        accelerations=tuple(_acceleration(text) for text in given["accelerations"]),
    )


def _acceleration(text: str) -> tuple[float, float, float]:
    numbers = values.split_numbers(text)
    if len(numbers) not in (2, 3) or not all(abs(a) < float("inf") for a in numbers):
        raise click.BadParameter(f"{text!r} is not E,N or E,N,U", param_hint="--acceleration")
    return numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 0.0


def _analyse(rig: Any, given: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of the analysis of a motion, and of a sweep.

    A motion that makes no sense comes from the command line: a rig file was checked when read.
    """
    from rotcli.errors import RotcliError
    from rotcli.observe import document as observability
    from rotcli.observe import observability as observe
    from rotcli.units import DEG

    rate = 10.0 if given["rate"] is None else given["rate"]
    motion = _motion(rig, given, None if given["axis"] == "none" else rate * DEG)
    try:
        result = observe.analyse(motion)
        own = {**observability.fields(result), "warnings": []}
        if given["sweep"]:
            parameter, limits = given["sweep"]
            start, stop, step = _limits(parameter, limits)
            found = observe.sweep(motion, parameter, start * DEG, stop * DEG, step * DEG)
            own["sweep"] = observability.sweep_fields(found, result.n.states)
    except RotcliError as fault:
        raise click.UsageError(str(fault)) from fault
    return own


def _limits(parameter: str, text: str) -> tuple[float, float, float]:
    if parameter not in ("roll", "pitch", "rate"):
        raise click.BadParameter(
            f"{parameter!r} is none of roll, pitch, rate", param_hint="--sweep"
        )
    try:
        start, stop, step = (float(part) for part in text.split(":"))
    except ValueError:
        raise click.BadParameter(f"{text!r} is not A:B:STEP", param_hint="--sweep") from None
    return start, stop, step


def _filter(
    imu: Any, table: Any, rig: Any, given: dict[str, Any], logs: list[Any]
) -> dict[str, Any]:
    """Return the fields of a filtered log; write its time series, save its calibration."""
    from dataclasses import replace

    from rotcli.files.documents import document, write_result
    from rotcli.models.sensors import TriadErrors
    from rotcli.observe import document as observability
    from rotcli.observe import observability as observe
    from rotcli.observe import zupt
    from rotcli.observe.zupt_files import CALIBRATION_KIND, calibration_fields
    from rotcli.rig.allan_figures import with_allan
    from rotcli.run.correction import read_correction

    correction = read_correction(given["calibration"]) if given["calibration"] else None
    gyro_errors = accel_errors = None
    if correction:
        correction.check_imu_name(rig.imu.name)
        gyro_errors = correction.gyro_errors(full=correction.gyro_column is not None)
        accel_errors = TriadErrors(bias=correction.accel_bias)
    noisy = rig
    if given["allan"]:
        noisy = replace(rig, imu=with_allan(given["allan"], rig.imu))
    messages.tell(f"filtering with updates at {given['update_rate']:g} Hz")
    told = zupt_filter.settings(given)
    run = zupt.prepare(imu, table, noisy, told, gyro_errors, accel_errors)
    result = zupt_filter.filtered(run, given["solution"])
    warnings = list(result.warnings)
    if correction and result.rate:
        mismatch = correction.check_applies(result.settings.axis, result.rate, constant_rate=True)
        warnings += [mismatch] if mismatch else []
    motion = _still_or_turning(_motion(rig, given, result.rate or None), result.angle, rig)
    analysis = observe.analyse(motion)
    judge = observe.analyse(replace(motion, model="simplified"))
    own = {
        **observability.fields(analysis),
        "filter": observability.filter_fields(result, judge),
        "warnings": warnings,
    }
    if given["save_calibration"]:
        fields = calibration_fields(result, correction, own["filter"]["not_to_be_used"])
        if fields["left_out"]:
            names = ", ".join(fields["left_out"])
            warnings.append(f"--save-calibration: left out what is not to be used: {names}")
        saved = {**fields, "warnings": warnings}
        doc = document(CALIBRATION_KIND, logs, rig.effective(), saved)
        write_result(given["save_calibration"], doc)
    return own


def _still_or_turning(motion: Any, angle: float, rig: Any) -> Any:
    """Return the motion; of a still table, with the attitude that its angle gives the sensor."""
    if motion.axis is not None or angle == 0.0:
        return motion
    from dataclasses import replace

    from rotcli.models.rotation import axis_rotation, euler_angles

    pitch, roll, azimuth = euler_angles(motion.C_nb @ axis_rotation(rig.table.axis, angle))
    return replace(motion, pitch=float(pitch), roll=float(roll), azimuth=float(azimuth))


def _deliver(
    own: dict[str, Any],
    logs: list[Any],
    rig: Any,
    given: dict[str, Any],
    output: str | None,
    quiet: bool,
) -> None:
    """Write what was asked for and print the rest."""
    from rotcli.files.documents import document
    from rotcli.observe import document as observability

    doc = document(observability.KIND, logs, rig.effective(), own)
    if given["plot"]:
        from rotcli.files.figures import save_figure
        from rotcli.observe import plot

        figure = plot.sweep_figure(doc) if given["sweep"] else plot.estimates_figure([doc])
        save_figure(figure, given["plot"])
    delivery.deliver(doc, observability.table(doc), output, quiet)
