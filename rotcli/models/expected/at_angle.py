"""Compare the mean residuals of a window with those of a still segment at the same table angle.

Where gravity turns in the sensor frame, scale factors, misalignment and nonlinearity make readings
depend on the table angle: `bias + a cos + b sin + c cos 2 + d sin 2`. The mean over a window is
that of many angles, the still segment has one. Least squares of the window on these five columns,
evaluated at the angle of the still segment, is comparable with its mean.

Amplitudes are known in advance to the tolerance of accelerometers as delivered. What the window
does not show of them (less than a turn, or turns of few blocks) enters the sigma with this
tolerance; everywhere else the sigma is that of the noise alone.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.expected.companions import MeanResidual
from rotcli.models.expected.sources import AccelSource, slow_covariances, whites
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class AngleComparison:
    """Blocks of `length` s from `start` s, at table rates (n,) rad/s.

    design: (n, 5) columns of the blocks; still: (5,) row of the still segment; tolerance: (5,)
    m/s^2 of the coefficients, infinite for the constant.
    """

    start: float
    length: float
    rate: FloatArray
    design: FloatArray
    still: FloatArray
    tolerance: FloatArray
    source: AccelSource

    @classmethod
    def of(
        cls,
        blocks: tuple[float, float, FloatArray, FloatArray],
        still_angle: float,
        tolerance: tuple[float, float],
        source: AccelSource,
    ) -> "AngleComparison":
        """Return the comparison of a window.

        blocks: start, length (s), rate (n,) rad/s, angle (n,) rad in the middle; still_angle: rad,
        of the still segment; tolerance: m/s^2, of amplitudes once and twice per turn.
        """
        start, length, rate, angle = blocks
        columns, row = [np.ones(len(rate))], [1.0]
        for order in (1, 2):
            mean = np.sinc(order * rate * length / (2.0 * np.pi))  # of a sine over a block
            columns += [mean * np.cos(order * angle), mean * np.sin(order * angle)]
            row += [np.cos(order * still_angle), np.sin(order * still_angle)]
        known = np.concatenate([[np.inf], np.repeat(tolerance, 2)])
        return cls(start, length, rate, np.column_stack(columns), np.array(row), known, source)

    def weights(self, used: NDArray[np.bool_] | None = None) -> FloatArray:
        """Return the weights (n,) of the blocks, sum 1; used: (n,) blocks that count."""
        X = self.design if used is None else self.design * used[:, None]
        bounded = np.isfinite(self.tolerance)
        scale = np.where(bounded, self.tolerance, 1.0)
        prior = np.where(bounded, float(whites(self.source).max()) ** 2 / self.length, 0.0)
        X = X * scale
        # Without noise and gravity that turns there are columns of zeros: least norm.
        inverse = np.linalg.pinv(X.T @ X + np.diag(prior), hermitian=True)
        return np.asarray(X @ (inverse @ (self.still * scale)))

    def test(self, values: FloatArray) -> MeanResidual:
        """Return the test of block residuals (n, 3), m/s^2, less the bias of the still segment."""
        w = self.weights()
        left = (self.still - self.design.T @ w)[1:] * self.tolerance[1:]
        axes = self.source.axes
        found = slow_covariances(self.start, self.length, self.rate, axes)
        variance = [
            (0.0 if E is None else float(w @ E.dense() @ w))
            + axis.white**2 / self.length * float(w @ w)
            for axis, E in zip(axes, found, strict=True)
        ]
        sigma = np.sqrt(np.broadcast_to(variance, 3) + left @ left)
        return MeanResidual.of(w @ values, sigma)
