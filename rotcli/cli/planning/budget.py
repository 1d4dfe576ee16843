"""`rotcli budget`: what one turn about each axis leaves of the sensor errors."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from rotcli.cli import loading, messages, options, values
from rotcli.cli import output as delivery

_NOISE = ("angle_random_walk", "bias_instability", "rate_random_walk")


@click.command(
    epilog=options.example("rotcli budget --imu nav440 --rate 10 --gyro-bias 0,0,0 -o budget.md")
)
@click.option(
    "--axis",
    "axes",
    type=click.Choice(["x", "y", "z"]),
    multiple=True,
    help="Only this rotation axis; may be given more than once [default: x, y and z].",
)
@click.option(
    "--rate",
    type=float,
    metavar="DEG_S",
    help="Table rate [default: the calibration's, else 10].",
)
@click.option("--calibration", metavar="FILE", help="Sensor errors of rotcli calibrate.")
@click.option("--imu", metavar="NAME|FILE", help="IMU profile: mti-g, nav440, ideal or a file.")
@click.option("--accel-bias", metavar="X,Y,Z", help="m/s^2.")
@click.option("--gyro-bias", metavar="X,Y,Z", help="deg/h.")
@click.option("--gyro-scale", metavar="X,Y,Z", help="Kgx, Kgy, Kgz, ppm.")
@click.option("--gyro-installation", metavar="XY,XZ,YX,YZ,ZX,ZY", help="Kgxy, Kgxz, Kgyx ..., ppm.")
@click.option("--angle-random-walk", metavar="X", type=click.FloatRange(min=0), help="deg/sqrt(h).")
@click.option("--bias-instability", metavar="X", type=click.FloatRange(min=0), help="deg/h.")
@click.option(
    "--rate-random-walk", metavar="X", type=click.FloatRange(min=0), help="deg/h/sqrt(s)."
)
@click.option("--latitude", type=float, metavar="DEG", help="[default: the rig's, else 51.08]")
@click.option(
    "--duration",
    metavar="S",
    type=click.FloatRange(min=1, max=3600),
    default=300.0,
    show_default=True,
    help="Time of growth, up to an hour: beyond it the unaided height runs away with everything.",
)
@click.option("--rig", "rig_path", metavar="FILE", help="[default: the calibration's, if any]")
@click.option("--plot", "plot_path", metavar="FILE", help="Draw the budget (.png, .svg, .pdf).")
@options.output_as(".md", ".tex", ".csv", ".txt")
def command(output: str | None, quiet: bool, **given: Any) -> None:
    """Say which axis to turn about: the error that one turn leaves, by axis and source.

    The sensor errors come from a profile (--imu), from a calibration, or from the options, each
    overriding the one before; what none of them says is zero. With --gyro-bias 0,0,0 the budget
    is that of an IMU whose gyro biases are calibrated. -o takes .json, .md, .tex, .csv or .txt.
    """
    from rotcli.budget import document as results
    from rotcli.files.documents import document

    delivery.check_outputs([given["calibration"], given["rig_path"], given["imu"]], {"-o": output})
    held = _gather(given)
    origin = [held["sources"][key] for key in ("imu", "calibration") if key in held["sources"]]
    messages.tell(
        f"sensor errors from {', '.join(origin) or 'the options'}; "
        f"one turn at {held['rate']:.6g} deg/s, then {given['duration']:g} s"
    )
    result = _budget(held, given)
    own = {**results.fields(result), "sources": held["sources"]}
    own["recommendation"] += held["sensors"].unequal()
    warnings = [*held["warnings"], *result.warnings]
    doc = document(results.KIND, [], held["rig"].effective(), {**own, "warnings": warnings})
    if given["plot_path"]:
        from rotcli.budget.plot import budget_figure
        from rotcli.files.figures import save_figure

        save_figure(budget_figure(doc), given["plot_path"])
        messages.tell(f"wrote {given['plot_path']}")
    _deliver(doc, output, quiet)


def _gather(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the sensor errors and noise, the rig, the rate, where they come from and warnings."""
    from rotcli.budget.sensors import Sensors
    from rotcli.files.documents import sha256
    from rotcli.rig.profile import read_profile

    path, rate, name = given["calibration"], given["rate"], None
    found, warnings = Sensors(), []
    rig = loading.load_rig(given["rig_path"], None)
    if given["imu"]:
        profile = read_profile(given["imu"])
        found, name = found.with_profile(profile), profile.name
    if path:
        correction, own_rig, made = _calibration(path)
        found = found.with_correction(correction)
        rig = rig if given["rig_path"] else own_rig
        rate = made if rate is None else rate
        if abs(abs(rate) - abs(made)) > 0.01 * abs(made):
            warnings.append(
                f"{path}: made at {made:.6g} deg/s, the budget is for {rate:.6g} deg/s: MEMS "
                "gyros are not linear; calibrate at the rate of the run"
            )
    found = found.with_figures(
        accel_bias=_numbers(given, "accel_bias", 3),
        gyro_bias=_numbers(given, "gyro_bias", 3),
        gyro_scale=_numbers(given, "gyro_scale", 3),
        gyro_installation=_numbers(given, "gyro_installation", 6),
    )
    if not found.known:
        raise click.UsageError(
            "no sensor errors: give --imu, --calibration, or figures such as --gyro-bias"
        )
    rate = 10.0 if rate is None else float(rate)
    if rate == 0.0 or not math.isfinite(rate):
        raise click.BadParameter("a table that does not turn has no turn", param_hint="--rate")
    found = found.with_noise(rig.imu, {key: given[key] for key in _NOISE})
    sources = {"imu": given["imu"], "calibration": path}
    sources |= {"calibration_sha256": sha256(path)} if path else {}
    return {
        "sensors": found,
        "rig": loading.lay_over(
            rig, {"site": {"latitude": given["latitude"]}, "imu": {"name": name}}
        ),
        "rate": rate,
        "sources": {key: name for key, name in sources.items() if name},
        "warnings": [*warnings, *found.assumed()],
    }


