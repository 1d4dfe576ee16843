"""One linear Kalman filter: covariances and gains, consistency, smoothing.

The covariance pass needs no data, so its gains are computed once and serve any number of runs.
Process noise enters half before and half after the transition (trapezoidal rule); updates are in
Joseph's form, which keeps a covariance symmetric and positive.
Sources: Gelb, Applied Optimal Estimation (1974), chapters 4 and 5; Bar-Shalom, Li, Kirubarajan,
Estimation with Applications to Tracking and Navigation (2001), section 5.4 (consistency).
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    import statistics

    from scipy import special

_MANY_DEGREES = 1000  # degrees of freedom from which the cube root is exact to 1e-6


@dataclass(frozen=True, eq=False)
class FilterGains:
    """The gains of a filter over n updates, which do not depend on the data.

    m states, p measurements. K: (n, m, p). S: (n, p, p) innovation covariance. sigma: (n, m) after
    update k. P: (m, m) covariance after the last of them.
    """

    K: FloatArray
    S: FloatArray
    sigma: FloatArray
    P: FloatArray

    def join(self, later: "FilterGains") -> "FilterGains":
        """Return these gains and those of the updates that follow, as one."""
        names: tuple[str, ...] = ("K", "S", "sigma")
        if isinstance(self, Gains) and isinstance(later, Gains):
            names = (*names, "Phi", "prior", "posterior")
        kind = Gains if len(names) > 3 else FilterGains
        joined = {n: np.concatenate([getattr(self, n), getattr(later, n)]) for n in names}
        return kind(**joined, P=later.P)


@dataclass(frozen=True, eq=False)
class Gains(FilterGains):
    """Gains with all covariances, as a smoother needs them.

    Phi: (n, m, m) transition to update k. prior, posterior: (n, m, m) covariance before and after
    update k.
    """

    Phi: FloatArray
    prior: FloatArray
    posterior: FloatArray


def predict(P: FloatArray, Phi: FloatArray, Q: FloatArray) -> FloatArray:
    """Return the covariance (..., m, m) after the transition Phi with process noise Q over it."""
    half = 0.5 * Q
    result: FloatArray = Phi @ (P + half) @ np.swapaxes(Phi, -1, -2) + half
    return result


def update(
    P: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return gain K, innovation covariance S and the updated covariance (Joseph's form).

    P: (..., m, m); H: (..., p, m); R: (p, p).
    """
    PHt = P @ np.swapaxes(H, -1, -2)
    S = H @ PHt + R
    K = PHt @ np.linalg.inv(S)
    A = np.eye(P.shape[-1]) - K @ H
    P = A @ P @ np.swapaxes(A, -1, -2) + K @ R @ np.swapaxes(K, -1, -2)
    return K, S, P


def gain_sequence(
    P0: FloatArray, Phi: FloatArray, Q: FloatArray, H: FloatArray, R: FloatArray
) -> Gains:
    """Run the covariance recursion over n updates: `predict` and `update` of one after the other.

    P0: (m, m). Phi: (n, m, m). Q: (m, m) process noise per transition. H: (n, p, m). R: (p, p),
    or (n, p, p) of each update.
    """
    n, m, p = len(Phi), len(P0), R.shape[-1]
    R = np.broadcast_to(R, (n, p, p))
    K, S = np.empty((n, m, p)), np.empty((n, p, p))
    prior, posterior = np.empty((n, m, m)), np.empty((n, m, m))
    half, one = 0.5 * Q, np.eye(m)
    Phi_T, H_T = np.swapaxes(Phi, -1, -2), np.swapaxes(H, -1, -2)
    P = P0
    # `dot` of two matrices costs a third of `@` at this size.
    for k in range(n):
        P = np.add(Phi[k].dot(P + half).dot(Phi_T[k]), half, out=prior[k])
        PHt = P.dot(H_T[k])
        innovation = np.add(H[k].dot(PHt), R[k], out=S[k])
        gain = PHt.dot(np.linalg.inv(innovation), out=K[k])
        A = one - gain.dot(H[k])
        P = np.add(A.dot(P).dot(A.T), gain.dot(R[k]).dot(gain.T), out=posterior[k])
    sigma = np.sqrt(np.diagonal(posterior, axis1=-2, axis2=-1))
    return Gains(K, S, sigma, posterior[-1].copy(), Phi, prior, posterior)


