"""Means of the segments of a log, and the covariance of their noise."""

from collections.abc import Sequence

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import IntervalNoise, SlowNoise
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class SegmentMeans:
    """Means of k segments: z (k, 3) = gyro - Earth rate - table rate, rad/s; rate w (k,), rad/s.

    start, end: (k,) s; rate_covariance (k, k), (rad/s)^2, of the errors of w. more: (k, m) further
    columns of the design.
    """

    start: FloatArray
    end: FloatArray
    z: FloatArray
    rate: FloatArray
    rate_covariance: FloatArray
    more: FloatArray | None = None

    @property
    def design(self) -> FloatArray:
        """Columns (k, 2 + m): table rate, constant, further ones."""
        more = np.empty((len(self.rate), 0)) if self.more is None else self.more
        return np.column_stack([self.rate, np.ones_like(self.rate), more])


@dataclass(frozen=True, eq=False)
class TriadNoise:
    """Noise of the three gyros: white (3,) rad/sqrt(s), slow noise of each."""

    white: FloatArray
    slow: Sequence[SlowNoise]

    def covariance(self, means: SegmentMeans, channel: int, u: FloatArray) -> FloatArray:
        """Return S (k, k) of the means of a gyro; errors of the table rate enter along u."""
        noise = self.of(means, channel)
        result: FloatArray = noise.covariance() + u[channel] ** 2 * means.rate_covariance
        return result

    def of(self, means: SegmentMeans, channel: int) -> IntervalNoise:
        """Return the noise of the means of a gyro."""
        white = float(self.white[channel])
        return IntervalNoise(means.start, means.end, self.slow[channel], white)
