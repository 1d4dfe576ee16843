"""Slow noise of the biases: the covariance of block means, and rows freed of it (whitened).

White noise alone does not describe a MEMS gyro over 40 minutes. Flicker noise (bias instability),
rate random walk and Gauss-Markov noise correlate the block means of a channel; `mean_covariance`
gives their covariance. The rows of the least squares are multiplied by an inverse factor of it, so
that ordinary least squares of the new rows is generalised least squares of the data.

The covariance of all 7000 blocks of an hour at once is too large. So each cell of consecutive
blocks is freed of what the cell before predicts, block by block, and of what the means of older
cells predict: single cells first, then pairs, fours and so on. Given these, a block of 1/f noise
hardly depends on the details of the distant past. Every prediction is exact (Vecchia, J. R.
Statist. Soc. B 50 (1988) 297); sigmas agree with those of the complete covariance within 1.5 %.

The bias that is estimated is the mean bias from the first to the last block: the slow noise counts
less its mean over that time. So its covariance is well defined although flicker noise has none.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import SlowNoise, mean_covariance
from rotcli.models.triad.blocks import Blocks
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]

CELL_BLOCKS = 24  # in a cell: 4 to 12 s of motion
KEPT_BLOCKS = 20_000  # their Jacobian rows (50 MB) stay in memory between passes


@dataclass(frozen=True, eq=False)
class Drift:
    """Slow noise of the six channels, gyros first, SI; interval: s between samples."""

    noise: tuple[SlowNoise, ...]
    interval: float

    def __bool__(self) -> bool:
        """Whether any channel has slow noise."""
        return any(_has_size(noise) for noise in self.noise)

    def scaled(self, factors: FloatArray) -> "Drift":
        """Return the noise times a factor (6,) for each channel."""
        noise = tuple(
            replace(
                one,
                bias_instability=one.bias_instability * float(f),
                rate_random_walk=one.rate_random_walk * float(f),
                markov_sigma=one.markov_sigma * float(f),
            )
            for one, f in zip(self.noise, factors, strict=True)
        )
        return Drift(noise, self.interval)


def _has_size(noise: SlowNoise) -> bool:
    return bool(noise.bias_instability or noise.rate_random_walk or noise.markov_sigma)


@dataclass(frozen=True, eq=False)
class _Group:
    """Channels of equal noise: their indices, slow noise, white noise of one sample (SI)."""

    channels: list[int]
    slow: SlowNoise
    sigma_1: float


class _Past:
    """Means over older cells of one group: single cells, pairs, fours and so on, oldest first.

    start, end: s; samples; level: cells as power of two; rows: (q,) mean row of each.
    """

    def __init__(self) -> None:
        """Begin without any cell."""
        self.start: list[float] = []
        self.end: list[float] = []
        self.samples: list[float] = []
        self.level: list[int] = []
        self.rows: list[FloatArray] = []

    def __len__(self) -> int:
        return len(self.rows)

    def add(self, start: float, end: float, samples: float, row: FloatArray) -> None:
        """Add the mean of one more cell; of three of a level the older two are joined."""
        self.start.append(start)
        self.end.append(end)
        self.samples.append(samples)
        self.level.append(0)
        self.rows.append(row)
        level = 0
        while self.level.count(level) > 2:
            self._join(self.level.index(level))
            level += 1

    def _join(self, k: int) -> None:
        """Replace the means k and k + 1 by their mean."""
        a, b = self.samples[k], self.samples[k + 1]
        self.rows[k] = (a * self.rows[k] + b * self.rows.pop(k + 1)) / (a + b)
        self.end[k] = self.end.pop(k + 1)
        self.samples[k] += self.samples.pop(k + 1)
        self.level[k] += 1
        del self.start[k + 1], self.level[k + 1]


class Whitening:
    """Inverse factor of the covariance of the block means of each channel.

    Without slow noise it divides by the white noise alone.
    """

    def __init__(self, blocks: Blocks, sigma_1: FloatArray, drift: Drift | None) -> None:
        """Prepare the cells of blocks in time order; sigma_1: (6,), SI."""
        self.sigma_1 = sigma_1
        self.count = blocks.count.astype(float)
        self.groups: list[_Group] = []
        if drift is None:
            return
        half = 0.5 * drift.interval * self.count
        self.start, self.end = blocks.time - half, blocks.time + half
        self.span = float(self.end[-1] - self.start[0])
        self.factors: dict[tuple[int, int], FloatArray] = {}
        self._shared: tuple[int, dict[SlowNoise, FloatArray]] = (-1, {})
        # Channels of equal noise share their factors.
        keys = [(noise, float(s)) for noise, s in zip(drift.noise, sigma_1, strict=True)]
        for slow, sigma in dict.fromkeys(key for key in keys if _has_size(key[0])):
            channels = [c for c in range(6) if keys[c] == (slow, sigma)]
            self.groups.append(_Group(channels, slow, sigma))

    def chunks(self, size: int) -> Iterator[slice]:
        """Yield slices of at most `size` blocks that end where a cell ends."""
        size = max(1, size // CELL_BLOCKS) * CELL_BLOCKS
        for first in range(0, len(self.count), size):
            yield slice(first, min(first + size, len(self.count)))

    def begin(self) -> "Whitened":
        """Return one pass over all pieces, in their order."""
        return Whitened(self)

    def factor(self, k: int, first: int, past: _Past) -> FloatArray:
        """Return F (n, j + n' + n) that whitens the cell from block `first` on.

        It multiplies the rows of the j past means, of the n' blocks of the cell before and of the
        n of the cell.
        """
        key = (k, first)
        if key not in self.factors:
            group = self.groups[k]
            at = slice(max(0, first - CELL_BLOCKS), min(first + CELL_BLOCKS, len(self.count)))
            # The last interval is all time: the slow noise counts less its mean over it.
            W = self._slow(group.slow, first, past, at)
            S = W[:-1, :-1] - W[:-1, -1:] - W[-1:, :-1] + W[-1, -1]
            samples = np.concatenate([past.samples, self.count[at]])
            S[np.diag_indices_from(S)] += group.sigma_1**2 / samples
            known = len(past) + first - at.start
            factor = np.linalg.inv(np.linalg.cholesky(S))[known:]
            self.factors[key] = factor.copy()  # without the rows above, which a view would keep
        return self.factors[key]

    def _slow(self, slow: SlowNoise, first: int, past: _Past, at: slice) -> FloatArray:
        """Return the covariance of the slow noise of past means, of the blocks `at`, of all time.

        Groups whose noises differ only in size share the matrices of unit size.
        """
        if self._shared[0] != first:
            self._shared = (first, {})
        units = self._shared[1]
        size_of_all = len(past) + at.stop - at.start + 1
        total = np.zeros((size_of_all, size_of_all))
        for name in ("bias_instability", "rate_random_walk", "markov_sigma"):
            size = getattr(slow, name)
            unit = SlowNoise(**{name: 1.0}, markov_time=slow.markov_time)
            if size and unit not in units:
                start = np.concatenate([past.start, self.start[at], self.start[:1]])
                end = np.concatenate([past.end, self.end[at], self.end[-1:]])
                units[unit] = mean_covariance(start, end, unit, span=self.span)
            if size:
                total += size**2 * units[unit]
        return total


class Whitened:
    """One pass of a whitening over the pieces; each depends on those before."""

    def __init__(self, whitening: Whitening) -> None:
        """Begin before the first piece."""
        self._of = whitening
        self._past: list[_Past] = []
        self._cell: list[FloatArray] = []

    def rows(self, which: slice, rows: FloatArray) -> FloatArray:
        """Return rows (6, n, q) of the blocks `which` with unit covariance."""
        of = self._of
        weight = np.sqrt(of.count[which]) / of.sigma_1[:, None]
        result: FloatArray = rows * weight[:, :, None]
        if not of.groups:
            return result
        n, q = rows.shape[1:]
        # The rows of a group's channels side by side.
        together = [np.concatenate(rows[group.channels], axis=1) for group in of.groups]
        if not self._past:
            self._cell = [one[:0] for one in together]
            self._past = [_Past() for _ in together]
        for first in range(0, n, CELL_BLOCKS):
            for k, group in enumerate(of.groups):
                cell = together[k][first : first + CELL_BLOCKS]
                white = self._of_cell(k, which.start + first, cell)
                for j, channel in enumerate(group.channels):
                    result[channel, first : first + len(cell)] = white[:, j * q : (j + 1) * q]
        return result

    def _of_cell(self, k: int, first: int, rows: FloatArray) -> FloatArray:
        """Return the rows of the cell from block `first` on with unit covariance."""
        of, past, before = self._of, self._past[k], self._cell[k]
        known = np.concatenate([*(row[None, :] for row in past.rows), before, rows])
        white: FloatArray = of.factor(k, first, past) @ known
        if len(before):
            weight = of.count[first - CELL_BLOCKS : first]
            samples = float(weight.sum())
            start, end = float(of.start[first - CELL_BLOCKS]), float(of.end[first - 1])
            past.add(start, end, samples, weight @ before / samples)
        self._cell[k] = rows
        return white
