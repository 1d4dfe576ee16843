"""Fits and selection of the error curve: an exact example and the sigmas of a set of rates."""

import numpy as np
import pytest

from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.mean_covariance import predict
from rotcli.scale.curves import available_models, group_rates
from rotcli.scale.figures import asymmetry, nonlinearity, scale_factor
from rotcli.scale.fit import CurveProblem, fit_curve, lack_of_fit, select_model
from tests.scale.sets import (
    A1,
    ALTERNATING,
    DEG,
    DPH,
    FULL_SCALE,
    IMUS,
    NAV440,
    PPM,
    blocks,
    truth,
)

E1_RATES = [0, 10, 20, 50, 100, 50, 20, 10, 0, -10, -20, -50, -100, -50, -20, -10, 0]
E1_PATTERN = [5, -3, 2, -4, 1, 3, -2, 4, -5, 2, -1, 3, -4, 5, -2, 1, -3]
FS = FULL_SCALE


@pytest.fixture(scope="module")
def e1():
    """The exact example: cubic truth plus a pattern of integer deg/h, no random numbers."""
    z = truth(E1_RATES, "cubic") + DPH * np.array(E1_PATTERN)
    problem = CurveProblem((blocks(E1_RATES, z),), 2, NAV440, FS)
    return problem, select_model(problem)


# model: constant (deg/h), coefficients and sigmas (ppm FS), next and own bias (deg/h), chi2
E1 = {
    "line": (64.2086, [728.7973], [32.8426], (58.8330, 14.1240), (65.7802, 0.7826), 14.58216),
    "asym": (
        57.2313,
        [728.7973, 88.7930],
        [32.8426, 34.9643],
        (53.8178, 14.2614),
        (55.9689, 3.9419),
        8.13294,
    ),
    "quad": (
        60.6248,
        [728.7973, 76.2105],
        [32.8426, 29.5952],
        (56.3242, 14.1576),
        (60.5984, 2.1591),
        7.95105,
    ),
    "odd": (
        64.2086,
        [872.8036, -136.1622],
        [64.9901, 53.0262],
        (61.2235, 14.1547),
        (65.7802, 0.7826),
        7.98841,
    ),
    "cubic": (
        60.6248,
        [872.8036, 76.2105, -136.1622],
        [64.9901, 29.5952, 53.0262],
        (58.7147, 14.1882),
        (60.5984, 2.1591),
        1.35729,
    ),
    "asym+odd": (
        57.2313,
        [872.8036, 88.7930, -136.1622],
        [64.9901, 34.9643, 53.0262],
        (56.2082, 14.2918),
        (55.9689, 3.9419),
        1.53919,
    ),
}


@pytest.mark.parametrize("model", E1)
def test_every_model_of_the_exact_example_has_the_published_figures(e1, model):
    problem, selection = e1
    constant, coefficients, sigma, following, own, chi2 = E1[model]
    fit = selection.fits[model]
    assert fit.gls.estimate[0] / DPH == pytest.approx(constant, rel=1e-4)
    np.testing.assert_allclose(fit.gls.estimate[1:] / FS / PPM, coefficients, rtol=1e-4)
    np.testing.assert_allclose(fit.gls.sigma[1:] / FS / PPM, sigma, rtol=1e-4)
    assert fit.gls.chi2 == pytest.approx(chi2, rel=1e-4)
    for horizon, expected in (
        (problem.horizon(1084, 1384), following),
        (problem.own_span(), own),
    ):
        bias = fit.curve(np.zeros(1), horizon)
        np.testing.assert_allclose([bias.value[0] / DPH, bias.sigma[0] / DPH], expected, rtol=1e-4)


def test_the_table_of_the_exact_example_has_the_published_figures(e1):
    problem, selection = e1
    fit = selection.fits["table"]
    values = [-176.5749, -81.5355, -3.0071, 31.5543, 59.2083, 92.5219, 124.9730, 220.9829, 354.4916]
    np.testing.assert_allclose(fit.gls.estimate / DPH, values, rtol=1e-4)
    assert fit.gls.chi2 == pytest.approx(0.98821, rel=1e-4)
    following = fit.curve(problem.rates, problem.horizon(1084, 1384))
    own = fit.curve(problem.rates, problem.own_span())
    np.testing.assert_allclose((following.value - fit.gls.estimate) / DPH, -1.4947, rtol=1e-4)
    shift = (own.value - fit.gls.estimate) / DPH
    np.testing.assert_allclose(shift, -0.5104, atol=1e-4)  # printed digits of a difference
    np.testing.assert_allclose(
        following.sigma / DPH,
        [20.8447, 18.3621, 17.3081, 16.3405, 14.7950, 17.4350, 18.7189, 19.7946, 22.1384],
        rtol=1e-4,
    )
    half = [14.9549, 11.3747, 10.0538, 9.1290, 7.5651]
    np.testing.assert_allclose(own.sigma / DPH, half + half[-2::-1], rtol=1e-4)


