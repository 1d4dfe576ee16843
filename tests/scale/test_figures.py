"""Hysteresis, misalignment, response ratio, repeatability, correction and design."""

import numpy as np
import pytest
from scipy.stats import chi2

from rotcli.models.laboratory.rate_curve import GyroCurve, RateCurve, correct, distort
from rotcli.models.sensors import NoiseFigures
from rotcli.scale.figures import (
    Figure,
    composite_error,
    maximum_draws,
    misalignment,
    nonlinearity,
    parts,
    rate_residuals,
    response_ratio,
)
from rotcli.scale.fit import CurveProblem, select_model
from rotcli.scale.hysteresis import directions, hysteresis
from rotcli.scale.prediction import alternating, design_sigmas, linear_verdict
from rotcli.scale.repeatability import minus_two_log_reml, repeatability
from tests.scale.sets import (
    A1,
    ALTERNATING,
    DEG,
    DPH,
    FULL_SCALE,
    IMUS,
    MTIG,
    NAV440,
    PPM,
    blocks,
    noisy_blocks,
    truth,
)

FS = FULL_SCALE
SWEEP = [-100, -50, -20, 20, 50, 100]
UP_DOWN = SWEEP + SWEEP[::-1]


def problem_of(rates, z=None, figures=NAV440, **keys):
    return CurveProblem((blocks(rates, z, **keys),), 2, figures, FS)


@pytest.mark.parametrize(
    ("imu", "quantiles"),
    [("NAV440", (41.1, 64.9, 76.7)), ("MTi-G", (93.4, 147.3, 174.7))],
)
def test_the_largest_deviation_under_a_line_has_the_published_quantiles(imu, quantiles):
    selection = select_model(problem_of(A1, truth(A1), IMUS[imu]))
    NL = nonlinearity(selection)
    assert NL.limit / PPM == pytest.approx(quantiles[1], rel=0.02)
    table = selection.fits["table"]
    A = np.column_stack([np.ones(9), table.problem.rates])
    maker = np.eye(9) - A @ np.linalg.pinv(A)
    draws = maximum_draws(maker @ table.gls.covariance @ maker.T) / FS / PPM
    got = draws.mean(), np.quantile(draws, 0.95), np.quantile(draws, 0.99)
    np.testing.assert_allclose(got, quantiles, rtol=0.02)


def test_residuals_of_an_exact_cubic_are_its_deviations_from_the_line():
    selection = select_model(problem_of(A1, truth(A1, "cubic")), "cubic")
    residuals = rate_residuals(selection)
    rates = np.array([-100, -50, -20, -10, 0, 10, 20, 50, 100])
    e = truth(rates, "cubic")
    expected = e - np.polyval(np.polyfit(rates, e, 1), rates)
    np.testing.assert_allclose(residuals.residual, expected, atol=1e-6 * DPH)
    np.testing.assert_allclose(residuals.curve, expected, atol=1e-6 * DPH)
    np.testing.assert_allclose(residuals.rates / DEG, rates, atol=1e-9)
    assert np.all(residuals.sigma > 0)
    assert composite_error(selection) == pytest.approx(np.max(np.abs(expected)) / FS, rel=1e-6)


def test_odd_and_even_parts_of_an_exact_cubic_are_its_terms():
    selection = select_model(problem_of(A1, truth(A1, "cubic")))
    found = parts(selection)
    x = np.array([10, 20, 50, 100]) / 100
    np.testing.assert_allclose(found.odd / DPH, 324 * x - 60 * x**3, atol=1e-6)
    np.testing.assert_allclose(found.even / DPH, 30 * x**2, atol=1e-6)
    np.testing.assert_allclose(found.rates / DEG, 100 * x)


def test_one_sign_alone_has_no_parts():
    assert parts(select_model(problem_of([0, 10, 20, 50, 0]))) is None


def test_blocks_know_the_side_that_they_were_reached_from():
    got = directions(problem_of(UP_DOWN))
    np.testing.assert_array_equal(got, [0, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1])
    log = blocks([0, 10, 0])
    both = CurveProblem((log, log), 2, NAV440, FS)
    np.testing.assert_array_equal(directions(both), [0, 1, -1, 0, 1, -1])


