"""Tests of a window's residuals beside the RMS: means, disturbed seconds, level of the table.

The RMS cannot show what the turn removes. The mean of the corrected gyros and accelerometers, the
level that the turn reveals, and whitened means of a second can; all sigmas come from the
covariance of the expected errors. Disturbances are searched for after a significant mean and a
significant level were subtracted: each finding has its cause.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.models.base import FixedBase
from rotcli.models.expected_companions import (
    P_BLOCK,
    BlockResiduals,
    MeanResidual,
    block_residuals,
    mean_residual,
)
from rotcli.models.expected_sources import AccelSource, GyroSource
from rotcli.navigate.level import ACCEL_SCALE_TOLERANCE, LevelEstimate, estimate_level
from rotcli.navigate.residuals import WindowResiduals
from rotcli.run.recording import NavigationRun

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Companions:
    """Tests of the residuals; None where one cannot be judged."""

    gyro_mean: MeanResidual | None = None
    gyro_blocks: BlockResiduals | None = None
    accel_mean: MeanResidual | None = None
    accel_blocks: BlockResiduals | None = None
    level: LevelEstimate | None = None


def gyro_companions(
    run: NavigationRun, residuals: WindowResiduals, gyro: GyroSource, end: float
) -> tuple[MeanResidual, BlockResiduals | None]:
    """Return the tests of the gyros, less a known axis column that is left in.

    Blocks of a rate that varies are not judged: the encoder's resolution is in their rate.
    """
    mean_error = residuals.mean_gyro - run.rate * gyro.column
    mean = mean_residual(mean_error, residuals.start, end, run.rate, gyro)
    if not run.constant_rate:
        return mean, None
    blocks = residuals.gyro - residuals.rate[:, None] * gyro.column
    return _blocks(blocks, mean, residuals, gyro)


def accel_companions(
    run: NavigationRun, residuals: WindowResiduals, accel: AccelSource, base: FixedBase
) -> tuple[MeanResidual | None, BlockResiduals, LevelEstimate | None]:
    """Return the tests of the accelerometers whose bias was measured in a still segment.

    Where gravity turns in the sensor frame, uncalibrated scale factors add to the mean.
    """
    found = estimate_level(residuals, run.axis, base, accel)
    values = residuals.accel - accel.bias
    tilted = found is not None and found.significant
    if found is not None and found.significant:
        # The still bias has the wrong gravity in it as well: nothing is left to compare with.
        values = values - found.turned
        values = values - np.median(values, axis=0)
    n = len(values)
    end = residuals.start + n * residuals.length
    mean = mean_residual(values.mean(axis=0), residuals.start, end, run.rate, accel)
    if run.rate or not run.constant_rate:
        g_b = base.specific_force
        turning = float(np.linalg.norm(g_b - run.axis * (run.axis @ g_b)))
        sigma = np.hypot(mean.sigma, ACCEL_SCALE_TOLERANCE * turning)
        mean = mean.with_sigma(sigma)
    mean, blocks = _blocks(values, mean, residuals, accel)
    return None if tilted else mean, blocks, found


def _blocks(
    values: FloatArray,
    mean: MeanResidual,
    residuals: WindowResiduals,
    source: GyroSource | AccelSource,
) -> tuple[MeanResidual, BlockResiduals]:
    """Return the tests of mean and blocks, each free of the other's cause.

    Disturbed seconds do not count for the p value of the mean; blocks are judged about their
    median where the mean is significant.
    """
    arguments = residuals.start, residuals.length, residuals.rate, source
    blocks = block_residuals(values, *arguments)
    if mean.p_value >= P_BLOCK:
        return mean, blocks
    starts = residuals.start + residuals.length * np.arange(len(values))
    quiet = ~np.isin(starts, blocks.disturbed)
    if quiet.any() and not quiet.all():
        without = replace(mean, value=values[quiet].mean(axis=0)).with_sigma(mean.sigma)
        if without.p_value >= P_BLOCK:
            return replace(mean, p_value=without.p_value), blocks
    return mean, block_residuals(values - np.median(values, axis=0), *arguments)
