"""Blocks of a log in which the IMU shakes, jumps or turns."""

import numpy as np
from numpy.typing import NDArray

from rotcli.run.still.scan import BlockStatistics, runs
from rotcli.units import FloatArray

Flags = NDArray[np.bool_]

SHAKING = 4.0  # times the quiet level of a block's standard deviation
_JUMP = 10.0  # times the typical step of the mean from block to block
_TURNING = 0.02  # rad/s (1.1 deg/s), mean rate above that of the stillest segment


def quiet_levels(statistics: BlockStatistics, judged: Flags) -> FloatArray:
    """Return the standard deviation (6,) of a quiet block of each axis; judged (blocks,).

    Where the last digit hides the noise, a block shakes by half of that digit or by none.
    """
    shake = np.sqrt(statistics.square[:, judged])
    levels = np.quantile(shake, 0.1, axis=1)
    return np.asarray(np.maximum(levels, 0.5 * statistics.digit))


def find_motion(statistics: BlockStatistics, n: int, excluded: Flags) -> tuple[Flags, Flags]:
    """Flag the samples (n,) of blocks that shake or jump, and of steady segments that turn.

    Blocks with excluded samples are not judged.
    """
    size, blocks = statistics.size, statistics.blocks
    judged = np.asarray(~excluded[: blocks * size].reshape(blocks, size).any(axis=1))
    complete = np.flatnonzero(judged)
    moving = np.zeros(blocks, dtype=bool)
    if len(complete) < 3:
        return np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    quiet = quiet_levels(statistics, judged)
    for mean, square, level in zip(statistics.mean, statistics.square, quiet, strict=True):
        shake = np.sqrt(square)[complete]
        moving[complete] |= shake > SHAKING * level + 1e-12
        step = np.abs(np.diff(mean[complete]))
        # A quiet block of white noise steps by its scatter at least.
        usual = max(float(np.median(step)), max(float(np.median(shake)), level) / np.sqrt(size))
        jump = np.flatnonzero(step > _JUMP * usual + 1e-12)
        moving[complete[jump]] = moving[complete[jump + 1]] = True
    turning = _turning(statistics.mean[:3].T, moving)
    # The last block contains the remaining samples, too.
    lengths = np.full(blocks, size)
    lengths[-1] += n - blocks * size
    return np.repeat(moving, lengths), np.repeat(turning, lengths)


def _turning(rates: FloatArray, moving: Flags) -> Flags:
    """Flag the blocks of steady segments whose mean rate (blocks, 3) is not that of rest."""
    turning = np.zeros(len(moving), dtype=bool)
    segments = runs(~moving)
    if not len(segments):
        return turning
    # A segment of a second or two may be the turning point of an oscillation.
    lengths = segments[:, 1] - segments[:, 0]
    longer = lengths >= min(5, int(np.max(lengths)))
    means = np.array([np.linalg.norm(rates[a:b].mean(axis=0)) for a, b in segments])
    for (a, b), mean in zip(segments, means, strict=True):
        turning[a:b] = mean > means[longer].min() + _TURNING
    return turning
