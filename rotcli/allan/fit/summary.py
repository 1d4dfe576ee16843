"""Measures of one record that a fit needs: its Allan variance, trend and lengths."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.allan.fit.model import slope_variance
from rotcli.allan.pooled import interpolation_gain, pooled_second_difference, pooled_variance
from rotcli.allan.survey.spectrum import MIN_WHITE_SHARE, Spectrum
from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

Factors = NDArray[np.int64]

SHORTEST = 5  # samples; below it the sensor's filter shapes the curve, not its noise
_MIN_LONGER = 8  # cluster times from SHORTEST on that a fit without the shorter ones needs
# Of the noise's variance that a line may have at a cluster time: its phase is known to a tenth.
MAX_LINE_SHARE = 0.3
_NO_GAPS = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Summary:
    """Allan variance of a record in one or several segments.

    factors (k,): cluster lengths, samples. variance (k,): the overlapping Allan variance there,
    without spectral lines. bend (k,): the mean second difference of the phase. trend: the
    regression slope of the rate. white_share (k,): of the white noise's variance that a low-pass
    filter passes, and that interpolation adds. lengths: phase points of the segments.
    """

    factors: Factors
    variance: FloatArray
    bend: FloatArray
    trend: float
    lengths: tuple[int, ...]
    interval: float
    white_share: FloatArray

    @property
    def duration(self) -> float:
        """Duration of the longest segment (s)."""
        return (max(self.lengths) - 1) * self.interval

    def with_share(self, matrix: FloatArray) -> FloatArray:
        """Return the columns of the terms with the filter's share on the random walk."""
        result = matrix.copy()
        result[:, 1] *= self.white_share
        return result

    def slope_variance(self, markov_time: float | None = None) -> FloatArray:
        """Return the variance of the regression slope under each unit term (4 or 5,).

        The common slope of segments weighs each by its length cubed.
        """
        total = np.zeros(4 if markov_time is None else 5)
        weights = np.array([_slope_weight(n - 1) for n in self.lengths])
        weights /= weights.sum()
        for weight, n in zip(weights, self.lengths, strict=True):
            total += weight**2 * slope_variance((n - 1) * self.interval, markov_time)
        return total


def _slope_weight(samples: int) -> float:
    """Return the sum of squared deviations of the sample numbers from their mean."""
    return samples * (samples * samples - 1.0) / 12.0


def summarize(
    phases: Sequence[FloatArray],
    factors: Factors,
    interval: float,
    variance: FloatArray | None = None,
    spectrum: Spectrum | None = None,
    gaps: NDArray[np.int64] = _NO_GAPS,
) -> Summary:
    """Measure the mean-free phases, each (n + 1,), of a record.

    factors: cluster lengths, ascending; those below five samples are excluded where enough
    longer ones remain. variance: the overlapping Allan variance there, where known already.
    spectrum: cluster times that its filter or its lines shape are excluded, and the rest of the
    lines' variance is subtracted. gaps: lengths of the gaps that were interpolated.
    """
    longer = factors >= SHORTEST
    used = longer if np.sum(longer) >= _MIN_LONGER else np.ones(len(factors), dtype=bool)
    if variance is None:
        variance = pooled_variance(phases, factors, interval)
    share, tau = np.ones(len(factors)), np.asarray(factors * interval, dtype=float)
    if spectrum is not None:
        share = spectrum.white_share(factors, interval)
        used &= share >= MIN_WHITE_SHARE
        lines = np.sum([line.variance(tau) for line in spectrum.lines], axis=0)
        envelope = np.sum([line.envelope(tau) for line in spectrum.lines], axis=0)
        variance = np.maximum(variance - lines, 0.1 * variance)
        used &= envelope <= MAX_LINE_SHARE * variance
    if len(gaps):
        share = share * interpolation_gain(factors, gaps, sum(len(p) - 1 for p in phases))
    factors = factors[used]
    weights = math.fsum(_slope_weight(len(phase) - 1) for phase in phases)
    # sum i y_i = -sum of the running sums, as the last running sum is zero.
    moment = math.fsum(float(phase.sum()) for phase in phases)
    return Summary(
        factors=factors,
        variance=variance[used],
        white_share=share[used],
        bend=pooled_second_difference(phases, factors),
        trend=float(-moment / weights / interval**2),
        lengths=tuple(len(phase) for phase in phases),
        interval=interval,
    )
