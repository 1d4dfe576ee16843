"""First-order Gauss-Markov figures of one axis, by the Whittle likelihood of block averages.

A Gauss-Markov process of standard deviation sigma and correlation time T, on top of white noise,
is averaged over blocks of about a second. The periodogram of n such blocks is compared with its
expectation for exactly n blocks (the debiased Whittle likelihood of Sykulski et al., Biometrika
106, 2019), so neither the removal of the mean nor leakage reduces T as in a plain fit of the
autocorrelation. `fit` lists the reasons why a record has no such figures.
"""

import math

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

BLOCK = 1.0  # s
_MIN_GAIN = 10.0  # twice the gain of log-likelihood over white noise: chi-squared, 2 dof, 0.7 %
_MAX_POWER_LAW_GAIN = 6.0  # twice that of a power law over the process: e^3 times likelier
_MIN_BLOCKS = 5.0  # T in blocks: below, the averages hide the exponential
_MAX_SHARE = 1.0 / 30.0  # T over the record: some 30 independent values give sigma to 13 %
_MAX_SPREAD = math.log(2.0)  # sigma(ln T): T is known to a factor of 2
_MAX_TREND = 3.0  # sigmas of the slope: 0.3 % of false alarms
_SINGLE_BINS = 200  # frequencies that are not pooled; of the others some 300 groups remain


@dataclass(frozen=True)
class GaussMarkov:
    """Standard deviation (unit of the rate) and correlation time (s), or the reason without them.

    sigma_spread, time_spread: one sigma of ln sigma and of ln T.
    """

    sigma: float | None = None
    time: float | None = None
    sigma_spread: float | None = None
    time_spread: float | None = None
    reason: str | None = None


