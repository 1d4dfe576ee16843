"""Covariance between the coarse steps of a window that slow sensor noise makes in the states.

The Toeplitz part of the blocks' covariance E depends on the distance of two coarse steps alone:
one small product a distance instead of one with n x n numbers.
"""

from collections.abc import Sequence

import numpy as np

from rotcli.models.expected.sources import SlowCovariance, toeplitz_between
from rotcli.units import FloatArray

# Slow noise between steps two apart is smooth: its logarithm has its singularity three half steps
# from their middles, so that 6 Chebyshev nodes leave (3 + sqrt(8))^-6 = 3e-5 of its variation.
_SMOOTH_FROM, _NODES = 2, 6


def sensor_covariance(
    W: FloatArray, covariances: Sequence[SlowCovariance], M: int, r: int
) -> FloatArray:
    """Return sum over s sensors of W_i E_i W_i^T between coarse steps, (M, 9, M, 9).

    W: (n, 9, s) responses of n = M r blocks; covariances: E of each sensor, or one for all. From
    two steps on the Toeplitz part of E is smooth, and its values at a few Chebyshev nodes of each
    step serve; nearer steps are replaced by all their blocks.
    """
    s = W.shape[2]
    by_step = W.reshape(M, r, 9, s)
    nodes, basis = _chebyshev(r) if r > _NODES else (np.arange(r, dtype=float), np.eye(r))
    distance = np.arange(M)[:, None, None] * r + nodes - nodes[:, None]
    at_nodes = np.einsum("mras,rq->smaq", by_step, basis)
    own = [slice(k, k + 1) for k in range(s)] if len(covariances) > 1 else [slice(s)]
    left, taken = [], []
    for sensors, E in zip(own, covariances, strict=True):
        W_i = by_step[..., sensors]
        left.append(np.einsum("mras,mrk->mask", W_i, E.left.reshape(M, r, -1)).reshape(M, 9, -1))
        taken.append(np.einsum("mras,kmr->mask", W_i, E.right.reshape(-1, M, r)).reshape(M, 9, -1))
    of_contrast = np.concatenate([*left, *taken], 2), np.concatenate([*taken, *left], 2)
    result = _smooth(at_nodes, toeplitz_between(covariances, distance), of_contrast)
    rows, columns = np.ogrid[:r, :r]
    for d in range(min(_SMOOTH_FROM, M)):
        near = np.abs(d * r + columns - rows)
        exact = -(of_contrast[0][: M - d] @ of_contrast[1][d:].transpose(0, 2, 1))
        for sensors, E in zip(own, covariances, strict=True):
            exact += _products(by_step[..., sensors], E.toeplitz[near], d)
        _diagonal(result, d)[...] = exact
        _diagonal(result.transpose(2, 3, 0, 1), d)[...] = exact
    return result


def _smooth(
    at_nodes: FloatArray, between: Sequence[FloatArray], less: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return the covariance (M, 9, M, 9) of all steps by the values at their nodes.

    at_nodes: (s, M, 9, q) responses of each sensor; between: (M, q, q) covariance between the
    nodes of two steps that are 0 ... M - 1 apart, of each sensor or one for all; less: two factors
    (M, 9, k), whose product is subtracted.
    """
    s, M, _, q = at_nodes.shape
    apart = [np.ascontiguousarray(T.transpose(1, 0, 2)) for T in between]  # distances in the middle
    by_sensor = at_nodes.transpose(1, 0, 3, 2).reshape(M, s * q, 9)
    last = np.concatenate([by_sensor, less[1].transpose(0, 2, 1)], axis=1)
    result, carried = np.empty((M, 9, M, 9)), np.empty((9, M, last.shape[1]))
    # Step by step: one product for all of them is slower, for its pages of memory are new.
    for m in range(M):
        after = M - m
        row = carried[:, :after]
        for k in range(s):
            with_later = apart[k % len(apart)][:, :after].reshape(q, after * q)
            row[:, :, k * q : (k + 1) * q] = (at_nodes[k, m] @ with_later).reshape(9, after, q)
        row[:, :, s * q :] = -less[0][m][:, None]
        product = row.transpose(1, 0, 2) @ last[m:]
        result[m, :, m:], result[m:, :, m] = product.transpose(1, 0, 2), product.transpose(0, 2, 1)
    return result


def _products(by_step: FloatArray, T: FloatArray, d: int) -> FloatArray:
    """Return W_i T W_(i+d)^T of all pairs of steps d apart, (M - d, 9, 9), summed over sensors.

    by_step: (M, r, 9, s); T: (r, r) between the blocks of the two steps.
    """
    M, r, _, s = by_step.shape
    first = by_step[: M - d].transpose(0, 2, 3, 1).reshape(-1, r) @ T
    last = by_step[d:].transpose(0, 3, 1, 2).reshape(M - d, s * r, 9)
    return np.asarray(first.reshape(M - d, 9, s * r) @ last)


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
