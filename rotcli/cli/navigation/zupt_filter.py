"""Options of the ZUPT filter of `rotcli observe`."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import click

from rotcli.cli import options
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.observe import zupt
    from rotcli.observe.zupt import model

if TYPE_CHECKING:
    from rotcli.observe.zupt import Options

Function = TypeVar("Function", bound=Callable[..., object])

_SMALLEST = 1e-12  # in the unit of an option; far below any sensor, and ratios cannot overflow

# Option: default, unit, meaning.
FILTER_OPTIONS = {
    "update-rate": (10.0, "HZ", "Zero-velocity updates per second."),
    "sigma-measurement": (
        None,
        "M/S",
        "Sigma of a zero-velocity measurement [default: estimated from the log].",
    ),
    "sigma-velocity": (0.001, "M/S", "Initial sigma of the velocity."),
    "sigma-tilt": (1.0, "DEG", "Initial sigma of the tilts."),
    "sigma-azimuth": (0.1, "DEG", "Initial sigma of the azimuth."),
    "sigma-accel": (0.02, "M/S^2", "Initial sigma of the accelerometer biases."),
    "sigma-gyro": (500.0, "DEG/H", "Initial sigma of the gyro biases."),
    "sigma-lever-arm": (0.1, "M", "Initial sigma of the lever arm."),
    "sigma-scale": (
        None,
        "PPM",
        "Initial sigma of uncalibrated gyro scale factor and installation errors; 0 removes these "
        "states [default: scale_sigma of the rig, else 3000].",
    ),
}


@dataclass(frozen=True)
class FilterOptions(options.OutputOptions):
    """Settings of the filter on the command line, in the units of the options."""

    update_rate: float
    sigma_measurement: float | None
    sigma_velocity: float
    sigma_tilt: float
    sigma_azimuth: float
    sigma_accel: float
    sigma_gyro: float
    sigma_lever_arm: float
    sigma_scale: float | None
    estimate_lever_arm: bool
    smooth: bool
    free_azimuth: bool
    window: options.Span | None

    def check(self) -> None:
        """Raise UsageError for a figure that is not positive."""
        if self.smooth and self.free_azimuth:
            raise click.UsageError("--smooth and --free-azimuth exclude each other")
        for name in FILTER_OPTIONS:
            value = getattr(self, name.replace("-", "_"))
            may_be_zero = name == "sigma-scale"
            if value is None or _SMALLEST <= value < math.inf or (value == 0.0 and may_be_zero):
                continue
            minimum = "0 or more" if may_be_zero else "above 0"
            if 0.0 < value < _SMALLEST:
                minimum = f"at least {_SMALLEST:g}"
            raise click.UsageError(f"--{name} {value:g}: must be {minimum}")

    def settings(self) -> "Options":
        """Return the settings of the filter in SI."""
        return zupt.Options(
            initial=model.InitialSigma(
                velocity=self.sigma_velocity,
                tilt=self.sigma_tilt * units.DEG,
                azimuth=self.sigma_azimuth * units.DEG,
                accel=self.sigma_accel,
                gyro=self.sigma_gyro * units.DEG_PER_HOUR,
                lever_arm=self.sigma_lever_arm,
            ),
            scale=None if self.sigma_scale is None else self.sigma_scale * units.PPM,
            update_rate=self.update_rate,
            velocity_sigma=self.sigma_measurement,
            estimate_lever_arm=self.estimate_lever_arm,
            slave_azimuth=not self.free_azimuth,
            smooth=self.smooth,
            window=self.window,
        )


def filter_options(function: Function) -> Function:
    """Add an option for every figure of the filter."""
    for name, (default, unit, text) in reversed(FILTER_OPTIONS.items()):
        shown = default is not None
        function = click.option(
            f"--{name}",
            type=options.NOT_NEGATIVE,
            default=default,
            metavar=unit,
            show_default=shown,
            help=text,
        )(function)
    return function
