"""Distinguish a bias step, a warm-up or a temperature drift from the slow noise of a record.

The record is averaged over BLOCKS blocks. White, flicker and random-walk noise of any size alone
are compared with the same noise plus one deterministic shape: a step at each block, exponentials,
a straight line, the temperature. Both likelihoods are maximal over the noise, on a grid of its
ratios with the scale in closed form (flicker noise and random walk have a covariance of contrasts
only, `rotcli.models.mean_covariance`). The grid does not depend on the log: it is whitened once.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Literal

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import SlowNoise, mean_covariance
from rotcli.units import FloatArray

BLOCKS = 96
# Twice the gain of log-likelihood that noise alone reaches in about one of 10,000 logs, over
# all steps and exponentials; for one known shape, chi-squared of one degree of freedom.
MIN_GAIN = 25.0
MIN_TEMPERATURE_GAIN = 16.0
_MIN_ADVANTAGE = 12.0  # of a step or an exponential over a straight line
_MAX_DISADVANTAGE = 6.0  # of the temperature against another shape: its cause is known
_MIN_SIDE = 3  # blocks on either side of a step
MAX_DRIFTS = 4  # of one axis
_RATIOS = np.concatenate([[0.0], np.geomspace(3e-3, 100.0, 7)])  # of B^2 L and K^2 L^2 to N^2
_TIMES = np.geomspace(2.0, BLOCKS / 1.5, 12)  # blocks, correlation times of an exponential
_MIN_TEMPERATURE_SPAN = 0.2  # degC; less is the resolution of thermometers

Kind = Literal["step", "exponential", "temperature"]


@dataclass(frozen=True)
class Drift:
    """A deterministic part of an axis: amplitude and sigma in the unit of the readings.

    step: the bias changes by amplitude at `start` (s). exponential: amplitude exp(-(t - start)/T),
    `time` T (s). temperature: amplitude per degC from `reference` (degC).
    """

    kind: Kind
    amplitude: float
    sigma: float
    start: float = 0.0
    time: float = 0.0
    reference: float = 0.0

    def values(self, time: FloatArray, temperature: FloatArray | None) -> FloatArray:
        """Return the drift (n,) at times (n,), s; temperature (n,) degC where it depends on it."""
        if self.kind == "step":
            return np.asarray(self.amplitude * (time >= self.start))
        if self.kind == "exponential":
            return np.asarray(self.amplitude * np.exp(-(time - self.start) / self.time))
        assert temperature is not None
        return self.amplitude * (temperature - self.reference)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Whitening of contrasts for each ratio of noises.

    contrast (b - 1, b); whiten (g, b - 1, b - 1); log_determinant (g,) of the covariances;
    steps (g, b - 1, s), exponentials (g, b - 1, e), line (g, b - 1): whitened shapes.
    """

    contrast: FloatArray
    whiten: FloatArray
    log_determinant: FloatArray
    steps: FloatArray
    exponentials: FloatArray
    line: FloatArray


def _step_shapes() -> FloatArray:
    """Return steps (b, s) before the blocks _MIN_SIDE to BLOCKS - _MIN_SIDE."""
    places = np.arange(_MIN_SIDE, BLOCKS - _MIN_SIDE + 1)
    return (np.arange(BLOCKS)[:, None] >= places).astype(float)


def _decays() -> FloatArray:
    """Return the block means (b, e) of exp(-t/T)."""
    k = np.arange(BLOCKS)[:, None]
    return np.asarray(np.exp(-k / _TIMES) * -np.expm1(-1.0 / _TIMES) * _TIMES)


@lru_cache(maxsize=1)
def _grid() -> _Grid:
    edges = np.arange(BLOCKS + 1, dtype=float)
    first, last = edges[:-1], edges[1:]
    # Orthonormal contrasts: a basis of all weights that sum to zero.
    contrast = np.linalg.qr(np.column_stack([np.ones(BLOCKS), np.eye(BLOCKS)[:, 1:]]))[0][:, 1:].T
    flicker = contrast @ mean_covariance(first, last, SlowNoise(bias_instability=1.0)) @ contrast.T
    walk = contrast @ mean_covariance(first, last, SlowNoise(rate_random_walk=1.0)) @ contrast.T
    pairs = [(1.0, b, k) for b in _RATIOS for k in _RATIOS]
    pairs += [(0.0, 1.0, 0.0), (0.0, 1.0, 0.1), (0.0, 1.0, 1.0), (0.0, 0.0, 1.0)]
    ratios = np.array(pairs)
    covariance = (
        ratios[:, 0, None, None] * np.eye(BLOCKS - 1)
        + ratios[:, 1, None, None] * flicker
        + ratios[:, 2, None, None] * walk
    )
    root = np.linalg.cholesky(covariance)
    whiten = np.linalg.inv(root)
    line = contrast @ np.arange(BLOCKS, dtype=float)
    return _Grid(
        contrast,
        whiten,
        2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1),
        whiten @ (contrast @ _step_shapes()),
        whiten @ (contrast @ _decays()),
        whiten @ line,
    )