def _calibration(path: str) -> tuple[Any, Any, float]:
    """Return the correction a calibration file holds, the rig and the rate (deg/s) it is for."""
    from rotcli.errors import ResultError
    from rotcli.files.documents import number, read_result
    from rotcli.rig.rig import rig_from_dict
    from rotcli.run.correction import KIND, read_correction

    correction, doc = read_correction(path), read_result(path, KIND)
    rig = doc.get("rig") or {}
    if not isinstance(rig, dict):
        raise ResultError(f"{path}: rig: not a table of sections; make it anew, or give --rig")
    return correction, rig_from_dict(rig, path), number(doc, path, "rate", "value")


def _budget(held: Mapping[str, Any], given: Mapping[str, Any]) -> Any:
    """Return the budget of what was gathered."""
    from rotcli.budget.estimate import budget
    from rotcli.models.base import FixedBase
    from rotcli.models.earth import gravity_at
    from rotcli.models.rotation import attitude_matrix
    from rotcli.rig.rig import LABORATORY
    from rotcli.units import DEG

    rig, sensors = held["rig"], held["sensors"]
    site, attitude = rig.site or LABORATORY, rig.attitude
    gravity = gravity_at(site.latitude, site.height, site.gravity)
    C_nb = attitude_matrix(attitude.pitch or 0.0, attitude.roll or 0.0, attitude.azimuth or 0.0)
    return budget(
        sensors.gyro,
        sensors.accel_bias,
        sensors.noise,
        FixedBase(site.latitude, gravity, C_nb),
        rate=held["rate"] * DEG,
        axes=tuple(dict.fromkeys(given["axes"])) or ("x", "y", "z"),
        duration=given["duration"],
    )


def _numbers(given: Mapping[str, Any], key: str, count: int) -> list[float] | None:
    """Return the finite numbers of an option, None where it was not given."""
    text = given[key]
    if text is None:
        return None
    numbers = values.split_numbers(text)
    if len(numbers) != count or not all(math.isfinite(number) for number in numbers):
        hint = f"--{key.replace('_', '-')}"
        raise click.BadParameter(f"{text!r} is not {count} numbers with commas", param_hint=hint)
    return numbers


def _deliver(doc: dict[str, Any], output: str | None, quiet: bool) -> None:
    """Print the tables, or write them or the document by the output's suffix."""
    from rotcli.budget.document import tables
    from rotcli.files.documents import write_result, write_text
    from rotcli.files.tables import WRITERS

    messages.warn(doc["warnings"], quiet)
    suffix = ".txt" if output is None else Path(output).suffix.lower()
    if suffix in WRITERS:
        write_text(output or "-", WRITERS[suffix](tables(doc)))
    else:
        write_result(str(output), doc)
    if output not in (None, "-"):
        messages.say(f"{output}: {doc['recommendation']}", quiet)
