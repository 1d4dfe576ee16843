"""Noise by methods that neither the simulation nor the covariance of means uses."""

import numpy as np
from scipy.signal import lfilter


def long_flicker(
    rng: np.random.Generator, n: int, interval: float, shape: tuple[int, ...] = ()
) -> np.ndarray:
    """Return flicker noise (*shape, n) of B = 1 as a sum of Ornstein-Uhlenbeck processes.

    Rates a factor of e^0.5 apart, each of variance 0.5 / pi: two-sided density 1 / (2 pi f) from
    1e-6 rad/s to beyond the samples; stationary, so that its past is unlimited.
    """
    total = np.zeros((*shape, n))
    for rate in np.exp(np.arange(np.log(1e-6), np.log(10.0 / interval), 0.5)):
        decay = np.exp(-rate * interval)
        drive = rng.standard_normal((*shape, n))
        drive[..., 1:] *= np.sqrt(1.0 - decay**2)
        total += np.sqrt(0.5 / np.pi) * lfilter([1.0], [1.0, -decay], drive)
    return total
