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
    IntervalNoise,
    SlowNoise,
    fit_gls,
    goodness,
    mean_covariance,
    predict,
    white_covariance,
)
from rotcli.models.slow_noise import simulate_slow_noise

# deg/h, deg/h/sqrt(s), deg/h sqrt(s): 1 deg/sqrt(h) is 60 deg/h sqrt(s).
NAV440 = SlowNoise(15.66, 0.35), 0.4 * 60
MTIG = SlowNoise(8.28, 2.6), 3.0 * 60
IMUS = {"NAV440": NAV440, "MTi-G": MTIG}
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


def test_the_series_of_far_intervals_equals_the_exact_second_difference():
    # Just beyond the distance where the series begins; 50 digits in the closed form.
    mpmath.mp.dps = 50
    p, q, h = mpmath.mpf(5), mpmath.mpf(20), mpmath.mpf(401)

    def F(x):
        return -(x**2) / 2 * (mpmath.log(abs(x)) - mpmath.mpf(3) / 2)

    exact = (F(h + p + q) + F(h - p - q) - F(h - p + q) - F(h + p - q)) / (4 * p * q)
    first = np.array([0.0]), np.array([10.0])
    last = np.array([386.0]), np.array([426.0])  # centres 401 apart
    noise = SlowNoise(np.sqrt(np.pi))
    got = mean_covariance(*first, noise, other=last, span=1.0)[0, 0] - 1.0
    assert got == pytest.approx(float(exact), abs=3e-14 * float(abs(exact)))
