"""The covariance recursion of a Kalman filter over thousands of updates, in blocks.

One update after the other costs ten calls on small matrices. The Riccati step is a
linear-fractional map of the covariance P, and such maps compose; so the updates are divided into
blocks of `BLOCK`, and each step is taken for all blocks together:

1. *Elements*: for each block, an ordinary filter from covariance zero. It gives C (covariance at
   the end for a known start), A (transition from the start to the estimate at the end) and J
   (information of the block about its start).
2. *Over the blocks*, one after the other: `P_end = A (1 + P J)^-1 P A' + C`.
3. *Fill*: all blocks together from their known starts, ordinary filter steps; K, S and the sigmas
   are stored.

The result is that of `kalman.gain_sequence` except for rounding: the rounding of J gives a
direction that no measurement observes a little false information, 1e-10 of a sigma after
200,000 updates, growing with the square of their number.
Sources: Särkkä, García-Fernández, IEEE Trans. Automatic Control 66 (2021) 299, section IV-A, for
the elements and their composition; Kailath, Sayed, Hassibi, Linear Estimation (2000), section 8.3.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.kalman import FilterGains, Gains, gain_sequence
from rotcli.units import FloatArray

BLOCK = 32  # updates; 16 and 64 are as fast
MIN_BLOCKS = 4  # fewer blocks are slower than one update after the other


@dataclass(frozen=True, eq=False)
class SparseModel:
    """A linear model whose last states are constants and whose measurement is simple.

    rows: (n, r, m), the first r rows of the transition to update k; the others are those of
    identity. Q: (m, m) process noise. H_rest: None where each update measures the first p states;
    else (n, p, q), and `columns` gives the q states that the measurement contains as well.
    R: (p, p). more_variance: (n,) that is added to the diagonal of R at each update; None: nothing.
    """

    rows: FloatArray
    Q: FloatArray
    R: FloatArray
    H_rest: FloatArray | None
    columns: slice
    more_variance: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def Phi(self) -> FloatArray:
        """Transitions (n, m, m)."""
        n, dynamic, m = self.rows.shape
        Phi = np.broadcast_to(np.eye(m), (n, m, m)).copy()
        Phi[:, :dynamic] = self.rows
        return Phi

    @property
    def H(self) -> FloatArray:
        """Measurement matrices (n, p, m)."""
        n, _, m = self.rows.shape
        H = np.broadcast_to(np.eye(len(self.R), m), (n, len(self.R), m)).copy()
        if self.H_rest is not None:
            H[:, :, self.columns] = self.H_rest
        return H

    def part(self, updates: slice) -> "SparseModel":
        """Return the model of some of the updates."""
        rest = None if self.H_rest is None else self.H_rest[updates]
        more = None if self.more_variance is None else self.more_variance[updates]
        return SparseModel(self.rows[updates], self.Q, self.R, rest, self.columns, more)

    @property
    def measurement_noise(self) -> FloatArray:
        """R of each update (n, p, p), or of all (p, p) where it is the same."""
        if self.more_variance is None:
            return self.R
        return self.R + self.more_variance[:, None, None] * np.eye(len(self.R))

    def times_H(self, P: FloatArray, H_rest: FloatArray | None) -> FloatArray:
        """Return P H' (..., m, p) of the blocks' H_rest (blocks, p, q)."""
        PHt = P[..., :, : len(self.R)]
        if H_rest is None:
            return PHt
        return PHt + P[..., :, self.columns] @ np.swapaxes(H_rest, -1, -2)


def inverse_symmetric_3(S: FloatArray) -> FloatArray:
    """Return the inverse of symmetric matrices S (..., 3, 3) in closed form (adjugate).

    >>> inverse_symmetric_3(np.diag([1.0, 2.0, 4.0])).diagonal()
    array([1.  , 0.5 , 0.25])
    """
    a, b, c = S[..., 0, 0], S[..., 0, 1], S[..., 0, 2]
    d, e, f = S[..., 1, 1], S[..., 1, 2], S[..., 2, 2]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * A + b * B + c * C)
    inverse = np.empty_like(S)
    inverse[..., 0, 0], inverse[..., 1, 1], inverse[..., 2, 2] = A * scale, D * scale, F * scale
    inverse[..., 0, 1] = inverse[..., 1, 0] = B * scale
    inverse[..., 0, 2] = inverse[..., 2, 0] = C * scale
    inverse[..., 1, 2] = inverse[..., 2, 1] = E * scale
    return inverse


def blocked_gains(P0: FloatArray, model: SparseModel, *, covariances: bool = False) -> FilterGains:
    """Run the covariance recursion from P0 (m, m) over the updates of a model.

    Measurements must be three: a velocity. covariances: keep prior and posterior (n, m, m) of each
    update, as a smoother needs them; the result is then a `Gains`.
    """
    count = len(model) // BLOCK
    if count < MIN_BLOCKS:
        return gain_sequence(P0, model.Phi, model.Q, model.H, model.measurement_noise)
    n, (_, dynamic, m), p = count * BLOCK, model.rows.shape, len(model.R)
    # Step first, so that the matrices of one step lie next to each other.
    rows = np.ascontiguousarray(np.swapaxes(model.rows[:n].reshape(count, BLOCK, dynamic, m), 0, 1))
    rest: list[FloatArray | None] = [None] * BLOCK
    if model.H_rest is not None:
        H_rest = model.H_rest[:n].reshape(count, BLOCK, p, -1)
        rest = list(np.ascontiguousarray(np.swapaxes(H_rest, 0, 1)))
    noise: list[FloatArray] = [model.R] * BLOCK
    if model.more_variance is not None:
        blocks = model.measurement_noise[:n].reshape(count, BLOCK, p, p)
        noise = list(np.ascontiguousarray(np.swapaxes(blocks, 0, 1)))
    steps = list(zip(rows, rest, noise, strict=True))
    starts, P_end = _block_starts(P0, _elements(steps, model))
    parts = [_fill(starts, steps, model, covariances=covariances)]
    if n < len(model):
        tail = model.part(slice(n, None))
        parts.append(gain_sequence(P_end, tail.Phi, tail.Q, tail.H, tail.measurement_noise))
    return parts[0].join(parts[1]) if len(parts) > 1 else parts[0]


def _predict(P: FloatArray, rows: FloatArray, half: FloatArray) -> None:
    """Predict P (blocks, m, m) in place: Phi (P + half) Phi' + half, rows (blocks, r, m) of Phi."""
    dynamic = rows.shape[1]
    P += half
    P[:, :dynamic] = rows @ P
    P[:, :, :dynamic] = P @ np.swapaxes(rows, -1, -2)
    P += half


