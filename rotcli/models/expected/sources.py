"""Error sources of a navigation run: noise, calibration contrast, priors; covariance per block.

The window is cut into n equal blocks of h seconds. A gyro that is corrected by `d_hat = g^T z`
and `K_hat = h^T z`, estimated from the segment means z of the same log, keeps in block j the slow
error `e_j = s_j - (g + h w_j)^T z`, s_j the mean slow noise and w_j the table rate of the block.
The weights sum to zero, so flicker noise and random walk that ran before the log have a
covariance here: `E = W_nn - G W_cn - W_nc G^T + G (W_cc + diag(N^2/tau)) G^T`, G rows g + h w_j,
W the generalised covariance of interval means (`rotcli.models.mean_covariance`).
White noise of the window itself is not part of E: `rotcli.models.expected.errors` adds it exactly.

Units: a gyro's figures in rad, s; an accelerometer's in m/s, s. Times in s on one clock.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rotcli.models.mean_covariance import IntervalNoise, SlowNoise, mean_covariance

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Contrast:
    """Linear estimate of a triad's bias and axis column from the means of k segments.

    start, end: (k,) s; bias, column: (k,) weights g (sum 1) and h (sum 0) of the segment means.
    Ordinary and generalised least squares differ only in g and h. `column` is zero where the
    mode leaves the axis column in (its mean effect then belongs to `GyroSource.column`).
    """

    start: FloatArray
    end: FloatArray
    bias: FloatArray
    column: FloatArray

    @property
    def duration(self) -> FloatArray:
        """Return the lengths (k,) of the segments, s."""
        return self.end - self.start


def still_contrast(start: float, end: float) -> Contrast:
    """Return the contrast of a bias that is the mean of one still segment."""
    return Contrast(np.array([start]), np.array([end]), np.ones(1), np.zeros(1))


def least_squares_contrast(start: FloatArray, end: FloatArray, rate: FloatArray) -> Contrast:
    """Return g and h of least squares on segment means weighted by their durations (R16 (34)).

    start, end: (k,) s; rate: (k,) rad/s. Two segments, still and turning: g = (1, 0) and
    h = (-1/w, 1/w).
    """
    design = np.column_stack([np.ones_like(rate), rate])
    weighted = design.T * (end - start)
    bias, column = np.linalg.solve(weighted @ design, weighted)
    return Contrast(start, end, bias, column)


def generalised_contrast(
    noise: IntervalNoise, rate: FloatArray, horizon: tuple[float, float]
) -> Contrast:
    """Return g and h of generalised least squares on segment means, the bias predicted (kriging).

    noise: of the segment means of one gyro; rate: (k,) rad/s; horizon: s, the window that the
    bias is predicted for. Two segments and two unknowns: the same as least squares.
    """
    design = np.column_stack([np.ones_like(rate), rate])
    weights = np.linalg.inv(noise.covariance())
    normal = design.T @ weights
    estimate = np.linalg.solve(normal @ design, normal)
    residual = np.eye(len(rate)) - design @ estimate
    bias = estimate[0] + noise.horizon(*horizon).cross @ weights @ residual
    return Contrast(noise.start, noise.end, bias, estimate[1])


@dataclass(frozen=True, eq=False)
class AxisSource:
    """Noise of one sensor: N; flicker and walk; how its correction was estimated, or None.

    Without a contrast the correction is free of error and only white noise counts.
    """

    white: float
    slow: SlowNoise
    contrast: Contrast | None


@dataclass(frozen=True, eq=False)
class GyroSource:
    """Errors of the corrected gyros.

    axes: one for the three gyros or three, rad, s.
    column: (3,) known axis column N u that the mode leaves in; it rotates the nominal attitude.
    column_sigma: (3,) of an axis column that is left in and only known to this sigma.
    turn_on_sigma: (3,) rad/s, change of the bias between the calibration's log and this one;
    column_turn_on_sigma: (3,) the same of the axis column.
    """

    axes: tuple[AxisSource, ...]
    column: FloatArray = field(default_factory=lambda: np.zeros(3))
    column_sigma: FloatArray = field(default_factory=lambda: np.zeros(3))
    turn_on_sigma: FloatArray = field(default_factory=lambda: np.zeros(3))
    column_turn_on_sigma: FloatArray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class AccelSource:
    """Errors of the accelerometers, which the modes of R16 do not correct.

    axes: one for the three or three, m/s, s; contrast: of a bias measured in a still segment.
    bias: (3,) m/s^2 known and left in; bias_sigma: (3,) m/s^2 of a bias known otherwise
    (calibrated, prior).
    """

    axes: tuple[AxisSource, ...]
    bias: FloatArray = field(default_factory=lambda: np.zeros(3))
    bias_sigma: FloatArray = field(default_factory=lambda: np.zeros(3))


def whites(source: GyroSource | AccelSource) -> FloatArray:
    """Return N (3,) of a triad."""
    return np.array([axis.white for axis in three_axes(source)])


def three_axes(source: GyroSource | AccelSource) -> tuple[AxisSource, ...]:
    """Return the source of each sensor of a triad."""
    return source.axes * 3 if len(source.axes) == 1 else source.axes


@dataclass(frozen=True, eq=False)
class SlowCovariance:
    """Covariance E (n, n) of the slow error in n equal blocks, as `T - (L R + (L R)^T)`.

    toeplitz: (n,) first column of T, the slow noise itself; left (n, k), right (k, n): what the
    contrast with the k segments takes out. slow, length (s), span (s): T between any two blocks.
    """

    toeplitz: FloatArray
    left: FloatArray
    right: FloatArray
    slow: SlowNoise
    length: float
    span: float

    def between(self, distance: FloatArray) -> FloatArray:
        """Return T between blocks whose starts are `distance` block lengths apart (any shape)."""
        start = self.length * distance.ravel()
        zero = np.zeros(1)
        found = mean_covariance(
            start, start + self.length, self.slow, other=(zero, zero + self.length), span=self.span
        )
        return found.reshape(distance.shape)

    def dense(self) -> FloatArray:
        """Return E (n, n)."""
        n = len(self.toeplitz)
        mirrored = np.concatenate([self.toeplitz[:0:-1], self.toeplitz])
        step = mirrored.strides[0]
        T = np.lib.stride_tricks.as_strided(
            mirrored[n - 1 :], (n, n), (-step, step), writeable=False
        )
        one = np.concatenate([self.left, self.right.T], axis=1)
        other = np.concatenate([self.right, self.left.T], axis=0)
        return np.asarray(T - one @ other)


def slow_covariance(
    start: float, length: float, rate: FloatArray, contrast: Contrast, slow: SlowNoise, white: float
) -> SlowCovariance:
    """Return E of the slow error of one sensor in n equal blocks.

    start: of the window, s; length: of a block, s; rate: (n,) rad/s, table rate of each block;
    white: N of the segments' means.
    """
    n = len(rate)
    first: FloatArray = start + length * np.arange(n, dtype=float)
    blocks = first, first + length
    span = _span(contrast, start, start + n * length)
    toeplitz = mean_covariance(*blocks, slow, other=(first[:1], first[:1] + length), span=span)
    G, cross, own = _contrast_terms(contrast, rate, blocks, slow, white, span)
    return SlowCovariance(toeplitz[:, 0], G, cross - 0.5 * own @ G.T, slow, length, span)


def window_mean_variance(start: float, end: float, rate: float, source: AxisSource) -> float:
    """Return the variance of the mean error of one sensor over a window, white noise included.

    rate: rad/s, mean table rate of the window.
    """
    white = source.white**2 / (end - start)
    if source.contrast is None:
        return white
    E = slow_covariance(
        start, end - start, np.array([rate]), source.contrast, source.slow, source.white
    )
    return float(E.dense()[0, 0]) + white


def _span(contrast: Contrast, start: float, end: float) -> float:
    """Return the seconds that segments and window cover together."""
    return max(end, float(contrast.end.max())) - min(start, float(contrast.start.min()))


def _contrast_terms(
    contrast: Contrast,
    rate: FloatArray,
    blocks: tuple[FloatArray, FloatArray],
    slow: SlowNoise,
    white: float,
    span: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return G (n, k), W_cn (k, n) and W_cc + diag(N^2/tau) (k, k)."""
    segments = contrast.start, contrast.end
    cross = mean_covariance(*segments, slow, other=blocks, span=span)
    own = mean_covariance(*segments, slow, span=span)
    own = own + np.diag(white**2 / contrast.duration)
    return contrast.bias + np.outer(rate, contrast.column), cross, own
