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

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import IntervalNoise, IntervalPairs, SlowNoise
from rotcli.models.numerics.remembered import remembered
from rotcli.units import FloatArray


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
    contrast with the k segments takes out. slow, length (s), span (s): see `toeplitz_between`.
    """

    toeplitz: FloatArray
    left: FloatArray
    right: FloatArray
    slow: SlowNoise
    length: float
    span: float

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


# Gyros and accelerometers, and the modes of a run, have the same blocks.
_pairs = remembered(8)(IntervalPairs)


def toeplitz_between(
    covariances: Sequence[SlowCovariance], distance: FloatArray
) -> list[FloatArray]:
    """Return T of each sensor between blocks `distance` block lengths apart (any shape).

    covariances: of sensors in the same blocks with the same segments.
    """
    start = covariances[0].length * distance.ravel()
    end, zero = start + covariances[0].length, np.zeros(1)
    first = zero, zero + covariances[0].length
    pairs = _pairs(start, end, first, covariances[0].span)
    return [pairs.covariance(E.slow).reshape(distance.shape) for E in covariances]


def slow_covariances(
    start: float, length: float, rate: FloatArray, axes: Sequence[AxisSource]
) -> list[SlowCovariance | None]:
    """Return E of the slow error of each sensor in n equal blocks, None without a contrast.

    start: of the window, s; length: of a block, s; rate: (n,) rad/s, table rate of each block;
    axes: sensors whose contrasts rest on the same segments; ValueError for others.
    """
    contrasts = [axis.contrast for axis in axes if axis.contrast is not None]
    if not contrasts:
        return [None] * len(axes)
    segments = contrasts[0].start, contrasts[0].end
    if not all(np.array_equal(segments, (other.start, other.end)) for other in contrasts):
        raise ValueError("the contrasts of the sensors rest on different segments")
    n = len(rate)
    first: FloatArray = start + length * np.arange(n, dtype=float)
    blocks = first, first + length
    span = max(start + n * length, float(segments[1].max())) - min(start, float(segments[0].min()))
    with_first = _pairs(*blocks, (first[:1], first[:1] + length), span)
    across, among = _pairs(*segments, blocks, span), _pairs(*segments, None, span)

    def one(axis: AxisSource, contrast: Contrast) -> SlowCovariance:
        own = among.covariance(axis.slow) + np.diag(axis.white**2 / contrast.duration)
        G = contrast.bias + np.outer(rate, contrast.column)
        right = across.covariance(axis.slow) - 0.5 * own @ G.T
        toeplitz = with_first.covariance(axis.slow)[:, 0]
        return SlowCovariance(toeplitz, G, right, axis.slow, length, span)

    return [None if axis.contrast is None else one(axis, axis.contrast) for axis in axes]


@remembered(12)
def window_mean_variance(start: float, end: float, rate: float, source: AxisSource) -> float:
    """Return the variance of the mean error of one sensor over a window, white noise included.

    rate: rad/s, mean table rate of the window.
    """
    (E,) = slow_covariances(start, end - start, np.array([rate]), [source])
    slow = 0.0 if E is None else float(E.dense()[0, 0])
    return slow + source.white**2 / (end - start)
