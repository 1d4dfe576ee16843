"""Covariance between the coarse steps of a window that slow sensor noise makes in the states.

The Toeplitz part of the blocks' covariance E depends on the distance of two coarse steps alone:
one small product a distance instead of one with n x n numbers.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.models.expected.sources import SlowCovariance

FloatArray = NDArray[np.float64]

# Slow noise between steps two apart is smooth: its logarithm has its singularity three half steps
# from their middles, so that 6 Chebyshev nodes leave (3 + sqrt(8))^-6 = 3e-5 of its variation.
_SMOOTH_FROM, _NODES = 2, 6


def sensor_covariance(
    W: FloatArray, covariances: Sequence[SlowCovariance], M: int, r: int
) -> FloatArray:
    """Return sum over s sensors of W_i E_i W_i^T between coarse steps, (M, 9, M, 9).

    W: (n, 9, s) responses of n = M r blocks; covariances: E of each sensor, or one for all. The
    Toeplitz part of E between two coarse steps depends on their distance alone: one product a
    distance. From two steps on it is smooth, and its values at a few Chebyshev nodes serve.
    """
    s = W.shape[2]
    by_step = W.reshape(M, r, 9, s)
    result = np.empty((M, 9, M, 9))
    rows, columns = np.ogrid[:r, :r]

    def exact(d: int) -> list[FloatArray]:
        return [E.toeplitz[np.abs(d * r + columns - rows)] for E in covariances]

    _fill(result, by_step, map(exact, range(min(_SMOOTH_FROM, M))), 0)
    if r <= _NODES:
        _fill(result, by_step, map(exact, range(_SMOOTH_FROM, M)), _SMOOTH_FROM)
    else:
        nodes, basis = _chebyshev(r)
        distance = np.arange(_SMOOTH_FROM, M)[:, None, None] * r + nodes - nodes[:, None]
        between = zip(*(E.between(distance) for E in covariances), strict=True)
        at_nodes = np.einsum("mras,rq->mqas", by_step, basis)
        _fill(result, at_nodes, between, _SMOOTH_FROM)
    left, taken = [], []
    for k, E in enumerate(covariances):
        own = by_step if len(covariances) == 1 else by_step[..., k : k + 1]
        left.append(np.einsum("mras,mrk->mask", own, E.left.reshape(M, r, -1)).reshape(9 * M, -1))
        taken.append(np.einsum("mras,kmr->mask", own, E.right.reshape(-1, M, r)).reshape(9 * M, -1))
    half = np.concatenate([*left, *taken], axis=1), np.concatenate([*taken, *left], axis=1)
    result -= (half[0] @ half[1].T).reshape(M, 9, M, 9)
    return result


def _fill(
    result: FloatArray,
    by_step: FloatArray,
    between: Iterable[Sequence[FloatArray]],
    first: int,
) -> None:
    """Set the blocks of result (M, 9, M, 9) whose steps are first, first + 1, ... apart.

    by_step: (M, q, 9, s) responses of the q blocks or nodes of each step; between: for each
    distance the (q, q) covariance of those of two steps, of each sensor or one for all.
    """
    M, q, _, s = by_step.shape
    # One product for the sensors together, or one a sensor; then sensors and blocks in one sum.
    together = np.ascontiguousarray(by_step.transpose(0, 2, 3, 1)).reshape(-1, q)
    apart = np.ascontiguousarray(by_step.transpose(3, 0, 2, 1)).reshape(s, -1, q)
    right = np.ascontiguousarray(by_step.transpose(0, 3, 1, 2)).reshape(M, s * q, 9)
    carried = np.empty((M, 9, s, q))
    for d, T in enumerate(between, start=first):
        if len(T) == 1:
            product = (together[: (M - d) * 9 * s] @ T[0]).reshape(M - d, 9, s * q) @ right[d:]
        else:
            for k in range(s):
                carried[d:, :, k] = (apart[k, : (M - d) * 9] @ T[k]).reshape(M - d, 9, q)
            product = carried[d:].reshape(M - d, 9, s * q) @ right[d:]
        _diagonal(result, d)[...] = product
        _diagonal(result.transpose(2, 3, 0, 1), d)[...] = product


def _diagonal(blocks: FloatArray, d: int) -> FloatArray:
    """Return a view (M - d, 9, 9) of the blocks [c, :, c + d, :] of blocks (M, 9, M, 9)."""
    row, a, column, b = blocks.strides
    shape = (blocks.shape[0] - d, blocks.shape[1], blocks.shape[3])
    return np.lib.stride_tricks.as_strided(blocks[0, :, d:], shape, (row + column, a, b))


def _chebyshev(r: int) -> tuple[FloatArray, FloatArray]:
    """Return _NODES Chebyshev nodes on blocks 0 ... r - 1 and their Lagrange basis (r, _NODES)."""
    k = np.arange(_NODES, dtype=float)
    nodes = 0.5 * (r - 1) * (1.0 - np.cos(np.pi * (k + 0.5) / _NODES))
    x = np.arange(r, dtype=float)[:, None, None]
    others = ~np.eye(_NODES, dtype=bool)
    ratio = np.where(others, x - nodes, 1.0) / np.where(others, nodes[:, None] - nodes, 1.0)
    return nodes, np.asarray(ratio.prod(axis=2))
