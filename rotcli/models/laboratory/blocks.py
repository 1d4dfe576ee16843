"""Blocks: means of the readings over time intervals of constant table rate and temperature."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import Horizon, IntervalNoise, SlowNoise, covered_span
from rotcli.models.sensors import NoiseFigures
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class Blocks:
    """k blocks of one log (one turn-on), in time order.

    start, end: (k,) s; rate: (k,) rad/s, mean table rate; mean: (k, 3), mean reading minus the
    true value (table rate and Earth rate; for accelerometers gravity) of each sensor of a triad.
    temperature: (k,) degC and heating: (k,) degC/s, its mean time derivative, where known.
    """

    start: FloatArray
    end: FloatArray
    rate: FloatArray
    mean: FloatArray
    temperature: FloatArray | None = None
    heating: FloatArray | None = None

    def __len__(self) -> int:
        """Return the number of blocks."""
        return len(self.start)

    @property
    def span(self) -> float:
        """Seconds from the first start to the last end."""
        return covered_span(self.start, self.end)

    def noise(self, figures: NoiseFigures) -> IntervalNoise:
        """Return the noise of the means of one sensor with these figures (SI)."""
        return IntervalNoise(self.start, self.end, SlowNoise.from_figures(figures), figures.white)


def joint_covariance(logs: tuple[Blocks, ...], figures: NoiseFigures) -> FloatArray:
    """Return S of the means of several logs, independent of each other (block diagonal)."""
    sizes = [len(log) for log in logs]
    total = np.zeros((sum(sizes), sum(sizes)))
    first = 0
    for log, size in zip(logs, sizes, strict=True):
        total[first : first + size, first : first + size] = log.noise(figures).covariance()
        first += size
    return total


def joint_horizon(
    logs: tuple[Blocks, ...], figures: NoiseFigures, start: float, end: float, log: int = -1
) -> Horizon:
    """Return the slow noise of the window [start, end] of one log (default: the last)."""
    number = log % len(logs)
    window = logs[number].noise(figures).horizon(start, end)
    cross = [window.cross if i == number else np.zeros(len(b)) for i, b in enumerate(logs)]
    return Horizon(np.concatenate(cross), window.variance)
