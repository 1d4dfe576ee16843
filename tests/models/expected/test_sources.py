"""Covariance of the slow error over the window, its mean, and the residual tests built on it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from rotcli.models.expected.companions import block_length, block_residuals, mean_residual
from rotcli.models.expected.sources import (
    AxisSource,
    GyroSource,
    generalised_contrast,
    least_squares_contrast,
    slow_covariances,
    still_contrast,
    window_mean_variance,
)
from rotcli.models.mean_covariance import IntervalNoise, SlowNoise, mean_covariance
from rotcli.models.slow_noise import simulate_slow_noise
from rotcli.units import DEG, DEG_PER_HOUR
from tests.models.expected.runs import PROFILES, contrast, window


def _gyro(profile: str, mode: str, w: float) -> GyroSource:
    p = PROFILES[profile]
    return GyroSource((AxisSource(p["white"], p["slow"], contrast(mode, w)),))


@pytest.mark.parametrize(
    ("profile", "mode", "first", "last", "mean"),
    [
        ("NAV440", "full", 16.5501, 26.1834, 16.6593),
        ("NAV440", "conventional", 16.5501, 26.1834, 16.6593),
        ("NAV440", "partial", 21.5560, 26.8321, 18.5796),
        ("MTi-G", "full", 27.7637, 53.2577, 37.7093),
        ("MTi-G", "conventional", 27.7637, 53.2577, 37.7093),
        ("MTi-G", "partial", 35.1343, 57.0637, 43.0254),
    ],
)
def test_drift_in_30_blocks_has_the_verified_sigmas(profile, mode, first, last, mean):
    w = 30.0 * DEG if mode != "conventional" else 0.0
    source, start = _gyro(profile, mode, w).axes[0], window(mode)[0]
    (slow,) = slow_covariances(start, 10.0, np.full(30, w), [source])
    E = slow.dense()
    found = np.sqrt([E[0, 0], E[-1, -1], E.mean()]) / DEG_PER_HOUR
    np.testing.assert_allclose(found, [first, last, mean], rtol=1e-5)


def test_the_covariance_is_that_of_the_contrast_written_out():
    # Weights of two segments and one block at a time, summing to zero: c^T W c + white.
    profile = PROFILES["NAV440"]
    ends = np.array([[0.0, 60.0], [61.0, 121.0]]).T
    w = 0.5
    gains = least_squares_contrast(*ends, np.array([0.0, w]))
    starts = np.concatenate([gains.start, 121.0 + 7.0 * np.arange(4)])
    finish = np.concatenate([gains.end, starts[2:] + 7.0])
    W = mean_covariance(starts, finish, profile["slow"])
    W[:2, :2] += np.diag(profile["white"] ** 2 / gains.duration)
    rate = np.array([w, 0.2, -w, 0.0])
    weights = np.hstack([-(gains.bias + np.outer(rate, gains.column)), np.eye(4)])
    np.testing.assert_allclose(weights.sum(axis=1), 0.0, atol=1e-12)
    axis = AxisSource(profile["white"], profile["slow"], gains)
    (E,) = slow_covariances(121.0, 7.0, rate, [axis])
    expected = weights @ W @ weights.T
    np.testing.assert_allclose(E.dense(), expected, rtol=1e-9, atol=1e-9 * expected.max())


def test_least_squares_of_two_segments_is_the_difference_over_the_rate():
    gains = least_squares_contrast(np.array([0.0, 61.0]), np.array([60.0, 121.0]), np.array([0, 2]))
    np.testing.assert_allclose(gains.bias, [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(gains.column, [-0.5, 0.5], atol=1e-12)


@pytest.mark.parametrize(("profile", "sigma"), [("NAV440", 16.72), ("MTi-G", 39.12)])
@pytest.mark.parametrize("rate", [10.0, 100.0])
def test_the_mean_corrected_output_has_the_verified_sigma_at_any_rate(profile, sigma, rate):
    source = _gyro(profile, "full", rate * DEG)
    variance = window_mean_variance(121.0, 421.0, rate * DEG, source.axes[0])
    assert np.sqrt(variance) / DEG_PER_HOUR == pytest.approx(sigma, rel=1e-3)
    at_three_sigma = np.array([0.0, 0.0, 3.0 * sigma * DEG_PER_HOUR])
    test = mean_residual(at_three_sigma, 121.0, 421.0, rate * DEG, source)
    assert test.p_value == pytest.approx(3 * 0.0027, rel=0.02)  # two-sided normal, three axes


def _residuals(seed: int) -> tuple[np.ndarray, GyroSource]:
    """Return one-second means (300, 3) of corrected gyros of a run in full mode, 10 Hz."""
    profile, interval = PROFILES["NAV440"], 0.1
    rng = np.random.default_rng(seed)
    source = _gyro("NAV440", "full", 30.0 * DEG)
    columns = []
    for _ in range(3):
        x = simulate_slow_noise(rng, 4210, interval, profile["slow"], history=10 * 4210)
        x += profile["white"] / np.sqrt(interval) * rng.standard_normal(4210)
        columns.append(x[1210:].reshape(300, 10).mean(axis=1) - x[610:1210].mean())
    return np.column_stack(columns), source


def test_whitened_residuals_of_clean_runs_are_standard_normal():
    whitened = []
    for seed in range(8):
        means, source = _residuals(seed)
        whitened.append(block_residuals(means, 121.0, 1.0, np.full(300, 30.0 * DEG), source))
    chi2 = np.array([w.chi2_per_dof for w in whitened])
    # 24 figures of 300 dof each: sigma of one 0.082, of the mean 0.017.
    assert np.all(np.abs(chi2 - 1.0) < 4 * 0.082)
    assert chi2.mean() == pytest.approx(1.0, abs=4 * 0.017)
    assert min(w.p_value for w in whitened) > 1e-3


def test_a_spike_in_one_second_is_found_with_axis_and_time():
    means, source = _residuals(3)
    means[123, 1] += 0.57 * DEG  # 57 deg/s for one sample of a hundred
    found = block_residuals(means, 121.0, 1.0, np.full(300, 30.0 * DEG), source)
    assert (found.axis, found.at) == (1, 244.0)
    assert found.p_value < 1e-12
    # Against white noise alone 85 sigma; with the flicker of a second's mean 71.
    assert found.maximum == pytest.approx(0.83 * 0.57 * DEG / source.axes[0].white, rel=0.03)


def test_long_windows_have_longer_blocks():
    assert block_length(21600.0) == 24.0


def test_every_disturbed_second_is_listed_and_noise_figures_that_are_too_small_are_none():
    means, source = _residuals(3)
    rate = np.full(300, 30.0 * DEG)
    assert block_residuals(means, 121.0, 1.0, rate, source).disturbed == ()
    noisy = block_residuals(3.0 * means, 121.0, 1.0, rate, source)
    assert noisy.p_value < 1e-3
    assert noisy.disturbed == ()
    means[[10, 11, 200], 2] += 1.0 * DEG
    found = block_residuals(means, 121.0, 1.0, rate, source)
    assert found.disturbed == (131.0, 132.0, 321.0)


def test_generalised_least_squares_of_two_segments_is_least_squares():
    profile = PROFILES["NAV440"]
    ends = np.array([[0.0, 60.0], [61.0, 121.0]]).T
    rate = np.array([0.0, 0.5])
    noise = IntervalNoise(*ends, profile["slow"], profile["white"])
    gls, ols = (
        generalised_contrast(noise, rate, (121.0, 421.0)),
        least_squares_contrast(*ends, rate),
    )
    np.testing.assert_allclose(gls.bias, ols.bias, atol=1e-6)
    np.testing.assert_allclose(gls.column, ols.column, atol=1e-6)


def test_generalised_least_squares_predicts_the_bias_better_than_least_squares():
    # Still, +50, still, -50, still (60 s each): 14.6 deg/h against 15.5 for the mean of the stills.
    profile, w = PROFILES["NAV440"], 50.0 * DEG
    start = 61.0 * np.arange(5)
    rate = w * np.array([0.0, 1.0, 0.0, -1.0, 0.0])
    noise = IntervalNoise(start, start + 60.0, profile["slow"], profile["white"])
    window = 304.0, 604.0
    gains = generalised_contrast(noise, rate, window)
    source = AxisSource(0.0, profile["slow"], gains)
    axis = AxisSource(profile["white"], profile["slow"], gains)
    (E,) = slow_covariances(304.0, 300.0, np.zeros(1), [axis])
    assert np.sqrt(E.dense()[0, 0]) / DEG_PER_HOUR == pytest.approx(14.6, abs=0.1)
    assert window_mean_variance(*window, 0.0, source) < E.dense()[0, 0]


def test_sensors_of_one_triad_share_their_segments():
    profile = PROFILES["NAV440"]
    one = AxisSource(profile["white"], profile["slow"], still_contrast(0.0, 60.0))
    other = AxisSource(profile["white"], profile["slow"], still_contrast(0.0, 30.0))
    without = AxisSource(profile["white"], profile["slow"], None)
    with pytest.raises(ValueError, match="different segments"):
        slow_covariances(121.0, 7.0, np.zeros(3), [one, other])
    assert slow_covariances(121.0, 7.0, np.zeros(3), [without, one])[0] is None
    together = slow_covariances(121.0, 7.0, np.zeros(3), [one, without, one])
    alone = slow_covariances(121.0, 7.0, np.zeros(3), [one])
    assert together[1] is None
    np.testing.assert_array_equal(together[2].dense(), alone[0].dense())


def test_least_squares_of_several_segments_is_a_weighted_line_fit():
    start = np.array([0.0, 61.0, 130.0, 200.0])
    end = np.array([60.0, 121.0, 150.0, 290.0])
    rate = np.array([0.0, 2.0, -1.0, 0.5])
    gains = least_squares_contrast(start, end, rate)
    root = np.sqrt(end - start)
    for k in range(4):
        # numpy.polyfit weights residuals, not their squares; its first figure is the slope.
        slope, offset = np.polyfit(rate, np.eye(4)[k], 1, w=root)
        assert (gains.bias[k], gains.column[k]) == pytest.approx((offset, slope), abs=1e-12)


def test_three_different_gyros_are_judged_each_by_its_own_noise():
    means, source = _residuals(5)
    one = source.axes[0]
    axes = tuple(replace(one, white=factor * one.white) for factor in (1.0, 3.0, 0.5))
    rate = np.full(300, 30.0 * DEG)
    found = block_residuals(means, 121.0, 1.0, rate, replace(source, axes=axes))
    for k, axis in enumerate(axes):
        alone = block_residuals(means, 121.0, 1.0, rate, replace(source, axes=(axis,)))
        assert found.chi2_per_dof[k] == pytest.approx(alone.chi2_per_dof[k], rel=1e-12)


@pytest.mark.parametrize(("factor", "listed"), [(0.995, ()), (1.005, (161.0,))])
def test_a_second_is_listed_from_the_sigmas_that_one_of_900_means_exceeds_in_a_thousandth(
    factor, listed
):
    # White noise alone: the sigma of a second's mean is N. 300 blocks of three gyros, two-sided.
    white = 0.4 * DEG_PER_HOUR
    contrast = still_contrast(0.0, 1e9)
    source = GyroSource((AxisSource(white, SlowNoise(0.0, 0.0), contrast),))
    means = np.zeros((300, 3))
    means[40, 2] = factor * norm.isf(0.5e-3 / 900) * white
    found = block_residuals(means, 121.0, 1.0, np.zeros(300), source)
    assert found.disturbed == listed
    one = 2.0 * norm.sf(found.maximum)  # of 900 independent means, the largest
    assert found.p_value == pytest.approx(1.0 - (1.0 - one) ** 900, rel=1e-6)
