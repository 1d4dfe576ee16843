"""Allan variances of a record in several segments: the sums of squares are pooled.

A second difference of the phase never reaches across a gap, so segments need no common mean.
Their variances are averaged with the number of second differences as weights. Segments are nearly
independent: the variance of the pooled value is that of independent terms.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.allan.deviation import (
    Factors,
    degrees_of_freedom,
    mean_second_difference,
    overlapping_variance,
)
from rotcli.units import FloatArray

_EXACT = 200  # samples of a cluster; in longer ones the ends of a cluster no longer matter


def pooled_variance(phases: Sequence[FloatArray], factors: Factors, interval: float) -> FloatArray:
    """Return the overlapping Allan variance (k,) of segments' phases, each (n + 1,).

    Segments shorter than two clusters do not contribute; the longest has two at least.
    """
    if len(phases) == 1:
        return overlapping_variance(phases[0], factors, interval)
    total, count = np.zeros(len(factors)), np.zeros(len(factors))
    for phase in phases:
        usable = 2 * factors < len(phase)
        terms = len(phase) - 2.0 * factors[usable]
        total[usable] += terms * overlapping_variance(phase, factors[usable], interval)
        count[usable] += terms
    return np.asarray(total / count)


def pooled_second_difference(phases: Sequence[FloatArray], factors: Factors) -> FloatArray:
    """Return the mean second difference (k,) of the phases of all segments."""
    total, count = np.zeros(len(factors)), np.zeros(len(factors))
    for phase in phases:
        usable = 2 * factors < len(phase)
        terms = len(phase) - 2.0 * factors[usable]
        total[usable] += terms * mean_second_difference(phase, factors[usable])
        count[usable] += terms
    return np.asarray(total / count)


def pooled_freedom(estimator: str, alpha: int, m: int, lengths: tuple[int, ...]) -> float:
    """Return the degrees of freedom of a pooled variance; lengths: phase points of the segments.

    With c terms and f degrees of freedom of each segment: (sum c)^2 / sum (c^2 / f). All
    estimators but the overlapping one use the longest segment alone.
    """
    if estimator != "oadev" or len(lengths) == 1:
        return max(degrees_of_freedom(estimator, alpha, m, max(lengths)), 1.0)
    terms = [n - 2 * m for n in lengths if n > 2 * m]
    freedoms = [max(degrees_of_freedom(estimator, alpha, m, n), 1.0) for n in lengths if n > 2 * m]
    return sum(terms) ** 2 / sum(c * c / f for c, f in zip(terms, freedoms, strict=True))


def interpolation_gain(factors: Factors, gaps: NDArray[np.int64], samples: int) -> FloatArray:
    """Return by which factor (k,) linear interpolation of lost samples changes white noise.

    gaps: lengths (j,) of isolated gaps in so many samples. Exact expectation: the weights of the
    interpolated samples go to their neighbours. One lost sample adds 1.5 - 3/m of a sample to
    the sum of squares of clusters of m; a gap of g adds g + g^2/2 to long ones.
    """
    gain = np.ones(len(factors))
    for length, count in zip(*np.unique(gaps, return_counts=True), strict=True):
        change = np.array([_gap_change(int(length), min(m, _EXACT)) for m in factors.tolist()])
        gain += count * change / samples
    return gain


def _gap_change(gap: int, m: int) -> float:
    """Return the change of the sum of squared weights, in samples, by one gap."""

    def correlation(lag: FloatArray) -> FloatArray:
        """Autocorrelation of the weights +1 (m times), -1 (m times); 2 m at lag 0."""
        size = np.abs(lag)
        return np.where(size <= m, 2.0 * m - 3.0 * size, np.minimum(size - 2.0 * m, 0.0))

    place = np.arange(1, gap + 1, dtype=float)
    before, after = 1.0 - place / (gap + 1), place / (gap + 1)
    mutual = correlation(np.subtract.outer(place, place))
    change = -gap * 2.0 * m
    for weight, distance in ((before, place), (after, gap + 1 - place)):
        change += float(2.0 * weight @ correlation(distance) + weight @ mutual @ weight)
    return change / (2.0 * m)
