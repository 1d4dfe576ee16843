"""Covariance of interval means, generalised least squares and prediction of a bias.

The numbers are in deg/h and s; they come from closed forms and quadrature that are independent
of the module, and from simulated flicker noise whose generator knows no covariance.
"""

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from rotcli.models.mean_covariance import (
    SlowNoise,
    mean_covariance,
    white_covariance,
)
from tests.models.imus import MTIG, NAV440


@pytest.mark.parametrize(
    ("slow", "expected"),
    [
        (SlowNoise(15.66), [-202.516913, -317.331282, -423.189299, -391.950406, -328.151110]),
        (SlowNoise(0.0, 0.35), [-1.225, -3.92, -14.945, -11.025, -6.125]),
    ],
)
def test_covariances_of_three_intervals_equal_the_published_values(slow, expected):
    start, end = np.array([0.0, 64.0, 124.0]), np.array([60.0, 124.0, 424.0])
    span = 424.0
    W = mean_covariance(start, end, slow, span=span)
    constant = slow.bias_instability**2 / np.pi * (np.log(span) + 1)
    constant += slow.rate_random_walk**2 * span
    plain = W - constant
    got = [plain[0, 0], plain[0, 1], plain[0, 2], plain[1, 2], plain[2, 2]]
    np.testing.assert_allclose(got, expected, rtol=2e-9, atol=5e-7)  # printed digits
    assert plain[1, 1] == pytest.approx(plain[0, 0], rel=1e-12)


@pytest.mark.parametrize(
    ("first", "last", "nav440", "mtig"),
    [
        ((0, 60), (64, 124), (229.628739, 5.39), (64.195325, 297.44)),
        ((0, 60), (124, 424), (315.710574, 22.54), (88.260480, 1243.84)),
        ((64, 124), (124, 424), (253.232789, 14.7), (70.794105, 811.2)),
        ((0, 60), (0, 124), (57.671554, 1.348817), (16.122739, 74.432688)),
    ],
)
def test_variances_of_differences_equal_the_published_values(first, last, nav440, mtig):
    start, end = np.array([first, last], float).T
    for (slow, _), (flicker, walk) in ((NAV440, nav440), (MTIG, mtig)):
        for noise, expected in (
            (SlowNoise(slow.bias_instability), flicker),
            (SlowNoise(0.0, slow.rate_random_walk), walk),
        ):
            W = mean_covariance(start, end, noise)
            got = W[0, 0] - W[0, 1] - W[1, 0] + W[1, 1]
            assert got == pytest.approx(expected, abs=2e-6)


def test_a_still_minute_of_white_noise_has_n_squared_over_tau():
    start, end = np.array([0.0]), np.array([60.0])
    assert white_covariance(start, end, NAV440[1])[0, 0] == pytest.approx(9.6)
    assert white_covariance(start, end, MTIG[1])[0, 0] == pytest.approx(540.0)


def test_half_the_variance_of_adjacent_means_is_the_allan_variance():
    for tau in (0.5, 60.0, 3600.0):
        W = mean_covariance(np.array([0, tau]), np.array([tau, 2 * tau]), NAV440[0])
        half = 0.5 * (W[0, 0] + W[1, 1] - 2 * W[0, 1])
        allan = 2 * np.log(2) / np.pi * 15.66**2 + 0.35**2 * tau / 3
        assert half == pytest.approx(allan, rel=1e-12)


def test_the_allan_variance_of_the_gauss_markov_process_equals_its_closed_form():
    from rotcli.models.sensors import NoiseFigures

    figures = NoiseFigures(markov_sigma=3.0, markov_time=50.0)
    slow = SlowNoise.from_figures(figures)
    for tau in (1.0, 50.0, 900.0):
        W = mean_covariance(np.array([0, tau]), np.array([tau, 2 * tau]), slow)
        half = 0.5 * (W[0, 0] + W[1, 1] - 2 * W[0, 1])
        assert half == pytest.approx(float(figures.allan_variance(np.array(tau))), rel=1e-9)


def _quadrature(g, a, b, c, d):
    """Mean of g(|t - s|) over [a, b] x [c, d] by the density of the difference (adaptive)."""
    corners = sorted({a - d, a - c, b - d, b - c, 0.0})

    def weighted(h):
        overlap = min(b, d + h) - max(a, c + h)
        return max(overlap, 0.0) * g(abs(h))

    low, high = a - d, b - c
    points = [x for x in corners if low <= x <= high]
    total = sum(
        quad(weighted, x, y, epsabs=0, epsrel=1e-12, limit=400)[0] for x, y in pairwise(points)
    )
    return total / ((b - a) * (d - c))


@pytest.mark.parametrize(
    ("first", "last"),
    [((0, 60), (64, 124)), ((0, 60), (30, 31)), ((5, 15), (5, 15)), ((0, 60), (2500, 2800))],
)
def test_closed_forms_equal_quadrature(first, last):
    start, end = np.array([first], float).T
    other = tuple(np.array([last], float).T)
    for noise, g in (
        (SlowNoise(1.0), lambda h: -np.log(h) / np.pi if h else 0.0),
        (SlowNoise(0.0, 1.0), lambda h: -0.5 * h),
        (SlowNoise(0, 0, 1.0, 40.0), lambda h: np.exp(-h / 40.0)),
    ):
        got = mean_covariance(start, end, noise, other=other, span=1.0)[0, 0]
        constant = noise.bias_instability / np.pi + noise.rate_random_walk
        expected = _quadrature(g, *map(float, first), *map(float, last))
        assert got - constant == pytest.approx(expected, rel=1e-10)


def test_far_intervals_keep_their_digits_after_48_hours():
    # Ten seconds, 48 h apart: the mean of -ln|h| differs from -ln of the distance by
    # (5^2 + 5^2) / (6 h^2); the plain second difference would lose seven digits.
    h = 48 * 3600.0
    noise = SlowNoise(np.sqrt(np.pi))
    got = mean_covariance(
        np.array([0.0]),
        np.array([10.0]),
        noise,
        other=(np.array([h]), np.array([h + 10])),
        span=1.0,
    )
    assert got[0, 0] - 1 + np.log(h) == pytest.approx(50 / (6 * h**2), abs=4e-15)


@pytest.mark.parametrize("swapped", [False, True])
def test_the_series_of_far_intervals_equals_the_exact_second_difference(swapped):
    # Just beyond the distance where the series begins; 50 digits in the closed form.
    mpmath.mp.dps = 50
    p, q, h = mpmath.mpf(5), mpmath.mpf(20), mpmath.mpf(401)

    def F(x):
        return -(x**2) / 2 * (mpmath.log(abs(x)) - mpmath.mpf(3) / 2)

    exact = (F(h + p + q) + F(h - p - q) - F(h - p + q) - F(h + p - q)) / (4 * p * q)
    first = np.array([0.0]), np.array([10.0])
    last = np.array([386.0]), np.array([426.0])  # centres 401 apart
    if swapped:
        first, last = last, first
    noise = SlowNoise(np.sqrt(np.pi))
    got = mean_covariance(*first, noise, other=last, span=1.0)[0, 0] - 1.0
    assert got == pytest.approx(float(exact), abs=3e-14 * float(abs(exact)))
