"""Allan deviations of one axis from its phase (running integral), with confidence limits.

The overlapping deviation, the default and the hot path, is array code of our own, tested
equal to allantools; the other estimators are allantools' own. Limits are chi-squared limits with
the equivalent degrees of freedom of the noise type at that cluster time.

Sources: SP1065 = W. J. Riley, Handbook of Frequency Stability Analysis, NIST SP 1065 (2008);
GR2003 = C. A. Greenhall, W. J. Riley, Uncertainty of Stability Variances Based on Finite
Differences, Proc. 35th PTTI (2003). The noise type is the exponent alpha of the rate's spectrum
f^alpha: 2 quantization, 0 white (random walk of the angle), -1 flicker, -2 random walk.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    import allantools
    from scipy import special

Factors = NDArray[np.int64]

ESTIMATORS = ("oadev", "adev", "mdev", "totdev")
PER_DECADE = 15  # default cluster times a decade
_BLOCK = 65536  # samples a pass: buffer and three inputs stay in a cache of 2 MB
_ROW = 8192  # values BLAS sums at once; from 10,000 on it would take threads of its own
ONE_SIGMA = math.erf(math.sqrt(0.5))  # 0.6827, the probability between the limits


def phase_from_rate(rate: FloatArray, interval: float) -> FloatArray:
    """Integrate a rate (n,) into its phase (n + 1,), first value 0, the mean rate removed.

    A constant rate gives zeros.
    """
    phase = np.empty(len(rate) + 1)
    phase[1:] = rate
    integrate(phase, interval)
    return phase


def integrate(phase: FloatArray, interval: float) -> float:
    """Turn a rate in phase[1:] (n,) into its phase (n + 1,), in place.

    The mean rate is removed, and returned: it cannot change an Allan deviation, and without it
    the sum keeps its last digits.
    """
    rate = phase[1:]
    mean = float(rate.mean())
    phase[0] = 0.0
    rate -= mean
    np.cumsum(rate, out=rate)
    rate *= interval
    return mean


def averaging_factors(n: int, taus: str | list[float] | None, interval: float) -> Factors:
    """Choose the cluster lengths, in samples, for a record of n samples.

    None: 15 a decade up to a third of the record; `octave`: 1, 2, 4, 8 …; `decade`: 1, 2, 4, 10,
    20, 40 …; `all`: every length up to a third of the record; a list: these times (s).
    Raises ValueError for a time that is no multiple of the interval, is longer than half
    the record (a third for the modified deviation), or an `all` that would take hours.
    """
    longest = n // 3
    if taus is None:
        spaced = 10.0 ** np.arange(0.0, math.log10(longest) + 1e-9, 1.0 / PER_DECADE)
        return np.unique(np.round(spaced).astype(np.int64))
    if taus == "octave":
        return 2 ** np.arange(int(math.log2(longest)) + 1)
    if taus == "decade":
        steps = np.outer(10 ** np.arange(int(math.log10(longest)) + 1), [1, 2, 4]).ravel()
        return steps[steps <= longest]
    if taus == "all":
        if n * longest > 10**10:
            raise ValueError(f"`all` means {longest} cluster times of {n} samples, hours of work")
        return np.arange(1, longest + 1)
    times = np.array(taus, dtype=float)
    factors = np.round(times / interval)
    # A clock that runs a thousandth fast or slow still has its 1 s; the curve names the true time.
    valid = (np.abs(factors * interval - times) <= 1e-3 * times) & (factors >= 1)
    if not np.all(valid):
        bad = times[~valid][0]
        raise ValueError(f"{bad:g} s is no integer multiple of the sample interval {interval:g} s")
    if np.any(2 * factors > n - 1):
        raise ValueError(f"{times.max():g} s is longer than half the record of {n * interval:g} s")
    return np.unique(factors.astype(np.int64))


def overlapping_variance(phase: FloatArray, factors: Factors, interval: float) -> FloatArray:
    """Compute the overlapping Allan variance at each cluster length (SP1065 (11)).

    phase (N,), factors (k,) with 2 m < N; result (k,) in the rate's unit squared. A phase
    0, 1, 0, 1, … gives 2 / interval^2 at m = 1 and 0 at m = 2.
    """
    result = np.empty(len(factors))
    buffer = np.empty(_BLOCK)
    for k, m in enumerate(factors.tolist()):
        count = len(phase) - 2 * m
        total = 0.0
        for i in range(0, count, _BLOCK):
            j = min(i + _BLOCK, count)
            second = buffer[: j - i]
            np.multiply(phase[i + m : j + m], -2.0, out=second)
            second += phase[i:j]
            second += phase[i + 2 * m : j + 2 * m]
            total += _sum_of_squares(second)
        result[k] = total / (2.0 * count * (m * interval) ** 2)
    return result


def _sum_of_squares(values: FloatArray) -> float:
    """Sum the squares of values (n,) row by row.

    BLAS sums a row in one thread: more would change the last digits. (einsum, the other method
    without threads, takes four times as long.)
    """
    complete = len(values) // _ROW * _ROW
    rows = values[:complete].reshape(-1, 1, _ROW)
    rest = values[complete:]
    return float(np.matmul(rows, rows.swapaxes(1, 2)).sum() + rest @ rest)


def mean_second_difference(phase: FloatArray, factors: Factors) -> FloatArray:
    """Compute the mean of phase[i + 2m] - 2 phase[i + m] + phase[i] for each cluster length.

    A rate that grows by r a second gives r (m interval)^2. Telescoping sums: one pass in all.
    """
    n = len(phase)
    edges = np.unique(np.concatenate([[0], factors, 2 * factors, n - factors, n - 2 * factors]))
    sums = np.concatenate([[0.0], np.cumsum(np.add.reduceat(phase, edges))])

    def below(index: Factors) -> FloatArray:
        return sums[np.searchsorted(edges, index)]

    total = (
        (sums[-1] - below(2 * factors))
        - 2.0 * (below(n - factors) - below(factors))
        + below(n - 2 * factors)
    )
    return np.asarray(total / (n - 2 * factors))


def deviation(phase: FloatArray, factors: Factors, interval: float, estimator: str) -> FloatArray:
    """Compute one of the ESTIMATORS; all but the overlapping one by allantools."""
    if estimator == "oadev":
        return np.sqrt(overlapping_variance(phase, factors, interval))
    function = getattr(allantools, estimator)
    taus, values, _, _ = function(
        phase, rate=1.0 / interval, data_type="phase", taus=factors * interval
    )
    if len(taus) != len(factors):
        raise ValueError(f"{estimator} cannot be computed at the longest cluster times")
    return np.asarray(values, dtype=float)


def _sw(t: FloatArray, alpha: int) -> FloatArray:
    """Generalized autocovariance of the phase, up to its sign (GR2003 (7))."""
    size = np.abs(t)
    power = 3 - alpha  # alpha 2 -> |t|, 0 -> |t|^3, -2 -> |t|^5; odd alpha with a logarithm
    if alpha % 2:
        return np.asarray(size**power * np.log(np.where(size > 0.0, size, 1.0)))
    return np.asarray(size**power)


def _sz(t: FloatArray, filter_factor: float, alpha: int) -> FloatArray:
    """Autocovariance of the filtered second difference (GR2003 (8), (9) with d = 2)."""

    def sx(u: FloatArray) -> FloatArray:
        if math.isinf(filter_factor):
            return _sw(u, alpha + 2)
        step = 1.0 / filter_factor
        return filter_factor**2 * (2 * _sw(u, alpha) - _sw(u - step, alpha) - _sw(u + step, alpha))

    return 6 * sx(t) - 4 * sx(t - 1) - 4 * sx(t + 1) + sx(t - 2) + sx(t + 2)


def _basic_sum(j_max: int, terms: float, stride: float, filter_factor: float, alpha: int) -> float:
    """Sum the squared autocovariance over the lags (GR2003 (10)), over its value at lag 0."""
    squares = _sz(np.arange(j_max + 1) / stride, filter_factor, alpha) ** 2
    lags = np.arange(1, j_max)
    inner = 2.0 * np.sum((1.0 - lags / terms) * squares[1:j_max])
    return float((squares[0] + (1.0 - j_max / terms) * squares[j_max] + inner) / squares[0])


# GR2003 tables 1 (modified) and 2 (unmodified) for d = 2: (a0, a1) by noise type.
_TABLE_1 = {
    2: (7.0 / 9.0, 0.5),
    1: (0.997, 0.616),
    0: (1.033, 0.607),
    -1: (1.048, 0.534),
    -2: (1.302, 0.535),
}
_TABLE_2 = {0: (2.0 / 3.0, 1.0 / 3.0), -1: (0.852, 0.375), -2: (1.079, 0.368)}


@lru_cache(maxsize=4096)
def degrees_of_freedom(estimator: str, alpha: int, m: int, n: int) -> float:
    """Return the equivalent degrees of freedom of an Allan variance of n phase points.

    GR2003 for oadev, adev and mdev, SP1065 table 7 for totdev; alpha is 2, 0, -1 or -2. The phase
    is the integral of the readings: of white noise (alpha 0) a random walk, exactly.
    White noise, oadev, m = 1: two thirds of n.
    """
    if estimator == "totdev":
        b, c = {0: (1.5, 0.0), -1: (1.17, 0.22), -2: (0.93, 0.36)}.get(alpha, (1.5, 0.0))
        return b * n / m - c
    modified = estimator == "mdev"
    stride = 1 if estimator == "adev" else m
    reach = (m if modified else 1) + 2 * m
    terms = 1 + stride * (n - reach) // m
    ratio = terms / stride
    j_max = min(terms, 3 * stride)
    if not modified and alpha == 2:  # case 4: only the lags 0, m and 2m are correlated
        lags = range(1, min(math.ceil(ratio), 3))
        weights = {1: 16.0 / 36.0, 2: 1.0 / 36.0}
        return terms / (1.0 + 2.0 * sum((1.0 - k / ratio) * weights[k] for k in lags))
    if modified:
        short, long, table = 1.0, 1.0, _TABLE_1
    else:
        # GR2003 averages the phase over a sample. That of integrated white rates is a random walk,
        # which is not averaged: up to 12 % more at small m. Other noises: 2 % at m = 5.
        averaged = alpha != 0 and 3 * m <= 100
        short, long, table = (float(m) if averaged else math.inf), math.inf, _TABLE_2
    if j_max <= 100:
        return terms / _basic_sum(j_max, terms, stride, short, alpha)
    if ratio > 3:
        a0, a1 = table[alpha]
        return ratio / (a0 - a1 / ratio)
    return 100.0 / _basic_sum(100, 100, 100.0 / ratio, long, alpha)


def limits(
    values: FloatArray, freedom: FloatArray, probability: float = ONE_SIGMA
) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper chi-squared limits of a deviation (SP1065 (45)).

    values, freedom (k,); the truth lies between the limits with the given probability.
    """
    tail = 0.5 * (1.0 - probability)
    high = 2.0 * special.gammaincinv(0.5 * freedom, 1.0 - tail)
    low = 2.0 * special.gammaincinv(0.5 * freedom, tail)
    return values * np.sqrt(freedom / high), values * np.sqrt(freedom / low)
