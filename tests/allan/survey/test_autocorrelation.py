"""The autocorrelation against its definition, and its expectation against simulation."""

import numpy as np
import pytest

from rotcli.allan.survey.autocorrelation import autocorrelation, expected_covariance
from rotcli.models.slow_noise import markov_noise


def test_it_is_the_mean_product_of_readings_a_lag_apart():
    values = np.random.default_rng(0).standard_normal(300) + 5.0
    found = autocorrelation(values, 2.0, None, None)
    rest = values - values.mean()
    direct = [np.mean(rest[k:] * rest[:-k]) for k in range(1, len(found.lag) + 1)]
    assert found.lag[0] == 2.0
    assert len(found.lag) == 30
    assert found.covariance == pytest.approx(direct, abs=1e-12)
    assert found.expected is None


def test_the_lags_reach_three_correlation_times():
    found = autocorrelation(np.random.default_rng(1).standard_normal(5000), 1.0, 2.0, 100.0)
    assert found.lag[-1] == 300.0
    assert len(found.expected) == 300


def test_the_expectation_is_the_mean_over_simulated_records():
    """Block averages of 10 samples of a process with T = 50 samples, the mean removed."""
    n, block, sigma, time = 300, 10, 3.0, 50.0
    rng = np.random.default_rng(2)
    lags = np.arange(1, 16)
    found = []
    for _ in range(1500):
        fine = sigma * markov_noise(rng, n * block, float(np.exp(-1.0 / time)))
        averages = fine.reshape(n, block).mean(axis=1)
        found.append(autocorrelation(averages, float(block), None, None).covariance[:15])
    expected = expected_covariance(lags, n, float(block), sigma, time)
    spread = np.std(found, axis=0) / np.sqrt(len(found))
    # The sampled process differs from the continuous one by (1/50)^2 / 6.
    assert np.all(np.abs(np.mean(found, axis=0) - expected) < 4.5 * spread + 2e-3 * sigma**2)


def test_the_mean_of_a_short_record_takes_its_own_variance_away():
    n, block, sigma, time = 30, 1.0, 2.0, 10.0
    a = block / time
    lags = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    # Block averages of exp(-|t|/T): lag 0 is not on the curve of the others.
    covariance = sigma**2 * (2.0 * np.cosh(a) - 2.0) / a**2 * np.exp(-a * lags)
    covariance[lags == 0] = 2.0 * sigma**2 * (a - 1.0 + np.exp(-a)) / a**2
    expected = covariance[0, 1:6] - covariance.mean()
    found = expected_covariance(np.arange(1, 6), n, block, sigma, time)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