@pytest.mark.parametrize(("sweeps", "sigma"), [(1, 13.22), (2, 8.23), (4, 5.50)])
def test_hysteresis_has_the_published_sigma(sweeps, sigma):
    found = hysteresis(problem_of(UP_DOWN * sweeps))
    assert found.difference.sigma / DPH == pytest.approx(sigma, rel=0.01)


def test_a_true_hysteresis_is_measured_up_minus_down():
    s = np.array([0, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1])
    z = truth(UP_DOWN) + 7.5 * DPH * s
    found = hysteresis(problem_of(UP_DOWN, z))
    assert found.difference.value / DPH == pytest.approx(15.0)
    assert found.limit == pytest.approx(found.difference.value + 2 * found.difference.sigma)
    np.testing.assert_allclose(found.per_rate / DPH, 15.0, atol=1e-6)


def test_a_sweep_in_one_direction_has_no_hysteresis():
    assert hysteresis(problem_of(SWEEP)) is None


@pytest.mark.campaign
def test_the_scatter_of_the_hysteresis_equals_its_sigma():
    rng = np.random.default_rng(44)
    s = np.array([0, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1])
    errors = []
    for _ in range(400):
        log, _, _ = noisy_blocks(rng, UP_DOWN, "line", NAV440)
        found = hysteresis(problem_of(UP_DOWN, log.mean[:, 2] + 7.5 * DPH * s))
        errors.append((found.difference.value - 15 * DPH) / found.difference.sigma)
    assert np.std(errors) == pytest.approx(1.0, abs=0.1)
    assert abs(np.mean(errors)) < 0.2


@pytest.mark.parametrize(
    ("true", "naive", "corrected"),
    [(0, 37.6, 13.9), (30, 46.5, 24.0), (100, 104.6, 94.3), (1000, 1000.4, 999.5)],
)
def test_the_misalignment_loses_the_bias_of_a_norm(true, naive, corrected):
    rng = np.random.default_rng(9)
    draws = rng.normal([true, 0], 30, (5_000, 2))
    found = [misalignment(Figure(a, 30.0), Figure(b, 30.0)) for a, b in draws]
    assert np.mean([f[1] for f in found]) == pytest.approx(naive, abs=1.4)
    assert np.mean([f[0].value for f in found]) == pytest.approx(corrected, abs=1.4)


def test_a_small_misalignment_has_an_upper_limit():
    figure, norm, limit = misalignment(Figure(30.0, 30.0), Figure(40.0, 30.0))
    assert (figure.value, figure.sigma) == (pytest.approx(np.sqrt(700)), pytest.approx(30.0))
    assert (norm, limit) == (pytest.approx(50.0), pytest.approx(110.0))
    assert misalignment(Figure(300.0, 30.0), Figure(400.0, 30.0))[2] is None


LOW = np.array([0.01, 0.02, 0.05, 0.1, 0.2])
LOW_PAIRS = [0, *np.column_stack([LOW, -LOW]).ravel(), 0]


def test_the_response_ratio_has_the_published_sigmas():
    found = response_ratio(parts(select_model(problem_of(LOW_PAIRS))))
    np.testing.assert_allclose(found.sigma, [0.218, 0.110, 0.044, 0.022, 0.011], atol=6e-4)
    np.testing.assert_allclose(found.ratio, 1.0)
    assert found.dead_band is None
    assert found.threshold == pytest.approx(0.01 * DEG)


def test_a_dead_band_and_its_threshold_are_found():
    w = np.array(LOW_PAIRS) * DEG
    z = np.where(np.abs(w) < 0.15 * DEG, -w, 0.0)  # no response below 0.15 deg/s
    found = response_ratio(parts(select_model(problem_of(LOW_PAIRS, z))))
    # At 0.01 and 0.02 deg/s the ratio is 0 with 2 sigma above the limit of 0.1.
    assert found.dead_band == pytest.approx(0.1 * DEG)
    assert found.threshold == pytest.approx(0.2 * DEG)


