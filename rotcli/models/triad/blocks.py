"""Blocks of samples and their means: the data of the full calibration.

The mean of a reading over K samples spaced h around tc equals a sum over three nodes tc,
tc +- x with weights (1 - 2 omega, omega, omega). x and omega match the moments of the discrete
uniform distribution up to the fifth, so the mean is exact for every polynomial to degree 5.
The value at the middle alone is wrong by turn^2/24 (28 mm/s^2 at 15 deg), and the mean of a
continuous distribution by h^2 w^2/24 (13 ug at 100 deg/s and 100 Hz).
"""

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.triad.kinematics import Table
from rotcli.models.triad.motion import TableMotion
from rotcli.models.triad.sensor import readings
from rotcli.units import DEG, FloatArray

IntArray = NDArray[np.int64]

STILL, TURN, RAMP = 0, 1, 2
KIND_NAMES = ("still", "turn", "ramp")

MAX_BLOCK_TURN = 15.0 * DEG  # rad; the three nodes leave 3e-6 m/s^2 at 15 deg
MAX_BLOCK_TIME = 0.5  # s, of a block in motion
MAX_STILL_TIME = 10.0  # s; shorter than the spacing of bias nodes
MIN_BLOCK_SAMPLES = 3  # three nodes need three samples
TRIM = 0.06  # s cut at both ends of each step: there the acceleration jumps


@dataclass(frozen=True, eq=False)
class Blocks:
    """Blocks of samples.

    time (m,) of the middle, s; count (m,) samples; kind (m,) STILL, TURN or RAMP; mounting (m,);
    angles, rates, accelerations (K, 3, m) at the nodes tc, tc - x, tc + x, rad and s; means (6, m)
    of the readings, gyros first, SI.
    """

    time: FloatArray
    count: IntArray
    kind: IntArray
    mounting: IntArray
    angles: FloatArray
    rates: FloatArray
    accelerations: FloatArray
    means: FloatArray

    def __len__(self) -> int:
        return len(self.time)

    def part(self, which: slice | NDArray[np.bool_] | IntArray) -> "Blocks":
        """Return some of the blocks."""
        return Blocks(*(getattr(self, f.name)[..., which] for f in fields(self)))

    def chunks(self, size: int) -> Iterator["Blocks"]:
        """Yield the blocks in groups of at most `size`."""
        for first in range(0, len(self), size):
            yield self.part(slice(first, first + size))


def concatenate(parts: list[Blocks]) -> Blocks:
    """Return blocks one after the other."""
    return Blocks(
        *(np.concatenate([getattr(b, f.name) for b in parts], axis=-1) for f in fields(Blocks))
    )


def node_offset(count: IntArray, spacing: float) -> FloatArray:
    """Return the distance x (m,), s, of the outer nodes from the middle of each block."""
    result: FloatArray = spacing * np.sqrt((3.0 * count.astype(float) ** 2 - 7.0) / 20.0)
    return result


def node_weight(count: IntArray) -> FloatArray:
    """Return the weight omega (m,) of each outer node.

    >>> node_weight(np.array([3]))  # three samples are the three nodes
    array([0.33333333])
    """
    square = count.astype(float) ** 2
    result: FloatArray = (square - 1.0) / (24.0 * (3.0 * square - 7.0) / 20.0)
    return result


def expected_means(table: Table, x: FloatArray, blocks: Blocks) -> FloatArray:
    """Return the model's block means (6, m), SI."""
    axes, nodes, m = blocks.angles.shape
    flat = [
        np.ascontiguousarray(a).reshape(axes, nodes * m)
        for a in (blocks.angles, blocks.rates, blocks.accelerations)
    ]
    y = readings(table, x, flat[0], flat[1], flat[2], np.tile(blocks.mounting, nodes))
    middle, before, after = y.reshape(6, nodes, m).transpose(1, 0, 2)
    omega = node_weight(blocks.count)
    result: FloatArray = middle + omega * (before + after - 2.0 * middle)
    return result


def split_samples(count: int, turn: float, rate: float, *, still: bool) -> IntArray:
    """Return the sizes of the blocks that `count` samples of one step are cut into.

    turn: rad, duration of the step times its largest table rate; rate: Hz.
    """
    if count < MIN_BLOCK_SAMPLES:
        return np.zeros(0, dtype=np.int64)
    longest = MAX_STILL_TIME if still else MAX_BLOCK_TIME
    parts = max(count / rate / longest, 0.0 if still else turn / MAX_BLOCK_TURN)
    parts = max(1, min(int(np.ceil(parts - 1e-9)), count // MIN_BLOCK_SAMPLES))
    edges = np.round(np.linspace(0, count, parts + 1)).astype(np.int64)
    return np.diff(edges)


def blocks_of_motion(motion: TableMotion, rate: float) -> Blocks:
    """Return the blocks of a planned motion sampled at `rate` (Hz); the means are zero."""
    first, last = motion.start[:-1] + TRIM, motion.start[1:] - TRIM
    begin = np.ceil((first - motion.start[0]) * rate - 1e-9).astype(np.int64)
    end = np.floor((last - motion.start[0]) * rate + 1e-9).astype(np.int64) + 1
    middle, counts, steps = [], [], []
    for k in range(len(first)):
        duration = motion.start[k + 1] - motion.start[k]
        # The fastest block of a ramp must not turn too far either.
        end_rate = motion.rate[k] + motion.acceleration[k] * duration
        moved = duration * np.maximum(np.abs(motion.rate[k]), np.abs(end_rate))
        still = not (motion.rate[k].any() or motion.acceleration[k].any())
        sizes = split_samples(int(end[k] - begin[k]), float(moved.max()), rate, still=still)
        before = begin[k] + np.concatenate([[0], np.cumsum(sizes)[:-1]]) if len(sizes) else sizes
        middle.append((before + 0.5 * (sizes - 1)) / rate + motion.start[0])
        counts.append(sizes)
        steps.append(np.full(len(sizes), k))
    time, count, step = np.concatenate(middle), np.concatenate(counts), np.concatenate(steps)
    offset = node_offset(count, 1.0 / rate)
    nodes = np.stack([time, time - offset, time + offset])
    shape = (motion.angle.shape[1], 3, len(time))
    moved = [a.reshape(shape) for a in motion.at(nodes.ravel(), np.tile(step, 3))]
    ramp = motion.acceleration[step].any(axis=1)
    turn = motion.rate[step].any(axis=1)
    kind = np.where(ramp, RAMP, np.where(turn, TURN, STILL))
    return Blocks(
        time, count, kind, motion.mounting[step], moved[0], moved[1], moved[2],
        np.zeros((6, len(time))),
    )  # fmt: skip
