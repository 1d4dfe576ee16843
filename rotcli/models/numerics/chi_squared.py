"""Limits of chi-squared, without the start-up time of scipy.special.

The probability that chi-squared of n degrees of freedom exceeds x is the regularized incomplete
gamma function Q(n/2, x/2): by its series below n/2 + 1, by its continued fraction above
(Abramowitz and Stegun 6.5.29, 6.5.31).
"""

import math
from functools import lru_cache

_TOLERANCE = 1e-15  # relative, of the series and the fraction: double precision
_MAX_TERMS = 100_000  # terms; some sqrt(n) are needed
_ITERATIONS = 200  # bisections: halves of any double interval


def exceeding_probability(x: float, dof: int) -> float:
    """Return the probability that chi-squared of dof degrees of freedom exceeds x.

    >>> round(exceeding_probability(3.841458820694124, 1), 12)
    0.05
    """
    a, z = 0.5 * dof, 0.5 * x
    if z <= 0.0:
        return 1.0
    front = math.exp(-z + a * math.log(z) - math.lgamma(a))
    if z < a + 1.0:
        term = total = 1.0 / a
        for k in range(1, _MAX_TERMS):
            term *= z / (a + k)
            total += term
            if term < total * _TOLERANCE:
                break
        return 1.0 - front * total
    # Continued fraction by Lentz' method.
    b = z + 1.0 - a
    c, d = 1e300, 1.0 / b
    h = d
    for k in range(1, _MAX_TERMS):
        factor = -k * (k - a)
        b += 2.0
        d = 1.0 / (factor * d + b)
        c = b + factor / c
        h *= c * d
        if abs(c * d - 1.0) < _TOLERANCE:
            break
    return front * h


@lru_cache(maxsize=256)
def upper_limit(dof: int, probability: float) -> float:
    """Return the limit that chi-squared exceeds with a probability.

    >>> round(upper_limit(10, 0.01), 9)
    23.209251159
    """
    low, high = 0.0, dof + 10.0
    while exceeding_probability(high, dof) > probability:
        high *= 2.0
    for _ in range(_ITERATIONS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if exceeding_probability(middle, dof) > probability:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
