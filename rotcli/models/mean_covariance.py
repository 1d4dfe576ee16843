"""Means over time intervals under white, flicker, random walk and Gauss-Markov noise.

Flicker noise and random walk were running before the log began: they have neither a mean nor
an absolute covariance, only a covariance of contrasts (weights that sum to zero). A generalized
covariance g(h) of the time difference h gives it (Matheron, "The intrinsic random functions",
Adv. Appl. Prob. 5 (1973)): flicker `-(B^2/pi) ln|h|`, random walk `-(K^2/2)|h|`, Gauss-Markov
its ordinary `sigma^2 exp(-|h|/T)`. The Allan variance that follows is exactly
`(2 ln2/pi) B^2 + K^2 tau/3` (IEEE Std 952). Generalised least squares (GLS) of the means, with a
constant among the columns of the design, depends on contrasts only.

A bias is a prediction: the mean slow noise over a window of time, the horizon, is estimated from
the residuals of the fit (kriging). Times in s; units of the means are the caller's, once.
"""

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.least_squares import (
    GlsFit,
    Goodness,
    Horizon,
    Prediction,
    fit_gls,
    goodness,
    predict,
)
from rotcli.units import FloatArray

if TYPE_CHECKING:
    from rotcli.models.sensors import NoiseFigures

__all__ = [
    "GlsFit",
    "Goodness",
    "Horizon",
    "IntervalNoise",
    "IntervalPairs",
    "Prediction",
    "SlowNoise",
    "covered_span",
    "fit_gls",
    "goodness",
    "mean_covariance",
    "predict",
    "white_covariance",
]


MAX_INTERVALS = 2000  # S is dense: its Cholesky factor takes 1 s at this size
# Two intervals whose distance exceeds this many times the sum of their half lengths use the
# series in (half lengths / distance): its first omitted term is (1/16)^10 / 10 = 1e-13.
_SERIES_DISTANCE = 16.0


@dataclass(frozen=True)
class SlowNoise:
    """Slow noise of one sensor axis: B, K (IEEE Std 952) and a Gauss-Markov process.

    In the sensor's unit u: bias instability B u (Allan floor 0.664 B), rate random walk
    K u/sqrt(s), Gauss-Markov standard deviation u and correlation time s.
    """

    bias_instability: float = 0.0
    rate_random_walk: float = 0.0
    markov_sigma: float = 0.0
    markov_time: float = 100.0

    @classmethod
    def from_figures(cls, figures: "NoiseFigures") -> "SlowNoise":
        """Return the slow part of a sensor's noise figures."""
        return cls(
            figures.bias_instability,
            figures.rate_random_walk,
            figures.markov_sigma,
            figures.markov_time,
        )


def mean_covariance(
    start: FloatArray,
    end: FloatArray,
    noise: SlowNoise,
    *,
    other: tuple[FloatArray, FloatArray] | None = None,
    span: float | None = None,
) -> FloatArray:
    """Return the generalised covariance (n, m) of the mean slow noise over intervals.

    start, end: (n,) s; other: starts and ends (m,) of the second set, default the first.
    span: seconds that all intervals of the problem cover together; it sets the constant that
    makes the matrix positive definite, and must be equal wherever matrices are combined.
    Only differences of times enter. The variance of the difference of two adjacent means of
    length tau is twice the Allan variance: `(4 ln2/pi) B^2 + 2 K^2 tau/3`.
    """
    if span is None:
        c, d = (start, end) if other is None else other
        span = covered_span(np.concatenate([start, c]), np.concatenate([end, d]))
    return IntervalPairs(start, end, other, span).covariance(noise)


class IntervalPairs:
    """Pairs of intervals (n, m): the covariance of their means for any number of sensors.

    start, end: (n,) s; other: starts and ends (m,) of the second set, default the first; span: s.
    """

    def __init__(
        self,
        start: FloatArray,
        end: FloatArray,
        other: tuple[FloatArray, FloatArray] | None,
        span: float,
    ) -> None:
        c, d = (start, end) if other is None else other
        self._distance = 0.5 * np.abs(np.add.outer(start + end, -(c + d)))
        shape = self._distance.shape
        self._halves = (
            np.broadcast_to((0.5 * (end - start))[:, None], shape),
            np.broadcast_to((0.5 * (d - c))[None, :], shape),
        )
        self._span = span

    def covariance(self, noise: SlowNoise) -> FloatArray:
        """Return the generalised covariance (n, m) of the means of one sensor's slow noise."""
        total = np.zeros(self._distance.shape)
        if noise.bias_instability:
            b2 = noise.bias_instability**2 / np.pi
            total += b2 * (self._minus_log + np.log(self._span) + 1.0)
        if noise.rate_random_walk:
            total += noise.rate_random_walk**2 * (self._span - 0.5 * self._mean_distance)
        if noise.markov_sigma:
            decay = _mean_decay(self._distance, *self._halves, noise.markov_time)
            total += noise.markov_sigma**2 * decay
        return total

    @cached_property
    def _minus_log(self) -> FloatArray:
        return _mean_minus_log(self._distance, *self._halves)

    @cached_property
    def _mean_distance(self) -> FloatArray:
        return _mean_distance(self._distance, *self._halves)