def test_the_reml_of_equal_sigmas_is_the_analysis_of_variance():
    y = np.array([3.0, 9.0, 4.0, 12.0, 7.0])
    found = repeatability(y, np.full(5, 2.0))
    assert found.sigma**2 == pytest.approx(np.var(y, ddof=1) - 4.0, rel=1e-4)
    assert found.mean == pytest.approx(7.0)
    assert found.mean_sigma == pytest.approx(np.std(y, ddof=1) / np.sqrt(5), rel=1e-4)
    assert found.low < found.sigma < found.high


def test_the_reml_equals_the_dense_restricted_likelihood():
    y, s = np.array([1.0, 5.0, 2.0]), np.array([0.5, 1.0, 2.0])
    V = np.diag(s**2 + 3.0)
    one = np.ones((3, 1))
    inverse = np.linalg.inv(V)
    P = inverse - inverse @ one @ one.T @ inverse / (one.T @ inverse @ one)
    dense = np.linalg.slogdet(V)[1] + np.log((one.T @ inverse @ one)[0, 0]) + y @ P @ y
    assert minus_two_log_reml(np.array([3.0]), y, s)[0] == pytest.approx(dense, rel=1e-12)


def test_equal_values_have_no_repeatability_but_an_upper_limit():
    found = repeatability(np.array([5.0, 5.1, 4.9]), np.full(3, 2.0))
    assert (found.sigma, found.low) == (0.0, 0.0)
    assert 0 < found.high < 20
    with pytest.raises(ValueError, match="two turn-ons"):
        repeatability(np.array([1.0]), np.array([1.0]))


@pytest.mark.campaign
@pytest.mark.parametrize("logs", [4, 6, 10, 20])
def test_the_repeatability_is_unbiased_over_turn_ons(logs):
    rng = np.random.default_rng(6)
    s = np.full(logs, 29.5)
    found = [repeatability(rng.normal(0, np.hypot(50, 29.5), logs), s).sigma for _ in range(2000)]
    # 2000 draws of 4: variance scatters by 2 %, and cutting off at zero adds a little.
    assert np.mean(np.square(found)) == pytest.approx(2500, rel=0.07)
    # It is zero where the scatter is below the sigma of a value.
    zero = chi2.cdf((logs - 1) * 29.5**2 / (50**2 + 29.5**2), logs - 1)
    assert np.mean(np.equal(found, 0)) == pytest.approx(zero, abs=0.02)


KNOTS = np.array([-100, -50, -20, -10, 0, 10, 20, 50, 100.0])


def curve_of(function, model="table", coefficients=(), knots=KNOTS, bias=60.0):
    """A triad of which gyro z has the error curve (deg/h over deg/s), the others none."""
    none = GyroCurve("line", np.zeros(1), 0 * knots, 0.0)
    gyro = GyroCurve(model, np.array(coefficients), function(knots) * DPH, 900 * PPM)
    return RateCurve(
        axis=np.array([0, 0, 1.0]),
        bias=np.array([0, 0, bias * DPH]),
        full_scale=FS,
        knots=knots * DEG,
        gyros=(none, none, gyro),
    )


def cubic(w):
    x = w / 100
    return 324 * x + 30 * x**2 - 60 * x**3


CUBIC = curve_of(cubic, "cubic", np.array([324, 30, -60]) * DPH)


def test_correcting_undoes_the_error_curve_to_2e_7_deg_per_hour():
    w = np.linspace(-100, 100, 401) * DEG
    true = np.column_stack([0 * w, 0 * w, w])
    np.testing.assert_allclose(correct(CUBIC, distort(CUBIC, true)), true, atol=3e-7 * DPH)


def test_a_table_is_read_by_a_monotone_cubic():
    def knee(w):
        return cubic(w) + 20 * np.tanh(w / 15)

    curve = curve_of(knee)
    w = np.linspace(-100, 100, 2001)
    worst = np.max(np.abs(curve.error(w * DEG)[:, 2] / DPH - knee(w)))
    assert worst == pytest.approx(2.9, abs=0.1)
    linear = np.max(np.abs(np.interp(w, KNOTS, knee(KNOTS)) - knee(w)))
    assert linear == pytest.approx(10.4, abs=0.1)


