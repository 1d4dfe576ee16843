"""Correct gyro readings by an error curve over rates: `gyro = w + d + e(u.w)`.

e is the selected polynomial if there is one; else a monotone cubic (PCHIP) of the table, never
linear: between the knots of a curve with a knee at 15 deg/s a line through two knots is wrong by
10 deg/h, PCHIP by 3.
"""

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from scipy import interpolate


# Columns next to the constant. The table has one free value per distinct rate (saturated).
MODELS: dict[str, tuple[str, ...]] = {
    "line": ("x",),
    "asym": ("x", "abs(x)"),
    "quad": ("x", "x^2"),
    "odd": ("x", "x^3"),
    "cubic": ("x", "x^2", "x^3"),
    "asym+odd": ("x", "abs(x)", "x^3"),
}
TABLE = "table"
# Share of the largest rate that readings may exceed the rates of the test: scale factor and noise.
OUTSIDE_MARGIN = 0.01
# Fixed-point passes: with slopes of 1e-3 the error after them is 2e-7 deg/h.
PASSES = 3


def column(name: str, x: FloatArray) -> FloatArray:
    """Return one column (k,) at normalised rates x (k,)."""
    if name == "abs(x)":
        return np.abs(x)
    power = 1 if name == "x" else int(name[2:])
    result: FloatArray = x**power
    return result


def polynomial_columns(model: str, x: FloatArray) -> FloatArray:
    """Return the columns (k, p - 1) of a model next to the constant."""
    return np.column_stack([column(name, x) for name in MODELS[model]])


@dataclass(frozen=True, eq=False)
class GyroCurve:
    """Error curve of one gyro without its bias.

    model: name; coefficients: (p,) of the polynomial, rad/s at full scale, empty for a table;
    values: (R,) e at the knots, rad/s; slope: of the straight line, used outside the knots.
    """

    model: str
    coefficients: FloatArray
    values: FloatArray
    slope: float

    def error(self, rate: FloatArray, knots: FloatArray, full_scale: float) -> FloatArray:
        """Return e (n,), rad/s, at rates (n,), rad/s; beyond the knots with the line's slope."""
        inside = np.clip(rate, knots[0], knots[-1])
        if self.model != TABLE:
            value = polynomial_columns(self.model, inside / full_scale) @ self.coefficients
        elif len(knots) < 3:
            value = np.interp(inside, knots, self.values)
        else:
            value = interpolate.PchipInterpolator(knots, self.values)(inside)
        result: FloatArray = value + (rate - inside) * self.slope
        return result


@dataclass(frozen=True, eq=False)
class RateCurve:
    """Error curves of a triad about one axis.

    axis: (3,) unit vector u; bias: (3,) rad/s; full_scale: rad/s; knots: (R,) rates of the test,
    rad/s, ascending; gyros: the three curves. removed: (3,) scale factors, removed_bias:
    (3,) rad/s that do not belong to the error (another calibration corrects them).
    """

    axis: FloatArray
    bias: FloatArray
    full_scale: float
    knots: FloatArray
    gyros: tuple[GyroCurve, ...]
    removed: FloatArray = field(default_factory=lambda: np.zeros(3))
    removed_bias: FloatArray = field(default_factory=lambda: np.zeros(3))

    def error(self, rate: FloatArray) -> FloatArray:
        """Return e (n, 3), rad/s, at rates about the axis (n,), rad/s."""
        curves = [gyro.error(rate, self.knots, self.full_scale) for gyro in self.gyros]
        line = np.multiply.outer(rate, self.removed) + self.removed_bias
        return np.column_stack(curves) - line

    def outside(self, gyro: FloatArray, samples: int = 1) -> NDArray[np.bool_]:
        """Return which readings (n, 3), rad/s, have a rate about the axis outside the knots.

        Means over `samples` readings are compared: white noise alone is not outside.
        """
        rate = (gyro - self.bias) @ self.axis
        count = max(1, samples)
        starts = np.arange(0, len(rate), count)
        sizes = np.diff(np.append(starts, len(rate)))
        mean = np.repeat(np.add.reduceat(rate, starts) / sizes, sizes) if len(rate) else rate
        margin = OUTSIDE_MARGIN * float(np.max(np.abs(self.knots)))
        result: NDArray[np.bool_] = (mean < self.knots[0] - margin) | (
            mean > self.knots[-1] + margin
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
