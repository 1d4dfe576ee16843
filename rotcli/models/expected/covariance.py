"""Covariance between the coarse steps of a window that slow sensor noise makes in the states.

The Toeplitz part of the blocks' covariance E depends on the distance of two coarse steps alone:
one small product a distance instead of one with n x n numbers.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rotcli.models.expected.sources import SlowCovariance

FloatArray = NDArray[np.float64]

# Slow noise between steps two apart is smooth: its logarithm has its singularity three half steps
# from their middles, so that 6 Chebyshev nodes leave (3 + sqrt(8))^-6 = 3e-5 of its variation.
_SMOOTH_FROM, _NODES = 2, 6


def sensor_covariance(W: FloatArray, E: SlowCovariance, M: int, r: int) -> FloatArray:
    """Return sum over s sensors of W_i E W_i^T between coarse steps, (M, 9, M, 9).

    W: (n, 9, s) responses of n = M r blocks; E is the same for each sensor. The Toeplitz part of
    E between two coarse steps depends on their distance alone: one product a distance. From two
    steps on it is smooth, and its values at a few Chebyshev nodes serve.
    """
    s = W.shape[2]
    by_step = W.reshape(M, r, 9, s)
    result = np.empty((M, 9, M, 9))
    rows, columns = np.ogrid[:r, :r]
    near = (E.toeplitz[np.abs(d * r + columns - rows)] for d in range(min(_SMOOTH_FROM, M)))
    _fill(result, by_step, near, 0)
    if r <= _NODES:
        far = (E.toeplitz[d * r + columns - rows] for d in range(_SMOOTH_FROM, M))
        _fill(result, by_step, far, _SMOOTH_FROM)
    else:
        nodes, basis = _chebyshev(r)
        steps = np.arange(_SMOOTH_FROM, M)[:, None, None]
        between = E.between(steps * r + nodes - nodes[:, None])
        _fill(result, np.einsum("mras,rq->mqas", by_step, basis), iter(between), _SMOOTH_FROM)
    left = np.einsum("mras,mrk->mask", by_step, E.left.reshape(M, r, -1))
    taken = np.einsum("mras,kmr->mask", by_step, E.right.reshape(-1, M, r))
    half = (left.reshape(9 * M, -1) @ taken.reshape(9 * M, -1).T).reshape(M, 9, M, 9)
    result -= half
    result -= half.transpose(2, 3, 0, 1)
    return result


def _fill(
    result: FloatArray, by_step: FloatArray, between: Iterator[FloatArray], first: int
) -> None:
    """Set the blocks of result (M, 9, M, 9) whose steps are first, first + 1, ... apart.

    by_step: (M, q, 9, s) responses of the q blocks or nodes of each step; between: for each
    distance the (q, q) covariance of those of two steps.
    """
    M, q, _, s = by_step.shape
    flat = np.ascontiguousarray(by_step.transpose(0, 2, 3, 1)).reshape(M, 9, s * q)
    right = np.ascontiguousarray(flat.swapaxes(1, 2))
    for d, T in enumerate(between, start=first):
        carried = (flat[: M - d].reshape(-1, q) @ T).reshape(M - d, 9, s * q)
        product = carried @ right[d:]
        c = np.arange(M - d)
        result[c, :, c + d] = product
        result[c + d, :, c] = product.swapaxes(1, 2)


def _chebyshev(r: int) -> tuple[FloatArray, FloatArray]:
    """Return _NODES Chebyshev nodes on blocks 0 ... r - 1 and their Lagrange basis (r, _NODES)."""
    k = np.arange(_NODES, dtype=float)
    nodes = 0.5 * (r - 1) * (1.0 - np.cos(np.pi * (k + 0.5) / _NODES))
    x = np.arange(r, dtype=float)[:, None, None]
    others = ~np.eye(_NODES, dtype=bool)
    ratio = np.where(others, x - nodes, 1.0) / np.where(others, nodes[:, None] - nodes, 1.0)
    return nodes, np.asarray(ratio.prod(axis=2))
