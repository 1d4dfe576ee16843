"""What the residuals of a table calibration contradict: findings by kind of block, clocks."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import Blocks
from rotcli.models.triad.information import CHUNK_BLOCKS, scaled_rows
from rotcli.run.findings import Finding
from rotcli.triad.estimate import Fit

CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CLOCK_SIGMAS = 4.0  # between the clock offsets of both halves
OUTLIER_SIGMAS = 7.0  # one of 1e5 Gaussian values exceeds it once in 4e6 logs
OUTLIER_SHARE = 0.1  # of the blocks; more of them are a wrong model
TURN_CHI2 = 1.5  # per row; above it blocks of a kind contradict the model


def residual_findings(
    fit: Fit, factors: tuple[float, float], blocks: Blocks, path: str, white: FloatArray
) -> list[Finding]:
    """Return what the residuals contradict.

    white: (2,) measured white noise of gyros and accelerometers over that of the weights; noise
    that is larger everywhere is no sign of one kind of block.
    """
    found = [*_outliers(fit, factors, blocks, path)]
    expected = np.maximum(white, 1.0) ** 2
    if not fit.converged:
        found.append(
            Finding(
                "not-converged",
                f"{path}: the estimate did not converge in {fit.passes} passes; check the rig, or "
                "estimate fewer parameters",
            )
        )
    for kind in fit.kinds:
        ratios = np.array([kind.gyro, kind.accel]) * np.square(factors) / expected
        worst = float(ratios.max())
        limit = max(TURN_CHI2, 1.0 + 6.0 * np.sqrt(2.0 / (3.0 * kind.blocks)))
        if worst > limit:
            cause = {
                "still": "bias drift or temperature",
                "turn": "clock, levers, or axes that do not meet",
                "ramp": "the encoder lags while it accelerates",
            }[kind.kind]
            found.append(
                Finding(
                    f"{kind.kind}-residuals",
                    f"{path}: chi-squared of {kind.kind} blocks is {worst:.3g} per reading; "
                    f"probable cause: {cause}. The noise of the gyros is multiplied by "
                    f"{factors[0]:.3g}, of the accelerometers by {factors[1]:.3g}",
                    where=kind.kind,
                    value=worst,
                    limit=float(limit),
                )
            )
    found += _clock_halves(fit, blocks, path)
    return found


def _outliers(fit: Fit, factors: tuple[float, float], blocks: Blocks, path: str) -> list[Finding]:
    """Return a finding on blocks that deviate by far more than their noise in one place."""
    size = np.abs(fit.innovations) * np.repeat(factors, 3)[:, None]
    usual = np.sqrt(np.mean(np.minimum(size, OUTLIER_SIGMAS) ** 2, axis=1, keepdims=True))
    size = size / np.maximum(usual, 1.0)
    count = int(np.sum(size.max(axis=0) > OUTLIER_SIGMAS))
    if not 0 < count <= OUTLIER_SHARE * len(blocks):
        return []
    channel, k = np.unravel_index(int(np.argmax(size)), size.shape)
    return [
        Finding(
            "disturbed-blocks",
            f"{path}: {CHANNELS[int(channel)]} deviates by {size[channel, k]:.3g} sigma at "
            f"{blocks.time[k]:.6g} s ({count} blocks above {OUTLIER_SIGMAS:g}): a shock, or a step "
            "of the bias. Exclude this part",
            where=f"{blocks.time[k]:.6g} s",
            value=float(size[channel, k]),
            limit=OUTLIER_SIGMAS,
        )
    ]


def _clock_halves(fit: Fit, blocks: Blocks, path: str) -> list[Finding]:
    """Return a finding where the clock offsets of both halves of the log differ."""
    middle = 0.5 * float(blocks.time[0] + blocks.time[-1])
    clocks = ((p.CLOCK_GYRO, slice(0, 3)), (p.CLOCK_ACCEL, slice(3, 6)))
    # For each clock and half: information, and information times the shift of the offset.
    sums = np.zeros((2, 2, 2))
    for rows, white, late in _columns_of_clocks(fit, blocks, middle):
        for c, (_, channels) in enumerate(clocks):
            column = rows[channels, :, c]
            np.add.at(sums[c, :, 0], late, np.sum(column**2, axis=0))
            np.add.at(sums[c, :, 1], late, np.sum(column * white[channels], axis=0))
    found = []
    for c, name in enumerate(("gyros", "accelerometers")):
        if clocks[c][0] not in fit.problem.free or np.any(sums[c, :, 0] <= 0.0):
            continue
        shift = sums[c, :, 1] / sums[c, :, 0]
        sigma = fit.scale * float(np.sqrt(np.sum(1.0 / sums[c, :, 0])))
        difference = float(shift[1] - shift[0])
        if abs(difference) > CLOCK_SIGMAS * sigma:
            found.append(
                Finding(
                    "clock-drift",
                    f"{path}: the clock offset of the {name} changes by {difference * 1e6:.3g} us "
                    f"({abs(difference) / sigma:.2g} sigma) between both halves of the log. The "
                    "clocks of IMU and table run at different rates; synchronize them",
                    value=difference,
                    limit=CLOCK_SIGMAS * sigma,
                    unit="s",
                )
            )
    return found


def _columns_of_clocks(
    fit: Fit, blocks: Blocks, middle: float
) -> Iterator[tuple[FloatArray, FloatArray, IntArray]]:
    """Yield whitened columns (6, n, 2) of both clocks and residuals (6, n), and the half (n,).

    The half is 1 after `middle` (s), else 0; columns are per second.
    """
    sizes = p.typical_sizes(fit.problem.table.mounting_count)
    index = [p.CLOCK_GYRO, p.CLOCK_ACCEL]
    at = np.searchsorted(fit.problem.free, index).clip(max=len(fit.problem.free) - 1)
    whitened, done = fit.whitening.begin(), 0
    for k, which in enumerate(fit.whitening.chunks(CHUNK_BLOCKS)):
        chunk = blocks.part(which)
        if fit.rows is not None:
            rows = fit.rows[k][:, :, at] / sizes[index]
        else:
            rows = whitened.rows(which, scaled_rows(fit.problem, fit.x, chunk)[:, :, at])
            rows = rows / sizes[index]
        white = fit.innovations[:, done : done + len(chunk)]
        done += len(chunk)
        yield rows, white, (chunk.time >= middle).astype(np.int64)
