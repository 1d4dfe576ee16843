"""Find a step of a channel's bias in time by a score test of the residuals.

For each channel c and candidate time t the model gets one more column, 0 before t and 1 after it.
With its whitened rows h, those of the parameters A, the whitened residuals r of the estimate and
the scaled covariance C of the parameters, the step has the size `s / v` and the statistic
`z = s / sqrt(v)`, `s = h^T r`, `v = h^T h - (A^T h)^T C (A^T h)`: a standard normal variable if the
noise model is right. Slow changes of the bias (warm-up) show as well, less sharply.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.triad.blocks import Blocks
from rotcli.models.triad.information import CHUNK_BLOCKS, scaled_rows
from rotcli.triad.estimate import Fit
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]

STEP_SIGMAS = 6.0  # some 150 candidates are tested: chance exceeds it once in 3e6 logs
_CANDIDATES = 24  # times per channel; a step halfway between two keeps 0.98 of its statistic


@dataclass(frozen=True)
class BiasStep:
    """Largest step of a bias: channel (0 to 5), time (s), size (rad/s or m/s^2), statistic."""

    channel: int
    time: float
    size: float
    sigmas: float


def whitened_rows(fit: Fit, blocks: Blocks) -> Iterator[tuple[slice, FloatArray]]:
    """Yield slices of the blocks and the whitened rows (6, n, p_free) of their Jacobian.

    Columns are per typical size of the parameters. The rows of a long log are computed again.
    """
    whitened = fit.whitening.begin()
    for k, which in enumerate(fit.whitening.chunks(CHUNK_BLOCKS)):
        if fit.rows is not None:
            yield which, fit.rows[k]
        else:
            rows = scaled_rows(fit.problem, fit.x, blocks.part(which))
            yield which, whitened.rows(which, rows)


class StepTest:
    """Sums of the score test over the blocks, at candidate times of all channels."""

    def __init__(self, fit: Fit, count: int, between: tuple[int, int] | None = None) -> None:
        """Choose the candidates: evenly over `count` blocks, or within a range of them."""
        first, last = between if between else (0, count)
        inner = np.linspace(first, last, _CANDIDATES + 2)[1:-1]
        self.at: IntArray = np.unique(np.round(inner).astype(np.int64).clip(1, max(count - 1, 1)))
        self._fit, self._count = fit, count
        self._whitened = fit.whitening.begin()
        # Less its mean over the samples: the constant part is the bias, whose information exceeds
        # that of the step by far, so that their difference would lose all digits in a long log.
        after = np.concatenate([[0.0], np.cumsum(fit.whitening.count)])
        self._share: FloatArray = 1.0 - after[self.at] / after[-1]
        self._score = np.zeros((6, len(self.at)))
        self._power = np.zeros((6, len(self.at)))
        self._joint = np.zeros((6, len(fit.problem.free), len(self.at)))

    def add(self, which: slice, rows: FloatArray) -> None:
        """Add the blocks `which`, in their order, with the whitened rows (6, n, p_free)."""
        after = (np.arange(self._count)[which, None] >= self.at) - self._share
        steps = self._whitened.rows(which, np.broadcast_to(after, (6, *after.shape)))
        self._score += np.einsum("cnq,cn->cq", steps, self._fit.innovations[:, which])
        self._power += np.einsum("cnq,cnq->cq", steps, steps)
        self._joint += rows.transpose(0, 2, 1) @ steps

    def result(
        self, blocks: Blocks, again: Callable[[], Iterator[tuple[slice, FloatArray]]]
    ) -> BiasStep | None:
        """Return the largest significant step; a second pass finds its time more exactly."""
        found = self.largest()
        if not found[3] > STEP_SIGMAS:
            return None
        k, count = found[1], self._count
        first = int(self.at[k - 1]) if k else 0
        last = int(self.at[k + 1]) if k + 1 < len(self.at) else count
        finer = StepTest(self._fit, count, (first, last))
        for which, rows in again():
            finer.add(which, rows)
        better = finer.largest()
        test, (channel, k, size, z) = (finer, better) if better[3] > found[3] else (self, found)
        return BiasStep(channel, float(blocks.time[test.at[k]]), size, z)

    def statistics(self) -> FloatArray:
        """Return the statistics (6, candidates), not negative."""
        z: FloatArray = np.abs(self._score) / np.sqrt(self._left()) / self._fit.scale
        return z

    def largest(self) -> tuple[int, int, float, float]:
        """Return channel, candidate, size (SI) and statistic of the largest step."""
        z = self.statistics()
        channel, k = np.unravel_index(int(np.argmax(z)), z.shape)
        amount = float(self._score[channel, k] / self._left()[channel, k])
        return int(channel), int(k), amount, float(z[channel, k])

    def _left(self) -> FloatArray:
        """Return the information (6, candidates) on a step that the parameters leave."""
        size = self._fit.problem.size
        C = self._fit.covariance / np.outer(size, size) / self._fit.scale**2
        seen = np.einsum("cpq,pr,crq->cq", self._joint, C, self._joint, optimize=True)
        # A step that the parameters imitate almost completely cannot be tested.
        left: FloatArray = np.maximum(self._power - seen, 1e-6 * self._power)
        left[self._power <= 0.0] = np.inf
        return left
