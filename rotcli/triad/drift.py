"""Bias nodes: piecewise linear drift of each channel, eliminated from the rows of the fit.

White noise alone does not describe a MEMS gyro over 40 minutes. The deviation c(t) from the mean
bias is piecewise linear over nodes; its differences between nodes have the sigma of a random walk
q sqrt(spacing), and the mean of all nodes is zero, so that the bias stays the mean bias of the
run. The nodes are eliminated channel by channel with orthogonal rotations (QR), so the rows that
remain describe the other parameters alone.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.models.triad.leastsquares import triangular

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

NODE_SPACING = 30.0  # s; shorter than the time in which a MEMS bias changes by its white noise
MAX_NODES = 400  # of one channel; longer logs have a wider spacing
_MEAN_WEIGHT = 1e3  # sigmas of a step; makes the mean of the nodes zero to a thousandth of a step


@dataclass(frozen=True, eq=False)
class Drift:
    """Random walk q (6,) of each channel's bias: rad/s/sqrt(s) and m/s^2/sqrt(s)."""

    walk: FloatArray
    spacing: float = NODE_SPACING

    def nodes(self, time: FloatArray) -> FloatArray:
        """Return the times of the nodes (J,), s, over the blocks' times."""
        first, last = float(time[0]), float(time[-1])
        spacing = max(self.spacing, (last - first) / (MAX_NODES - 1))
        steps = max(1, int(np.ceil((last - first) / spacing - 1e-9)))
        return np.linspace(first, last, steps + 1)


def eliminate(
    drift: Drift, channel: int, time: FloatArray, weight: FloatArray, rows: FloatArray
) -> FloatArray:
    """Return rows [A | r] without nodes that hold all that the channel says of the parameters.

    time (m,), s; weight (m,): 1 / sigma of each row; rows (m, p + 1), weighted. Columns that the
    channel does not use stay zero.
    """
    walk = float(drift.walk[channel])
    if walk <= 0.0:
        return rows
    nodes = drift.nodes(time)
    used = np.flatnonzero(np.any(rows[:, :-1] != 0.0, axis=0))
    used = np.append(used, rows.shape[1] - 1)
    step = walk * np.sqrt(nodes[1] - nodes[0])
    parts = list(_by_interval(nodes, time, weight * step, rows[:, used]))
    parts.append(_node_priors(len(nodes), len(used)))
    stacked = triangular(np.concatenate(parts))
    result = np.zeros((len(stacked) - len(nodes), rows.shape[1]))
    result[:, used] = stacked[len(nodes) :, len(nodes) :]
    return result


def smoothed(
    drift: Drift, channel: int, time: FloatArray, weight: FloatArray, residual: FloatArray
) -> FloatArray:
    """Return the drift (m,) of a channel at the blocks from residuals (m,) without it.

    weight (m,): 1 / sigma of each residual.
    """
    walk = float(drift.walk[channel])
    if walk <= 0.0:
        return np.zeros(len(time))
    nodes = drift.nodes(time)
    count, spacing = len(nodes), float(nodes[1] - nodes[0])
    at = np.clip(((time - nodes[0]) / spacing).astype(np.int64), 0, count - 2)
    share = (time - nodes[at]) / spacing
    prior = _node_priors(count, 0) / (walk * np.sqrt(spacing))
    normal, right, w2 = prior.T @ prior, np.zeros(count), weight**2
    for i, a in ((0, 1.0 - share), (1, share)):
        np.add.at(right, at + i, w2 * a * residual)
        for j, b in ((0, 1.0 - share), (1, share)):
            np.add.at(normal, (at + i, at + j), w2 * a * b)
    c = np.linalg.solve(normal, right)
    return np.asarray((1.0 - share) * c[at] + share * c[at + 1])


def _by_interval(
    nodes: FloatArray, time: FloatArray, weight: FloatArray, rows: FloatArray
) -> Iterator[FloatArray]:
    """Yield the rows of each interval between two nodes, compressed by QR; node columns first."""
    count, spacing = len(nodes), nodes[1] - nodes[0]
    order = np.argsort(time, kind="stable")
    at = np.clip(((time[order] - nodes[0]) / spacing).astype(np.int64), 0, count - 2)
    edges = np.searchsorted(at, np.arange(count))
    for k in range(count - 1):
        which = order[edges[k] : edges[k + 1]]
        if len(which) == 0:
            continue
        share = ((time[which] - nodes[k]) / spacing)[:, None]
        w = weight[which][:, None]
        local = np.concatenate([w * (1.0 - share), w * share, rows[which]], axis=1)
        if len(local) > local.shape[1]:
            local = triangular(local)
        wide = np.zeros((len(local), count + rows.shape[1]))
        wide[:, k : k + 2] = local[:, :2]
        wide[:, count:] = local[:, 2:]
        yield wide


def _node_priors(count: int, columns: int) -> FloatArray:
    """Return rows for the differences of the nodes and for their mean, in units of one step."""
    rows = np.zeros((count, count + columns))
    k = np.arange(count - 1)
    rows[k, k], rows[k, k + 1] = -1.0, 1.0
    rows[-1, :count] = _MEAN_WEIGHT / count
    return rows
