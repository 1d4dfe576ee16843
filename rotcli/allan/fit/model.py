"""The noise model of one axis on its Allan variance, its spectrum, and what both imply.

    sigma^2(tau) = 3 Q^2/tau^2 + N^2/tau + (2 ln2/pi) B^2 + K^2 tau/3 + R^2 tau^2/2

(IEEE Std 952; B on the two-sided density, so the flat floor is 0.664 B), and where the record
contains a Gauss-Markov process of known correlation time its term as well (the standard's C.20).
Arrays over terms run Q, N, B, K and, where a correlation time is given, the Gauss-Markov
variance; the ramp R is no noise and not among them.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rotcli.units import FloatArray

Factors = NDArray[np.int64]

FLICKER_VARIANCE = 2.0 * math.log(2.0) / math.pi  # of B^2


def noise_type(slope: FloatArray) -> NDArray[np.int64]:
    """Return the noise type alpha (2, 0, -1, -2) at each point from the slope of the variance."""
    return np.select([slope < -1.5, slope < -0.5, slope < 0.5], [2, 0, -1], -2)


def terms(tau: FloatArray, markov_time: float | None = None) -> FloatArray:
    """Return the Allan variance of each noise term (k, 4 or 5) for unit squares; tau (k,) s."""
    found = [3.0 / tau**2, 1.0 / tau, np.full_like(tau, FLICKER_VARIANCE), tau / 3.0]
    if markov_time is not None:
        r = tau / markov_time
        exact = r - 1.5 + 2.0 * np.exp(-r) - 0.5 * np.exp(-2.0 * r)
        # Below r = 0.01 the difference has lost its digits; its series has 1e-6 there.
        found.append(
            2.0 * np.where(r < 0.01, r / 3.0 - r**2 / 4.0 + 7.0 * r**3 / 60.0, exact / r**2)
        )
    return np.stack(found, axis=-1)


def slopes(tau: FloatArray, squares: FloatArray, markov_time: float | None = None) -> FloatArray:
    """Return d ln variance / d ln tau (k,) of the noise: -2 for Q to 1 for K."""
    step = 1e-4
    ahead, here = (terms(tau * factor, markov_time) @ squares for factor in (1.0 + step, 1.0))
    return np.asarray(np.log(ahead / here) / math.log1p(step))


def columns(
    factors: Factors,
    interval: float,
    sampling: str,
    detrended: FloatArray | None,
    markov_time: float | None = None,
) -> FloatArray:
    """Return the expected variance (k, 4 or 5) of each unit term as this record shows it.

    Samples of the rate at an instant alias what averages smooth: a random walk then gives
    K^2 tau/3 (1 + 1/(2 m^2)) exactly, flicker about 1 + 0.7/m^2 (0.5 band-limited, 0.86 for the
    fractional-difference model). A removed regression line takes tau^2/2 times the variance of
    its slope away; detrended: that variance under each unit term (4 or 5,).
    """
    m = factors.astype(float)
    tau = m * interval
    result = terms(tau, markov_time)
    if sampling == "instant":
        result[:, 2] *= 1.0 + 0.7 / m**2
        result[:, 3:] *= (1.0 + 0.5 / m**2)[:, None]
    if detrended is not None:
        result -= 0.5 * tau[:, None] ** 2 * detrended
    return result


def slope_variance(duration: float, markov_time: float | None = None) -> FloatArray:
    """Return the variance of a regression slope under each unit term (4 or 5,).

    The slope's weights have the spectrum |W|^2 = 36 j1(pi f T)^2 / T^2 (j1: spherical Bessel);
    its integrals with 1, 1/f and 1/f^2 are closed. Q: white angle noise met at both ends.
    Gauss-Markov: white noise of its density 2 T at zero, the correlation being short.
    """
    t = duration
    found = [72.0 / t**4, 12.0 / t**3, 9.0 / (math.pi * t**2), 6.0 / (5.0 * t)]
    return np.array(found + ([] if markov_time is None else [24.0 * markov_time / t**3]))


def _filters_and_spectra(
    factors: Factors, interval: float, markov_time: float | None
) -> tuple[FloatArray, FloatArray]:
    """Return Allan filters (k, f) and two-sided spectra (p, f) of the unit terms.

    H: the Allan filter 2 sin^4(pi f tau) / (m sin(pi f interval))^2, times the weight of a
    logarithmic grid of frequencies. Where it oscillates faster than the grid, the grid takes its
    mean.
    """
    m = factors.astype(float)[:, None]
    f = np.geomspace(0.02 / (m.max() * interval), 0.5 / interval, 1500)
    sine = np.sin(math.pi * f * interval)
    w = 2.0 * math.pi * f
    spectra = [4.0 * sine**2 / interval, np.ones_like(f), 1.0 / w, 1.0 / w**2]
    if markov_time is not None:
        spectra.append(2.0 * markov_time / (1.0 + (w * markov_time) ** 2))
    filters = np.sin(math.pi * f * m * interval) ** 4 / (m * sine) ** 2 * np.sqrt(f)
    return filters, np.array(spectra)


@lru_cache(maxsize=8)
def _spectral_products(
    factors: tuple[int, ...], interval: float, markov_time: float | None
) -> FloatArray:
    """Return the integrals (p, p, k, k) of T_i T_j H_a H_b over frequency, T the spectra."""
    filters, spectra = _filters_and_spectra(np.array(factors), interval, markov_time)
    count = len(spectra)
    products = np.empty((count, count, len(factors), len(factors)))
    for i in range(count):
        for j in range(i, count):
            products[i, j] = products[j, i] = (filters * (spectra[i] * spectra[j])) @ filters.T
    return products


@lru_cache(maxsize=8)
def _spectral_overlap(
    factors: tuple[int, ...], interval: float, markov_time: float | None
) -> FloatArray:
    """Return by which share (k, p, p) two unit terms make the same second differences.

    1 for a term with itself, less for terms of different spectra.
    """
    filters, spectra = _filters_and_spectra(np.array(factors), interval, markov_time)
    both = np.einsum("if,jf,kf->kij", spectra, spectra, filters**2, optimize=True)
    size = np.sqrt(np.diagonal(both, axis1=1, axis2=2))
    return np.asarray(both / (size[:, :, None] * size[:, None, :]))


def mixed_freedom(
    factors: Factors,
    interval: float,
    variances: FloatArray,
    freedoms: FloatArray,
    markov_time: float | None = None,
) -> FloatArray:
    """Return the degrees of freedom (k,) of a sum of noises.

    variances, freedoms (k, p): Allan variance and degrees of freedom of each term alone. The
    variance of an estimate is proportional to the integral of the squared spectrum, so terms add
    as their spectra overlap. A single term keeps its freedom; white noise with random walk has
    more than flicker noise of the same slope.
    """
    overlap = _spectral_overlap(tuple(factors.tolist()), interval, markov_time)
    spread = variances / np.sqrt(freedoms)
    error = np.einsum("ki,kij,kj->k", spread, overlap, spread)
    total = variances.sum(axis=1)
    return np.asarray(total**2 / np.where(error > 0.0, error, 1.0))


def curve_covariance(
    factors: Factors,
    interval: float,
    squares: FloatArray,
    spread: FloatArray,
    markov_time: float | None = None,
) -> FloatArray:
    """Return the covariance (k, k) of the variances at the given clusters.

    For a Gaussian record cov(a, b) is proportional to the integral of S^2 H_a H_b, S the
    spectrum of the model; this gives the correlation, `spread` (k,) the sigma of each point.
    """
    products = _spectral_products(tuple(factors.tolist()), interval, markov_time)
    k = len(factors)
    full = (np.outer(squares, squares).ravel() @ products.reshape(-1, k * k)).reshape(k, k)
    scale = spread / np.sqrt(np.diag(full))
    return np.asarray(full * np.outer(scale, scale))
