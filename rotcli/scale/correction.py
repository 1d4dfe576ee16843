"""Correct gyro readings by an error curve over rates: `gyro = w + d + e(u.w)`.

e is the selected polynomial if there is one; else a monotone cubic (PCHIP) of the table, never
linear: between the knots of a curve with a knee at 15 deg/s a line through two knots is wrong by
10 deg/h, PCHIP by 3.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.scale.curves import TABLE, polynomial_columns

FloatArray = NDArray[np.float64]

# Fixed-point passes: with slopes of 1e-3 the error after them is 2e-7 deg/h.
PASSES = 3


@dataclass(frozen=True, eq=False)
class RateCurve:
    """Error curve of a triad about one axis.

    axis: (3,) unit vector u; bias: (3,) rad/s; full_scale: rad/s; model: its name;
    coefficients: (p, 3) of the polynomial, rad/s at full scale, or empty for a table;
    knots: (R,) rates of the test, rad/s; values: (R, 3) e at them, rad/s, 0 at rate 0.
    slope: (3,) of the straight line, used outside the knots.
    """

    axis: FloatArray
    bias: FloatArray
    full_scale: float
    model: str
    coefficients: FloatArray
    knots: FloatArray
    values: FloatArray
    slope: FloatArray

    def error(self, rate: FloatArray) -> FloatArray:
        """Return e (n, 3), rad/s, at rates about the axis (n,), rad/s.

        Outside the knots the curve continues with the slope of the straight line.
        """
        low, high = self.knots[0], self.knots[-1]
        inside = np.clip(rate, low, high)
        if self.model == TABLE:
            value = self._interpolated(inside)
        else:
            value = polynomial_columns(self.model, inside / self.full_scale) @ self.coefficients
        result: FloatArray = value + np.multiply.outer(rate - inside, self.slope)
        return result

    def _interpolated(self, rate: FloatArray) -> FloatArray:
        from scipy.interpolate import PchipInterpolator

        if len(self.knots) < 3:
            columns = [np.interp(rate, self.knots, column) for column in self.values.T]
            return np.column_stack(columns)
        curve: Callable[[FloatArray], FloatArray] = PchipInterpolator(self.knots, self.values)
        return curve(rate)

    def outside(self, gyro: FloatArray) -> NDArray[np.bool_]:
        """Return which readings (n, 3), rad/s, have a rate about the axis outside the knots."""
        rate = (gyro - self.bias) @ self.axis
        margin = 1e-3 * float(np.max(np.abs(self.knots)))
        result: NDArray[np.bool_] = (rate < self.knots[0] - margin) | (
            rate > self.knots[-1] + margin
        )
        return result


def distort(curve: RateCurve, true: FloatArray) -> FloatArray:
    """Return readings (n, 3), rad/s, of true rates (n, 3): `w + d + e(u.w)`."""
    return true + curve.bias + curve.error(true @ curve.axis)


def correct(curve: RateCurve, gyro: FloatArray) -> FloatArray:
    """Return corrected readings (n, 3), rad/s; undoes `distort`."""
    reading = gyro - curve.bias
    true = reading
    for _ in range(PASSES):
        true = reading - curve.error(true @ curve.axis)
    return true
