"""Isolated readings far outside the noise, and rows of zeros: errors of a transmission."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.files.channels import AXES
from rotcli.logs.record import ImuSource
from rotcli.run.still.motion import SHAKING, quiet_levels
from rotcli.run.still.scan import BlockStatistics, runs
from rotcli.units import FloatArray

Flags = NDArray[np.bool_]
Index = NDArray[np.int64]

# Sigmas from the median of a second: Gaussian noise does it once in 1e15 readings.
MIN_SIGMAS = 8.0
MAX_LENGTH = 5  # samples; a longer disturbance is motion
_MAX_PER_BLOCK = 5  # of a block of 100; a block with more is motion


@dataclass(frozen=True, eq=False)
class Spikes:
    """Samples (k,) of an axis, relative to the span, and how many sigmas each deviates."""

    samples: Index
    sigmas: FloatArray
    sigma: float


def find_spikes(
    log: ImuSource, span: slice, statistics: BlockStatistics
) -> tuple[dict[str, Spikes], BlockStatistics, Flags]:
    """Return the spikes of each axis, the statistics of the blocks without them, and zero rows.

    The third value (n,) flags rows in which all six readings are zero. A block is examined where
    a reading deviates by MIN_SIGMAS from its mean; sigma is the median over the blocks.
    """
    n = span.stop - span.start
    zeros = np.zeros(n, dtype=bool)
    every = np.ones(statistics.blocks, dtype=bool)
    quiet = quiet_levels(statistics, every)
    sigma = np.maximum(np.median(np.sqrt(statistics.square), axis=1), 0.5 * statistics.digit)
    reach = np.maximum(statistics.high - statistics.mean, statistics.mean - statistics.low)
    suspect = reach > (MIN_SIGMAS * sigma + 1e-12)[:, None]
    found: dict[str, list[tuple[Index, FloatArray]]] = {}
    mean, square = statistics.mean.copy(), statistics.square.copy()
    for block in np.flatnonzero(suspect.any(axis=0)):
        first = span.start + int(block) * statistics.size
        rows = _rows(log, slice(first, first + statistics.size))
        zeros[first - span.start : first - span.start + statistics.size] = (rows == 0.0).all(axis=0)
        for k in np.flatnonzero(suspect[:, block]):
            at, deviation = _block_spikes(rows[k], float(sigma[k]))
            if not len(at):
                continue
            rest = np.delete(rows[k], at)
            if rest.std() > SHAKING * quiet[k] + 1e-12:
                continue
            mean[k, block], square[k, block] = rest.mean(), rest.var()
            sample = first - span.start + at
            found.setdefault(AXES[k], []).append((sample, deviation / sigma[k]))
    spikes = {
        name: Spikes(
            np.concatenate([sample for sample, _ in parts]),
            np.concatenate([size for _, size in parts]),
            float(sigma[AXES.index(name)]),
        )
        for name, parts in found.items()
    }
    return spikes, replace(statistics, mean=mean, square=square), zeros


def _rows(log: ImuSource, span: slice) -> FloatArray:
    """Return the readings (6, k) of a span."""
    rows = np.empty((6, span.stop - span.start))
    for row, name in zip(rows, AXES, strict=True):
        log.fill(row, name, span)
    return rows


def _block_spikes(values: FloatArray, sigma: float) -> tuple[Index, FloatArray]:
    """Return the samples of the spikes of a block (size,), and their deviations; maybe none."""
    deviation = values - np.median(values)
    flags = np.abs(deviation) > MIN_SIGMAS * sigma + 1e-12
    lengths = np.diff(runs(flags), axis=1)
    if lengths.max(initial=0) > MAX_LENGTH or flags.sum() > max(
        MAX_LENGTH, _MAX_PER_BLOCK * len(values) // 100
    ):
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    at = np.flatnonzero(flags)
    return at, deviation[at]
