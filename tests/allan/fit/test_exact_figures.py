"""Parts of the fit against closed forms, without random numbers in what they expect."""

import numpy as np
import pytest
from scipy import stats

from rotcli.allan.deviation import averaging_factors, phase_from_rate
from rotcli.allan.fit import gauss_markov
from rotcli.allan.fit.goodness import goodness_of_fit
from rotcli.allan.fit.model import columns, curve_covariance, slope_variance, terms
from rotcli.allan.fit.solve import _Problem
from rotcli.allan.fit.summary import summarize
from rotcli.allan.fit.trimmed import fit_trimmed
from rotcli.allan.survey.spectrum import Line, Spectrum
from rotcli.models.sensors import NoiseFigures, noise


def second_difference_weights(n, m):
    """Weights (j, n) of the readings in each difference of neighbouring means of m readings."""
    first = np.arange(n - 2 * m + 1)[:, None]
    place = np.arange(n)[None, :] - first
    return (((place >= m) & (place < 2 * m)) * 1.0 - ((place >= 0) & (place < m)) * 1.0) / m


def test_the_expected_curve_of_white_noise_without_its_line_is_that_of_the_covariance():
    n, interval = 300, 0.5
    line = np.linalg.qr(np.stack([np.ones(n), np.arange(n)], axis=1))[0]
    covariance = (np.eye(n) - line @ line.T) / interval
    factors = np.array([10, 30, 60, 100])
    expected = []
    for m in factors.tolist():
        weights = second_difference_weights(n, m)
        expected.append(0.5 * np.einsum("ij,jk,ik->i", weights, covariance, weights).mean())
    removed = slope_variance(n * interval)
    found = columns(factors, interval, "instant", removed)[:, 1]
    np.testing.assert_allclose(found, expected, rtol=1e-4)  # n^2 - 1 of the sum is n^2


def test_goodness_counts_the_terms_of_the_curve_and_names_the_largest_deviation():
    factors, interval = 2 ** np.arange(3, 10), 0.1
    tau = factors * interval
    matrix = terms(tau)
    squares = np.array([0.0, 4.0, 0.0, 0.0])
    variance = matrix @ squares
    variance[4] *= 1.21
    freedom = np.full(len(factors), 200.0)
    found = goodness_of_fit(factors, interval, variance, matrix, squares, lambda *_: freedom, None)
    assert found is not None
    assert found.dof == len(factors) - 1
    assert found.largest == pytest.approx(0.1, rel=1e-12)
    assert found.largest_tau == pytest.approx(tau[4], rel=1e-12)
    assert found.largest_sigma == pytest.approx(0.21 / np.sqrt(2.0 / 200.0), rel=1e-12)
    assert found.p_value == pytest.approx(stats.chi2.sf(found.chi2, found.dof), rel=1e-10)
    # Generalized least squares of one term, by the normal equation.
    curve = curve_covariance(factors, interval, squares, matrix @ squares * 0.1)
    column = matrix[:, 1]
    inverse = np.linalg.inv(curve)
    value = column @ inverse @ variance / (column @ inverse @ column)
    rest = variance - value * column
    assert found.chi2 == pytest.approx(rest @ inverse @ rest, rel=1e-9)


def test_one_point_of_one_noise_knows_it_to_the_spread_of_its_variance():
    phase, factors = np.zeros(101), np.array([10])
    record = summarize([phase], factors, 0.1, np.array([2.0]))
    matrix = terms(factors * 0.1)
    squares, active = np.array([0.0, 3.0, 0.0, 0.0]), np.array([False, True, False, False])
    problem = _Problem(matrix @ squares, matrix, record, None)
    found = problem.sigmas(squares, np.array([5.0]), np.array([50.0]), active)
    # The relative variance of a chi-squared variable is two over its degrees of freedom.
    np.testing.assert_allclose(found, [0.0, 3.0 * np.sqrt(2.0 / 50.0), 0.0, 0.0], rtol=1e-12)


