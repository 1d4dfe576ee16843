"""Integrals of evenly sampled signals, to the sixth order of the interval.

Samples are values at the instants 0, 1, ... or means over the intervals that end there. Between
them the signal is the polynomial through the six nearest samples. Fewer samples give a lower
order. Arrays are components first, (k, n).
"""

import numpy as np

from rotcli.models.rotation import cross
from rotcli.units import FloatArray


def instants(average: FloatArray) -> FloatArray:
    """Return values at the sample times (k, n) from means over the intervals that end there.

    The value between two intervals from the three on either side, exact for polynomials of
    degree 5 (Colella and Woodward, J. Comput. Phys. 54 (1984) 174, at next order).
    """
    n = average.shape[1]
    points = min(6, n)
    result = np.empty_like(average)
    if points == 6:
        a = average
        result[:, 2:-3] = (
            37.0 * (a[:, 2:-3] + a[:, 3:-2])
            - 8.0 * (a[:, 1:-4] + a[:, 4:-1])
            + (a[:, :-5] + a[:, 5:])
        ) / 60.0
    # At the ends the same polynomial through the nearest intervals, off centre.
    edge = np.arange(points)
    powers = np.arange(1, points + 1)
    # Column j: mean of x^j over the interval that ends at x = edge.
    means = ((edge[:, None]) ** powers - (edge[:, None] - 1.0) ** powers) / powers
    values = edge[:, None].astype(float) ** (powers - 1)
    weights = values @ np.linalg.inv(means)
    head = min(2, n)
    result[:, :head] = average[:, :points] @ weights[:head].T
    tail = min(3, n)
    result[:, n - tail :] = average[:, n - points :] @ weights[points - tail :].T
    return result


def interval_integrals(y: FloatArray, interval: float) -> FloatArray:
    """Return the integrals (k, n-1) of y (k, n) from each sample to the next.

    A quintic through the six nearest samples, fewer where there are fewer. The weights inside are
    those of Adams's central formula: (11, -93, 802, 802, -93, 11) / 1440.
    """
    n = y.shape[1]
    points = min(6, n)
    result = np.empty((y.shape[0], n - 1))
    if points == 6:
        result[:, 2:-2] = (
            802.0 * (y[:, 2:-3] + y[:, 3:-2])
            - 93.0 * (y[:, 1:-4] + y[:, 4:-1])
            + 11.0 * (y[:, :-5] + y[:, 5:])
        )
        result[:, 2:-2] *= interval / 1440.0
    # At the ends the same polynomial through the nearest samples, off centre.
    at = np.arange(points, dtype=float)
    powers = np.arange(points)
    moments = (at[1:, None] ** (powers + 1) - at[:-1, None] ** (powers + 1)) / (powers + 1)
    weights = interval * moments @ np.linalg.inv(at[:, None] ** powers)
    edge = min(2, n - 1)
    result[:, :edge] = y[:, :points] @ weights[:edge].T
    result[:, n - 1 - edge :] = y[:, n - points :] @ weights[points - 1 - edge :].T
    return result


def running_integral(y: FloatArray, start: FloatArray, interval: float, lead: int) -> FloatArray:
    """Return the running integral of y (3, m) that has the value `start` at sample `lead`."""
    total = np.zeros_like(y)
    np.cumsum(interval_integrals(y, interval), axis=1, out=total[:, 1:])
    total += (start - total[:, lead])[:, None]
    return total


def extrapolate(y: FloatArray, before: int, after: int) -> FloatArray:
    """Return y (k, n) with `before` and `after` more columns at its ends.

    The polynomial through the six nearest samples continues, fewer where there are fewer. Noise
    grows by 32 in the first new sample and by 210 in the second, so continue by few samples.
    """
    points = min(6, y.shape[1])
    at = np.arange(points, dtype=float)
    powers = np.arange(points)
    basis = np.linalg.inv(at[:, None] ** powers)
    head = np.arange(-before, 0.0)[:, None] ** powers @ basis
    tail = np.arange(points, points + after, dtype=float)[:, None] ** powers @ basis
    return np.concatenate([y[:, :points] @ head.T, y, y[:, -points:] @ tail.T], axis=1)


def rotation_vectors(w: FloatArray, angle: FloatArray, interval: float) -> FloatArray:
    """Return the rotations (3, n-1) between samples, of rates w (3, n) and their integrals.

    The rotation vector of a step is the angle increment plus the non-commutative part: with the
    rate as a + b s + c s^2 + d s^3, s from -1/2 to 1/2 over the step, the Magnus series up to the
    sixth order of the interval. Before the first and after the last sample the rate continues as
    the polynomial through the six nearest.
    Source: Blanes, Casas, Oteo, Ros, Phys. Rep. 470 (2009) 151, equation (253), for C' = C (w x),
    whose last bracket is of seventh order and omitted; the term in d from the double integral of
    the commutator, its equation (48).
    """
    w = extrapolate(w, 1, 1)
    inner_sum, inner_step = w[:, 1:-2] + w[:, 2:-1], w[:, 2:-1] - w[:, 1:-2]
    outer_sum, outer_step = w[:, :-3] + w[:, 3:], w[:, 3:] - w[:, :-3]
    a = interval / 16.0 * (9.0 * inner_sum - outer_sum)
    b = interval / 24.0 * (27.0 * inner_step - outer_step)
    c = interval / 4.0 * (outer_sum - inner_sum)
    d = interval / 6.0 * (outer_step - 3.0 * inner_step)
    a_b = cross(a, b)
    nested = cross(a, c / 360.0 - a_b / 720.0)
    return angle + cross(a, b / 12.0 + d / 80.0 + nested) + cross(c + a_b, b) / 240.0
