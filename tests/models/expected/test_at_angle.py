"""The mean at one table angle against the mean over a window, by dense Gaussian conditioning."""

import numpy as np
import pytest

from rotcli.models.expected.at_angle import AngleComparison
from rotcli.models.expected.sources import AccelSource, AxisSource
from rotcli.models.slow_noise import SlowNoise

LENGTH, RATE, STILL = 2.0, 0.4, 0.7  # s, rad/s, rad
TOLERANCE = (5e-3, 2e-3)  # m/s^2
WHITE = 1e-3  # m/s/sqrt(s)


def comparison(blocks):
    middle = RATE * LENGTH * np.arange(blocks)
    source = AccelSource((AxisSource(WHITE, SlowNoise(), None),))
    return middle, AngleComparison.of(
        (10.0, LENGTH, np.full(blocks, RATE), middle), STILL, TOLERANCE, source
    )


def test_the_columns_are_the_means_of_sines_over_the_blocks():
    middle, found = comparison(6)
    within = RATE * LENGTH * (np.arange(2000) + 0.5) / 2000 - 0.5 * RATE * LENGTH
    angle = middle[:, None] + within
    columns = [np.ones_like(angle)]
    for order in (1, 2):
        columns += [np.cos(order * angle), np.sin(order * angle)]
    expected = np.stack([column.mean(axis=1) for column in columns], axis=1)
    np.testing.assert_allclose(found.design, expected, atol=1e-7)
    row = [1.0, np.cos(STILL), np.sin(STILL), np.cos(2 * STILL), np.sin(2 * STILL)]
    np.testing.assert_allclose(found.still, row, atol=1e-15)


@pytest.mark.parametrize("blocks", [3, 8, 40])  # less than a turn, a turn, five turns
def test_weights_and_sigma_are_those_of_gaussian_conditioning(blocks):
    _, found = comparison(blocks)
    prior = np.diag([1.0, *np.repeat(TOLERANCE, 2) ** 2])  # 1 m/s^2: nearly nothing
    noise = WHITE**2 / LENGTH * np.eye(blocks)
    covariance = found.design @ prior @ found.design.T + noise
    common = found.design @ prior @ found.still
    weights = np.linalg.solve(covariance, common)
    variance = found.still @ prior @ found.still - common @ weights
    np.testing.assert_allclose(found.weights(), weights, atol=1e-4)
    assert found.weights().sum() == pytest.approx(1.0, abs=1e-9)
    values = found.design @ np.array([[0.3], [1e-3], [-2e-3], [5e-4], [1e-3]]) * np.ones(3)
    result = found.test(values)
    np.testing.assert_allclose(result.sigma, np.sqrt(variance), rtol=1e-3)
    if blocks == 40:  # all columns are known
        expected = found.still @ [0.3, 1e-3, -2e-3, 5e-4, 1e-3]
        np.testing.assert_allclose(result.value, expected, atol=3e-5)
