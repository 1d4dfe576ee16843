"""Correct readings by bias and scale factor over temperature: `w = (I + N(T))^-1 (gyro - d(T))`.

d and N are evaluated on a grid of temperatures and interpolated linearly.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

# With 0.05 degC the error of the interpolation is h^2 |d''|/8: below 1e-3 deg/h at 3 deg/h/degC^2.
GRID_STEP = 0.05  # degC
MARGIN = 1.0  # degC outside the range that is still accepted: thermometers differ by that much


@dataclass(frozen=True, eq=False)
class ThermalCurve:
    """Errors of a triad over temperature on a grid (g,), degC.

    bias: (g, 3), rad/s (m/s^2); column: (g, 3), dimensionless, the errors that a rotation about
    `axis` (unit vector, (3,)) excites; low, high: range of the calibration, degC.
    """

    grid: FloatArray
    bias: FloatArray
    column: FloatArray
    axis: FloatArray
    low: float
    high: float

    def outside(self, temperature: FloatArray) -> NDArray[np.bool_]:
        """Return which temperatures (n,), degC, are outside the range and its margin."""
        result: NDArray[np.bool_] = (temperature < self.low - MARGIN) | (
            temperature > self.high + MARGIN
        )
        return result

    def errors(self, temperature: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return bias (n, 3) and column (n, 3) at temperatures (n,), degC.

        Temperatures within the margin outside the grid use its edge.
        """
        bias = [np.interp(temperature, self.grid, values) for values in self.bias.T]
        column = [np.interp(temperature, self.grid, values) for values in self.column.T]
        return np.column_stack(bias), np.column_stack(column)


def temperature_grid(low: float, high: float) -> FloatArray:
    """Return the grid (g,) from low to high in steps of at most 0.05 degC."""
    return np.linspace(low, high, max(2, int(np.ceil((high - low) / GRID_STEP)) + 1))


def distort(curve: ThermalCurve, true: FloatArray, temperature: FloatArray) -> FloatArray:
    """Return readings (n, 3) of the truth (n, 3): `(I + k(T) u^T) w + d(T)`."""
    bias, column = curve.errors(temperature)
    return true + column * (true @ curve.axis)[:, None] + bias


def correct(curve: ThermalCurve, measured: FloatArray, temperature: FloatArray) -> FloatArray:
    """Return corrected readings (n, 3); undoes `distort`.

    The inverse of I + k u^T is I - k u^T / (1 + u.k) (Sherman and Morrison).
    """
    bias, column = curve.errors(temperature)
    reading = measured - bias
    along = (reading @ curve.axis) / (1.0 + column @ curve.axis)
    return reading - column * along[:, None]
