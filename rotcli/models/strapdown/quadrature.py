"""Quadrature of evenly sampled signals to the sixth order of the interval.

Samples are values at the instants 0, 1, ... or means over the intervals that end there. Between
two samples the signal is the polynomial through the six nearest samples. Arrays are (3, m, n)
with time along the second axis.
"""

from functools import lru_cache
from math import factorial

import numpy as np

from rotcli.models.strapdown.cells import Arena
from rotcli.units import FloatArray

# Weights of the pairs of samples next to an interval, next but one, and so on. The means on
# either side give the value between them (Colella and Woodward, J. Comput. Phys. 54 (1984) 174,
# at next order); values give the integral over the interval (Adams's central formula).
_VALUE_OF_MEANS = (37.0 / 60.0, -8.0 / 60.0, 1.0 / 60.0)
_INTEGRAL = (802.0 / 1440.0, -93.0 / 1440.0, 11.0 / 1440.0)


def extrapolate(y: FloatArray, before: int, after: int) -> tuple[FloatArray, FloatArray]:
    """Return the samples before and after y (n, k) by the polynomial through the six nearest.

    Fewer than six samples give a polynomial of lower degree. The noise grows by 32 in the first
    sample and by 210 in the second, so extrapolate by few samples. Means continue like values:
    the means of a quintic are a quintic.
    """
    points = min(6, len(y))
    head, tail = _continuation(points, before, after)
    return head @ y[:points], tail @ y[-points:]


@lru_cache(maxsize=32)
def _continuation(points: int, before: int, after: int) -> tuple[FloatArray, FloatArray]:
    """Return the weights (before, points) and (after, points) of samples in those around them."""
    at = np.arange(points, dtype=float)
    powers = np.arange(points)
    basis = np.linalg.inv(at[:, None] ** powers)
    head = np.arange(-before, 0.0)[:, None] ** powers @ basis
    tail = np.arange(points, points + after, dtype=float)[:, None] ** powers @ basis
    return head, tail


def instants(means: FloatArray, out: FloatArray, arena: Arena) -> None:
    """Compute values out (3, m-5, n) at the sample times from means (3, m, n).

    Row k of the result is the value at the end of the interval of row k + 2.
    """
    _six_point(means, _VALUE_OF_MEANS, out, arena)


def step_integrals(y: FloatArray, out: FloatArray, arena: Arena) -> None:
    """Compute the integrals out (3, m-5, n) of values y (3, m, n) at unit interval.

    Row k of the result is the integral from row k + 2 of y to row k + 3.
    """
    _six_point(y, _INTEGRAL, out, arena)


def _six_point(
    y: FloatArray, weights: tuple[float, float, float], out: FloatArray, arena: Arena
) -> None:
    inner, middle, outer = weights
    with arena.stage():
        pair = arena.real(*out.shape)
        np.add(y[:, 2:-3], y[:, 3:-2], out=out)
        out *= inner
        np.add(y[:, 1:-4], y[:, 4:-1], out=pair)
        pair *= middle
        out += pair
        np.add(y[:, :-5], y[:, 5:], out=pair)
        pair *= outer
        out += pair


def add_non_commutative_part(phi: FloatArray, w: FloatArray, arena: Arena) -> None:
    """Turn the angle increments phi (3, m, n) of steps into rotation vectors, in place.

    w: (3, m+3, n) angular rate times the interval, at the instants from one before the first step
    to one after the last one.

    With the rate as a + b s + c s^2 + d s^3, s from -1/2 to 1/2 over the step, the Magnus series
    of C' = C (w x) up to the sixth order of the interval is

        phi = angle + a x (b/12 + d/80 + a x (c/360 - a x b/720)) + (c + a x b) x b/240.

    Source: Blanes, Casas, Oteo, Ros, Phys. Rep. 470 (2009) 151, equation (253), whose last bracket
    is of seventh order and omitted; the term in d from the double integral of the commutator, its
    equation (48). The cubic passes through four samples; in the terms of third order a and b are
    the mean and the difference of two samples.
    """
    with arena.stage():
        shape = phi.shape
        total, step, curve, a_b, inner, term = (arena.real(*shape) for _ in range(6))
        np.add(w[:, 1:-2], w[:, 2:-1], out=total)  # 2 a
        np.subtract(w[:, 2:-1], w[:, 1:-2], out=step)  # b
        np.add(w[:, :-3], w[:, 3:], out=curve)
        curve -= total  # 4 c
        cross(total, step, a_b, arena)  # 2 a x b
        # (c + a x b) x b / 240
        np.multiply(a_b, 2.0, out=inner)
        inner += curve
        cross(inner, step, term, arena)
        term *= 1.0 / 960.0
        phi += term
        # a x (c/360 - a x b/720)
        np.subtract(curve, a_b, out=inner)
        inner *= 1.0 / 2880.0
        cross(total, inner, term, arena)
        # b/12 + d/80 = 7/80 step - outer step/720
        np.subtract(w[:, 3:], w[:, :-3], out=inner)
        inner *= -1.0 / 720.0
        term += inner
        step *= 7.0 / 80.0
        term += step
        # a of the cubic, with the outer samples
        total *= 0.5
        curve *= 1.0 / 16.0
        total -= curve
        cross(total, term, inner, arena)
        phi += inner


def cross(a: FloatArray, b: FloatArray, out: FloatArray, arena: Arena) -> None:
    """Compute out = a x b of vectors (3, m, n)."""
    with arena.stage():
        product = arena.real(*out.shape[1:])
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            np.multiply(a[j], b[k], out=out[i])
            np.multiply(a[k], b[j], out=product)
            out[i] -= product


def motion_weights(samples: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the weights of accelerations in velocity, displacement and its running integral.

    Each is (samples + 1, samples + 5): row j for the time of sample j from sample 0, at unit
    interval; the columns are the accelerations at the samples -2 to samples + 2. They integrate
    the quintics between samples exactly.
    """
    nodes, powers = np.arange(-2.0, 4.0), np.arange(6)
    basis = np.linalg.inv(nodes[:, None] ** powers)
    once, twice, thrice = (
        np.array([factorial(p) / factorial(p + k) for p in range(6)]) @ basis for k in (1, 2, 3)
    )
    v, d, m = (np.zeros((samples + 1, samples + 5)) for _ in range(3))
    for j in range(samples):
        stencil = slice(j, j + 6)
        v[j + 1], d[j + 1], m[j + 1] = v[j], d[j] + v[j], m[j] + d[j] + 0.5 * v[j]
        v[j + 1, stencil] += once
        d[j + 1, stencil] += twice
        m[j + 1, stencil] += thrice
    return v, d, m