def test_the_exact_example_is_nonlinear_and_cubic(e1):
    _, selection = e1
    assert selection.tests["cubic"] == pytest.approx(0.0013436, rel=1e-4)
    assert selection.p_line == pytest.approx(3 * 0.0013436, rel=1e-4)
    assert selection.model == "cubic"
    assert selection.selected.bic == pytest.approx(12.6901, rel=1e-4)
    line, table = selection.fits["line"], selection.fits["table"]
    assert lack_of_fit(line, table) == pytest.approx(0.0589, abs=5e-5)


def test_the_line_of_the_exact_examples_cubic_has_the_published_figures(e1):
    problem, selection = e1
    fit = selection.selected
    K = scale_factor(fit)
    np.testing.assert_allclose([K.value / PPM, K.sigma / PPM], [761.3392, 35.2028], rtol=1e-4)
    for horizon, expected in (
        (problem.horizon(1084, 1384), [66.6406, 14.3101]),
        (problem.own_span(), [68.5243, 1.3221]),
    ):
        offset = predict(fit.gls, fit.straight_line()[:1], np.ones(1), horizon)
        np.testing.assert_allclose(
            [offset.value[0] / DPH, offset.sigma[0] / DPH], expected, rtol=1e-4
        )
    NL = nonlinearity(selection)
    np.testing.assert_allclose([NL.value / PPM, NL.sigma / PPM], [78.8919, 23.1392], rtol=1e-4)
    # The published asymmetry is 2 a; by definition it is divided by S = 1 + K of model asym.
    A, S = asymmetry(selection), 1 + 728.7973 * PPM
    np.testing.assert_allclose([A.value * S / PPM, A.sigma * S / PPM], [177.586, 69.929], rtol=1e-4)


# bias next, own (deg/h), coefficients (ppm FS)
A1_SIGMAS = {
    ("NAV440", "line"): (14.11, 0.740, [29.51]),
    ("MTi-G", "line"): (35.00, 5.333, [65.10]),
    ("NAV440", "cubic"): (14.20, 2.764, [64.24, 26.95, 53.00]),
    ("MTi-G", "cubic"): (35.14, 7.753, [151.9, 56.95, 123.6]),
    ("NAV440", "asym"): (14.28, 4.422, [29.51, 31.86]),
    ("MTi-G", "asym"): (35.07, 10.54, [65.10, 66.51]),
}


@pytest.mark.parametrize(("imu", "model"), A1_SIGMAS)
def test_sigmas_of_19_blocks_equal_the_published_ones(imu, model):
    problem = CurveProblem((blocks(A1),), 2, IMUS[imu], FS)
    fit = fit_curve(problem, model)
    following, own, coefficients = A1_SIGMAS[imu, model]
    zero = np.zeros(1)
    got = fit.curve(zero, problem.horizon(1212, 1512)).sigma[0] / DPH
    assert got == pytest.approx(following, rel=0.01)
    assert fit.curve(zero, problem.own_span()).sigma[0] / DPH == pytest.approx(own, rel=0.01)
    np.testing.assert_allclose(fit.gls.sigma[1:] / FS / PPM, coefficients, rtol=0.01)


@pytest.mark.parametrize(
    ("imu", "expected"),
    [("NAV440", [17.02, 14.07, 14.23, 18.28]), ("MTi-G", [40.94, 34.94, 35.22, 43.27])],
)
def test_the_predicted_line_has_the_published_sigmas_at_its_rates(imu, expected):
    problem = CurveProblem((blocks(A1),), 2, IMUS[imu], FS)
    rates = np.array([-100, -10, 10, 100]) * DEG
    curve = fit_curve(problem, "line").curve(rates, problem.horizon(1212, 1512))
    np.testing.assert_allclose(curve.sigma / DPH, expected, rtol=0.01)


def test_the_straight_line_of_the_true_cubic_is_exact():
    z = truth(A1, "cubic")
    selection = select_model(CurveProblem((blocks(A1, z),), 2, NAV440, FS), "cubic")
    K, NL = scale_factor(selection.selected), nonlinearity(selection)
    assert K.value / PPM == pytest.approx(763.56, abs=0.01)
    assert K.sigma / PPM == pytest.approx(32.52, rel=0.01)
    assert NL.value / PPM == pytest.approx(89.49, abs=0.01)


def test_alternating_signs_halve_the_sigma_of_the_scale_factor():
    def sigma(rates, duration):
        problem = CurveProblem((blocks(rates, duration=duration),), 2, NAV440, FS)
        return fit_curve(problem, "line").gls.sigma[1] / FS / PPM

    got = [[sigma(r, d) for d in (60, 30, 15)] for r in (ALTERNATING, A1)]
    np.testing.assert_allclose(got, [[12.57, 13.50, 15.12], [29.51, 29.62, 30.40]], rtol=0.01)
    got = [sigma(A1 + A1, d) for d in (60, 30, 15)]
    np.testing.assert_allclose(got, [20.67, 20.75, 21.28], rtol=0.01)


