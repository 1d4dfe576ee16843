"""Profile likelihood of one variance component: 95 % interval and the gain over zero.

The other components are re-estimated at each value. For that a Newton step with the Hessian of
the estimate suffices in large fleets, whose likelihood is nearly a parabola; where it does not
converge, L-BFGS-B starts from its last point.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rotcli.fleet.variance.likelihood import (
    minimise,
    minus_two_log_reml,
    scale_of,
    value_and_slope,
)
from rotcli.fleet.variance.nested import NestedRows
from rotcli.units import FloatArray

INTERVAL_GAIN = 3.841  # 95 % quantile of chi-squared with one degree of freedom
_ROOT_TOLERANCE = 5e-4  # of the root of the gain at an interval's end, in sigmas
_MAX_ROOT_STEPS = 50
_MAX_STEP_UP = 60  # doublings when an upper end is bracketed; 2^60 is beyond any variance ratio
_DIFFERENCE = 1e-4  # of var(y), step of the differences that make the Hessian
_MAX_NEWTON_STEPS = 15
_STEPS_PER_HESSIAN = 3  # steps with the Hessian of the estimate before one of the point is made
_NEWTON_TOLERANCE = 1e-6  # of -2 ln REML, the decrement at which the steps end
# Standard deviations from zero at which the gain is taken from the parabola: p is then below 1e-15.
_CERTAIN = 8.0


class Profile:
    """The profile of -2 ln REML about an estimate (3,) with its minimum."""

    def __init__(
        self,
        rows: NestedRows,
        estimable: tuple[bool, bool, bool],
        best: FloatArray,
        minimum: float,
    ) -> None:
        self._rows, self._estimable = rows, np.array(estimable)
        self._best, self._minimum = best, minimum
        self._hessian = self._differences(best)
        self._last = (-1, best)

    def _differences(self, x: FloatArray) -> FloatArray:
        """Return the Hessian (3, 3) of -2 ln REML at x by forward differences of its slope."""
        step = _DIFFERENCE * scale_of(self._rows)
        _, slope = value_and_slope(self._rows, x)
        hessian = np.zeros((3, 3))
        for k in np.flatnonzero(self._estimable):
            moved = x.copy()
            moved[k] += step
            hessian[k] = (value_and_slope(self._rows, moved)[1] - slope) / step
        return 0.5 * (hessian + hessian.T)

    def _root_sigma(self, k: int) -> float | None:
        """Return the sigma of the standard deviation of component k by the parabola, or None."""
        index = [i for i in range(3) if self._estimable[i] and self._best[i] > 0.0]
        if k not in index:
            return None
        block = self._hessian[np.ix_(index, index)]
        try:
            covariance = 2.0 * np.linalg.inv(block)
        except np.linalg.LinAlgError:
            return None
        variance = float(covariance[index.index(k), index.index(k)])
        return None if variance <= 0.0 else math.sqrt(variance / self._best[k]) / 2.0

    def gain_at_zero(self, k: int) -> float:
        """Return how much -2 ln REML grows when component k is zero."""
        sigma = self._root_sigma(k)
        if sigma is not None and math.sqrt(self._best[k]) > _CERTAIN * sigma:
            return float(self._best[k]) / sigma**2
        return max(self.at(k, 0.0) - self._minimum, 0.0)

    def at(self, k: int, value: float) -> float:
        """Return -2 ln REML with component k at `value` and the others at their best."""
        free = self._estimable.copy()
        free[k] = False
        index = np.flatnonzero(free)
        x = self._start(index, k, value)
        if len(index) == 0:
            return minus_two_log_reml(self._rows, x)
        before = math.inf
        hessian = self._hessian
        for step_number in range(_MAX_NEWTON_STEPS):
            here, slope = value_and_slope(self._rows, x)
            active = index[(x[index] > 0.0) | (slope[index] < 0.0)]
            if len(active) == 0 or here > before + _NEWTON_TOLERANCE:
                break
            if step_number == _STEPS_PER_HESSIAN:
                hessian = self._differences(x)
            block = hessian[np.ix_(active, active)]
            if not _positive(block):
                break
            step = np.linalg.solve(block, slope[active])
            if 0.5 * float(step @ slope[active]) < _NEWTON_TOLERANCE:
                self._last = (k, x)
                return here
            before = here
            x = x.copy()
            x[active] = np.maximum(x[active] - step, 0.0)
        return self._search(free, x)

    def _start(self, index: NDArray[np.int64], k: int, value: float) -> FloatArray:
        """Return where the search starts: the last point if nearer, else along the Hessian."""
        last_k, last = self._last
        if last_k == k and abs(last[k] - value) < abs(self._best[k] - value):
            x = last.copy()
        else:
            x = self._best.copy()
        shift, x[k] = value - x[k], value
        block = self._hessian[np.ix_(index, index)]
        if len(index) and _positive(block):
            move = np.linalg.solve(block, self._hessian[index, k]) * shift
            x[index] = np.maximum(x[index] - move, 0.0)
        return x

    def _search(self, free: NDArray[np.bool_], x: FloatArray) -> float:
        fixed = np.where(free, 0.0, x)
        start = np.maximum(self._best, 1e-3 * scale_of(self._rows))
        chosen = (bool(free[0]), bool(free[1]), bool(free[2]))
        return minimise(self._rows, chosen, fixed, start)[1]

    def interval(self, k: int, gain_at_zero: float) -> tuple[float, float]:
        """Return the 95 % limits of variance k; the lower one is 0 when 0 is not refuted."""
        centre = math.sqrt(self._best[k])
        guess = 2.0 * (self._root_sigma(k) or 0.5 * centre)
        lower = 0.0
        if gain_at_zero > INTERVAL_GAIN:
            far = max(centre - 1.2 * guess, 0.0)
            if far > 0.0 and self._excess(k, far) < 0.0:
                far = 0.0
            at_far = math.sqrt(gain_at_zero) - math.sqrt(INTERVAL_GAIN)
            lower = self._root(k, far, at_far if far == 0.0 else self._excess(k, far))
        step = max(guess, 1e-2 * math.sqrt(scale_of(self._rows)))
        upper, beyond = centre + step, 0.0
        for _ in range(_MAX_STEP_UP):
            if (beyond := self._excess(k, upper)) > 0.0:
                break
            step *= 2.0
            upper = centre + step
        return lower**2, self._root(k, upper, beyond) ** 2

    def _excess(self, k: int, root: float) -> float:
        """Return the root of the gain minus that of the interval's end, nearly linear in `root`."""
        gain = self.at(k, root**2) - self._minimum
        return math.sqrt(max(gain, 0.0)) - math.sqrt(INTERVAL_GAIN)

    def _root(self, k: int, far: float, at_far: float) -> float:
        """Return the root between the estimate and `far`, by false position (Illinois rule)."""
        a, fa = far, at_far
        b, fb = math.sqrt(self._best[k]), -math.sqrt(INTERVAL_GAIN)
        x = a
        for _ in range(_MAX_ROOT_STEPS):
            x = (a * fb - b * fa) / (fb - fa)
            fx = self._excess(k, x)
            if (fx > 0.0) == (fa > 0.0):
                step, a, fa, fb = abs(x - a), x, fx, 0.5 * fb
            else:
                step, b, fb, fa = abs(x - b), x, fx, 0.5 * fa
            if abs(fx) < _ROOT_TOLERANCE or step < 1e-12 * abs(x):
                break
        return x


def _positive(block: FloatArray) -> bool:
    return bool((np.linalg.eigvalsh(block) > 0.0).all())