# One step of all blocks: rows (blocks, r, m), H_rest (blocks, p, q) or None, R (p, p) or
# (blocks, p, p).
_Step = tuple[FloatArray, FloatArray | None, FloatArray]


def _elements(steps: list[_Step], model: SparseModel) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, C, J (blocks, m, m) of each block."""
    count, dynamic, m = steps[0][0].shape
    p, half = len(model.R), 0.5 * model.Q
    A = np.broadcast_to(np.eye(m), (count, m, m)).copy()
    C, J = np.zeros_like(A), np.zeros_like(A)
    for U, H_rest, R in steps:
        _predict(C, U, half)
        A[:, :dynamic] = U @ A
        G = A[:, :p].copy()
        PHt = model.times_H(C, H_rest)
        S = PHt[:, :p] + R
        if H_rest is not None:
            G += H_rest @ A[:, model.columns]
            S = S + H_rest @ PHt[:, model.columns]
        S_inverse = inverse_symmetric_3(S)
        K = PHt @ S_inverse
        J += np.swapaxes(G, -1, -2) @ (S_inverse @ G)
        A -= K @ G
        C -= K @ np.swapaxes(PHt, -1, -2)
    return A, C, J


def _block_starts(
    P0: FloatArray, elements: tuple[FloatArray, FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance (blocks, m, m) at the start of each block, and at the end of all."""
    one = np.eye(len(P0))
    starts = np.empty_like(elements[0])
    P = P0
    for k, (A, C, J) in enumerate(zip(*elements, strict=True)):
        starts[k] = P
        P = A.dot(np.linalg.solve(one + P.dot(J), P)).dot(A.T) + C
        P = 0.5 * (P + P.T)
    return starts, P


def _fill(
    starts: FloatArray,
    steps: list[_Step],
    model: SparseModel,
    *,
    covariances: bool,
) -> FilterGains:
    """Return the gains of all updates from the covariance (blocks, m, m) at their starts."""
    size, (count, _, m) = len(steps), steps[0][0].shape
    p, half = len(model.R), 0.5 * model.Q
    K, S = np.empty((size, count, m, p)), np.empty((size, count, p, p))
    variance = np.empty((size, count, m))
    prior, posterior = (np.empty((size if covariances else 0, count, m, m)) for _ in range(2))
    P = starts.copy()
    for k, (U, H_rest, R) in enumerate(steps):
        _predict(P, U, half)
        if covariances:
            prior[k] = P
        PHt = model.times_H(P, H_rest)
        S[k] = PHt[:, :p] + R
        if H_rest is not None:
            S[k] += H_rest @ PHt[:, model.columns]
        np.matmul(PHt, inverse_symmetric_3(S[k]), out=K[k])
        P -= K[k] @ np.swapaxes(PHt, -1, -2)
        if covariances:
            posterior[k] = 0.5 * (P + np.swapaxes(P, -1, -2))
        variance[k] = np.diagonal(P, axis1=-2, axis2=-1)

    def in_order(a: FloatArray) -> FloatArray:
        return np.swapaxes(a, 0, 1).reshape(-1, *a.shape[2:])

    last = 0.5 * (P[-1] + P[-1].T)
    gains = FilterGains(in_order(K), in_order(S), np.sqrt(in_order(variance)), last)
    if not covariances:
        return gains
    Phi = model.part(slice(0, count * size)).Phi
    return Gains(gains.K, gains.S, gains.sigma, gains.P, Phi, in_order(prior), in_order(posterior))