def test_outside_its_rates_a_curve_continues_with_the_slope_of_the_line():
    error = CUBIC.error(np.array([100.0, 110.0]) * DEG)[:, 2] / DPH
    assert error[1] - error[0] == pytest.approx(10 * 3600 * 900 * PPM)
    gyro = distort(CUBIC, np.array([[0, 0, 99.0], [0, 0, 102.0], [0, 0, -102.0]]) * DEG)
    np.testing.assert_array_equal(CUBIC.outside(gyro), [False, True, True])
    assert not np.any(CUBIC.outside(gyro, samples=3))  # their mean is inside


def azimuth_error(calibrated, rate):
    """Azimuth error (deg) after 300 s at a rate with a bias and a scale factor, deg/h and 1."""
    bias, K = calibrated
    return (60 + cubic(rate) - bias - K * rate * 3600) * 300 / 3600


def test_a_calibration_at_one_rate_is_exact_at_that_rate_only():
    at_50 = (60.0, cubic(50) / (50 * 3600))
    got = [azimuth_error(at_50, w) for w in (10, 20, 50, 100, -100)]
    np.testing.assert_allclose(got, [0.02, 0.06, 0, -2.5, 7.5], atol=6e-3)


def test_sigmas_of_a_design_need_no_data():
    got = design_sigmas(np.array(ALTERNATING) * DEG, NAV440, FS)
    assert got.scale / PPM == pytest.approx(12.57, rel=0.01)
    assert got.bias / DPH == pytest.approx(14.08, rel=0.01)
    assert got.bias_own / DPH == pytest.approx(0.761, rel=0.01)
    assert got.total == 18 * 64 - 4
    sweep = design_sigmas(np.array(A1) * DEG, NAV440, FS, duration=15.0)
    assert sweep.scale / PPM == pytest.approx(30.40, rel=0.01)
    assert sweep.bias_own / DPH == pytest.approx(1.541, rel=0.01)
    low = design_sigmas(np.array(LOW_PAIRS) * DEG, NAV440, FS)
    assert low.response_ratio == pytest.approx(0.218, rel=0.01)


def test_the_recommended_order_alternates_the_signs():
    got = alternating(np.array(A1, float))
    np.testing.assert_array_equal(got, ALTERNATING)


def test_a_line_is_good_enough_below_40_ppm_of_100_deg_per_second():
    def verdict(ppm, figures=NAV440):
        x = np.array(A1) / 100
        z = truth(A1) + ppm * PPM * FS * (x**3 - x) / 0.385  # deviation about ppm of full scale
        return linear_verdict(select_model(problem_of(A1, z, figures), "cubic").selected)

    assert verdict(25).good
    assert not verdict(120).good
    assert verdict(25).up_to == float("inf")
    assert verdict(120).up_to is None or verdict(120).up_to < 5
    assert verdict(25).sigma / DPH == pytest.approx(18, rel=0.3)
    assert verdict(120, MTIG).good


def test_the_verdict_of_a_straight_line_is_good_for_every_run():
    found = linear_verdict(select_model(problem_of(A1, truth(A1))).selected)
    assert (found.deviation, found.up_to) == (0.0, float("inf"))


def test_white_noise_excuses_short_runs_only():
    noisy = NoiseFigures(white=3.0 * DEG / 60, bias_instability=1.0 * DPH)
    z = truth(A1, "cubic")
    found = linear_verdict(select_model(problem_of(A1, z, noisy), "cubic").selected)
    assert 10 < found.up_to < 300


@pytest.mark.parametrize(("sigmas", "significant"), [(2.9, False), (3.1, True)])
def test_a_hysteresis_is_significant_beyond_three_sigmas(sigmas, significant):
    s = np.array([0, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1])
    sigma = hysteresis(problem_of(UP_DOWN)).difference.sigma
    found = hysteresis(problem_of(UP_DOWN, truth(UP_DOWN) + 0.5 * sigmas * sigma * s))
    assert (found.limit is None) is significant


def test_a_large_bias_does_not_put_readings_outside_the_rates():
    curve = curve_of(cubic, "cubic", np.array([324, 30, -60]) * DPH, bias=5 * 3600.0)  # 5 deg/s
    gyro = np.array([[0, 0, 104.0], [0, 0, -94.0], [0, 0, -99.0]]) * DEG
    np.testing.assert_array_equal(curve.outside(gyro), [False, False, True])
