"""`rotcli calibrate`: gyro biases, scale factor and installation errors."""

from typing import Any

import click

from rotcli.cli import loading, messages, options
from rotcli.cli import output as delivery
from rotcli.cli.batch import run
from rotcli.cli.navigation import srins


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
    )
)
@click.argument("imu_log", required=False)
@click.argument("table_log", required=False)
@options.rig
@click.option(
    "--static",
    type=options.WINDOW,
    multiple=True,
    help="Still stretch, s [default: the rig's, else the first found].",
)
@click.option(
    "--rotation",
    type=options.WINDOW,
    multiple=True,
    help="Turning stretch, s; more than once for several [default: the rig's, else all found].",
)
@click.option(
    "--earth-rate",
    type=click.Choice(["compensate", "ignore"]),
    default="compensate",
    show_default=True,
    help="Take the Earth's rotation out of the data, or leave it in as R16 does.",
)
@click.option("--report-residuals", metavar="FILE", help="Write what the fit leaves (CSV/Parquet).")
@srins.calibrate_options
@options.max_gap
@options.max_bytes
@run.options
@options.output
def command(
    imu_log: str | None, table_log: str | None, output: str | None, quiet: bool, **given: Any
) -> None:
    """Estimate gyro biases, scale factor and installation errors from a log.

    IMU_LOG and TABLE_LOG hold a still stretch and one or more stretches turning at a constant
    rate about one axis: the rate that navigation will use, for MEMS gyros are not linear.
    """
    if given["method"] == "srins":
        if given["batch"]:
            raise click.UsageError("--batch is not for --method srins")
        logs = run.needed(imu_log, "IMU_LOG"), run.needed(table_log, "TABLE_LOG")
        srins.calibrate(*logs, output, quiet, given)
        return
    srins.refuse(given, srins.CALIBRATE_NAMES, "needs --method srins")
    if given["batch"]:
        run.run("calibrate", (imu_log, table_log), output, quiet, given)
        return

    from rotcli.calibrate import document as calibration

    logs = run.needed(imu_log, "IMU_LOG"), run.needed(table_log, "TABLE_LOG")
    delivery.check_outputs(
        [table_log, given["rig_path"]],
        {"-o": output, "--report-residuals": given["report_residuals"]},
        log=imu_log,
    )
    (doc,) = documents(*logs, given)
    delivery.deliver(doc, calibration.table(doc), output, quiet, calibration.headline)


def documents(imu_log: str, table_log: str, given: dict[str, Any]) -> list[Any]:
    """Calibrate one run; return its document, the residuals written if asked for."""
    from rotcli.calibrate import document as calibration
    from rotcli.calibrate.estimate import residual_parts
    from rotcli.files.documents import document
    from rotcli.run.correction import KIND

    rig = loading.load_rig(given["rig_path"], imu_log)
    imu, table = loading.load_logs(imu_log, table_log, rig, given["max_gap"])
    base = _base(rig) if given["earth_rate"] == "compensate" else None
    result, warnings = _calibrate(imu, table, rig, base, given)
    if given["report_residuals"]:
        left = residual_parts(imu, table, result, base)
        delivery.write_parts(
            given["report_residuals"], (calibration.residuals(*part) for part in left)
        )
    own = {**calibration.fields(result), "warnings": warnings}
    return [document(KIND, [imu, table], rig.effective(), own)]


def _calibrate(
    imu: Any, table: Any, rig: Any, base: Any, given: dict[str, Any]
) -> tuple[Any, list[str]]:
    """Find the stretches, check them and calibrate; return the result and all warnings."""
    from rotcli.calibrate.estimate import calibrate
    from rotcli.run.recording import calibration_run, check_calibration_run
    from rotcli.units import DEG, show_span

    rig = loading.lay_over(
        rig, {"stages": {"rotation": [list(pair) for pair in given["rotation"]] or None}}
    )
    found = calibration_run(imu, table, rig, given["static"])
    static, rotation = (
        [part.stretch for part in parts] for parts in (found.static, found.rotation)
    )
    for stretch in (*static, *rotation):
        what = f"turning at {stretch.rate / DEG:.6g} deg/s" if stretch.rate else "still"
        messages.tell(f"calibrating on {what}: {show_span(stretch.start, stretch.end)}")
    warnings = [*found.warnings, *check_calibration_run(imu, table, rig, found)]
    with messages.progress("calibrating") as told:
        result = calibrate(
            imu,
            table,
            static,
            rotation,
            axis_name=rig.table.axis_name,
            axis=rig.table.axis,
            base=base,
            white=rig.imu.figure("angle_random_walk"),
            wander=_wander(rig.imu),
            progress=told,
        )
    return result, [*warnings, *result.warnings]


def _wander(imu: Any) -> Any:
    """Return the slow noise of each gyro, None where the rig names none."""
    from rotcli.models.sensors import NoiseFigures

    names = {
        "bias_instability": "bias_instability",
        "rate_random_walk": "rate_random_walk",
        "markov_sigma": "gauss_markov_gyro_sigma",
        "markov_time": "gauss_markov_gyro_time",
    }
    held = {ours: imu.figure(name) for ours, name in names.items()}
    if held["markov_sigma"] is None or held["markov_time"] is None:
        held["markov_sigma"] = held["markov_time"] = None
    given = {name: figure for name, figure in held.items() if figure is not None}
    if not given:
        return None
    return [NoiseFigures(**{name: float(f[k]) for name, f in given.items()}) for k in range(3)]


def _base(rig: Any) -> Any:
    """Return the base whose Earth rate is taken out; the rig must say where and how it stands."""
    from rotcli.errors import RigError
    from rotcli.models.base import FixedBase
    from rotcli.models.earth import gravity_at
    from rotcli.models.rotation import attitude_matrix

    held = rig.attitude
    angles = {"pitch": held.pitch, "roll": held.roll, "azimuth": held.azimuth}
    missing = [f"[attitude] {name}" for name, angle in angles.items() if angle is None]
    if rig.site is None:
        missing.insert(0, "[site] latitude")
    if missing:
        raise RigError(
            f"{rig.path or 'no rig.toml'}: {', '.join(missing)}: missing; compensating the Earth "
            "rate needs it: add it to the rig (--rig), or use --earth-rate ignore"
        )
    site = rig.site
    gravity = gravity_at(site.latitude, site.height, site.gravity)
    return FixedBase(site.latitude, gravity, attitude_matrix(held.pitch, held.roll, held.azimuth))
