"""Reduce logs to blocks of samples: means of the readings, table angles at the nodes.

A log of hours comes in chunks; blocks never cross the end of a chunk's complete steps, and only
blocks stay in memory.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.triad.blocks import (
    MIN_BLOCK_SAMPLES,
    RAMP,
    STILL,
    TRIM,
    TURN,
    Blocks,
    concatenate,
    node_offset,
    split_samples,
)
from rotcli.triad.table.steps import (
    RAMP_ACCELERATION,
    Steps,
    encoder_noise,
    find_steps,
    fit_cubics,
)
from rotcli.units import DEG, FloatArray

IntArray = NDArray[np.int64]

_CHUNK_BLOCKS = 4096  # whose encoder samples are worked on at once
_CUBIC_SIGMAS = 6.0  # of the encoder's noise, for the largest of some 25 deviations in 1e4 blocks
_CUBIC_FLOOR = 2e-6 * DEG  # rad: digits of a log; 1e-5 deg/s over half a second
_MIN_TABLE_SAMPLES = 6  # of one cubic; four would have no redundancy


@dataclass(frozen=True, eq=False)
class TableLog:
    """A table log on an even clock: time (m,), s; angles (m, K), rad, without wraps."""

    time: FloatArray
    angles: FloatArray


@dataclass(frozen=True, eq=False)
class Samples:
    """Consecutive IMU samples: index of the first, readings (n, 6), gyros first, SI."""

    first: int
    readings: FloatArray


@dataclass(frozen=True)
class ImuClock:
    """Even clock of the IMU log: time (s) of sample 0, and the spacing (s).

    The time of a mean or an increment is the middle of its interval.
    """

    start: float
    spacing: float


@dataclass(frozen=True, eq=False)
class Layout:
    """Which samples form which block: first sample and count (m,), step of each."""

    first: IntArray
    count: IntArray
    step: IntArray


def lay_out(clock: ImuClock, samples: int, steps: Steps, *, trim: float = TRIM) -> Layout:
    """Return the blocks of an IMU log of some samples on the steps of a table log."""
    begin = np.ceil((steps.start + trim - clock.start) / clock.spacing - 1e-9).astype(np.int64)
    end = np.floor((steps.end - trim - clock.start) / clock.spacing + 1e-9).astype(np.int64) + 1
    begin, end = np.maximum(begin, 0), np.minimum(end, samples)
    firsts, counts, owners = [], [], []
    for k in range(len(begin)):
        turn = float(steps.peak_rate[k]) * max(0, int(end[k] - begin[k])) * clock.spacing
        sizes = split_samples(
            max(0, int(end[k] - begin[k])), turn, 1.0 / clock.spacing, still=bool(steps.still[k])
        )
        before = np.cumsum(sizes) - sizes
        firsts.append(begin[k] + before)
        counts.append(sizes)
        owners.append(np.full(len(sizes), k))
    if not firsts:
        nothing = np.zeros(0, dtype=np.int64)
        return Layout(nothing, nothing, nothing)
    layout = Layout(np.concatenate(firsts), np.concatenate(counts), np.concatenate(owners))
    keep = layout.count >= MIN_BLOCK_SAMPLES
    return Layout(layout.first[keep], layout.count[keep], layout.step[keep])


def block_means(chunks: Iterable[Samples], layout: Layout) -> tuple[FloatArray, FloatArray]:
    """Return the means (6, m) of all blocks and the variance (6, m) of one sample in each.

    chunks: consecutive samples of the log. The variance comes from third differences, which the
    motion does not enlarge: at 100 deg/s and 100 Hz gravity adds 5e-5 m/s^2.
    """
    m = len(layout.first)
    sums, squares = np.zeros((6, m)), np.zeros((6, m))
    differences = np.zeros(m)
    last = layout.first + layout.count
    for chunk in chunks:
        n = len(chunk.readings)
        a, b = chunk.first, chunk.first + n
        which = np.flatnonzero((layout.first < b) & (last > a))
        if len(which) == 0:
            continue
        low, high = np.maximum(layout.first[which], a) - a, np.minimum(last[which], b) - a
        padded = np.concatenate([chunk.readings, np.zeros((1, 6))])
        pairs = np.column_stack([low, high]).ravel()
        sums[:, which] += np.add.reduceat(padded, pairs, axis=0)[::2].T
        thirds = np.zeros((n + 1, 6))
        thirds[3:n] = np.diff(chunk.readings, n=3, axis=0) ** 2
        at = np.column_stack([np.minimum(low + 3, high), high]).ravel()
        found = np.add.reduceat(thirds, at, axis=0)[::2].T
        found[:, high - low < 4] = 0.0
        squares[:, which] += found
        differences[which] += np.maximum(high - low - 3, 0)
    return sums / layout.count, squares / (20.0 * np.maximum(differences, 1))


def table_blocks(
    clock: ImuClock, table: TableLog, steps: Steps, layout: Layout, mounting: IntArray
) -> tuple[Blocks, NDArray[np.bool_]]:
    """Return the blocks with the table's motion at their nodes, and which of them may be used.

    The means are zero. A block in which the angle is no cubic of time must not be used.
    """
    count = layout.count
    time = clock.start + (layout.first + 0.5 * (count - 1)) * clock.spacing
    spacing = float((table.time[-1] - table.time[0]) / (len(table.time) - 1))
    half = np.maximum(0.5 * count * clock.spacing, 0.5 * _MIN_TABLE_SAMPLES * spacing)
    start, end = steps.start[layout.step], steps.end[layout.step]
    low = np.searchsorted(table.time, np.maximum(time - half, start) - 1e-9)
    high = np.searchsorted(table.time, np.minimum(time + half, end) + 1e-9)
    high = np.maximum(high, np.minimum(low + 4, len(table.time)))
    low = np.maximum(0, np.minimum(low, high - 4))
    cubic = np.empty((4, table.angles.shape[1], len(time)))
    misfit = np.empty(len(time))
    for first in range(0, len(time), _CHUNK_BLOCKS):
        part = slice(first, first + _CHUNK_BLOCKS)
        cubic[:, :, part], misfit[part] = fit_cubics(
            table.time, table.angles, time[part], half[part], low[part], high[part]
        )
    still = steps.still[layout.step]
    cubic[1:, :, still] = 0.0
    if still.any():
        at = np.flatnonzero(still)
        for k in at:
            cubic[0][:, k] = table.angles[low[k] : high[k]].mean(axis=0)
    x = node_offset(count, clock.spacing) / half
    u = np.stack([np.zeros_like(x), -x, x])
    c = cubic[:, :, None, :]
    angles = c[0] + u * (c[1] + u * (c[2] + u * c[3]))
    rates = (c[1] + u * (2 * c[2] + 3 * u * c[3])) / half
    accelerations = (2 * c[2] + 6 * u * c[3]) / half**2
    ramp = np.abs(accelerations[:, 0]).max(axis=0) > RAMP_ACCELERATION
    kind = np.where(still, STILL, np.where(ramp, RAMP, TURN))
    # Where no cubic describes the motion, the mean over the nodes is wrong.
    limit = _CUBIC_SIGMAS * encoder_noise(table.angles, table.time) + _CUBIC_FLOOR
    sound = still | (misfit < limit)
    means = np.zeros((6, len(time)))
    return Blocks(time, count, kind, mounting, angles, rates, accelerations, means), sound


def reduce_logs(
    chunks: Iterable[Samples], clock: ImuClock, samples: int, table: TableLog
) -> tuple[Blocks, FloatArray, Steps]:
    """Return the blocks of both logs, the variance (6,) of one sample, and the table's steps."""
    steps = find_steps(table.time, table.angles)
    layout = lay_out(clock, samples, steps)
    means, scatter = block_means(chunks, layout)
    mounting = np.zeros(len(layout.first), dtype=np.int64)
    blocks, sound = table_blocks(clock, table, steps, layout, mounting)
    # Vibration of a turning table is no noise of the sensor: still blocks where there are any.
    still = steps.still[layout.step]
    finite = np.all(np.isfinite(means), axis=0) & np.all(np.isfinite(scatter), axis=0)
    still = still & finite
    weight = (layout.count - 3.0) * (still if np.any(still) else finite)
    known = np.where(finite, scatter, 0.0)
    variance = (known * weight).sum(axis=1) / max(float(weight.sum()), 1.0)
    sound &= finite
    filled = Blocks(
        blocks.time, blocks.count, blocks.kind, blocks.mounting, blocks.angles, blocks.rates,
        blocks.accelerations, means,
    )  # fmt: skip
    return filled.part(sound), variance, steps


def join(parts: Iterator[Blocks]) -> Blocks:
    """Return the blocks of several recordings as one."""
    return concatenate(list(parts))
