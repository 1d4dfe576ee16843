"""Autocorrelation of block averages, with the exponential of a fitted Gauss-Markov process.

O17 section 4 reads the standard deviation and the correlation time of its filter from this
curve. The mean of the record is removed, which lowers every lag by the variance of the mean: the
exponential is drawn as expected after that.
O17 is "Observability of a rotating MEMS INS", Sensors 2017, 17, 698.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

_TIMES = 3.0  # correlation times that the lags reach
_SHARE = 0.1  # of the record that they reach without a correlation time
_MIN_LAGS = 20


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Lags (k,) s from one block on, autocovariance (k,) in the unit squared, and the model's.

    expected: None without a Gauss-Markov process.

    """

    lag: FloatArray
    covariance: FloatArray
    expected: FloatArray | None


def autocorrelation(
    averages: FloatArray, block: float, sigma: float | None, time: float | None
) -> Autocorrelation:
    """Return the autocorrelation of averages (n,) over blocks (s); sigma, time (s) of the process.

    Lag 0 contains the white noise and is not returned. White noise has zero at every lag.
    """
    n = len(averages)
    longest = _SHARE * n if time is None else _TIMES * time / block
    count = int(min(max(longest, _MIN_LAGS), n // 2))
    rest = averages - averages.mean()
    spectrum = np.fft.rfft(rest, 2 * n)
    sums = np.fft.irfft(np.abs(spectrum) ** 2)[1 : count + 1]
    lags = np.arange(1, count + 1)
    expected = None
    if sigma is not None and time is not None:
        expected = expected_covariance(lags, n, block, sigma, time)
    return Autocorrelation(
        np.asarray(lags * block, dtype=np.float64),
        np.asarray(sums / (n - lags), dtype=float),
        expected,
    )


def expected_covariance(
    lags: NDArray[np.int64], n: int, block: float, sigma: float, time: float
) -> FloatArray:
    """Return the expected autocovariance (k,) of n block averages without their mean.

    Averages over blocks of a = block/time have sigma^2 (2 cosh a - 2)/a^2 exp(-k a) at lag k;
    the variance of the mean of the record is subtracted.
    """
    a = block / time
    plain = sigma**2 * (2.0 * math.cosh(a) - 2.0) / a**2 * np.exp(-a * lags)
    b = n * a
    mean = 2.0 * sigma**2 * (b - 1.0 + math.exp(-b)) / b**2
    return np.asarray(plain - mean)
