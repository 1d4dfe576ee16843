"""Tests of a window's residuals next to the RMS: means, disturbed seconds, level of the table.

The RMS cannot show what the turn removes. The mean of the corrected gyros and accelerometers, the
level that the turn reveals, and whitened means of a second can; all sigmas come from the
covariance of the expected errors. Disturbances are searched for after a significant mean and a
significant level were subtracted: each finding has its cause.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.base import FixedBase
from rotcli.models.expected.at_angle import AngleComparison
from rotcli.models.expected.companions import (
    P_BLOCK,
    BlockResiduals,
    MeanResidual,
    block_residuals,
    mean_residual,
)
from rotcli.models.expected.sources import AccelSource, GyroSource
from rotcli.navigate.level import ACCEL_SCALE_TOLERANCE, LevelEstimate, estimate_level
from rotcli.navigate.residuals import StillAccelerometers, WindowResiduals
from rotcli.run.findings import Finding
from rotcli.run.recording import NavigationRun
from rotcli.units import FloatArray, digits

# Second-order nonlinearity of accelerometers, relative to the gravity that turns: 0.2 % of a range
# of 5 g is 0.4 mg/g^2, cheaper ones have twice as much.
_NONLINEARITY_TOLERANCE = 1e-3
_MAX_BIAS_SIGMAS = 5.0  # of the still accelerometers: one in two million for each of three axes


@dataclass(frozen=True, eq=False)
class Companions:
    """Tests of the residuals; None where one cannot be judged."""

    gyro_mean: MeanResidual | None = None
    gyro_blocks: BlockResiduals | None = None
    accel_mean: MeanResidual | None = None
    accel_blocks: BlockResiduals | None = None
    level: LevelEstimate | None = None


def gyro_companions(
    run: NavigationRun,
    residuals: WindowResiduals,
    gyro: GyroSource,
    end: float,
    *,
    changed: bool = False,
    known: bool = True,
) -> tuple[MeanResidual | None, BlockResiduals | None]:
    """Return the tests of the gyros, less a known axis column that is left in.

    Blocks of a rate that varies are not judged: the encoder's resolution is in their rate.
    changed: the correction is of another log or lacks the axis column; blocks are then judged
    about their median. known: the sigma of that change is known; else the mean is not judged.
    """
    mean_error = residuals.mean_gyro - run.rate * gyro.column
    mean = mean_residual(mean_error, residuals.start, end, run.rate, gyro)
    column = gyro.column_sigma * run.rate
    mean = mean.with_sigma(np.sqrt(mean.sigma**2 + gyro.turn_on_sigma**2 + column**2))
    if not run.constant_rate:
        return mean if known else None, None
    values = residuals.gyro - residuals.rate[:, None] * gyro.column
    if changed:
        values = values - np.median(values, axis=0)
        return mean if known else None, block_residuals(values, *_arguments(residuals, gyro))
    return _blocks(values, mean, residuals, gyro, lambda quiet: values[quiet].mean(axis=0))


def accel_companions(
    run: NavigationRun,
    residuals: WindowResiduals,
    accel: AccelSource,
    base: FixedBase,
    rest: StillAccelerometers,
) -> tuple[MeanResidual | None, BlockResiduals, LevelEstimate | None]:
    """Return the tests of the accelerometers whose bias was measured in a still segment.

    Where gravity turns in the sensor frame, the mean is that at the table angle of the segment.
    """
    found = estimate_level(residuals, run.axis, base, accel)
    values = residuals.accel - accel.bias
    if found is not None and found.significant:
        # The still bias has the wrong gravity in it as well: nothing is left to compare with.
        values = values - found.turned
        values = values - np.median(values, axis=0)
        return None, block_residuals(values, *_arguments(residuals, accel)), found
    g_b = base.specific_force
    turning = float(np.linalg.norm(g_b - run.axis * (run.axis @ g_b)))
    tolerance = ACCEL_SCALE_TOLERANCE * turning, _NONLINEARITY_TOLERANCE * turning
    window = residuals.start, residuals.length, residuals.rate, residuals.angle
    comparison = AngleComparison.of(window, rest.angle, tolerance, accel)

    def without(quiet: NDArray[np.bool_]) -> FloatArray:
        return np.asarray(comparison.weights(quiet) @ values)

    mean, blocks = _blocks(values, comparison.test(values), residuals, accel, without)
    return mean, blocks, found


def _blocks(
    values: FloatArray,
    mean: MeanResidual,
    residuals: WindowResiduals,
    source: GyroSource | AccelSource,
    mean_of: Callable[[NDArray[np.bool_]], FloatArray],
) -> tuple[MeanResidual, BlockResiduals]:
    """Return the tests of mean and blocks, each free of the other's cause.

    Disturbed seconds do not count for the p value of the mean; blocks are judged about their
    median where the mean is significant. mean_of: the mean (3,) of the blocks that are flagged.
    """
    arguments = _arguments(residuals, source)
    blocks = block_residuals(values, *arguments)
    if mean.p_value >= P_BLOCK:
        return mean, blocks
    starts = residuals.start + residuals.length * np.arange(len(values))
    quiet = ~np.isin(starts, blocks.disturbed)
    if quiet.any() and not quiet.all():
        without = MeanResidual.of(mean_of(quiet), mean.sigma)
        if without.p_value >= P_BLOCK:
            return replace(mean, p_value=without.p_value), blocks
    return mean, block_residuals(values - np.median(values, axis=0), *arguments)


def _arguments(
    residuals: WindowResiduals, source: GyroSource | AccelSource
) -> tuple[float, float, FloatArray, GyroSource | AccelSource]:
    return residuals.start, residuals.length, residuals.rate, source


def still_bias_finding(
    path: str, rest: StillAccelerometers, sigma: FloatArray, turning: bool
) -> list[Finding]:
    """Return the finding of a still segment that reads otherwise than [attitude] and its sigma say.

    Standing still, a wrong level and an accelerometer bias look alike; a turn separates them, so
    that a turning window has its own finding. sigma: (3,) m/s^2, of the accelerometer biases.
    """
    size = np.abs(rest.bias) / np.maximum(sigma, np.finfo(float).tiny)
    axis = int(np.argmax(size))
    if turning or size[axis] <= _MAX_BIAS_SIGMAS:
        return []
    value, limit = float(rest.bias[axis]), float(sigma[axis])
    text = (
        f"{path}: accel_{'xyz'[axis]} differs by {digits(value)} m/s^2 from gravity at the rig's "
        f"[attitude] in the still segment, accel_bias_sigma is {digits(limit)} m/s^2. Check the "
        "level of the table and the accelerometer"
    )
    where = f"accel_{'xyz'[axis]}"
    return [Finding("level-unexpected", text, where=where, value=value, limit=limit, unit="m/s^2")]
