"""Second halves of the segments against a calibration of the first: value, sigma, finding."""

import numpy as np
import pytest
from scipy.stats import kstest

from rotcli.calibrate.out_of_sample import OutOfSample, _together, out_of_sample
from rotcli.models.mean_covariance import SlowNoise
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR
from tests.independent_noise import long_flicker

U = np.array([0.0, 0.0, 1.0])
WHITE, FLICKER = 0.4 * DEG_PER_ROOT_HOUR, 15.66 * DEG_PER_HOUR
NOISE = TriadNoise(np.full(3, WHITE), [SlowNoise(FLICKER)] * 3)
RATE = 30.0 * DEG
ENCODER = 0.01 * DEG
BIAS, COLUMN = np.array([1e-4, -2e-4, 3e-4]), np.array([1e-3, -2e-3, 3e-3])


def halves(noise, encoder=0.0):
    """Return first and second halves of a still and a turning minute; noise: (124, 3) per s.

    encoder: (3,) rad, errors of the table angle at start, middle and end of the turning minute.
    """
    first, second = [], []
    for start, rate in ((0, 0.0), (64, RATE)):
        for k, means in enumerate((first, second)):
            span = slice(start + 30 * k, start + 30 * (k + 1))
            read = noise[span].mean(axis=0) + BIAS + rate * (COLUMN + U)
            error = np.diff(np.broadcast_to(encoder, 3))[k] / 30.0 if rate else 0.0
            means.append((float(span.start), float(span.stop), read - (rate + error) * U, rate))
    variance = np.diag([0.0, 2.0 * (ENCODER / 30.0) ** 2])
    found = []
    for means in (first, second):
        start, end, z, rate = (np.array(column) for column in zip(*means, strict=True))
        found.append(SegmentMeans(start, end, z, rate, variance))
    turning = found[1]
    one = SegmentMeans(
        turning.start[1:], turning.end[1:], turning.z[1:], turning.rate[1:], variance[1:, 1:]
    )
    return found[0], one


def compare(noise, encoder=0.0):
    first, second = halves(noise, encoder)
    readings = second.z[0] + second.rate[0] * U
    return out_of_sample(first, second, [1], np.ones(1), readings, NOISE, U, (124.0, 424.0))


def test_without_noise_the_second_halves_are_the_table_rate():
    found = compare(np.zeros((124, 3)))
    np.testing.assert_allclose(found.mean, RATE * U, atol=1e-12)
    np.testing.assert_allclose(found.error, 0.0, atol=1e-12)
    assert found.test.exceeded is False


def test_sigma_and_level_are_those_of_noise_made_by_another_method():
    rng = np.random.default_rng(11)
    ratio, chi2 = [], []
    flicker = long_flicker(rng, 5 * 124, 0.2, (400, 3)).reshape(400, 3, 124, 5).mean(axis=-1)
    for slow in flicker:
        noise = WHITE * rng.standard_normal((124, 3)) + FLICKER * slow.T
        found = compare(noise, ENCODER * rng.standard_normal(3))
        ratio.append(found.error / found.sigma)
        chi2.append(found.test.value)
    # 400 draws of each gyro: their standard deviation is 1 +- 0.035.
    np.testing.assert_allclose(np.std(ratio, axis=0), 1.0, atol=0.11)
    assert kstest(chi2, "chi2", args=(3,)).statistic < 1.63 / np.sqrt(400.0)


def test_a_bias_that_changes_in_the_middle_of_a_segment_is_found_with_its_size():
    noise = np.zeros((124, 3))
    noise[94:, 1] = 200.0 * DEG_PER_HOUR
    found = compare(noise)
    (finding,) = found.findings("imu.csv")
    assert finding.code == "mean-after-unexpected"
    assert "gyro_y" in finding.text
    assert "read 200 deg/h too much" in finding.text
    assert found.error[1] == pytest.approx(200.0 * DEG_PER_HOUR, rel=1e-9)


def test_without_noise_figures_nothing_is_tested():
    found = OutOfSample(np.zeros(3), np.ones(3), np.zeros(3))
    assert found.test is None
    assert found.findings("imu.csv") == []


def test_second_halves_count_by_their_samples_and_share_the_angle_in_their_middle():
    rates = np.array([0.0, RATE, 2.0 * RATE])
    start = np.array([0.0, 100.0, 200.0])
    shift = np.array([[0.0, 0.0, 0.0], [3e-6, 0.0, -3e-6]])
    readings = BIAS + np.outer(rates, COLUMN)
    variance = np.diag([0.0, 4e-12, 9e-12])
    first = SegmentMeans(start, start + 30.0, readings, rates, variance)
    second = SegmentMeans(
        start[1:] + 30.0, start[1:] + 60.0, readings[1:] + shift, rates[1:], variance[1:, 1:]
    )
    samples = np.array([1.0, 2.0])
    found = out_of_sample(first, second, [1, 2], samples, BIAS, NOISE, U, (260.0, 560.0))
    np.testing.assert_allclose(found.error, [2e-6, 0.0, -2e-6], atol=1e-15)
    both = _together(first, second, [1, 2])
    # The rate of a half is the difference of two angles, whose middle one has both signs.
    middle = -0.5 * np.diag([4e-12, 9e-12])
    expected = np.zeros((5, 5))
    expected[:3, :3], expected[3:, 3:] = variance, variance[1:, 1:]
    expected[1:3, 3:] = expected[3:, 1:3] = middle
    np.testing.assert_allclose(both.rate_covariance, expected, atol=1e-24)
    np.testing.assert_array_equal(both.rate, [*rates, *rates[1:]])
