"""Tail of a quadratic form against chi-squared distributions that are known in closed form."""

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from rotcli.models.expected.distribution import (
    QuadraticForms,
    principal_axes,
    quantiles,
    upper_tail,
)


def _form(lam, delta2=None) -> QuadraticForms:
    lam = np.atleast_2d(np.array(lam, dtype=float))
    return QuadraticForms(lam, np.zeros_like(lam) if delta2 is None else np.atleast_2d(delta2))


# Lugannani and Rice is exact to first order; for equal eigenvalues its relative error in the
# upper tail is that of Stirling's formula: below 6 % for one degree of freedom, 3 % for two.
@pytest.mark.parametrize(("dof", "error"), [(1, 0.06), (2, 0.03), (10, 0.003)])
@pytest.mark.parametrize("p", [0.05, 1e-3, 1e-6])
def test_equal_eigenvalues_have_the_chi_squared_tail(dof, error, p):
    q = chi2.isf(p, dof) * 2.5
    found = upper_tail(_form(np.full(dof, 2.5)), np.array([q]))
    assert found[0] == pytest.approx(p, rel=error)


@pytest.mark.parametrize("p", [0.05, 1e-3])
def test_a_mean_gives_the_noncentral_tail(p):
    q = ncx2.isf(p, 2, 9.0)
    found = upper_tail(_form([1.0, 1.0], np.array([[9.0, 0.0]])), np.array([q]))
    assert found[0] == pytest.approx(p, rel=0.02)


def test_the_lower_tail_is_no_alarm():
    q = chi2.ppf(0.03, 1)
    assert upper_tail(_form([1.0]), np.array([q]))[0] == pytest.approx(0.97, abs=0.02)


def test_quantiles_invert_the_tail_for_many_forms_at_once():
    rng = np.random.default_rng(2)
    forms = QuadraticForms(rng.uniform(0.0, 1.0, (6, 9)) ** 4, rng.uniform(0.0, 2.0, (6, 9)))
    found = quantiles(forms, (0.5, 0.95, 0.999))
    for column, p in zip(found.T, (0.5, 0.05, 0.001), strict=True):
        np.testing.assert_allclose(upper_tail(forms, column), p, rtol=1e-3)


def test_quantiles_agree_with_draws():
    # 200,000 draws: sigma of an exceedance of 1 % is 0.02 %; the formula is within 2 % of it
    # (at the median it is 1 % high).
    rng = np.random.default_rng(5)
    lam = np.array([1.0, 0.3, 0.1, 0.03, 0.01])
    delta2 = np.array([0.5, 0.0, 2.0, 0.0, 0.0])
    draws = ((rng.standard_normal((200_000, 5)) + np.sqrt(delta2)) ** 2) @ lam
    limits = quantiles(_form(lam, delta2), (0.5, 0.95, 0.99))[0]
    for limit, p, error in zip(limits, (0.5, 0.05, 0.01), (0.015, 0.002, 0.0008), strict=True):
        assert np.mean(draws > limit) == pytest.approx(p, abs=error)


def test_near_the_mean_the_tail_is_continuous():
    form = _form([1.0, 0.5])
    q = form.mean * np.array([1.0 - 3e-4, 1.0, 1.0 + 3e-4])
    tail = [float(upper_tail(form, np.array([x]))[0]) for x in q]
    assert tail[0] > tail[1] > tail[2]
    assert tail[0] - tail[2] < 1e-3


def test_an_impossible_rms_has_p_zero_and_no_error():
    assert upper_tail(_form([1.0, 0.1]), np.array([1e6]))[0] == 0.0


def test_a_form_without_variance_is_certain():
    form = _form([0.0, 0.0])
    np.testing.assert_array_equal(upper_tail(form, np.array([1.0])), [0.0])


def test_a_pair_has_the_distribution_of_both_rows_together():
    rng = np.random.default_rng(1)
    A = rng.standard_normal((12, 20)) * np.linspace(1.0, 0.1, 12)[:, None]
    Z = A @ A.T
    mean = rng.standard_normal(12)
    blocks = Z.reshape(6, 2, 6, 2)
    alone = np.stack([blocks[:, k, :, k] for k in range(2)])
    cross = (blocks[:, 0, :, 1],)
    axes = principal_axes(alone, np.ones(6), ((0, 1),), cross)
    forms = axes.forms(mean.reshape(6, 2))
    lam = np.linalg.eigvalsh(Z)
    assert forms.mean[2] == pytest.approx(lam.sum() + mean @ mean, rel=1e-5)
    np.testing.assert_allclose(np.sort(forms.lam[2])[-12:], lam, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("delta2", [1e2, 1e4, 1e6])
def test_a_mean_that_outweighs_the_noise_gives_the_noncentral_quantiles(delta2):
    # Nearly Gaussian: the median lies where the formula is 0/0.
    probabilities = (0.001, 0.3, 0.5, 0.7, 0.999)
    found = quantiles(_form([1.0], np.array([[delta2]])), probabilities)[0]
    due = ncx2.ppf(probabilities, 1, delta2)
    # The formula's relative error of a tail, 1e-3 and less, moves a quantile by that of a sigma.
    np.testing.assert_allclose(found, due, rtol=2e-3 / np.sqrt(delta2))


def test_near_the_mean_the_tail_falls_with_the_density():
    form = _form([1.0], np.array([[1e4]]))
    q = form.mean[0] * (1.0 + 5e-5 * np.array([-1.0, 0.0, 1.0]))
    tail = [float(upper_tail(form, np.array([x]))[0]) for x in q]
    np.testing.assert_allclose(tail, ncx2.sf(q, 1, 1e4), atol=1e-6)
