"""Two companions of the RMS test, from the same covariance: mean residual and block residuals.

The turn removes a constant error of the gyros from the RMS; it stays in the mean corrected output
over the window (R16 table 7). A spike is small in both, but large in the mean of its second.

- Mean: sigma^2 = mean of E + N^2/T per axis; p is three times the two-sided one (three axes).
- Blocks of 1 s: residuals whitened by the Cholesky factor of E + N^2/h; the largest magnitude is
  judged against three times the number of blocks, chi2 per degree of freedom shows wrong noise
  figures or units (0.95 to 1.03 on clean logs).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.models.expected_sources import (
    AccelSource,
    GyroSource,
    slow_covariance,
    window_mean_variance,
)

FloatArray = NDArray[np.float64]

BLOCK = 1.0  # s; shorter disturbances have their time to a second
MAX_BLOCKS = 900  # dense Cholesky: 15 ms; longer windows have longer blocks
_AXES = 3


@dataclass(frozen=True, eq=False)
class MeanResidual:
    """Mean error of a triad over the window: value (3,), its sigma, p value of the largest."""

    value: FloatArray
    sigma: float
    p_value: float


@dataclass(frozen=True, eq=False)
class BlockResiduals:
    """Whitened residuals of a triad: the largest, and chi2 per degree of freedom (3,).

    length: s, of a block; maximum: of |whitened| in sigmas, on `axis` (0, 1, 2), in the block
    that begins at `at` s; whitened: (n, 3).
    """

    length: float
    maximum: float
    axis: int
    at: float
    p_value: float
    chi2_per_dof: FloatArray
    whitened: FloatArray


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
    sigma = math.sqrt(window_mean_variance(start, end, rate, source))
    largest = float(np.max(np.abs(value))) / sigma
    return MeanResidual(value, sigma, min(1.0, _AXES * _two_sided(largest)))


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
    from scipy.linalg import solve_triangular

    n = len(means)
    S = np.eye(n) * (source.white**2 / length)
    if source.contrast is not None:
        S += slow_covariance(
            start, length, rate, source.contrast, source.slow, source.white
        ).dense()
    whitened = solve_triangular(np.linalg.cholesky(S), means, lower=True, check_finite=False)
    k, axis = np.unravel_index(int(np.argmax(np.abs(whitened))), whitened.shape)
    maximum = float(abs(whitened[k, axis]))
    return BlockResiduals(
        length=length,
        maximum=maximum,
        axis=int(axis),
        at=start + length * float(k),
        p_value=min(1.0, _AXES * n * _two_sided(maximum)),
        chi2_per_dof=np.asarray(np.mean(whitened**2, axis=0)),
        whitened=whitened,
    )


def _two_sided(sigmas: float) -> float:
    """Return P(|n| > sigmas) of a standard normal n."""
    return math.erfc(sigmas / math.sqrt(2.0))