def covered_span(start: FloatArray, end: FloatArray) -> float:
    """Return the seconds from the first start to the last end."""
    return float(np.max(end) - np.min(start))


def white_covariance(start: FloatArray, end: FloatArray, white: float) -> FloatArray:
    """Return the covariance (n, n) of mean white noise of N u sqrt(s): `N^2 / tau`.

    The intervals must not overlap: white noise of common samples would be correlated.
    """
    result: FloatArray = np.diag(white**2 / (end - start))
    return result


def _second_difference(
    function: Callable[[FloatArray], FloatArray], h: FloatArray, p: FloatArray, q: FloatArray
) -> FloatArray:
    """Return `[F(h+p+q) - F(h-p+q) - F(h+p-q) + F(h-p-q)] / (4 p q)` of an even F."""
    outer = function(np.abs(h + p + q)) + function(np.abs(h - p - q))
    inner = function(np.abs(h - p + q)) + function(np.abs(h + p - q))
    result: FloatArray = (outer - inner) / (4.0 * p * q)
    return result


def _mean_minus_log(h: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the mean of -ln|t - s| over two intervals, centres h apart, half lengths p, q.

    The second antiderivative of -ln|h| is `-(h^2/2)(ln|h| - 3/2)`. Far intervals use the even
    moments of the difference of two uniform variables, free of its cancellation.
    """
    result = np.empty(h.shape)
    far = h > _SERIES_DISTANCE * (p + q)
    near = ~far

    def antiderivative(x: FloatArray) -> FloatArray:
        log = np.log(np.where(x > 0.0, x, 1.0))
        value: FloatArray = -0.5 * x**2 * (log - 1.5)
        return value

    result[near] = _second_difference(antiderivative, h[near], p[near], q[near])
    d = h[far]
    u, v = (p[far] / d) ** 2, (q[far] / d) ** 2
    m2 = (u + v) / 3.0
    m4 = u**2 / 5.0 + 2.0 * u * v / 3.0 + v**2 / 5.0
    m6 = u**3 / 7.0 + u * v * (u + v) + v**3 / 7.0
    m8 = u**4 / 9.0 + 4.0 * u * v * (u**2 + v**2) / 3.0 + 2.8 * u**2 * v**2 + v**4 / 9.0
    result[far] = -np.log(d) + m2 / 2.0 + m4 / 4.0 + m6 / 6.0 + m8 / 8.0
    return result


def _mean_distance(h: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the mean of |t - s| over two intervals; h where they do not overlap."""
    result = h.copy()
    over = h < p + q

    def antiderivative(x: FloatArray) -> FloatArray:
        value: FloatArray = x**3 / 6.0
        return value

    result[over] = _second_difference(antiderivative, h[over], p[over], q[over])
    return result


def _mean_decay(h: FloatArray, p: FloatArray, q: FloatArray, time: float) -> FloatArray:
    """Return the mean of exp(-|t - s|/T) over two intervals."""
    gap = np.maximum(h - p - q, 0.0)
    first, last = -np.expm1(-2.0 * p / time), -np.expm1(-2.0 * q / time)
    result = np.exp(-gap / time) * first * last * time**2 / (4.0 * p * q)
    over = h < p + q

    def antiderivative(x: FloatArray) -> FloatArray:
        value: FloatArray = time**2 * (np.expm1(-x / time) + x / time)
        return value

    result[over] = _second_difference(antiderivative, h[over], p[over], q[over])
    return result


@dataclass(frozen=True, eq=False)
class IntervalNoise:
    """Noise of the means over k intervals [start, end] (s) of one channel in one log.

    slow, white (N, u sqrt(s)): noise figures. `span` is kept equal in all matrices.
    """

    start: FloatArray
    end: FloatArray
    slow: SlowNoise
    white: float

    @property
    def span(self) -> float:
        """Seconds from the first start to the last end."""
        return covered_span(self.start, self.end)

    def covariance(self) -> FloatArray:
        """Return S (k, k), white and slow noise, of the interval means."""
        slow = mean_covariance(self.start, self.end, self.slow, span=self.span)
        return slow + white_covariance(self.start, self.end, self.white)

    def horizon(self, start: float, end: float) -> Horizon:
        """Return the slow noise of the window [start, end] with the intervals."""
        window = np.array([start]), np.array([end])
        cross = mean_covariance(self.start, self.end, self.slow, other=window, span=self.span)
        own = mean_covariance(*window, self.slow, span=self.span)
        return Horizon(cross[:, 0], float(own[0, 0]))

    def own_span(self) -> Horizon:
        """Return the horizon from the first start to the last end."""
        return self.horizon(float(np.min(self.start)), float(np.max(self.end)))
