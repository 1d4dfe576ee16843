"""Flicker noise with a past: the variance of its contrasts against the generalised covariance."""

import numpy as np
import pytest

from rotcli.models.mean_covariance import SlowNoise, mean_covariance
from rotcli.models.slow_noise import flicker_noise, markov_noise, simulate_slow_noise

# The still interval and the navigation window of the paper's run, one sample per 4 s.
_FIRST, _LAST, _LENGTH = slice(0, 15), slice(31, 106), 106


def contrast_ratio(history, seeds=3000):
    """Variance of (mean of the last interval - mean of the first), simulated over exact."""
    rng = np.random.default_rng(7)
    start, end = np.array([0.0, 31.0]), np.array([15.0, 106.0])
    W = mean_covariance(start, end, SlowNoise(1.0))
    exact = W[0, 0] + W[1, 1] - 2 * W[0, 1]
    draws = [flicker_noise(rng, _LENGTH, history) for _ in range(seeds)]
    differences = [x[_LAST].mean() - x[_FIRST].mean() for x in draws]
    return np.mean(np.square(differences)) / exact


def test_flicker_with_a_past_has_the_variance_of_a_running_sensor():
    # 3000 squares scatter by 2.6 %.
    assert contrast_ratio(None) == pytest.approx(0.995, abs=0.08)


def test_flicker_from_zero_has_too_small_a_variance():
    assert contrast_ratio(0) == pytest.approx(0.83, abs=0.07)


def test_the_past_is_part_of_one_longer_series():
    # Same draws: the last samples of a series from zero are those of a series with that history.
    complete = flicker_noise(np.random.default_rng(3), 500, 0)
    cut = flicker_noise(np.random.default_rng(3), 180, 320)
    np.testing.assert_allclose(cut, complete[320:], atol=1e-12)


def test_the_first_samples_from_zero_follow_the_binomial_series():
    white = np.random.default_rng(5).standard_normal(3)
    got = flicker_noise(np.random.default_rng(5), 3, 0)
    # (1 - z^-1)^(-1/2) = 1 + 1/2 z^-1 + 3/8 z^-2 + ...
    expected = [white[0], white[1] + white[0] / 2, white[2] + white[1] / 2 + 3 / 8 * white[0]]
    np.testing.assert_allclose(got, expected, atol=1e-14)


def test_the_gauss_markov_process_is_stationary():
    rng = np.random.default_rng(11)
    draws = np.array([markov_noise(rng, 20, 0.9) for _ in range(4000)])
    np.testing.assert_allclose(draws.var(axis=0), 1.0, atol=0.1)  # four sigmas of 2.2 %
    assert np.mean(draws[:, 0] * draws[:, 5]) == pytest.approx(0.9**5, abs=0.07)


def test_a_random_walk_starts_at_zero_and_spreads_by_k_squared_t():
    rng = np.random.default_rng(12)
    noise = SlowNoise(rate_random_walk=2.0)
    draws = np.array([simulate_slow_noise(rng, 51, 0.1, noise) for _ in range(4000)])
    assert np.all(draws[:, 0] == 0)
    assert draws[:, 50].var() == pytest.approx(4.0 * 5.0, rel=0.09)


def test_switching_one_noise_off_leaves_the_others_unchanged():
    both = simulate_slow_noise(np.random.default_rng(1), 40, 1.0, SlowNoise(1.0, 2.0, 3.0, 9.0))
    parts = [
        simulate_slow_noise(np.random.default_rng(1), 40, 1.0, noise)
        for noise in (SlowNoise(1.0), SlowNoise(0.0, 2.0), SlowNoise(0.0, 0.0, 3.0, 9.0))
    ]
    np.testing.assert_allclose(both, sum(parts), atol=1e-12)


def test_no_samples_are_an_empty_series():
    assert len(flicker_noise(np.random.default_rng(0), 0)) == 0


def test_the_correlation_time_of_a_gauss_markov_process_is_in_seconds():
    noise = SlowNoise(markov_sigma=3.0, markov_time=10.0)
    x = simulate_slow_noise(np.random.default_rng(13), 200_000, 2.0, noise)
    # exp(-2 s / 10 s); 200,000 samples scatter by 0.0013.
    assert np.corrcoef(x[:-1], x[1:])[0, 1] == pytest.approx(np.exp(-0.2), abs=0.006)


def test_no_samples_after_a_past_are_an_empty_series():
    assert len(flicker_noise(np.random.default_rng(0), 0, 1)) == 0


def test_the_steps_of_a_slow_gauss_markov_process_have_the_variance_that_is_lost():
    decay, n = 0.999, 50
    white = np.random.default_rng(14).standard_normal(n)
    x = markov_noise(np.random.default_rng(14), n, decay)
    assert x[0] == white[0]
    expected = np.sqrt((1.0 - decay) * (1.0 + decay)) * white[1:]
    np.testing.assert_allclose(x[1:] - decay * x[:-1], expected, rtol=0.0, atol=1e-14)
