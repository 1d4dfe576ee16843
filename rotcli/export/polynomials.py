"""Temperature polynomials about another temperature and of a lower order."""

import numpy as np
from numpy.polynomial import chebyshev, polynomial

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

AUTOPILOT_ORDER = 3  # both autopilots evaluate a cubic
_GRID = 201  # temperatures over the range, for refits and maxima


@dataclass(frozen=True, eq=False)
class Recentred:
    """Coefficients (n, order + 1) of powers of (T - centre), lowest first, and the max residual."""

    coefficients: FloatArray
    residual: float


def recentre(powers: FloatArray, old: float, new: float) -> FloatArray:
    """Return the coefficients (n, p) of powers of (T - new) of polynomials in (T - old).

    Exact (binomial). Check: a straight line keeps its slope.
    """
    shift = np.array([new - old, 1.0])
    rows = []
    for row in powers:
        total = np.zeros(len(row))
        for coefficient in row[::-1]:
            total = polynomial.polyadd(polynomial.polymul(total, shift), [coefficient])[: len(row)]
        rows.append(np.pad(total, (0, len(row) - len(total))))
    return np.array(rows)


def to_order(
    powers: FloatArray,
    old: float,
    new: float,
    low: float,
    high: float,
    order: int = AUTOPILOT_ORDER,
) -> Recentred:
    """Return polynomials (n, p) in (T - old) as polynomials of at most `order` in (T - new).

    Higher orders are refitted by least squares at Chebyshev points of the range [low, high] degC;
    the residual is the largest difference over the range and over the rows.
    """
    if powers.shape[1] <= order + 1:
        exact = recentre(powers, old, new)
        return Recentred(np.pad(exact, ((0, 0), (0, order + 1 - exact.shape[1]))), 0.0)
    t = np.cos(np.pi * (np.arange(_GRID) + 0.5) / _GRID)
    T = 0.5 * (low + high) + 0.5 * (high - low) * t
    values = np.array([polynomial.polyval(T - old, row) for row in powers])
    fitted = chebyshev.chebfit(t, values.T, order)
    residual = float(np.nanmax(np.abs(values - chebyshev.chebval(t, fitted))))
    scale = 2.0 / (high - low)
    rows = []
    for column in fitted.T:
        in_t = chebyshev.cheb2poly(column)
        in_T = in_t * scale ** np.arange(len(in_t))  # powers of (T - middle)
        rows.append(np.pad(in_T, (0, order + 1 - len(in_T))))
    return Recentred(recentre(np.array(rows), 0.5 * (low + high), new), residual)


def largest_change(powers: FloatArray, old: float, low: float, high: float) -> float:
    """Return the largest |p(T) - p(old)| over the range and the rows that are known."""
    T = np.linspace(low, high, _GRID)
    changes = [
        polynomial.polyval(T - old, row) - row[0] for row in powers if np.isfinite(row).all()
    ]
    return float(np.max(np.abs(changes))) if changes else 0.0