def test_rates_that_cannot_separate_a_model_leave_it_out():
    assert available_models(np.array([0, 50.0])) == ["line"]
    assert available_models(np.array([0, 20.0, 50.0])) == ["line", "odd"]
    assert available_models(np.array([-50, 0, 50.0])) == ["line", "asym"]
    assert available_models(np.array([-50, -20, 20, 50.0])) == ["line", "asym", "odd", "asym+odd"]
    assert len(available_models(np.array([-50, -20, 0, 20, 50.0]))) == 6
    assert available_models(np.array([30.0])) == []


def test_one_rate_alone_is_refused():
    with pytest.raises(ValueError, match="two different rates"):
        select_model(CurveProblem((blocks([50, 50]),), 2, NAV440, FS))


def test_two_rates_have_a_line_and_nothing_that_could_refute_it():
    selection = select_model(CurveProblem((blocks([50, -50], truth([50, -50])),), 2, NAV440, FS))
    assert (selection.model, selection.p_line, selection.tests) == ("line", 1.0, {})


def test_rates_that_an_encoder_repeats_are_one_rate():
    rates, group = group_rates(np.array([10.004, -10, 10, 0, 0.0005, 0.02]) * DEG)
    np.testing.assert_allclose(rates / DEG, [-10, 0.00025, 0.02, 10.002])
    np.testing.assert_array_equal(group, [3, 0, 3, 1, 1, 2])


def test_two_logs_have_a_bias_each_and_one_curve():
    z = truth(A1, "cubic")
    logs = (blocks(A1, z), blocks(A1, z + 500 * DPH))
    problem = CurveProblem(logs, 2, NAV440, FS)
    for model in ("cubic", "table"):
        fit = fit_curve(problem, model)
        assert fit.gls.chi2 < 1e-6
        single = fit_curve(CurveProblem(logs[1:], 2, NAV440, FS), model)
        value = fit.curve(problem.rates, problem.own_span()).value
        np.testing.assert_allclose(
            value, single.curve(problem.rates, single.problem.own_span()).value, atol=1e-12
        )
        assert scale_factor(fit).sigma == pytest.approx(scale_factor(single).sigma / np.sqrt(2))


def test_a_random_slope_per_log_enlarges_the_sigma_of_the_mean_slope():
    logs = tuple(blocks(A1) for _ in range(4))
    problem = CurveProblem(logs, 2, NAV440, FS, scale_sigma=50 * PPM)
    got = scale_factor(fit_curve(problem, "line")).sigma / PPM
    assert got == pytest.approx(np.sqrt((29.51**2 + 50**2) / 4), rel=0.01)


def least_squares_sigmas(log, horizon, weights):
    """Sigma of bias (deg/h) and scale factor (ppm) of weighted least squares."""
    noise = log.noise(NAV440)
    A = np.column_stack([np.ones(len(log)), log.rate])
    gain = np.linalg.solve(A.T @ (weights[:, None] * A), (weights[:, None] * A).T)
    S, window = noise.covariance(), noise.horizon(*horizon)
    bias = gain[0] @ S @ gain[0] - 2 * gain[0] @ window.cross + window.variance
    return np.sqrt(bias) / DPH, np.sqrt(gain[1] @ S @ gain[1]) / PPM


def test_ordinary_least_squares_is_worse_and_white_noise_alone_claims_far_too_much():
    log = blocks(A1)
    following = least_squares_sigmas(log, (1212, 1512), np.ones(19))
    own = least_squares_sigmas(log, (0, 1212), np.ones(19))
    np.testing.assert_allclose([*following, own[0]], [17.50, 37.79, 0.741], rtol=0.01)
    white = NAV440.white / np.sqrt(60.0)
    A = np.column_stack([np.ones(19), log.rate])
    claimed = np.sqrt(np.diag(np.linalg.inv(A.T @ A))) * white
    np.testing.assert_allclose(claimed / [DPH, PPM], [0.711, 3.77], rtol=0.01)


def test_segments_of_a_100_hz_log_have_the_published_sigmas():
    # Legs of 64 s with ramps of 2 s between different rates; two of the three stills are omitted.
    start, now = [], 0.0
    for before, rate in zip([0, *A1], A1, strict=False):
        now += 2.0 * (before != rate)
        start.append(now)
        now += 64.0
    used = [k for k in range(19) if k not in (9, 18)]
    begin = np.array(start)[used]
    assert begin[-1] + 64 == 1182
    rates = np.array(A1)[used] * DEG
    log = Blocks(begin, begin + 64, rates, np.zeros((17, 3)))
    problem = CurveProblem((log,), 2, NAV440, FS)
    fit = fit_curve(problem, "line")
    zero = np.zeros(1)
    got = [
        fit.gls.sigma[1] / FS / PPM,
        fit.curve(zero, problem.horizon(1182, 1482)).sigma[0] / DPH,
        fit.curve(zero, problem.own_span()).sigma[0] / DPH,
    ]
    np.testing.assert_allclose(got, [29.72, 14.22, 0.987], rtol=0.01)
    plain = least_squares_sigmas(log, (1182, 1482), np.ones(17))
    np.testing.assert_allclose(plain, [17.38, 37.89], rtol=0.01)
