"""The zero-velocity filter of `rotcli observe`: its options, and a run filtered with them."""

from typing import Any

import click

from rotcli.cli import messages, output

# Figures of the filter: default, unit, meaning.
FIGURES = {
    "update-rate": (10.0, "HZ", "Zero-velocity updates per second."),
    "sigma-measurement": (0.002, "M/S", "Of the zero velocity."),
    "sigma-velocity": (0.001, "M/S", "InitialSigma: velocity."),
    "sigma-tilt": (1.0, "DEG", "InitialSigma: tilts."),
    "sigma-azimuth": (0.1, "DEG", "InitialSigma: azimuth."),
    "sigma-accel": (0.02, "M/S^2", "InitialSigma: accelerometer biases."),
    "sigma-gyro": (500.0, "DEG/H", "InitialSigma: gyro biases."),
    "sigma-lever-arm": (0.1, "M", "InitialSigma: lever arm."),
    "sigma-scale": (
        None,
        "PPM",
        "Gyro scale factor and installation that no calibration removes, as states "
        "0 for none [default: the rig's scale_sigma, else 3000].",
    ),
}


def figures(function: Any) -> Any:
    """Add an option for every figure of the filter."""
    for name, (default, unit, text) in reversed(FIGURES.items()):
        shown = default is not None
        function = click.option(
            f"--{name}", type=float, default=default, metavar=unit, show_default=shown, help=text
        )(function)
    return function


def check_figures(given: dict[str, Any]) -> None:
    """Refuse figures of the filter that mean nothing."""
    for name in FIGURES:
        value = given[name.replace("-", "_")]
        least = "0 or more" if name == "sigma-scale" else "above 0"
        if value is not None and not (
            0.0 < value < float("inf") or (value == 0.0 and name == "sigma-scale")
        ):
            raise click.UsageError(f"--{name} {value:g}: must be {least}")


def settings(given: dict[str, Any]) -> Any:
    """Return the options of the filter as its stage takes them."""
    from rotcli.observe.zupt import Options
    from rotcli.observe.zupt.model import InitialSigma
    from rotcli.units import DEG, DEG_PER_HOUR, PPM

    return Options(
        initial=InitialSigma(
            velocity=given["sigma_velocity"],
            tilt=given["sigma_tilt"] * DEG,
            azimuth=given["sigma_azimuth"] * DEG,
            accel=given["sigma_accel"],
            gyro=given["sigma_gyro"] * DEG_PER_HOUR,
            lever_arm=given["sigma_lever_arm"],
        ),
        scale=None if given["sigma_scale"] is None else given["sigma_scale"] * PPM,
        update_rate=given["update_rate"],
        velocity_sigma=given["sigma_measurement"],
        estimate_lever_arm=given["estimate_lever_arm"],
        slave_azimuth=not given["free_azimuth"],
        smooth=given["smooth"],
        window=given["window"],
    )


def filtered(run: Any, path: str | None) -> Any:
    """Filter a run, and once more where the table stands off its attitude; write the time series.

    path: of the time series, written part by part; None for none.
    """
    from rotcli.observe.zupt import TiltFoundError

    # What a pipe has been given cannot be taken back: there the first pass only looks.
    only_look = path is not None and output.is_special(path)
    try:
        result = _passed(run, None if only_look else path)
        return _passed(run, path) if only_look else result
    except TiltFoundError as found:
        messages.tell("filtering once more, about the attitude at which the table stands")
        return _passed(found.run, path)


def _passed(run: Any, path: str | None) -> Any:
    """Filter a run, the time series written on the way; return what was found.

    A pass that ends in TiltFoundError leaves no time series behind.
    """
    from rotcli.observe.zupt import Summary, estimate_parts
    from rotcli.observe.zupt_files import solution_parts

    summary = Summary(run)
    with messages.progress("filtering") as told:
        parts = summary.watch(estimate_parts(run, told))
        if path:
            output.write_parts(path, solution_parts(run, parts))
        else:
            for _ in parts:
                pass
    return summary.result()
