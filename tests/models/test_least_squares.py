"""Generalised least squares of interval means and prediction of a bias.

The numbers are in deg/h and s; they come from closed forms that are independent of the module, and
from simulated flicker noise whose generator knows no covariance.
"""

import numpy as np
import pytest
from scipy.stats import chi2 as chi_squared

from rotcli.models.mean_covariance import (
    IntervalNoise,
    SlowNoise,
    fit_gls,
    goodness,
    mean_covariance,
    predict,
    white_covariance,
)
from rotcli.models.slow_noise import simulate_slow_noise
from tests.models.imus import IMUS, NAV440

RATE = 100 * 3600.0  # deg/h: 100 deg/s
PPM = 1e6


def design(rates):
    """Columns of the constant and of the table rate in units of 100 deg/s."""
    return np.column_stack([np.ones(len(rates)), np.asarray(rates) / 100.0])


def blocks(imu, starts, ends):
    return IntervalNoise(np.array(starts, float), np.array(ends, float), *imu)


def every_64(count):
    starts = 64.0 * np.arange(count)
    return starts, starts + 60.0


def sigmas(imu, rates, starts, ends, window):
    """Sigma of the bias (deg/h), of the scale factor (ppm), and their correlation."""
    noise = blocks(imu, starts, ends)
    fit = fit_gls(design(rates), np.zeros(len(rates)), noise.covariance())
    horizon = noise.own_span() if window == "own" else noise.horizon(*window)
    result = predict(fit, np.eye(2), [1, 0], horizon)
    return result.sigma[0], result.sigma[1] / RATE * PPM, result.correlation(0, 1)


@pytest.mark.parametrize(
    ("imu", "bias", "scale", "correlation", "own"),
    [("NAV440", 18.651, 44.290, -0.546, 8.284), ("MTi-G", 43.268, 105.469, -0.576, 25.111)],
)
def test_the_paper_run_has_the_published_sigmas(imu, bias, scale, correlation, own):
    run = ([0, 100], [0, 64], [60, 124])
    got = sigmas(IMUS[imu], *run, (124, 424))
    np.testing.assert_allclose(got, (bias, scale, correlation), rtol=5e-5, atol=6e-4)
    assert sigmas(IMUS[imu], *run, "own")[0] == pytest.approx(own, abs=6e-4)


@pytest.mark.parametrize(
    ("imu", "expected"),
    [
        ("NAV440", [19.148, 19.325, 24.155, 20.059]),
        ("MTi-G", [36.596, 50.516, 96.625, 27.926]),
    ],
)
def test_the_bias_sigma_depends_on_the_horizon(imu, expected):
    windows = [(124, 184), (124, 724), (124, 3724), (0, 1)]
    got = [sigmas(IMUS[imu], [0, 100], [0, 64], [60, 124], w)[0] for w in windows]
    np.testing.assert_allclose(got, expected, atol=6e-4)


@pytest.mark.parametrize(
    ("imu", "expected"),
    [("NAV440", [17.818, 7.646, 40.627]), ("MTi-G", [42.884, 25.034, 104.907])],
)
def test_blocks_of_10_s_gain_a_little(imu, expected):
    starts = np.concatenate([np.arange(0, 60, 10), np.arange(64, 124, 10)])
    run = [0] * 6 + [100] * 6, starts, starts + 10
    bias, scale, _ = sigmas(IMUS[imu], *run, (124, 424))
    own, _, _ = sigmas(IMUS[imu], *run, "own")
    np.testing.assert_allclose([bias, own, scale], expected, atol=6e-4)


@pytest.mark.parametrize(
    ("imu", "expected"),
    [("NAV440", [14.630, 1.437, 48.333]), ("MTi-G", [35.148, 10.396, 111.386])],
)
def test_still_plus_50_still_minus_50_still_has_the_published_sigmas(imu, expected):
    run = ([0, 50, 0, -50, 0], *every_64(5))
    bias, scale, _ = sigmas(IMUS[imu], *run, (316, 616))
    own, _, _ = sigmas(IMUS[imu], *run, "own")
    np.testing.assert_allclose([bias, own, scale], expected, atol=6e-4)


@pytest.mark.parametrize(
    ("imu", "weights"),
    [
        ("NAV440", [0.147, 0.109, 0.108, 0.109, 0.527]),
        ("MTi-G", [-0.003, 0.139, 0.096, 0.139, 0.630]),
    ],
)
def test_weights_of_the_predicted_bias_equal_the_published_values(imu, weights):
    noise = blocks(IMUS[imu], *every_64(5))
    horizon = noise.horizon(316, 616)
    got = []
    for k in range(5):
        fit = fit_gls(design([0, 50, 0, -50, 0]), np.eye(5)[k], noise.covariance())
        got.append(predict(fit, np.eye(2), [1, 0], horizon).value[0])
    np.testing.assert_allclose(got, weights, atol=5.1e-4)


