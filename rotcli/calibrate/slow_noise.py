"""How far slow noise carries the mean reading of one stretch of a log from that of another.

Flicker noise and random walk start from zero at the log's first sample, as a bias does that is
named after its value at turn-on; the Gauss-Markov process is stationary. This is what
`rotcli.models.sensors.noise` draws.

A process with covariance c(s, t) has `G(s, t)`, its double integral from (0, 0); the covariance
of its means over [a, b] and [c, d] is `(G(b, d) - G(a, d) - G(b, c) + G(a, c)) / ((b-a)(d-c))`.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.models.sensors import NoiseFigures

Array = NDArray[np.float64]


def covariance_of_means(figures: NoiseFigures, start: Array, end: Array) -> Array:
    """Return the covariance (k, k) of the mean slow noise over k stretches, (rad/s)^2.

    start, end: (k,) s from the log's first sample, end after start >= 0. The white noise of
    `figures` is left out. A random walk of K over [0, T] alone gives K^2 T / 3.
    """
    edges = np.concatenate([start, end])
    total = np.zeros((len(edges), len(edges)))
    if figures.bias_instability:
        total += figures.bias_instability**2 * _flicker(edges)
    if figures.rate_random_walk:
        total += figures.rate_random_walk**2 * _walk(edges)
    if figures.markov_sigma:
        total += figures.markov_sigma**2 * _markov(edges, figures.markov_time)
    k = len(start)
    first, last = slice(0, k), slice(k, 2 * k)
    box = total[last, last] - total[first, last] - total[last, first] + total[first, first]
    result: Array = box / np.outer(end - start, end - start)
    return result


def _ordered(edges: Array) -> tuple[Array, Array]:
    """Return the earlier and the later (k, k) of every two times (k,)."""
    return np.minimum.outer(edges, edges), np.maximum.outer(edges, edges)


def _flicker(edges: Array) -> Array:
    """G of unit flicker noise: white noise of unit density through 1/sqrt(j omega).

    Its response sqrt(1 / (pi t)) gives c(s, t) = (2 / pi) artanh(sqrt(s / t)), s before t; as the
    double integral of that, pi G = sqrt(s t) (s + t) - (t - s)^2 artanh(sqrt(s / t)).
    """
    s, t = _ordered(edges)
    apart = s < t
    far = np.zeros_like(s)
    far[apart] = (t - s)[apart] ** 2 * np.arctanh(np.sqrt(s[apart] / t[apart]))
    result: Array = (np.sqrt(s * t) * (s + t) - far) / np.pi
    return result


def _walk(edges: Array) -> Array:
    """G of the unit random walk, c = min(s, t): s^2 t / 2 - s^3 / 6 for s before t."""
    s, t = _ordered(edges)
    result: Array = s**2 * (0.5 * t - s / 6.0)
    return result


def _markov(edges: Array, time: float) -> Array:
    """G of the unit Gauss-Markov process, c = exp(-|t - s| / T)."""
    s, t = _ordered(edges)
    near = time * np.expm1(-s / time) + time * np.expm1(-t / time)
    near -= time * np.expm1(-(t - s) / time)
    result: Array = time * (2.0 * s + near)
    return result
