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
FLICKER_SPACING = 8.0  # s; flicker noise also changes within the minute of one spin
MAX_NODES = 1500  # of one channel; longer logs have a wider spacing
_MEAN_WEIGHT = 1e4  # sigmas of a step; makes the mean of the nodes zero to 1e-4 of a step


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
    channel does not use stay zero. The nodes are eliminated one after the other; their running
    mean goes along as a second state, so that the mean of all can be made zero at the end.
    """
    walk = float(drift.walk[channel])
    if walk <= 0.0:
        return rows
    nodes = drift.nodes(time)
    used = np.append(np.flatnonzero(np.any(rows[:, :-1] != 0.0, axis=0)), rows.shape[1] - 1)
    step = walk * np.sqrt(nodes[1] - nodes[0])
    parts = _intervals(nodes, time, weight * step, rows[:, used])
    share = 1.0 / len(nodes)
    # Columns: this node, the mean so far, the parameters, the right-hand side.
    state = np.zeros((1, 2 + len(used)))
    state[0, :2] = _MEAN_WEIGHT * np.array([-share, 1.0])
    for local in parts:
        # New columns: this node, the next one, the mean with the next one.
        before = np.zeros((len(state), 3 + len(used)))
        before[:, 0], before[:, 2] = state[:, 0], state[:, 1]
        before[:, 1] = -share * state[:, 1]
        before[:, 3:] = state[:, 2:]
        data = np.zeros((len(local) + 1, 3 + len(used)))
        data[:-1, :2], data[:-1, 3:] = local[:, :2], local[:, 2:]
        data[-1, :2] = -1.0, 1.0
        state = triangular(np.concatenate([before, data]))[1:, 1:]
    last = np.zeros((1, state.shape[1]))
    last[0, 1] = _MEAN_WEIGHT
    left = triangular(np.concatenate([state, last]))[2:, 2:]
    result = np.zeros((len(left), rows.shape[1]))
    result[:, used] = left
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


def _intervals(
    nodes: FloatArray, time: FloatArray, weight: FloatArray, rows: FloatArray
) -> Iterator[FloatArray]:
    """Yield the rows of each interval between two nodes, the columns of both nodes first."""
    count, spacing = len(nodes), nodes[1] - nodes[0]
    order = np.argsort(time, kind="stable")
    at = np.clip(((time[order] - nodes[0]) / spacing).astype(np.int64), 0, count - 2)
    edges = np.searchsorted(at, np.arange(count))
    for k in range(count - 1):
        which = order[edges[k] : edges[k + 1]]
        share = ((time[which] - nodes[k]) / spacing)[:, None]
        w = weight[which][:, None]
        local = np.concatenate([w * (1.0 - share), w * share, rows[which]], axis=1)
        yield triangular(local) if len(local) > local.shape[1] else local


def _node_priors(count: int, columns: int) -> FloatArray:
    """Return rows for the differences of the nodes and for their mean, in units of one step."""
    rows = np.zeros((count, count + columns))
    k = np.arange(count - 1)
    rows[k, k], rows[k, k + 1] = -1.0, 1.0
    rows[-1, :count] = _MEAN_WEIGHT / count
    return rows