def test_a_constant_does_not_change_the_gauss_markov_figures():
    figures = NoiseFigures(white=0.1, markov_sigma=1.0, markov_time=20.0)
    average = noise(np.random.default_rng(4), 4000, 1.0, figures)
    found, moved = gauss_markov.fit(average, 1.0), gauss_markov.fit(average + 50.0, 1.0)
    assert found.time == pytest.approx(20.0, rel=0.5)
    assert moved.time == pytest.approx(found.time, rel=1e-6)
    assert moved.sigma == pytest.approx(found.sigma, rel=1e-6)


def test_the_cluster_times_around_a_bump_are_excluded_and_no_others():
    n, interval = 200_000, 0.01
    factors = averaging_factors(n, None, interval)
    tau = factors * interval
    centre = 30
    near = np.abs(np.log(tau / tau[centre])) <= np.log(1.6)
    variance = 4.0 / tau * np.where(near, 1.2, 1.0)
    variance[centre] *= 1.2
    record = summarize([np.zeros(n + 1)], factors, interval, variance)
    fit, misfit = fit_trimmed(record, "instant")
    assert misfit is not None
    assert misfit.goodness.largest_tau == pytest.approx(tau[centre])
    assert near.sum() == 7  # fifteen a decade: three on each side are nearer than a factor of 1.6
    np.testing.assert_allclose(misfit.excluded, tau[near])
    assert fit.coefficients["random_walk"].value == pytest.approx(2.0, rel=1e-6)


def test_a_curve_that_no_term_describes_has_no_coefficients():
    n, interval = 2_000_000, 0.01
    factors = averaging_factors(n, None, interval)
    place = np.arange(len(factors))
    jagged = np.where(place // 3 % 2 == 0, 1.276, 0.724)
    variance = 4.0 / (factors * interval) * np.where(place >= 12, jagged, 1.0)
    record = summarize([np.zeros(n + 1)], factors, interval, variance)
    fit, misfit = fit_trimmed(record, "instant")
    # Without 41 of the 81 cluster times the rest would agree; half must remain.
    assert misfit is not None
    assert misfit.excluded == ()
    assert 0.124 < misfit.goodness.largest < 0.125
    assert fit.coefficients["random_walk"].value is None
    assert "deviates from all noise terms by 12 % at 0.18 s" in (
        fit.coefficients["random_walk"].reason or ""
    )


def test_the_variance_of_a_line_is_subtracted_where_it_is_a_small_part():
    n, interval = 20_000, 0.01
    factors = averaging_factors(n, None, interval)
    tau = factors * interval
    line = Line(7.3, 0.2)
    white = 1e-4 / tau
    bins = np.linspace(0.1, 50.0, 500)
    spectrum = Spectrum(bins, np.ones(500), np.ones(500), (line,), None, None, 1, None)
    record = summarize([np.zeros(n + 1)], factors, interval, white + line.variance(tau), spectrum)
    used = np.isin(factors, record.factors)
    assert used.sum() >= 5
    np.testing.assert_allclose(record.variance, white[used], rtol=1e-9)
    assert not used[line.envelope(tau) > 0.3 * white].any()


def test_the_trend_of_segments_is_their_common_slope():
    interval, slope = 0.1, 3e-4
    lengths = (4000, 1000)
    phases = [phase_from_rate(slope * interval * np.arange(n), interval) for n in lengths]
    record = summarize(phases, np.array([10, 100]), interval)
    assert record.trend == pytest.approx(slope, rel=1e-9)
    # Each segment counts by its length cubed, and so does the variance of its slope.
    weights = np.array(lengths) ** 3.0 / np.sum(np.array(lengths) ** 3.0)
    each = [slope_variance(n * interval) for n in lengths]
    expected = weights[0] ** 2 * each[0] + weights[1] ** 2 * each[1]
    np.testing.assert_allclose(record.slope_variance(), expected, rtol=1e-5)