@dataclass(frozen=True, eq=False)
class _Profile:
    """Twice the gain (s,) of each shape over noise alone, its amplitude and sigma (s,)."""

    gain: FloatArray
    amplitude: FloatArray
    sigma: FloatArray


def _profile(grid: _Grid, data: FloatArray, shapes: FloatArray, alone: float) -> _Profile:
    """Compare shapes (g, b - 1, s), whitened, with data (g, b - 1); alone: -2 log L of noise."""
    count = data.shape[1]
    power = np.einsum("gij,gij->gj", shapes, shapes)
    amplitude = np.einsum("gij,gi->gj", shapes, data) / power
    rest = np.maximum(np.sum(data**2, axis=1)[:, None] - amplitude**2 * power, 1e-300)
    cost = count * np.log(rest / count) + grid.log_determinant[:, None]
    best = np.argmin(cost, axis=0)
    every = np.arange(shapes.shape[2])
    sigma = np.sqrt(rest[best, every] / count / power[best, every])
    return _Profile(alone - cost[best, every], amplitude[best, every], sigma)


def find_drifts(
    means: FloatArray,
    start: float,
    length: float,
    temperature: FloatArray | None = None,
    *,
    refine: Callable[[float, float], float] | None = None,
) -> list[Drift]:
    """Return the deterministic parts of block means (BLOCKS,), most significant first.

    start (s) and length (s) of the blocks; temperature (BLOCKS,): their mean temperatures, degC.
    refine: returns the time (s) of a step of a size that lies within a block of a given time.
    """
    found: list[Drift] = []
    rest = means
    while len(found) < MAX_DRIFTS:
        drift = _best(rest, start, length, temperature)
        if drift is None:
            break
        if drift.kind == "step" and refine is not None:
            drift = Drift("step", drift.amplitude, drift.sigma, refine(drift.start, length))
        found.append(drift)
        rest = rest - block_means(drift, start, length, temperature)
    return found


def block_means(
    drift: Drift, start: float, length: float, temperature: FloatArray | None
) -> FloatArray:
    """Return the means (BLOCKS,) of a drift over the blocks."""
    if drift.kind == "temperature":
        return drift.values(np.zeros(BLOCKS), temperature)
    fine = 32  # points a block
    time = start + length * (np.arange(BLOCKS * fine) + 0.5) / fine
    return np.asarray(drift.values(time, None).reshape(BLOCKS, fine).mean(axis=1))


def _best(
    means: FloatArray, start: float, length: float, temperature: FloatArray | None
) -> Drift | None:
    """Return the most significant deterministic part of block means, None if none is."""
    grid = _grid()
    data = grid.whiten @ (grid.contrast @ means)
    count = data.shape[1]
    square = np.maximum(np.sum(data**2, axis=1), 1e-300)
    alone = float(np.min(count * np.log(square / count) + grid.log_determinant))
    line = _profile(grid, data, grid.line[:, :, None], alone).gain[0]
    steps = _profile(grid, data, grid.steps, alone)
    decays = _profile(grid, data, grid.exponentials, alone)
    k, j = int(np.argmax(steps.gain)), int(np.argmax(decays.gain))
    other = max(float(steps.gain[k]), float(decays.gain[j]), float(line))
    if temperature is not None and np.ptp(temperature) >= _MIN_TEMPERATURE_SPAN:
        shape = grid.contrast @ (temperature - temperature.mean())
        follows = _profile(grid, data, (grid.whiten @ shape)[:, :, None], alone)
        gain = float(follows.gain[0])
        if gain >= max(MIN_TEMPERATURE_GAIN, other - _MAX_DISADVANTAGE):
            value, sigma = float(follows.amplitude[0]), float(follows.sigma[0])
            return Drift("temperature", value, sigma, reference=float(temperature.mean()))
    if other < max(MIN_GAIN, float(line) + _MIN_ADVANTAGE):
        return None
    if steps.gain[k] >= decays.gain[j]:
        value, sigma = float(steps.amplitude[k]), float(steps.sigma[k])
        return Drift("step", value, sigma, start + length * (k + _MIN_SIDE))
    value, sigma = float(decays.amplitude[j]), float(decays.sigma[j])
    return Drift("exponential", value, sigma, start, float(_TIMES[j]) * length)


def refine_step(
    averages: FloatArray, start: float, interval: float, near: float, reach: float
) -> float:
    """Return the time (s) at which a step within `reach` of `near` splits averages (n,) best.

    start, interval: s, of the averages.
    """
    first = max(0, int((near - 2.0 * reach - start) / interval))
    last = min(len(averages), math.ceil((near + 2.0 * reach - start) / interval) + 1)
    part = averages[first:last]
    if len(part) < 4:
        return near
    n = np.arange(1, len(part))
    before = np.cumsum(part)[:-1]
    after = part.sum() - before
    between = before**2 / n + after**2 / (len(part) - n)
    allowed = np.abs(start + (first + n) * interval - near) <= reach
    if not allowed.any():
        return near
    k = int(np.argmax(np.where(allowed, between, -np.inf)))
    return start + (first + k + 1) * interval
