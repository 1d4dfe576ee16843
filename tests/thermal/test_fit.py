"""Bias and scale factor over temperature: an exact example, sigmas, orders, left-out soaks."""

import numpy as np
import pytest

from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.laboratory.thermal_curve import ThermalCurve, correct, distort, temperature_grid
from rotcli.models.mean_covariance import predict
from rotcli.thermal.basis import Chebyshev, Hats
from rotcli.thermal.fit import (
    ThermalProblem,
    fit_basis,
    fit_orders,
    group_temperatures,
    largest_orders,
    select_orders,
)
from rotcli.thermal.validation import leave_one_out
from tests.scale.sets import DEG, DPH, FULL_SCALE, NAV440, PPM
from tests.thermal.sets import (
    END,
    SOAKS,
    UP_AND_DOWN,
    blocks,
    noisy_problem,
    problem,
    true_bias,
    true_scale,
    truth,
)


@pytest.fixture(scope="module")
def e2():
    pattern = (7 * np.arange(30)) % 11 - 5
    return problem(truth(blocks()) + pattern * DPH)


@pytest.mark.parametrize(
    ("orders", "chi2", "bic"),
    [((2, 2), 9.61926, 30.02644), ((3, 2), 1.23769, 25.04607), ((4, 2), 1.23683, 28.44641)],
)
def test_the_exact_example_has_the_published_chi2(e2, orders, chi2, bic):
    fit = fit_orders(e2, *orders)
    assert fit.gls.chi2 == pytest.approx(chi2, rel=1e-4)
    assert fit.bic == pytest.approx(bic, rel=1e-4)


def test_the_exact_example_selects_the_true_orders(e2):
    assert largest_orders(e2) == (3, 3)
    assert select_orders(e2).orders == (3, 2)
    assert select_orders(e2, (4, 3)).orders == (3, 2)


def test_the_exact_example_has_the_published_powers(e2):
    fit = fit_orders(e2, 3, 2)
    constant = fit.bias_basis.powers(20.0)[0] @ fit.gls.estimate[:4]
    assert constant / DPH == pytest.approx(60.86789, rel=1e-6)
    following = fit.bias_powers(20.0, e2.horizon(END, END + 300))
    own = fit.bias_powers(20.0, e2.own_span())
    value = [62.85952, 9.965405, -0.09401403, 0.001302622]
    sigma = [24.64604, 0.7553582, 0.01058087, 0.0004499413]
    np.testing.assert_allclose(following.value / DPH, value, rtol=1e-6)
    np.testing.assert_allclose(following.sigma / DPH, sigma, rtol=1e-6)
    np.testing.assert_allclose(
        [own.value[0] / DPH, own.sigma[0] / DPH], [60.29810, 8.97314], rtol=1e-6
    )
    scale = fit.scale_powers(20.0)
    np.testing.assert_allclose(scale.value / PPM, [899.1938, 37.07791, 0.2492721], rtol=1e-6)
    np.testing.assert_allclose(scale.sigma / PPM, [21.36275, 0.4846724, 0.02048318], rtol=1e-6)


def test_sigmas_over_temperature_equal_the_published_ones():
    p = problem()
    fit = fit_orders(p, 3, 2)
    following = fit.bias(SOAKS, p.horizon(END, END + 300)).sigma / DPH
    own = fit.bias(SOAKS, p.own_span()).sigma / DPH
    np.testing.assert_allclose(following, [14.73, 21.84, 24.65, 28.58, 32.12], rtol=0.01)
    np.testing.assert_allclose(own, [19.03, 13.98, 8.97, 12.69, 17.28], rtol=0.01)
    np.testing.assert_allclose(
        fit.scale(SOAKS).sigma / PPM, [28.85, 18.68, 21.36, 18.68, 28.85], rtol=0.01
    )


def difference_sigma(fit, high, low):
    P = fit.bias_rows(np.atleast_1d(high)) - fit.bias_rows(np.array([low]))
    return predict(fit.gls, P, np.zeros(len(P))).sigma / DPH


def test_differences_of_biases_have_the_published_sigmas():
    fit = fit_orders(problem(), 3, 2)
    got = difference_sigma(fit, SOAKS, 20.0)
    np.testing.assert_allclose(got, [22.54, 12.80, 0, 12.87, 22.98], rtol=0.01, atol=1e-9)
    outside = difference_sigma(fit, np.array([70.0, 80, 100]), 20.0)
    np.testing.assert_allclose(outside, [40.3, 73.2, 193.2], rtol=0.01)
    assert difference_sigma(fit, 60.0, -20.0) == pytest.approx(30.42, rel=0.01)


def test_one_direction_alone_is_worse_than_up_and_down():
    fit = fit_orders(problem(soaks=SOAKS), 3, 2)
    assert difference_sigma(fit, 60.0, -20.0) == pytest.approx(42.10, rel=0.01)


