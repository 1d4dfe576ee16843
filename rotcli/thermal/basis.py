"""Functions of temperature: Chebyshev polynomials, hat functions, powers about a temperature.

Raw powers of degrees are ill-conditioned (order 5 over 80 degC: 6e8, Chebyshev 1.9): polynomials
are fitted as Chebyshev series and printed as powers about T_ref by an exact linear map.
"""

import numpy as np
from numpy.polynomial import chebyshev, polynomial

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray


@dataclass(frozen=True)
class Chebyshev:
    """Chebyshev polynomials up to an order over [low, high], degC."""

    order: int
    low: float
    high: float

    @property
    def size(self) -> int:
        """Number of functions."""
        return self.order + 1

    @property
    def unity(self) -> FloatArray:
        """Coefficients (size,) of the constant 1."""
        return np.asarray(np.eye(self.size)[0])

    def _normalised(self, temperature: FloatArray) -> FloatArray:
        return np.asarray((2.0 * temperature - self.low - self.high) / (self.high - self.low))

    def values(self, temperature: FloatArray) -> FloatArray:
        """Return the functions (n, size) at temperatures (n,), degC."""
        return np.asarray(chebyshev.chebvander(self._normalised(temperature), self.order))

    def derivatives(self, temperature: FloatArray) -> FloatArray:
        """Return their derivatives (n, size), per degC."""
        slope = 2.0 / (self.high - self.low)
        unit = np.eye(self.size)
        columns = [
            chebyshev.chebval(self._normalised(temperature), chebyshev.chebder(row)) for row in unit
        ]
        return np.asarray(np.column_stack(columns) * slope)

    def powers(self, reference: float) -> FloatArray:
        """Return M (size, size): coefficients of (T - reference)^n of each function."""
        centre, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        # t = (T - reference)/half + (reference - centre)/half
        argument = np.array([(reference - centre) / half, 1.0 / half])
        columns = np.zeros((self.size, self.size))
        for n in range(self.size):
            in_t = chebyshev.cheb2poly(np.eye(self.size)[n])
            total, power = np.zeros(1), np.ones(1)
            for coefficient in in_t:
                total = polynomial.polyadd(total, coefficient * power)
                power = polynomial.polymul(power, argument)
            columns[: len(total), n] = total[: self.size]
        return columns


@dataclass(frozen=True)
class Hats:
    """Hat functions at knots (degC, ascending): linear between them, constant outside."""

    knots: tuple[float, ...]

    @property
    def size(self) -> int:
        """Number of functions."""
        return len(self.knots)

    @property
    def unity(self) -> FloatArray:
        """Coefficients (size,) of the constant 1."""
        return np.ones(self.size)

    def values(self, temperature: FloatArray) -> FloatArray:
        """Return the functions (n, size) at temperatures (n,), degC."""
        unit = np.eye(self.size)
        return np.column_stack([np.interp(temperature, self.knots, row) for row in unit])

    def derivatives(self, temperature: FloatArray) -> FloatArray:
        """Return their derivatives (n, size), per degC: of the right side at a knot."""
        knots = np.asarray(self.knots)
        slopes = np.diff(np.eye(self.size), axis=0) / np.diff(knots)[:, None]
        number = np.clip(np.searchsorted(knots, temperature, side="right") - 1, 0, len(slopes) - 1)
        inside = (temperature >= knots[0]) & (temperature <= knots[-1])
        result: FloatArray = slopes[number] * inside[:, None]
        return result


Basis = Chebyshev | Hats
