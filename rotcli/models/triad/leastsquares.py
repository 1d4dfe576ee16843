"""Least squares in scaled columns: QR block by block, covariance, rank, null directions."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

RANK_TOLERANCE = 1e-7  # of the largest singular value; regular ones stay above 5e-6
SMALL_COEFFICIENT = 0.02  # of the largest entry of a null vector: not worth a word


def triangular(rows: FloatArray) -> FloatArray:
    """Return the triangular factor (QR) of rows; it has at most as many rows as columns."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


class TriangularSum:
    """The triangular factor of stacked rows [A | r], updated chunk by chunk (QR).

    So a long log needs memory for one chunk of rows only.
    """

    def __init__(self, columns: int) -> None:
        """Begin with no rows; columns: number of parameters."""
        self.columns = columns
        self.rows = 0
        self._R = np.zeros((0, columns + 1))

    def add(self, A: FloatArray, r: FloatArray) -> None:
        """Add weighted rows A (n, p) and their right-hand side r (n,)."""
        self.add_joined(np.concatenate([A, r[:, None]], axis=1))

    def add_joined(self, rows: FloatArray) -> None:
        """Add weighted rows [A | r] (n, p + 1)."""
        self.rows += len(rows)
        self._R = triangular(np.concatenate([self._R, rows]))

    def copy(self) -> "TriangularSum":
        """Return an independent copy."""
        other = TriangularSum(self.columns)
        other.rows, other._R = self.rows, self._R.copy()
        return other

    @property
    def R(self) -> FloatArray:
        """The factor of A: upper triangular, at most (p, p)."""
        return self._R[: self.columns, : self.columns]

    def solve(self) -> FloatArray:
        """Return the x (p,) with the least sum of squares; the factor must be regular."""
        return np.asarray(np.linalg.solve(self.R, self._R[: self.columns, self.columns]))

    def residual_sum(self) -> float:
        """Return the sum of squares left at the solution."""
        return float(np.sum(self._R[self.columns :, self.columns] ** 2))


def covariance_of(R: FloatArray) -> FloatArray:
    """Return (R^T R)^-1 (p, p)."""
    inverse = np.linalg.solve(R, np.eye(R.shape[1]))
    return np.asarray(inverse @ inverse.T)


@dataclass(frozen=True, eq=False)
class Rank:
    """Rank of the scaled Jacobian; null: (q, p), sparse basis of the directions without data."""

    rank: int
    singular_values: FloatArray
    null: FloatArray


def rank_of(R: FloatArray, tolerance: float = RANK_TOLERANCE) -> Rank:
    """Return the rank of scaled rows from their triangular factor, and the null directions.

    Gauss-Jordan with pivots makes each null vector as short as possible: its pivot is a
    parameter that no other null vector contains.
    """
    p = R.shape[1]
    _, s, Vt = np.linalg.svd(R if len(R) >= p else np.vstack([R, np.zeros((p - len(R), p))]))
    rank = int(np.sum(s > tolerance * s[0]))
    return Rank(rank, s, gauss_jordan(Vt[rank:]))


def gauss_jordan(rows: FloatArray) -> FloatArray:
    """Return the same span (q, p) in reduced form; each pivot is the largest entry left."""
    B = rows.copy()
    pivots: list[int] = []
    for k in range(len(B)):
        left = np.abs(B[k:])
        left[:, pivots] = 0.0
        i, j = np.unravel_index(int(np.argmax(left)), left.shape)
        B[[k, k + int(i)]] = B[[k + int(i), k]]
        B[k] /= B[k, j]
        for other in range(len(B)):
            if other != k:
                B[other] -= B[other, j] * B[k]
        pivots.append(int(j))
    B[np.abs(B) < SMALL_COEFFICIENT * np.abs(B).max(axis=1, keepdims=True, initial=0.0)] = 0.0
    return B
