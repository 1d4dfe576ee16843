"""Means for a calibration on uneven motion: integrated gyros against the encoder.

A table that oscillates or is turned by hand has no segment at constant rate. The time is cut
into blocks; over each the mean of the gyros is compared with the angle at its ends over time. A
third column, the mean acceleration of the block, estimates the lag between the clocks.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import TableLog
from rotcli.models.mean_covariance import fit_gls
from rotcli.run.consistency.blocks import EarthHarmonics, SegmentBlocks
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.run.motion import EncoderNoise
from rotcli.run.table_angle import angle_at
from rotcli.units import FloatArray

MAX_BLOCKS = 600  # blocks: their covariance is dense
_MAX_ITERATIONS = 8  # of the variance factor; two or three suffice
_CONVERGED = 0.02  # of chi-squared over its degrees of freedom, a third of its scatter
_MIN_FACTOR, _MAX_FACTOR = 1e-6, 1e4  # of the encoder's variance from its own differences
MIN_LENGTH = 0.5  # s: shorter blocks hold little but noise


@dataclass(frozen=True, eq=False)
class UnevenMeans:
    """Means over blocks; acceleration (k,), rad/s^2: column of the lag."""

    means: SegmentMeans
    acceleration: FloatArray


def uneven_means(
    blocks: SegmentBlocks,
    table: TableLog,
    earth: EarthHarmonics,
    u: FloatArray,
    encoder: EncoderNoise,
) -> UnevenMeans:
    """Return the means over blocks of an uneven motion, in the form of segment means."""
    edges = blocks.edges
    keep = np.flatnonzero((edges >= table.time[0]) & (edges <= table.time[-1]))
    total = edges[keep[-1]] - edges[keep[0]]
    step = max(1, round(max(MIN_LENGTH, total / MAX_BLOCKS) / (blocks.size * blocks.interval)))
    first = keep[::step]
    weight = np.add.reduceat(blocks.counts, first[:-1])
    weight[-1] = blocks.counts[first[-2] : first[-1]].sum()

    def average(values: FloatArray) -> FloatArray:
        sums = np.array(
            [(values[a:b].T * blocks.counts[a:b]).sum(axis=-1) for a, b in pairwise(first)]
        )
        return np.asarray((sums.T / weight).T)

    at = edges[first]
    tau = np.diff(at)
    angle = angle_at(table, at)
    rate = np.diff(angle) / tau
    slope = _edge_rates(table, at)
    z = average(blocks.gyro) - earth.at(average(blocks.cos), average(blocks.sin))
    count = len(tau)
    D = (np.eye(count + 1)[1:] - np.eye(count + 1)[:-1]) / tau[:, None]
    sigma = np.sqrt(encoder.sigma**2 + (encoder.time_sigma * slope) ** 2)
    means = SegmentMeans(at[:-1], at[1:], z - np.outer(rate, u), rate, (D * sigma**2) @ D.T)
    return UnevenMeans(means, np.diff(slope) / tau)


def _edge_rates(table: TableLog, time: FloatArray) -> FloatArray:
    """Return the table rate (n,), rad/s, at times, over a few records to either side."""
    half = 2.0 * table.interval
    low = np.clip(time - half, table.time[0], table.time[-1])
    high = np.clip(time + half, table.time[0], table.time[-1])
    moved = np.interp(high, table.time, table.angle) - np.interp(low, table.time, table.angle)
    return np.asarray(moved / (high - low))


def with_encoder_noise(
    means: SegmentMeans, noise: TriadNoise, channel: int, u: FloatArray
) -> SegmentMeans:
    """Return the means with the encoder's noise as the residuals of the gyro along the axis show.

    Stamps and steps of a cheap encoder are not white; the factor of its covariance is found that
    makes chi-squared equal to its degrees of freedom.
    """
    scaled = means
    factor = 1.0
    for _ in range(_MAX_ITERATIONS):
        fit = fit_gls(means.design, means.z[:, channel], noise.covariance(scaled, channel, u))
        ratio = fit.chi2 / fit.dof
        if abs(ratio - 1.0) < _CONVERGED:
            break
        factor = float(np.clip(factor * ratio, _MIN_FACTOR, _MAX_FACTOR))
        scaled = replace(means, rate_covariance=factor * means.rate_covariance)
    return scaled
