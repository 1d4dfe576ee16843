"""Two companions of the RMS test, from the same covariance: mean residual and block residuals.

The turn removes a constant error of the gyros from the RMS; it stays in the mean corrected output
over the window (R16 table 7). A spike is small in both, but large in the mean of its second.

- Mean: sigma^2 = mean of E + N^2/T per axis; p is that of the largest of three axes.
- Blocks of 1 s: residuals whitened by the Cholesky factor of E + N^2/h; the largest magnitude is
  judged as one of three times the number of blocks, chi2 per degree of freedom shows wrong noise
  figures or units (0.95 to 1.03 on clean logs).
"""

import math

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.expected.sources import (
    AccelSource,
    AxisSource,
    GyroSource,
    slow_covariances,
    window_mean_variance,
)
from rotcli.models.numerics.remembered import remembered
from rotcli.models.numerics.triangular import solve_triangular
from rotcli.units import FloatArray

BLOCK = 1.0  # s; shorter disturbances have their time to a second
MAX_BLOCKS = 900  # dense Cholesky: 15 ms; longer windows have longer blocks
_MAX_KEPT = 400  # blocks whose factors, 8 n^2 bytes each, are kept for the next run of a batch
_AXES = 3
P_BLOCK = 1e-3  # of the largest residual of a clean window
_MAX_DISTURBED = 200  # blocks that are listed
_MEDIAN_OF_NORMAL = 0.67449  # of |n|, n standard normal


@dataclass(frozen=True, eq=False)
class MeanResidual:
    """Mean error of a triad over the window: value, sigma (3,), p value of the largest."""

    value: FloatArray
    sigma: FloatArray
    p_value: float

    @classmethod
    def of(cls, value: FloatArray, sigma: FloatArray) -> "MeanResidual":
        """Return the test of a value (3,) with its sigma (3,)."""
        largest = float(np.max(np.abs(value) / sigma))
        return cls(value, sigma, any_of(_AXES, _two_sided(largest)))

    def with_sigma(self, sigma: FloatArray) -> "MeanResidual":
        """Return the test of the same value with another sigma (3,)."""
        return MeanResidual.of(self.value, sigma)


@dataclass(frozen=True, eq=False)
class BlockResiduals:
    """Whitened residuals of a triad: the largest, and chi2 per degree of freedom (3,).

    count, length (s): of the blocks; maximum: of |whitened| in sigmas, on `axis` (0, 1, 2), in
    the block that begins at `at` s; disturbed: starts (s) of all blocks that are less likely than
    P_BLOCK.
    """

    count: int
    length: float
    maximum: float
    axis: int
    at: float
    p_value: float
    chi2_per_dof: FloatArray
    disturbed: tuple[float, ...]


def block_length(duration: float) -> float:
    """Return the length (s) of the blocks of a window: a second, or what keeps them few.

    >>> block_length(300.0), block_length(9000.0)
    (1.0, 10.0)
    """
    return BLOCK * max(1.0, math.ceil(duration / (BLOCK * MAX_BLOCKS)))


def mean_residual(
    value: FloatArray, start: float, end: float, rate: float, source: GyroSource | AccelSource
) -> MeanResidual:
    """Return the test of the mean residuals (3,) over a window [start, end] (s).

    rate: rad/s, mean table rate; known errors (an axis column left in) are already subtracted.
    """
    variances = [window_mean_variance(start, end, rate, axis) for axis in source.axes]
    return MeanResidual.of(value, np.sqrt(np.broadcast_to(variances, 3)))


def block_residuals(
    means: FloatArray,
    start: float,
    length: float,
    rate: FloatArray,
    source: GyroSource | AccelSource,
) -> BlockResiduals:
    """Return the test of the mean residuals (n, 3) of n equal blocks of `length` s from `start`.

    rate: (n,) rad/s, table rate of the blocks.
    """
    n = len(means)
    whitened = np.empty((n, 3))
    factors_of = _kept_factors if n <= _MAX_KEPT else _factors
    factors = factors_of(start, length, rate, source.axes)
    for k, factor in enumerate(factors):
        own = slice(None) if len(factors) == 1 else slice(k, k + 1)
        whitened[:, own] = solve_triangular(factor, means[:, own], lower=True)
    block, sensor = np.unravel_index(int(np.argmax(np.abs(whitened))), whitened.shape)
    maximum = float(abs(whitened[block, sensor]))
    p_value = any_of(_AXES * n, _two_sided(maximum))
    disturbed: set[int] = set()
    if p_value < P_BLOCK:
        for k in range(3):
            disturbed |= _disturbed_blocks(means[:, k], factors[min(k, len(factors) - 1)])
    return BlockResiduals(
        count=n,
        length=length,
        maximum=maximum,
        axis=int(sensor),
        at=start + length * float(block),
        p_value=p_value,
        chi2_per_dof=np.asarray(np.mean(whitened**2, axis=0)),
        disturbed=tuple(start + length * k for k in sorted(disturbed)),
    )


def _factors(
    start: float, length: float, rate: FloatArray, axes: tuple[AxisSource, ...]
) -> list[FloatArray]:
    """Return the Cholesky factors (n, n) of the covariance of block means, one a sensor."""
    n = len(rate)
    factors = []
    for axis, E in zip(axes, slow_covariances(start, length, rate, axes), strict=True):
        S = np.zeros((n, n)) if E is None else E.dense()
        S[np.diag_indices(n)] += axis.white**2 / length
        factors.append(np.asarray(np.linalg.cholesky(S), dtype=float))
    return factors


_kept_factors = remembered(4)(_factors)  # gyros and accelerometers, of two modes


def _disturbed_blocks(means: FloatArray, factor: FloatArray) -> set[int]:
    """Return the blocks of one axis that the others contradict, the largest first, one by one.

    A block's residual given all others is `(P x)_k / sqrt(P_kk)`, P the inverse covariance. The
    block found is then replaced by its prediction from the others, so that its neighbours are not
    listed with it. Residuals are divided by their robust scatter where it exceeds 1: noise
    figures that are too small are no disturbance.
    """
    n = len(means)
    inverse = np.linalg.inv(factor)
    P = inverse.T @ inverse
    root = np.sqrt(np.diag(P))
    product = P @ means
    scatter = max(1.0, float(np.median(np.abs(product / root))) / _MEDIAN_OF_NORMAL)
    found: set[int] = set()
    while len(found) < _MAX_DISTURBED:
        sizes = np.abs(product / root) / scatter
        sizes[list(found)] = 0.0
        k = int(np.argmax(sizes))
        if _AXES * n * _two_sided(float(sizes[k])) >= P_BLOCK:
            break
        found.add(k)
        product = product - P[:, k] * (product[k] / P[k, k])
    return found


def any_of(count: float, p: float) -> float:
    """Return the chance that one of `count` independent figures has a p value as small as p.

    >>> any_of(3, 0.5)
    0.875
    """
    return -math.expm1(count * math.log1p(-p)) if p < 1.0 else 1.0


def _two_sided(sigmas: float) -> float:
    """Return P(|n| > sigmas) of a standard normal n."""
    return math.erfc(sigmas / math.sqrt(2.0))