def test_hat_functions_at_the_soaks_have_the_published_sigmas():
    p = problem(truth(blocks()))
    hats = Hats(tuple(SOAKS))
    fit = fit_basis(p, hats, hats)
    np.testing.assert_allclose(
        fit.bias(SOAKS, p.horizon(END, END + 300)).sigma / DPH,
        [14.76, 22.72, 26.33, 29.27, 32.12],
        rtol=0.01,
    )
    np.testing.assert_allclose(
        fit.bias(SOAKS, p.own_span()).sigma / DPH, [19.06, 15.14, 13.25, 13.95, 17.31], rtol=0.01
    )
    np.testing.assert_allclose(fit.scale(SOAKS).sigma / PPM, 30.66, rtol=0.01)
    T = np.linspace(-20, 60, 801)
    worst = np.max(np.abs(fit.bias(T, p.own_span()).value - true_bias(T))) / DPH
    assert worst == pytest.approx(20.6, abs=0.1)
    with pytest.raises(ValueError, match="no powers"):
        fit.bias_powers(20.0, p.own_span())


def test_powers_of_chebyshev_polynomials_are_exact():
    basis = Chebyshev(5, -20.0, 60.0)
    T = np.linspace(-25, 65, 11)
    coefficients = np.array([3.0, -2, 1, 0.5, -0.25, 0.125])
    powers = basis.powers(33.0) @ coefficients
    np.testing.assert_allclose(
        np.polynomial.polynomial.polyval(T - 33.0, powers), basis.values(T) @ coefficients
    )
    step = 1e-4
    slope = (basis.values(T + step) - basis.values(T - step)) / (2 * step)
    np.testing.assert_allclose(basis.derivatives(T), slope, atol=1e-7)
    np.testing.assert_array_equal(basis.values(T) @ basis.unity, 1.0)


def test_hat_functions_sum_to_one_and_have_the_slope_of_a_line():
    hats = Hats((-20.0, 0.0, 60.0))
    T = np.array([-30, -20, -5, 10, 59, 70.0])
    np.testing.assert_allclose(hats.values(T) @ hats.unity, 1.0)
    np.testing.assert_allclose(hats.derivatives(T) @ np.array([-20, 0, 60.0]), [0, 1, 1, 1, 1, 0])


def test_temperatures_within_two_degrees_are_one_soak():
    soaks, group = group_temperatures(np.array([20.0, -19.5, 21.5, -20, 40]))
    np.testing.assert_allclose(soaks, [-19.75, 20.75, 40])
    np.testing.assert_array_equal(group, [1, 0, 1, 0, 2])


def test_a_small_swing_is_refused_or_has_a_line():
    def with_swing(swing):
        T = np.linspace(20, 20 + swing, 12)
        start = 100.0 * np.arange(12)
        log = Blocks(start, start + 60, 0 * T, np.zeros((12, 3)), T, 0 * T)
        return ThermalProblem((log,), 2, NAV440)

    with pytest.raises(ValueError, match=r"2\.0 degC; 3 are needed"):
        largest_orders(with_swing(2.0))
    assert largest_orders(with_swing(9.0)) == (1, -1)
    assert largest_orders(with_swing(30.0)) == (5, -1)


def test_a_second_log_has_its_offset_and_the_same_curve():
    z = truth(blocks())
    logs = blocks(z), blocks(z + 300 * DPH)
    p = ThermalProblem(logs, 2, NAV440, FULL_SCALE)
    fit = fit_orders(p, 3, 2)
    assert fit.gls.chi2 < 1e-6
    np.testing.assert_allclose(
        fit.bias(SOAKS, p.own_span()).value, true_bias(SOAKS) + 300 * DPH, atol=1e-9
    )
    powers = fit.bias_powers(20.0, p.own_span()).value / DPH
    np.testing.assert_allclose(powers, [360, 10, -0.09375, 0.00125], atol=1e-6)
    single = fit_orders(problem(z), 3, 2)
    assert fit.scale(SOAKS).sigma[2] == pytest.approx(single.scale(SOAKS).sigma[2] / np.sqrt(2))
    T = np.array([0.0, 30.0])
    np.testing.assert_allclose(
        fit.sensitivity(T).value / DPH,
        10 - 2 * 0.09375 * (T - 20) + 3 * 0.00125 * (T - 20) ** 2,
        atol=1e-6,
    )


def test_still_blocks_alone_have_no_scale_factor():
    log = blocks(truth(blocks()))
    still = log.rate == 0
    log = Blocks(
        log.start[still],
        log.end[still],
        log.rate[still],
        log.mean[still],
        log.temperature[still],
        log.heating[still],
    )
    p = ThermalProblem((log,), 2, NAV440)
    selection = select_orders(p)
    assert selection.orders[1] == -1
    assert selection.selected.scale_size == 0


