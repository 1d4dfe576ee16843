"""Covariances of means against simulated noise and against quadrature."""

import numpy as np
import pytest

from rotcli.calibrate.slow_noise import covariance_of_means
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.sensors import NoiseFigures
from rotcli.models.slow_noise import simulate_slow_noise

START, END = np.array([0.0, 20.0, 70.0, 65.0]), np.array([20.0, 50.0, 100.0, 80.0])
KINDS = {
    "flicker": NoiseFigures(bias_instability=2.0),
    "walk": NoiseFigures(rate_random_walk=0.3),
    "markov": NoiseFigures(markov_sigma=1.5, markov_time=12.0),
    "all": NoiseFigures(
        bias_instability=1.0, rate_random_walk=0.1, markov_sigma=0.7, markov_time=40.0
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_means_of_simulated_noise_have_the_covariance(kind):
    interval, runs = 0.1, 3000
    first, last = (START / interval).astype(int), (END / interval).astype(int)
    rng = np.random.default_rng(5)
    means = np.empty((runs, len(START)))
    for run in means:
        slow = SlowNoise.from_figures(KINDS[kind])  # from zero, as the covariance assumes
        drawn = simulate_slow_noise(rng.spawn(1)[0], 1000, interval, slow, history=0)
        run[:] = [drawn[a:b].mean() for a, b in zip(first, last, strict=True)]
    found = means.T @ means / runs
    expected = covariance_of_means(KINDS[kind], START, END)
    sigma = np.sqrt(np.diag(expected))
    # An element of a covariance of n draws scatters by up to sqrt(2/n) of its sigmas: five times
    # that, and 1 % for samples that are a tenth of a second apart.
    scale = np.outer(sigma, sigma)
    np.testing.assert_allclose(found / scale, expected / scale, atol=5 * np.sqrt(2 / runs) + 0.01)


def test_known_variances():
    one = np.zeros(1), np.array([60.0])
    # Walk: K^2 T / 3. Flicker: the mean of (2 / pi) artanh(sqrt(s / t)) is 2 / pi.
    assert covariance_of_means(KINDS["walk"], *one) == pytest.approx(0.3**2 * 60 / 3, rel=1e-12)
    assert covariance_of_means(KINDS["flicker"], *one) == pytest.approx(4.0 * 2 / np.pi, rel=1e-12)
    # Gauss-Markov over many correlation times: 2 sigma^2 T / length, less (T / length)^2 of it.
    expected = 2 * 1.5**2 * (12.0 / 6e3) * (1 - 12.0 / 6e3)
    long = covariance_of_means(KINDS["markov"], np.zeros(1), np.array([6e3]))
    assert long == pytest.approx(expected, rel=1e-12)


def test_neighbouring_means_of_flicker_differ_by_the_allan_floor():
    """Far from the start: half the squared difference of neighbours is the Allan variance."""
    start = 1e6 + np.array([0.0, 30.0])
    C = covariance_of_means(KINDS["flicker"], start, start + 30.0)
    allan = 0.5 * (C[0, 0] + C[1, 1] - 2 * C[0, 1])
    # Twelve digits lost in (t - s)^2 artanh of times that are a million seconds.
    assert allan == pytest.approx(4.0 * 2 * np.log(2) / np.pi, rel=1e-3)
