"""Generate flicker noise, random walk and Gauss-Markov noise of a sensor that has been running.

Flicker noise that starts from zero at the first sample has contrasts (differences of means) with
0.83 of their variance; with one record length of history, 0.995.
Source of the filter: Kasdin, "Discrete simulation of colored noise", Proc. IEEE 83 (1995), V.
"""

import numpy as np

from rotcli.lazy import lazily
from rotcli.models.mean_covariance import SlowNoise
from rotcli.units import FloatArray

with lazily():
    from scipy import fft, signal


# The quotes spare commands that make no noise the import of numpy.random.
def simulate_slow_noise(
    rng: "np.random.Generator",
    n: int,
    interval: float,
    noise: SlowNoise,
    *,
    history: int | None = None,
) -> FloatArray:
    """Return n samples (n,) of slow noise at the given interval (s).

    history: samples of flicker noise that precede the first one, default n. The random walk is
    zero at the first sample: it has no mean, its first value belongs to the turn-on bias.
    """
    flicker, walk, markov = rng.spawn(3)
    total = np.zeros(n)
    if noise.bias_instability:
        total += noise.bias_instability * flicker_noise(flicker, n, history)
    if noise.rate_random_walk:
        steps = noise.rate_random_walk * np.sqrt(interval) * walk.standard_normal(n)
        steps[:1] = 0.0
        total += np.cumsum(steps)
    if noise.markov_sigma:
        decay = float(np.exp(-interval / noise.markov_time))
        total += noise.markov_sigma * markov_noise(markov, n, decay)
    return total


def flicker_noise(rng: "np.random.Generator", n: int, history: int | None = None) -> FloatArray:
    """Return flicker noise (n,) of B = 1, that has been running for `history` samples before.

    Unit white noise through the filter (1 - z^-1)^(-1/2); two-sided density 1/(2 pi f), that of
    IEEE Std 952's B = 1. With history = 0 the process starts from zero.
    """
    past = n if history is None else history
    length = n + past
    if not length:
        return np.zeros(0)
    k = np.arange(1, length)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    # A circular convolution of this size folds its end onto the history alone, not the output.
    size = fft.next_fast_len(2 * length - min(past, length - 1) - 1, real=True)
    spectrum = fft.rfft(rng.standard_normal(length), size)
    spectrum *= fft.rfft(response, size)
    result: FloatArray = fft.irfft(spectrum, size)[past:length].copy()
    return result


def markov_noise(rng: "np.random.Generator", n: int, decay: float) -> FloatArray:
    """Return a stationary x_k = decay x_(k-1) + sqrt(1 - decay^2) w_k of unit variance, (n,)."""
    white = rng.standard_normal(n)
    drive = np.sqrt(1.0 - decay**2) * white
    drive[:1] = white[:1]
    result: FloatArray = signal.lfilter([1.0], [1.0, -decay], drive)
    return result
