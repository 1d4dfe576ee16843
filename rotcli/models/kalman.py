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
    """Run the covariance recursion over n updates: `predict` and `update` of one after the other.

    P0: (m, m). Phi: (n, m, m). Q: (m, m) process noise per transition. H: (n, p, m). R: (p, p).
    """
    n, m, p = len(Phi), len(P0), len(R)
    K, S = np.empty((n, m, p)), np.empty((n, p, p))
    prior, posterior = np.empty((n, m, m)), np.empty((n, m, m))
    half, one = 0.5 * Q, np.eye(m)
    Phi_T, H_T = np.swapaxes(Phi, -1, -2), np.swapaxes(H, -1, -2)
    P = P0
    # `dot` of two matrices costs a third of `@` at this size, and this is where the time goes.
    for k in range(n):
        P = np.add(Phi[k].dot(P + half).dot(Phi_T[k]), half, out=prior[k])
        PHt = P.dot(H_T[k])
        innovation = np.add(H[k].dot(PHt), R, out=S[k])
        gain = PHt.dot(np.linalg.inv(innovation), out=K[k])
        A = one - gain.dot(H[k])
        P = np.add(A.dot(P).dot(A.T), gain.dot(R).dot(gain.T), out=posterior[k])
    return Gains(Phi, K, S, prior, posterior)


@dataclass(frozen=True, eq=False)
class Later:
    """What smoothing some updates needs of the one that follows them.

    Phi: (m, m) transition to it. prior, covariance: (m, m) its covariance before the update and
    smoothed. correction: (..., m) what the update and the smoothing added to the state.
    """

    Phi: Array
    prior: Array
    covariance: Array
    correction: Array


def smoother_corrections(
    gains: Gains, corrections: Array, later: Later | None = None
) -> tuple[Array, Array, Later]:
    """Return what a Rauch-Tung-Striebel pass adds to filtered estimates, and its covariance.

    For a filter that feeds back its estimates: `corrections` (n, ..., m) is what each update
    added to the state. The result (n, ..., m) is to be added to the state held after update k;
    the covariance (n, m, m) is that of the smoothed state. later: where the updates do not end
    the run, what was returned last for those that follow.
    Source: Rauch, Tung, Striebel, AIAA Journal 3 (1965); predicted states are zero here because
    each update's estimate has been taken out of the state.
    """
    Phi, prior = gains.Phi, gains.prior
    if later is not None:
        Phi, prior = np.append(Phi, later.Phi[None], 0), np.append(prior, later.prior[None], 0)
    PhiP = Phi[1:] @ gains.posterior[: len(Phi) - 1]
    G = np.swapaxes(np.linalg.solve(prior[1:], PhiP), -1, -2)
    added = np.zeros_like(corrections)
    covariance = gains.posterior.copy()
    for k in range(len(G) - 1, -1, -1):
        if k + 1 < len(added):
            correction, after = corrections[k + 1] + added[k + 1], covariance[k + 1]
        elif later is not None:
            correction, after = later.correction, later.covariance
        added[k] = correction @ G[k].T
        covariance[k] += G[k] @ (after - prior[k + 1]) @ G[k].T
    first = Later(gains.Phi[0], gains.prior[0], covariance[0], corrections[0] + added[0])
    return added, covariance, first


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
