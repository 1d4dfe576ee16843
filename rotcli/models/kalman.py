"""One linear Kalman filter: covariances and gains, consistency, smoothing.

The covariance pass needs no data, so its gains are computed once and serve any number of runs.
Process noise enters half before and half after the transition (trapezoidal rule); updates are in
Joseph's form, which keeps a covariance symmetric and positive.
Sources: Gelb, Applied Optimal Estimation (1974), chapters 4 and 5; Bar-Shalom, Li, Kirubarajan,
Estimation with Applications to Tracking and Navigation (2001), section 5.4 (consistency).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gains:
    """The data-independent part of a filter run over n updates, m states, p measurements.

    Phi: (n, m, m) transition to update k. K: (n, m, p) gain. S: (n, p, p) innovation covariance.
    prior, posterior: (n, m, m) covariance before and after update k.
    """

    Phi: Array
    K: Array
    S: Array
    prior: Array
    posterior: Array


def predict(P: Array, Phi: Array, Q: Array) -> Array:
    """Return the covariance (..., m, m) after the transition Phi with process noise Q over it."""
    half = 0.5 * Q
    result: Array = Phi @ (P + half) @ np.swapaxes(Phi, -1, -2) + half
    return result


def update(P: Array, H: Array, R: Array) -> tuple[Array, Array, Array]:
    """Return gain K, innovation covariance S and the updated covariance (Joseph's form).

    P: (..., m, m); H: (..., p, m); R: (p, p).
    """
    PHt = P @ np.swapaxes(H, -1, -2)
    S = H @ PHt + R
    K = PHt @ np.linalg.inv(S)
    A = np.eye(P.shape[-1]) - K @ H
    P = A @ P @ np.swapaxes(A, -1, -2) + K @ R @ np.swapaxes(K, -1, -2)
    return K, S, P


def gain_sequence(P0: Array, Phi: Array, Q: Array, H: Array, R: Array) -> Gains:
    """Run the covariance recursion over n updates.

    P0: (m, m). Phi: (n, m, m). Q: (m, m) process noise per transition. H: (n, p, m). R: (p, p).
    """
    n, m, p = len(Phi), len(P0), len(R)
    K, S = np.empty((n, m, p)), np.empty((n, p, p))
    prior, posterior = np.empty((n, m, m)), np.empty((n, m, m))
    P = P0
    for k in range(n):
        prior[k] = P = predict(P, Phi[k], Q)
        K[k], S[k], P = update(P, H[k], R)
        posterior[k] = P
    return Gains(Phi, K, S, prior, posterior)


def smoother_corrections(gains: Gains, corrections: Array) -> tuple[Array, Array]:
    """Return what a Rauch-Tung-Striebel pass adds to filtered estimates, and its covariance.

    For a filter that feeds back its estimates: `corrections` (n, ..., m) is what each update
    added to the state. The result (n, ..., m) is to be added to the state held after update k;
    the covariance (n, m, m) is that of the smoothed state.
    Source: Rauch, Tung, Striebel, AIAA Journal 3 (1965); predicted states are zero here because
    each update's estimate has been taken out of the state.
    """
    PhiP = gains.Phi[1:] @ gains.posterior[:-1]
    G = np.swapaxes(np.linalg.solve(gains.prior[1:], PhiP), -1, -2)
    added = np.zeros_like(corrections)
    covariance = gains.posterior.copy()
    for k in range(len(G) - 1, -1, -1):
        added[k] = (corrections[k + 1] + added[k + 1]) @ G[k].T
        covariance[k] += G[k] @ (covariance[k + 1] - gains.prior[k + 1]) @ G[k].T
    return added, covariance


def normalized_squares(x: Array, P: Array) -> Array:
    """Return x' P^-1 x (...): of innovations (NIS) or of errors (NEES), x (..., m), P (..., m, m).

    Its mean is m when P tells the truth.
    """
    result: Array = np.einsum("...i,...i->...", x, np.linalg.solve(P, x[..., None])[..., 0])
    return result


def mean_bounds(degrees: int, count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the two-sided bounds of the mean of `count` chi-squared values of `degrees`.

    Of many values by Wilson and Hilferty's cube root (PNAS 17 (1931)), which is then within 1e-6
    of the exact ones and needs no library.

    >>> [round(b, 3) for b in mean_bounds(3, 1)]  # chi-squared tables, 3 degrees
    [0.216, 9.348]
    """
    tail, total = 0.5 * (1.0 - confidence), degrees * count
    if total > 1000:
        from statistics import NormalDist

        c, z = 2.0 / (9.0 * total), NormalDist().inv_cdf(1.0 - tail)
        return degrees * (1.0 - c - z * c**0.5) ** 3, degrees * (1.0 - c + z * c**0.5) ** 3

    from scipy.special import gammaincinv

    low, high = (2.0 * gammaincinv(0.5 * degrees * count, p) for p in (tail, 1.0 - tail))
    return float(low / count), float(high / count)