def block_averages(phase: FloatArray, interval: float) -> tuple[FloatArray, float]:
    """Return the averages (k,) of a rate over blocks of about a second, and the block length."""
    size = max(1, round(BLOCK / interval))
    edges = phase[: (len(phase) - 1) // size * size + 1 : size]
    return np.diff(edges) / (size * interval), size * interval


def fit(average: FloatArray, block: float, has_trend: bool = False) -> GaussMarkov:
    """Estimate the Gauss-Markov figures of a record from its averages (n,) over blocks (s).

    has_trend: the record is known to contain a ramp.

    Rejected: a record shorter than 30 times 5 blocks; a linear trend beyond three sigma of the
    fitted process; a gain below 10 of twice the log-likelihood over white noise, or one below
    that of white, flicker and random walk noise by 6 (three figures as well); T beyond a
    thirtieth of the record or below 5 blocks; sigma(ln T) above ln 2.
    """
    n = len(average)
    record = n * block
    if n < _MIN_BLOCKS / _MAX_SHARE:
        shortest = _MIN_BLOCKS / _MAX_SHARE * block
        return GaussMarkov(reason=f"record below {shortest:.4g} s")
    if has_trend:
        return GaussMarkov(reason="a linear trend remains in the record")
    frequency, power, count = _pooled_periodogram(average)
    white = float(np.sum(count * power) / np.sum(count))
    if white <= 0.0:
        return GaussMarkov(reason="the record is constant")
    theta = _search(frequency, power / white, count, n)
    theta, spread = _refine(theta, frequency, power / white, count, n)
    cost_white = float(np.sum(count))
    gain = 2.0 * (cost_white - _cost(theta, frequency, power / white, count, n))
    variance, blocks = math.exp(theta[0]) * white, math.exp(theta[1])
    if gain < _MIN_GAIN:
        return GaussMarkov(reason="there is no exponential part: white noise explains the record")
    power_law = cost_white - _power_law_cost(frequency, power / white, count)
    if 2.0 * power_law > gain + _MAX_POWER_LAW_GAIN:
        return GaussMarkov(reason="there is no exponential part: flicker or random walk fit better")
    # Slope of a record under a noise of density S(0) per block: 12 S(0) / n^3.
    density = 2.0 * variance * blocks + math.exp(theta[2]) * white
    index = np.arange(n) - 0.5 * (n - 1)
    trend = float(index @ average) / (n * (n * n - 1.0) / 12.0)
    if abs(trend) > _MAX_TREND * math.sqrt(12.0 * density / n**3):
        return GaussMarkov(reason="a linear trend remains in the record")
    if blocks > n * _MAX_SHARE:
        return GaussMarkov(
            reason=f"the correlation time, about {blocks * block:.2g} s, is beyond a thirtieth "
            f"of the record ({record * _MAX_SHARE:.3g} s)"
        )
    if blocks < _MIN_BLOCKS:
        return GaussMarkov(
            reason=f"the correlation time, about {blocks * block:.2g} s, is below "
            f"{_MIN_BLOCKS:g} blocks of {block:.3g} s"
        )
    if spread[1] > _MAX_SPREAD:
        return GaussMarkov(reason="the correlation time is known only to a factor above two")
    return GaussMarkov(math.sqrt(variance), blocks * block, 0.5 * spread[0], spread[1])


def _pooled_periodogram(average: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return angular frequency, mean power and count of each bin; _SINGLE_BINS are not pooled."""
    n = len(average)
    power = np.abs(np.fft.rfft(average - average.mean())[1 : (n + 1) // 2]) ** 2 / n
    index = np.arange(len(power))
    if len(power) > _SINGLE_BINS:
        ends = np.geomspace(_SINGLE_BINS, len(power), 300)
        starts = np.unique(np.concatenate([index[:_SINGLE_BINS], ends[:-1].astype(np.int64)]))
    else:
        starts = index
    count = np.diff(np.append(starts, len(power))).astype(float)
    frequency = 2.0 * math.pi * np.add.reduceat(index + 1.0, starts) / count / n
    return frequency, np.add.reduceat(power, starts) / count, count


def _expected(theta: FloatArray, frequency: FloatArray, n: int) -> FloatArray:
    """Return the expected periodogram (..., k) of n blocks for theta (..., 3).

    theta: ln sigma^2, ln T (in blocks), ln white variance of a block. Block averages have the
    autocovariance g0 at lag 0 and g1 exp(-(k - 1)/T) at lag k; the sum over lags with the
    triangular weight 1 - k/n is closed.
    """
    variance, blocks, white = (np.exp(theta[..., i, None]) for i in range(3))
    decay = np.exp(-1.0 / blocks)
    g0 = 2.0 * variance * blocks**2 * (1.0 / blocks + np.expm1(-1.0 / blocks))
    g1 = variance * (blocks * np.expm1(-1.0 / blocks)) ** 2
    q = decay * np.exp(1j * frequency)
    lags = q / (1.0 - q) - q * (1.0 - decay**n) / (n * (1.0 - q) ** 2)
    return np.asarray(g0 + 2.0 * g1 / decay * lags.real + white)


def _cost(
    theta: FloatArray, frequency: FloatArray, power: FloatArray, count: FloatArray, n: int
) -> float:
    model = _expected(theta, frequency, n)
    return float(np.sum(count * (np.log(model) + power / model)))


def _power_law_cost(frequency: FloatArray, power: FloatArray, count: FloatArray) -> float:
    """Return the cost of the best white, flicker and random-walk spectrum, none negative.

    Multiplicative steps for this cost (Fevotte, Bertin, Durrieu, Neural Computation 21, 2009).
    """
    chord = 2.0 * np.sin(0.5 * frequency)
    terms = np.stack([np.ones_like(chord), 1.0 / chord, 1.0 / chord**2])
    weight = 1.0 / (3.0 * (terms @ count) / count.sum())
    for _ in range(300):
        model = weight @ terms
        weight = weight * np.sqrt((terms @ (count * power / model**2)) / (terms @ (count / model)))
    model = weight @ terms
    return float(np.sum(count * (np.log(model) + power / model)))


def _search(frequency: FloatArray, power: FloatArray, count: FloatArray, n: int) -> FloatArray:
    """Return the best theta of a coarse grid, with the common scale in closed form."""
    times = np.geomspace(1.0, n / 3.0, 30)
    ratios = np.geomspace(1e-3, 1e3, 25)  # sigma^2 over the white variance of a block
    best, lowest = np.zeros(3), math.inf
    for ratio in ratios:
        theta = np.stack(
            [np.full(30, math.log(ratio)), np.log(times), np.zeros(30)],
            axis=-1,
        )
        model = _expected(theta, frequency, n)
        scale = (power / model) @ count / count.sum()
        cost = np.log(model) @ count + np.log(scale) * count.sum()
        k = int(np.argmin(cost))
        if cost[k] < lowest:
            lowest = float(cost[k])
            best = theta[k] + math.log(scale[k]) * np.array([1.0, 0.0, 1.0])
    return best


def _refine(
    theta: FloatArray, frequency: FloatArray, power: FloatArray, count: FloatArray, n: int
) -> tuple[FloatArray, FloatArray]:
    """Improve theta by Fisher scoring; return it with the sigma of each element."""
    step = 1e-4
    cost = _cost(theta, frequency, power, count, n)
    for _ in range(30):
        model = _expected(theta, frequency, n)
        shifted = _expected(theta + step * np.eye(3), frequency, n)
        gradient = (np.log(shifted) - np.log(model)) / step
        fisher = (gradient * count) @ gradient.T
        score = gradient @ (count * (power / model - 1.0))
        move = np.clip(np.linalg.pinv(fisher, rcond=1e-10, hermitian=True) @ score, -1.0, 1.0)
        while (new := _cost(theta + move, frequency, power, count, n)) > cost and np.max(
            np.abs(move)
        ) > 1e-6:
            move *= 0.5
        if new >= cost - 1e-9:
            break
        theta, cost = theta + move, new
    return theta, np.sqrt(np.diag(np.linalg.pinv(fisher, rcond=1e-12, hermitian=True)))
