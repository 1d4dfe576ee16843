"""Mean table rate over the same samples as the gyro means, from the angle at the ends.

With a precise encoder the rate is the angle between the edges of the samples over the time, which
weighs every sample alike, as the mean of the gyros does; a ramp's tail then does no harm. With a
coarse one the angle at each end is averaged over a window, in which the gyros show the motion:
the difference of encoder and integrated gyros changes linearly in time, and its slope is that of
the mean differences in the two windows. The window is chosen for the smallest variance.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import TableLog
from rotcli.run.consistency.blocks import SegmentBlocks
from rotcli.run.motion import EncoderNoise
from rotcli.run.table_angle import angle_at
from rotcli.units import DEG_PER_HOUR, FloatArray

_WINDOW_SHARES = (0.0, 0.02, 0.05, 0.1, 0.2, 1.0 / 3.0)  # of the segment, from which to choose
# rad/s: an encoder that shows the rate of a still table to this also shows the tail of a ramp in
# it; it is below the bias instability of every gyro on a rate table of its class
_PRECISE_RATE = 0.003 * DEG_PER_HOUR
_MIN_WINDOW_RECORDS = 4  # records: fewer do not average the encoder's steps


@dataclass(frozen=True)
class TableRate:
    """Mean table rate of a segment (rad/s); variance: of its error, (rad/s)^2.

    It contains the encoder's noise and the gyro noise that the weights of a window add to that of
    the plain mean.
    """

    rate: float
    variance: float


def table_rate(
    blocks: SegmentBlocks, table: TableLog, u: FloatArray, noise: EncoderNoise, white: float
) -> TableRate:
    """Return the mean table rate over the samples of a segment.

    It is 0 for a still segment, unless the encoder is precise.

    u: (3,) table axis. white: rad/sqrt(s), random walk of the gyro along it.
    """
    T = blocks.duration
    precise = 2.0**0.5 * noise.sigma / T < _PRECISE_RATE
    if blocks.segment.rate == 0.0 and not precise:
        return TableRate(0.0, 0.0)
    sigma = np.hypot(noise.sigma, noise.time_sigma * blocks.segment.rate)
    choices = [_variance(T, share * T, sigma, white, table.interval) for share in _WINDOW_SHARES]
    best = int(np.argmin(choices))
    edges = blocks.inner_edges
    low, high = _within(table, edges[[0, -1]])
    if best == 0:
        first, last = (float(angle) for angle in angle_at(table, np.array([low, high])))
        return TableRate((last - first) / (high - low), choices[0])
    width = _WINDOW_SHARES[best] * T
    ends = [_mean_difference(blocks, table, u, low, low + width)]
    ends.append(_mean_difference(blocks, table, u, high - width, high))
    (t0, c0), (t1, c1) = ends
    gyro = float(blocks.mean(blocks.gyro) @ u)
    return TableRate(gyro + (c1 - c0) / (t1 - t0), choices[best])


def _within(table: TableLog, edges: FloatArray) -> tuple[float, float]:
    """Return the edges (s), cut to the table log: half a sample may lie outside it."""
    return max(float(edges[0]), float(table.time[0])), min(float(edges[1]), float(table.time[-1]))


def _variance(T: float, window: float, sigma: float, white: float, interval: float) -> float:
    """Return the variance of the mean rate of a segment of T (s) with windows at its ends (s).

    The gyros then have trapezoidal weights: white noise N^2 (T - 4/3 w) / (T - w)^2.
    """
    records = window / interval
    if window and records < _MIN_WINDOW_RECORDS:
        return float(np.inf)
    encoder = 2.0 * sigma**2 / max(1.0, records) / (T - window) ** 2
    added = white**2 * ((T - 4.0 / 3.0 * window) / (T - window) ** 2 - 1.0 / T)
    return float(encoder + max(added, 0.0))


def _mean_difference(
    blocks: SegmentBlocks, table: TableLog, u: FloatArray, start: float, end: float
) -> tuple[float, float]:
    """Return mean time (s) and mean of encoder angle less integrated gyros (rad) of a window."""
    edges = blocks.edges
    steps = (blocks.gyro @ u) * blocks.counts * blocks.interval
    integrated = np.concatenate([[0.0], np.cumsum(steps)])
    near = slice(*(int(k) for k in np.searchsorted(table.time, [start, end])))
    time = table.time[near]
    difference = table.angle[near] - np.interp(time, edges, integrated)
    return float(time.mean()), float(difference.mean())