def test_a_left_out_soak_is_predicted_exactly_without_noise():
    p = problem(truth(blocks()))
    found = leave_one_out(fit_orders(p, 3, 2))
    np.testing.assert_array_equal(found.temperatures, [0, 20, 40])
    assert found.rms < 1e-6 * DPH
    assert len(found.errors) == 18
    assert leave_one_out(fit_orders(p, 4, 2)) is None


def left_out(seeds):
    rng = np.random.default_rng(77)
    sums = np.zeros((3, 2))
    for _ in range(seeds):
        p, _, _ = noisy_problem(rng)
        for i, order in enumerate((1, 2, 3)):
            found = leave_one_out(fit_orders(p, order, 2))
            sums[i] += (found.rms / DPH) ** 2, found.chi2_per_value
    return np.sqrt(sums[:, 0] / seeds), sums[:, 1] / seeds


def test_left_out_soaks_refute_too_low_an_order():
    rms, chi2 = left_out(25)
    assert chi2[0] > 2.2
    assert chi2[2] == pytest.approx(1.0, abs=0.3)
    assert rms[0] > rms[2]


@pytest.mark.campaign
def test_left_out_soaks_have_the_published_errors():
    rms, chi2 = left_out(400)
    np.testing.assert_allclose(chi2, [3.23, 1.45, 1.00], rtol=0.08)
    np.testing.assert_allclose(rms, [62.6, 37.1, 29.9], rtol=0.06)


def scatter(seeds):
    """Errors over sigma: bias at 20 degC next and own, three powers of d, three of K; chi2/dof."""
    rng = np.random.default_rng(1431)
    errors, chi2, orders = [], [], []
    d = np.array([60, 10, -0.09375, 0.00125]) * DPH
    K = np.array([900, 37.5, 0.25]) * PPM
    for _ in range(seeds):
        p, following, own = noisy_problem(rng)
        selection = select_orders(p)
        orders.append(selection.orders)
        fit = selection.fits[3, 2]
        chi2.append(fit.gls.chi2 / fit.gls.dof)
        first = fit.bias_powers(20.0, p.horizon(END, END + 300))
        second = fit.bias_powers(20.0, p.own_span())
        third = fit.scale_powers(20.0)
        errors.append(
            [
                (first.value[0] - d[0] - following) / first.sigma[0],
                (second.value[0] - d[0] - own) / second.sigma[0],
                *((first.value - d) / first.sigma)[1:],
                *((third.value - K) / third.sigma),
            ]
        )
    return np.array(errors), np.array(chi2), orders


def test_sigmas_equal_the_scatter_of_simulated_soaks():
    errors, chi2, _ = scatter(25)
    # 25 draws scatter by 14 %.
    assert np.all(np.abs(errors.std(axis=0) - 1) < 0.45)
    assert chi2.mean() == pytest.approx(1.0, abs=0.15)


@pytest.mark.campaign
def test_sigmas_and_orders_of_500_simulated_sets_are_as_published():
    errors, chi2, orders = scatter(500)
    assert np.all(np.abs(errors.std(axis=0) - 1) < 0.1)
    assert np.all(np.abs(errors.mean(axis=0)) < 0.2)
    assert chi2.mean() == pytest.approx(1.0, abs=0.04)
    share = np.mean([o == (3, 2) for o in orders])
    assert share >= 0.6
    assert share == pytest.approx(0.76, abs=0.06)
    assert np.mean([o == (2, 2) for o in orders]) == pytest.approx(0.19, abs=0.06)


def test_correcting_over_temperature_undoes_the_errors():
    grid = temperature_grid(-20.0, 60.0)
    column = np.column_stack([1e-3 + 0 * grid, -2e-3 + 0 * grid, true_scale(grid)])
    bias = np.column_stack([0 * grid, true_bias(grid), true_bias(grid)])
    curve = ThermalCurve(grid, bias, column, np.array([0, 0, 1.0]), -20.0, 60.0)
    rng = np.random.default_rng(2)
    T = rng.uniform(-20, 60, 200)
    true = rng.uniform(-100, 100, (200, 3)) * DEG
    reading = distort(curve, true, T)
    expected = true[:, 2] * (1 + true_scale(T)) + true_bias(T)
    # The grid of 0.05 degC interpolates to 1e-3 deg/h, the scale factor to 1e-9.
    np.testing.assert_allclose(reading[:, 2], expected, atol=2e-3 * DPH)
    np.testing.assert_allclose(correct(curve, reading, T), true, atol=1e-12)
    got = curve.outside(np.array([-21.5, -20.5, 0, 60.9, 61.1]))
    np.testing.assert_array_equal(got, [True, False, False, False, True])


def test_the_grid_has_steps_of_at_most_a_twentieth_of_a_degree():
    assert len(temperature_grid(-20.0, 60.0)) == 1601
    assert np.max(np.diff(temperature_grid(20.0, 23.33))) <= 0.05
    assert len(UP_AND_DOWN) == 10
