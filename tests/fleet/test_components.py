"""Variance components against dense algebra, analysis of variance, statsmodels and known truth."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rotcli.fleet.variance.components import fit, unit_means
from rotcli.fleet.variance.likelihood import (
    minimise,
    minus_two_log_reml,
    scale_of,
    value_and_slope,
)
from rotcli.fleet.variance.nested import nest
from rotcli.fleet.variance.profile import INTERVAL_GAIN, Profile
from tests.fleet.fleets import dense_criterion, fleet

E3_Y = np.array([50, 56, 61, 58, 82, 79, 90, 95, 20, 28, 31, 25.0])
E3_S = np.array([3, 5, 2, 4, 6, 3, 4, 2, 5, 5, 3, 4.0])


def e3():
    return nest(E3_Y, E3_S, np.repeat([0, 1, 2], 4), np.tile([0, 0, 1, 1], 3))


def test_the_exact_example_has_its_likelihood() -> None:
    assert minus_two_log_reml(e3(), (400.0, 25.0, 9.0)) == pytest.approx(60.953747, abs=1e-6)
    assert minus_two_log_reml(e3(), (0.0, 0.0, 0.0)) == pytest.approx(721.260025, abs=1e-6)


def test_the_exact_example_has_its_estimates() -> None:
    rows = e3()
    result = fit(rows)
    assert result.variances == pytest.approx([888.92, 42.657, 2.297], rel=1e-3)
    assert result.minimum == pytest.approx(59.748402, abs=1e-6)
    assert (result.mean, result.mean_sigma) == pytest.approx((56.5619, 17.4555), abs=1e-3)
    means = unit_means(rows, result)
    assert means.shrunk == pytest.approx([56.148, 86.168, 27.369], abs=1e-3)
    assert means.shrunk_sigma == pytest.approx([4.902, 4.919, 5.087], abs=1e-3)


def test_six_units_with_unequal_days_equal_dense_algebra() -> None:
    rng = np.random.default_rng(6)
    unit = np.repeat(np.arange(6), [1, 2, 3, 4, 5, 9])
    day = rng.integers(0, 3, len(unit))
    rows = nest(rng.normal(50, 30, len(unit)), rng.uniform(1, 9, len(unit)), unit, day)
    for variances in ((0.0, 0.0, 0.0), (400.0, 25.0, 9.0), (1e4, 0.0, 1e-3)):
        dense = dense_criterion(rows, variances)
        assert minus_two_log_reml(rows, variances) == pytest.approx(dense, abs=1e-10 * abs(dense))


@settings(max_examples=20)
@given(st.integers(0, 10_000), st.lists(st.floats(0.0, 1e3), min_size=3, max_size=3))
def test_random_small_fleets_equal_the_dense_likelihood(seed, variances) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 30))
    rows = nest(
        rng.normal(100, 20, n), rng.uniform(1, 9, n), rng.integers(0, 5, n), rng.integers(0, 3, n)
    )
    dense = dense_criterion(rows, variances)
    assert abs(minus_two_log_reml(rows, variances) - dense) < 1e-10 * max(abs(dense), 1.0)


@settings(max_examples=20)
@given(st.lists(st.floats(1.0, 1e3), min_size=3, max_size=3))
def test_slopes_equal_differences_of_the_likelihood(variances) -> None:
    rows, v = e3(), np.array(variances)
    _, slope = value_and_slope(rows, v)
    for k in range(3):
        step = 1e-4 * v[k] * np.eye(3)[k]
        up, down = minus_two_log_reml(rows, v + step), minus_two_log_reml(rows, v - step)
        assert slope[k] == pytest.approx((up - down) / (2 * step[k]), rel=1e-5, abs=1e-7)


def balanced(seed: int = 1, sigma: float = 4.0):
    rows, _ = fleet(seed, units=12, days=4, turns=3, s_range=(sigma, sigma))
    return rows


def test_balanced_data_give_the_analysis_of_variance_minus_s2() -> None:
    rows = balanced()
    y = rows.y.reshape(12, 4, 3)
    days, units = y.mean(axis=2), y.mean(axis=(1, 2))
    ms_turn = ((y - days[..., None]) ** 2).sum() / (12 * 4 * 2)
    ms_day = 3 * ((days - units[:, None]) ** 2).sum() / (12 * 3)
    ms_unit = 12 * ((units - units.mean()) ** 2).sum() / 11
    expected = ((ms_unit - ms_day) / 12, (ms_day - ms_turn) / 3, ms_turn - 16.0)
    assert min(expected) > 0.0
    assert fit(rows, intervals=False).variances == pytest.approx(expected, rel=1e-4)


def test_balanced_data_give_the_estimates_of_statsmodels() -> None:
    import pandas as pd
    import statsmodels.formula.api as smf

    rows = balanced(seed=2)
    unit = rows.unit_of_day()[rows.day_of_row()]
    frame = pd.DataFrame({"y": rows.y, "unit": unit, "day": rows.day_of_row()})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # statsmodels warns about its optimiser
        model = smf.mixedlm(
            "y ~ 1", frame, groups="unit", re_formula="1", vc_formula={"day": "0 + C(day)"}
        )
        other = model.fit(reml=True, method="lbfgs", gtol=1e-8)
    expected = (float(other.cov_re.iloc[0, 0]), float(other.vcomp[0]), other.scale - 16.0)
    result = fit(rows, intervals=False)
    assert result.variances == pytest.approx(expected, rel=2e-3)  # its optimiser stops at 1e-3
    assert result.mean - rows.centre == pytest.approx(float(other.params["Intercept"]), abs=1e-3)
    assert result.mean_sigma == pytest.approx(float(other.bse["Intercept"]), rel=1e-3)


def test_interval_ends_have_the_gain_of_95_percent() -> None:
    """The other components are re-estimated here by a grid-free independent search."""
    from scipy.optimize import minimize

    rows, _ = fleet(3, units=15)
    result = fit(rows)
    for k in range(3):
        for end in result.intervals[k]:
            others = [i for i in range(3) if i != k]

            def criterion(roots, k=k, end=end, others=others):
                v = np.zeros(3)
                v[k], v[others] = end, np.square(roots)
                return minus_two_log_reml(rows, v)

            best = minimize(criterion, np.sqrt(result.variances[others]), method="Nelder-Mead")
            assert best.fun - result.minimum == pytest.approx(INTERVAL_GAIN, abs=0.01)


def test_missing_levels_are_zero_and_named() -> None:
    one_turn = fit(fleet(1, turns=1)[0])
    assert one_turn.variances[2] == 0.0
    assert one_turn.intervals[2] is None
    assert one_turn.notes == (
        "one turn-on per day: the day variance contains the turn-on variance",
    )
    one_day = fit(fleet(1, days=1)[0])
    assert one_day.variances[1] == 0.0
    assert "the unit variance contains the day variance" in one_day.notes[0]
    single = fit(fleet(1, units=1)[0])
    assert single.variances[0] == 0.0
    assert "the unit variance cannot be estimated" in single.notes[0]
    lone = fit(fleet(1, days=1, turns=1)[0])
    assert lone.variances[1:] == pytest.approx([0.0, 0.0])


def test_a_constant_added_to_all_values_moves_only_the_mean() -> None:
    rows = e3()
    moved = nest(E3_Y + 1e7, E3_S, np.repeat([0, 1, 2], 4), np.tile([0, 0, 1, 1], 3))
    assert fit(moved).variances == pytest.approx(fit(rows).variances, rel=1e-5)
    assert fit(moved).mean == pytest.approx(fit(rows).mean + 1e7, abs=1e-5)


def test_recovery_over_30_fleets() -> None:
    """Means of 30 fleets; one fleet scatters by 201, 9.0, 2.7: four standard errors of the mean."""
    results = [fit(fleet(seed)[0], intervals=False) for seed in range(30)]
    mean = np.mean([r.variances for r in results], axis=0)
    for value, truth, scatter in zip(mean, (900, 64, 25), (201, 9.0, 2.7), strict=True):
        assert abs(value - truth) < 4 * scatter / 30**0.5


@pytest.mark.campaign
def test_recovery_and_coverage_over_200_fleets() -> None:
    truth = np.array([900.0, 64.0, 25.0])
    results, blup, inside = [], [], np.zeros(3)
    for seed in range(200):
        rows, means = fleet(seed)
        result = fit(rows)
        results.append(result)
        estimate = unit_means(rows, result)
        blup.append((estimate.shrunk - means) / estimate.shrunk_sigma)
        inside += [low <= t <= high for (low, high), t in zip(result.intervals, truth, strict=True)]
    mean = np.mean([r.variances for r in results], axis=0)
    assert (np.abs(mean - truth) < 3 * np.array([14.0, 0.6, 0.2])).all()
    assert (inside >= 0.90 * 200).all()  # 97, 93, 96 % expected; 3 sigma of 95 % is 4.6 %
    z = [(r.mean - 60.0) / r.mean_sigma for r in results]
    assert 0.9 < np.std(z) < 1.2
    assert 0.95 < np.std(np.concatenate(blup)) < 1.10


@pytest.mark.campaign
def test_a_zero_day_variance_is_found_zero() -> None:
    results = [fit(fleet(seed, sigmas=(30.0, 0.0, 5.0))[0]) for seed in range(100)]
    assert np.mean([r.variances[1] for r in results]) < 1.0
    assert (
        all(r.intervals[1][0] == 0.0 for r in results)
        or np.mean([r.intervals[1][0] == 0.0 for r in results]) > 0.95
    )


def test_the_scale_of_the_variances_is_that_of_the_values_or_of_their_noise() -> None:
    rows, _ = fleet(4, units=6)
    assert scale_of(rows) == pytest.approx(float(np.var(rows.y)))
    same = nest(np.full(6, 3.0), np.arange(1.0, 7.0), np.repeat([0, 1], 3), np.arange(6))
    assert scale_of(same) == pytest.approx(np.mean(np.arange(1.0, 7.0) ** 2))
    assert fit(same).variances == pytest.approx([0.0, 0.0, 0.0])


def test_the_hessian_is_that_of_second_differences_anywhere() -> None:
    rows, _ = fleet(6, units=12)
    free = (True, True, True)
    profile = Profile(rows, free, *minimise(rows, free))
    x, step = np.array([500.0, 30.0, 40.0]), np.diag([2.0, 0.2, 0.2])
    found = profile._differences(x)
    for i in range(3):
        for j in range(3):
            corners = [
                a * b * minus_two_log_reml(rows, x + a * step[i] + b * step[j])
                for a in (1, -1)
                for b in (1, -1)
            ]
            expected = sum(corners) / (4.0 * step[i, i] * step[j, j])
            assert found[i, j] == pytest.approx(expected, rel=0.02, abs=1e-6)
