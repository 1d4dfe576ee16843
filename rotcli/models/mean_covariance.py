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
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from rotcli.models.sensors import NoiseFigures

FloatArray = NDArray[np.float64]

MAX_INTERVALS = 2000  # S is dense: its Cholesky factor takes 1 s at this size
# Two intervals whose distance exceeds this many times the sum of their half lengths use the
# series in (half lengths / distance): its first omitted term is (1/16)^10 / 10 = 1e-13.
_SERIES_DISTANCE = 16.0
# Probabilities of the chi-squared test of a fit: outside them the noise figures are contradicted.
LOW_QUANTILE, HIGH_QUANTILE = 0.01, 0.99


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
    c, d = (start, end) if other is None else other
    if span is None:
        span = covered_span(np.concatenate([start, c]), np.concatenate([end, d]))
    h = 0.5 * np.abs(np.add.outer(start + end, -(c + d)))
    p, q = 0.5 * (end - start), 0.5 * (d - c)
    p, q = np.broadcast_to(p[:, None], h.shape), np.broadcast_to(q[None, :], h.shape)
    total = np.zeros(h.shape)
    if noise.bias_instability:
        b2 = noise.bias_instability**2 / np.pi
        total += b2 * (_mean_minus_log(h, p, q) + np.log(span) + 1.0)
    if noise.rate_random_walk:
        total += noise.rate_random_walk**2 * (span - 0.5 * _mean_distance(h, p, q))
    if noise.markov_sigma:
        total += noise.markov_sigma**2 * _mean_decay(h, p, q, noise.markov_time)
    return total


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
class Horizon:
    """Slow noise of the window for which a bias is predicted.

    cross: (k,) covariance of its mean with the k block means; variance: of its mean. Both with
    the constant (span) of the fit's S.
    """

    cross: FloatArray
    variance: float


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


@dataclass(frozen=True, eq=False)
class GlsFit:
    """Result of generalised least squares `z = A x + noise`, noise of covariance S.

    estimate (p,), covariance (p, p) = (A^T S^-1 A)^-1, residual (k,) = z - A x, chi2 =
    r^T S^-1 r, dof = k - p; factor: lower Cholesky factor (k, k) of S; whitened: L^-1 A.
    The variance of the constant in `covariance` means nothing (S is generalised): use `predict`.
    """

    estimate: FloatArray
    covariance: FloatArray
    residual: FloatArray
    chi2: float
    dof: int
    factor: FloatArray
    whitened: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations (p,) of the estimate; that of a constant means nothing."""
        result: FloatArray = np.sqrt(np.diag(self.covariance))
        return result

    @property
    def gain(self) -> FloatArray:
        """B (p, k) of the estimate x = B z."""
        from scipy.linalg import solve_triangular

        white_gain = self.covariance @ self.whitened.T
        result: FloatArray = solve_triangular(self.factor, white_gain.T, lower=True, trans="T").T
        return result


@dataclass(frozen=True, eq=False)
class Prediction:
    """Values (r,) and error covariance (r, r) of linear functions of a fit and its bias."""

    value: FloatArray
    covariance: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations (r,)."""
        result: FloatArray = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return result

    def correlation(self, i: int, j: int) -> float:
        """Return the correlation of values i and j."""
        return float(self.covariance[i, j] / (self.sigma[i] * self.sigma[j]))


def fit_gls(A: FloatArray, z: FloatArray, S: FloatArray) -> GlsFit:
    """Return the generalised least-squares fit of z (k,) on the columns of A (k, p).

    S: (k, k) positive definite. Cholesky factor of S, QR of the whitened A. Raises ValueError
    if the columns of A are linearly dependent or S is not positive definite.
    Two means and the columns [1 1], [0 w] give the plain difference over w.
    """
    from scipy.linalg import solve_triangular

    k, p = A.shape
    try:
        factor = np.asarray(np.linalg.cholesky(S), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise ValueError("the covariance of the means is not positive definite") from None
    whitened = solve_triangular(factor, A, lower=True)
    q, r = np.linalg.qr(whitened)
    diagonal = np.abs(np.diag(r))
    norms = np.linalg.norm(whitened, axis=0)
    if k < p or np.any(diagonal <= 1e-10 * norms):  # rounding of double precision, times 1e5
        raise ValueError("the columns of the design are linearly dependent")
    white_z = solve_triangular(factor, z, lower=True)
    estimate = solve_triangular(r, q.T @ white_z)
    inverse = solve_triangular(r, np.eye(p))
    white_residual = white_z - whitened @ estimate
    return GlsFit(
        estimate=estimate,
        covariance=inverse @ inverse.T,
        residual=z - A @ estimate,
        chi2=float(white_residual @ white_residual),
        dof=k - p,
        factor=factor,
        whitened=whitened,
    )


def predict(
    fit: GlsFit, P: FloatArray, bias_weight: FloatArray, horizon: Horizon | None = None
) -> Prediction:
    """Return `P x + e G (z - A x)` and its error covariance; G = s_h^T S^-1.

    P: (r, p), rows of parameters or of curve values; bias_weight e: (r,), the weight of the
    constant in each row (1 for a bias, 0 for a slope): the horizon's slow noise enters with it.
    Without a horizon only rows with e = 0 have a meaning.
    """
    from scipy.linalg import solve_triangular

    e = np.asarray(bias_weight, dtype=float)
    if horizon is None:
        if np.any(e):
            raise ValueError("a bias needs a horizon")
        return Prediction(P @ fit.estimate, P @ fit.covariance @ P.T)
    white_cross = solve_triangular(fit.factor, horizon.cross, lower=True)
    white_residual = solve_triangular(fit.factor, fit.residual, lower=True)
    kriged = float(white_cross @ white_residual)
    remaining = horizon.variance - float(white_cross @ white_cross)
    D = P - np.outer(e, white_cross @ fit.whitened)
    covariance = D @ fit.covariance @ D.T + np.outer(e, e) * remaining
    return Prediction(P @ fit.estimate + e * kriged, covariance)


@dataclass(frozen=True)
class Goodness:
    """Chi-squared test of a fit: statistic, degrees of freedom, limits, factor for all sigmas."""

    chi2: float
    dof: int
    low: float
    high: float
    sigma_factor: float

    @property
    def noise_too_small(self) -> bool:
        """Whether the data scatter more than the noise figures allow (99 % quantile)."""
        return self.sigma_factor > 1.0

    @property
    def noise_too_large(self) -> bool:
        """Whether the data scatter less than the noise figures imply (1 % quantile)."""
        return self.dof > 0 and self.chi2 < self.low


def goodness(chi2: float, dof: int) -> Goodness:
    """Return the test of chi2 on dof degrees of freedom.

    Above the 99 % quantile all sigmas are to be multiplied by sqrt(chi2/dof); they are never
    reduced. Without degrees of freedom nothing is tested and the factor is 1.
    """
    if dof < 1:
        return Goodness(chi2, dof, 0.0, float("inf"), 1.0)
    from scipy.special import chdtri

    low, high = float(chdtri(dof, 1.0 - LOW_QUANTILE)), float(chdtri(dof, 1.0 - HIGH_QUANTILE))
    factor = float(np.sqrt(chi2 / dof)) if chi2 > high else 1.0
    return Goodness(chi2, dof, low, high, factor)