@pytest.mark.parametrize(
    ("imu", "expected"),
    [("NAV440", [15.266, 15.503, 16.659, 21.691]), ("MTi-G", [38.943, 39.705, 37.709, 56.549])],
)
def test_the_prediction_beats_the_plain_estimates(imu, expected):
    noise = blocks(IMUS[imu], *every_64(5))
    horizon, S = noise.horizon(316, 616), noise.covariance()
    A = design([0, 50, 0, -50, 0])
    weights = [np.array([fit_gls(A, row, S).estimate[0] for row in np.eye(5)])]
    weights += [
        np.array(w) for w in ([1 / 3, 0, 1 / 3, 0, 1 / 3], [0, 0, 0, 0, 1], [1, 0, 0, 0, 0])
    ]
    got = [np.sqrt(w @ S @ w - 2 * w @ horizon.cross + horizon.variance) for w in weights]
    np.testing.assert_allclose(got, expected, atol=6e-4)


@pytest.mark.parametrize(
    ("imu", "expected"),
    [("NAV440", [20.565, 9.444, 60.042]), ("MTi-G", [55.265, 23.966, 141.191])],
)
def test_six_rising_rates_have_the_published_sigmas(imu, expected):
    run = ([0, 10, 20, 50, 80, 100], *every_64(6))
    bias, scale, _ = sigmas(IMUS[imu], *run, (380, 680))
    own, _, _ = sigmas(IMUS[imu], *run, "own")
    np.testing.assert_allclose([bias, own, scale], expected, atol=6e-4)


def test_flicker_alone_separates_two_windows_by_the_published_sigmas():
    # A floor of 10.8 deg/h: B = 10.8 / sqrt(2 ln2/pi); the mean over the first minute against
    # that over the first second, the next minute and the next five.
    noise = SlowNoise(10.8 / np.sqrt(2 * np.log(2) / np.pi))
    for window, expected in (((0, 1), 20.51), ((61, 121), 15.40), ((121, 421), 18.38)):
        start, end = np.array([(0.0, 60.0), window]).T
        W = mean_covariance(start, end, noise)
        assert np.sqrt(W[0, 0] + W[1, 1] - 2 * W[0, 1]) == pytest.approx(expected, abs=6e-3)


def test_a_bias_needs_a_horizon_and_slopes_do_not():
    noise = blocks(NAV440, *every_64(5))
    fit = fit_gls(design([0, 50, 0, -50, 0]), np.zeros(5), noise.covariance())
    with pytest.raises(ValueError, match="needs a horizon"):
        predict(fit, np.eye(2), [1, 0])
    slope = predict(fit, np.array([[0.0, 1.0]]), [0])
    assert slope.sigma[0] / RATE * PPM == pytest.approx(48.333, abs=6e-4)


def test_dependent_columns_are_rejected():
    noise = blocks(NAV440, *every_64(3))
    with pytest.raises(ValueError, match="linearly dependent"):
        fit_gls(design([50, 50, 50]), np.zeros(3), noise.covariance())


def test_degrees_of_freedom_are_values_less_columns():
    rates = [-50, 0, 50, 50]
    fit = fit_gls(design(rates), np.zeros(4), blocks(NAV440, *every_64(4)).covariance())
    assert fit.dof == 4 - design(rates).shape[1]
    with pytest.raises(ValueError, match="linearly dependent"):
        fit_gls(design([50]), np.zeros(1), blocks(NAV440, *every_64(1)).covariance())


def test_sigmas_are_enlarged_above_the_99_percent_quantile_and_never_reduced():
    # Quantiles of chi-squared on 10 degrees of freedom from printed tables: 2.558, 23.209.
    assert goodness(23.3, 10).sigma_factor == pytest.approx(np.sqrt(2.33))
    assert goodness(23.3, 10).noise_too_small
    assert goodness(23.1, 10).sigma_factor == 1.0
    assert goodness(2.5, 10).noise_too_large
    assert not goodness(2.6, 10).noise_too_large
    assert goodness(2.5, 10).sigma_factor == 1.0
    assert goodness(0.0, 0).sigma_factor == 1.0
    assert not goodness(0.0, 0).noise_too_large


# A step of 2 s resolves intervals of 60 s: the averages over samples are what is compared, and
# the covariance of the means of flicker sampled at 2 s differs by less than 0.5 %.
_STEP = 2.0
_DESIGNS = {
    "paper": ([0, 100], [0.0, 64.0], [60.0, 124.0]),
    "still and turning five times": ([0, 50, 0, -50, 0], *every_64(5)),
    "six rising rates": ([0, 10, 20, 50, 80, 100], *every_64(6)),
}


