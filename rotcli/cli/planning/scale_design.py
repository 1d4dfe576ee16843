"""`rotcli budget --scale RATES`: predicted sigmas of a scale factor test."""

from dataclasses import replace
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, output
from rotcli.lazy import lazily

with lazily():
    import numpy as np

    from rotcli import units
    from rotcli.models import sensors
    from rotcli.rig import profile as profiles
    from rotcli.run.laboratory import blocks
    from rotcli.scale import design

if TYPE_CHECKING:
    from rotcli.cli.planning.budget import BudgetCommand
    from rotcli.models.sensors import NoiseFigures
    from rotcli.rig.rig import Rig


def run(rates: str, given: "BudgetCommand") -> None:
    """Predict the sigmas of a test at comma-separated rates (deg/s)."""
    rig = loading.load_rig(given.rig_path, None)
    figures, full_scale = _figures(given, rig)
    output.check_result_name(given.output)
    try:
        values = units.DEG * np.array([float(part) for part in rates.split(",")])
        if not np.all(np.isfinite(values)) or given.segment <= 0.0:
            raise ValueError("rates and segment must be finite and positive durations")
        result = design.scale_design(
            values,
            figures,
            full_scale=full_scale,
            duration=given.segment,
            change=given.change,
            rig=rig.effective(),
        )
    except ValueError as error:
        raise click.UsageError(f"--scale {rates}: {error}; give rates such as 0,50,-50") from error
    output.print_or_write(result, given.output, given.quiet)


def _figures(given: "BudgetCommand", rig: "Rig") -> "tuple[NoiseFigures, float | None]":
    """Return the noise of a gyro and its range: profile, else rig; options override both."""
    found, full_scale = sensors.NoiseFigures(), rig.imu.gyro_range
    if given.imu:
        gyro = profiles.read_profile(given.imu).gyro
        found, full_scale = sensors.NoiseFigures(**gyro.noise), gyro.range
    else:
        triad = blocks.gyro_figures(rig.imu)
        if triad is not None:
            found = triad[
                int("xyz".find(rig.table.axis_name) if rig.table.axis_name in "xyz" else 2)
            ]
    if given.angle_random_walk is not None:
        found = replace(found, white=given.angle_random_walk * units.DEG_PER_ROOT_HOUR)
    if given.bias_instability is not None:
        found = replace(found, bias_instability=given.bias_instability * units.DEG_PER_HOUR)
    if given.rate_random_walk is not None:
        found = replace(found, rate_random_walk=given.rate_random_walk * units.DEG_PER_HOUR)
    if not found.white:
        raise click.UsageError("--scale: use --imu, --rig or --angle-random-walk for the noise")
    return found, full_scale