@dataclass(frozen=True, eq=False)
class SmootherState:
    """The state of a smoother between two chunks of updates, as the earlier chunk needs it.

    Phi: (m, m) transition to the first update of the later chunk. prior, covariance: (m, m)
    covariance before that update, and smoothed. correction: (..., m) of the state by the update
    and the smoothing together.
    """

    Phi: FloatArray
    prior: FloatArray
    covariance: FloatArray
    correction: FloatArray


def smoothing_corrections(
    gains: Gains, corrections: FloatArray, next_state: SmootherState | None = None
) -> tuple[FloatArray, FloatArray, SmootherState]:
    """Return the corrections of filtered estimates by a Rauch-Tung-Striebel pass.

    For a filter that feeds back its estimates: `corrections` (n, ..., m) are those of the updates.
    The result (n, ..., m) is to be added to the state after update k; the covariance (n, m, m) is
    that of the smoothed state; the last result is for the updates before these. next_state: that
    of the updates that follow; None at the end of the run.
    Source: Rauch, Tung, Striebel, AIAA Journal 3 (1965); predicted states are zero here because
    each update's estimate is fed back at once.
    """
    Phi, prior = gains.Phi, gains.prior
    if next_state is not None:
        Phi = np.append(Phi, next_state.Phi[None], 0)
        prior = np.append(prior, next_state.prior[None], 0)
    PhiP = Phi[1:] @ gains.posterior[: len(Phi) - 1]
    G = np.swapaxes(np.linalg.solve(prior[1:], PhiP), -1, -2)
    smoothing = np.zeros_like(corrections)
    covariance = gains.posterior.copy()
    for k in range(len(G) - 1, -1, -1):
        if k + 1 < len(smoothing):
            correction, after = corrections[k + 1] + smoothing[k + 1], covariance[k + 1]
        elif next_state is not None:
            correction, after = next_state.correction, next_state.covariance
        smoothing[k] = correction @ G[k].T
        covariance[k] += G[k] @ (after - prior[k + 1]) @ G[k].T
    first = SmootherState(
        gains.Phi[0], gains.prior[0], covariance[0], corrections[0] + smoothing[0]
    )
    return smoothing, covariance, first


def normalized_squares(x: FloatArray, P: FloatArray) -> FloatArray:
    """Return x' P^-1 x (...): of innovations (NIS) or of errors (NEES), x (..., m), P (..., m, m).

    Its mean is m when P is the covariance of x.
    """
    result: FloatArray = np.einsum("...i,...i->...", x, np.linalg.solve(P, x[..., None])[..., 0])
    return result


def mean_bounds(degrees: int, count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the two-sided bounds of the mean of `count` chi-squared values of `degrees`.

    For more than 1000 degrees in all by Wilson and Hilferty's cube root (PNAS 17 (1931)), which
    is then within 1e-6 of the exact bounds and needs no library.

    >>> [round(b, 3) for b in mean_bounds(3, 1)]  # chi-squared tables, 3 degrees
    [0.216, 9.348]
    """
    tail, total = 0.5 * (1.0 - confidence), degrees * count
    if total > _MANY_DEGREES:
        c, z = 2.0 / (9.0 * total), statistics.NormalDist().inv_cdf(1.0 - tail)
        return degrees * (1.0 - c - z * c**0.5) ** 3, degrees * (1.0 - c + z * c**0.5) ** 3

    low, high = (2.0 * special.gammaincinv(0.5 * degrees * count, p) for p in (tail, 1.0 - tail))
    return float(low / count), float(high / count)