def normalised_errors(imu, run, seeds, history=20):
    """Errors over sigma (seeds, 3): bias next 300 s, bias own span, scale factor."""
    rates, starts, ends = run[0], np.asarray(run[1]), np.asarray(run[2])
    slow, white = imu
    length = float(ends[-1]) + 300.0
    n = round(length / _STEP)
    rng = np.random.default_rng(20160)
    noise = blocks(imu, starts, ends)
    A, S = design(rates), noise.covariance()
    windows = [(float(ends[-1]), length), (0.0, float(ends[-1]))]
    errors = np.empty((seeds, 3))
    for seed in range(seeds):
        slow_noise = simulate_slow_noise(rng, n, _STEP, slow, history=history * n)

        def mean(a, b, series=slow_noise):
            return series[round(a / _STEP) : round(b / _STEP)].mean()

        z = np.array([mean(a, b) for a, b in zip(starts, ends, strict=True)])
        z += white / np.sqrt(ends - starts) * rng.standard_normal(len(z))
        fit = fit_gls(A, z, S)
        for i, window in enumerate(windows):
            result = predict(fit, np.eye(2), [1, 0], noise.horizon(*window))
            errors[seed, i] = (result.value[0] - mean(*window)) / result.sigma[0]
        errors[seed, 2] = result.value[1] / result.sigma[1]
    return errors


@pytest.mark.parametrize("imu", IMUS)
def test_sigmas_equal_the_scatter_of_simulated_errors(imu):
    errors = normalised_errors(IMUS[imu], _DESIGNS["paper"], seeds=200)
    # The standard deviation of 200 draws scatters by 5 %: three sigmas and 1 % of the step.
    assert np.all(np.abs(errors.std(axis=0) - 1) < 0.16)
    assert np.all(np.abs(errors.mean(axis=0)) < 0.21)


@pytest.mark.campaign
@pytest.mark.parametrize("imu", IMUS)
@pytest.mark.parametrize("run", _DESIGNS)
def test_sigmas_equal_the_scatter_of_3000_simulated_errors(imu, run):
    errors = normalised_errors(IMUS[imu], _DESIGNS[run], seeds=3000)
    assert np.all(np.abs(errors.std(axis=0) - 1) < 0.045)  # 1.3 % each, three sigmas
    assert np.all(np.abs(errors.mean(axis=0)) < 0.06)


def test_nothing_reported_depends_on_the_constant():
    start, end = every_64(5)
    rates, z = [0, 50, 0, -50, 0], np.array([3.0, 8.0, -4.0, 1.0, 6.0])
    results = []
    for span in (316.0, 1e4, 1e6):
        S = mean_covariance(start, end, NAV440[0], span=span)
        S += white_covariance(start, end, NAV440[1])
        fit = fit_gls(design(rates), z, S)
        window = np.array([316.0]), np.array([616.0])
        cross = mean_covariance(start, end, NAV440[0], other=window, span=span)[:, 0]
        own = mean_covariance(*window, NAV440[0], span=span)[0, 0]
        from rotcli.models.mean_covariance import Horizon

        p = predict(fit, np.eye(2), [1, 0], Horizon(cross, own))
        results.append(np.concatenate([p.value, p.sigma, [fit.chi2]]))
    np.testing.assert_allclose(results[1], results[0], rtol=1e-9)
    np.testing.assert_allclose(results[2], results[0], rtol=1e-8)


def test_the_gain_is_that_of_the_normal_equations():
    noise = blocks(NAV440, *every_64(5))
    A, S = design([0, 50, 0, -50, 0]), noise.covariance()
    fit = fit_gls(A, np.array([3.0, 8.0, -4.0, 1.0, 6.0]), S)
    weighted = A.T @ np.linalg.inv(S)
    np.testing.assert_allclose(fit.gain, np.linalg.solve(weighted @ A, weighted), atol=1e-9)


@pytest.mark.parametrize("unit", [1e-8, 1.0, 1e8])
def test_the_unit_of_the_columns_is_of_no_account(unit):
    A, z = design([0, 50, 20, -50]), np.array([3.0, 8.0, -4.0, 1.0])
    fit = fit_gls(A * unit, z, np.eye(4))
    np.testing.assert_allclose(
        fit.estimate * unit, np.linalg.lstsq(A, z, rcond=None)[0], rtol=1e-10
    )
    with pytest.raises(ValueError, match="linearly dependent"):
        fit_gls(design([30, 30, 30, 30]) * unit, z, np.eye(4))


def test_a_small_excess_of_many_degrees_of_freedom_is_noise_too_small():
    dof, chi2 = 50_000, 50_800.0  # 1.6 %, beyond the 99 % quantile; a factor of 1.008
    assert chi_squared.sf(chi2, dof) < 0.01
    assert goodness(chi2, dof).noise_too_small
