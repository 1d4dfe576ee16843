"""False alarms and powers of outliers, control charts and trends against simulated truth."""

import numpy as np
import pytest
from scipy import stats

from rotcli.fleet.aging import DAYS_PER_YEAR, _judge, benjamini_hochberg, trends
from rotcli.fleet.charts import chart, ewma_factor, ewma_run_length, points
from rotcli.fleet.outliers import find_outliers, unit_deviations, value_deviations
from rotcli.fleet.variance.components import fit
from rotcli.fleet.variance.nested import nest
from tests.fleet.fleets import dense_covariance, fleet


def flagged_units(seed: int, shift=None) -> set[int]:
    rows, _ = fleet(seed, units=50, shift=shift)
    found = find_outliers(rows, fit(rows, intervals=False))
    return set(np.flatnonzero(found.unit_flagged))


def test_unit_deviation_is_the_dense_prediction_error() -> None:
    rows, _ = fleet(1, units=6, days=2, turns=2)
    result = fit(rows, intervals=False)
    z = unit_deviations(rows, result, np.zeros(6, dtype=bool))
    V = dense_covariance(rows, result.variances)
    unit = rows.unit_of_day()[rows.day_of_row()]
    for u in range(6):
        mine, rest = unit == u, unit != u
        inverse, one = np.linalg.inv(V[np.ix_(rest, rest)]), np.ones(rest.sum())
        A = one @ inverse @ one
        mu = one @ inverse @ rows.y[rest] / A
        inside = np.linalg.inv(V[np.ix_(mine, mine)] - result.variances[0])
        a = inside.sum()
        mean = inside.sum(axis=0) @ rows.y[mine] / a
        expected = (mean - mu) / np.sqrt(result.variances[0] + 1 / a + 1 / A)
        assert z[u] == pytest.approx(expected, rel=1e-8)


def test_value_deviation_is_the_dense_prediction_error_for_a_known_mean() -> None:
    rows, _ = fleet(2, units=3, days=3, turns=3)
    result = fit(rows, intervals=False)
    z = value_deviations(rows, result)
    V = dense_covariance(rows, result.variances)
    y = rows.y + rows.centre - result.mean
    unit = rows.unit_of_day()[rows.day_of_row()]
    for k in range(len(y)):
        others = (unit == unit[k]) & (np.arange(len(y)) != k)
        weights = np.linalg.solve(V[np.ix_(others, others)], V[others, k])
        variance = V[k, k] - weights @ V[others, k]
        assert z[k] == pytest.approx((y[k] - weights @ y[others]) / np.sqrt(variance), rel=1e-8)


def test_no_fleet_of_10_has_a_false_outlier_and_two_bad_units_are_found() -> None:
    """The rate is 1 % per fleet: none in 10 with 90 %; both units at 8.3 sigma in 98 %."""
    assert not any(flagged_units(seed) for seed in range(10))
    assert all(flagged_units(seed, {7: 250.0, 8: 250.0}) == {7, 8} for seed in range(5))


def test_a_bad_unit_of_a_small_fleet_is_found_although_it_inflates_the_variance() -> None:
    """Of 12 units one at 8.3 sigma: found alone in 95 %; a clean fleet has a flag in 1 %."""

    def flags(seed: int, shift=None) -> set[int]:
        rows, _ = fleet(seed, units=12, shift=shift)
        found = find_outliers(rows, fit(rows, intervals=False))
        return set(np.flatnonzero(found.unit_flagged))

    assert sum(flags(seed, {3: 250.0}) == {3} for seed in range(6)) >= 4
    assert sum(bool(flags(seed)) for seed in range(6)) <= 1


@pytest.mark.campaign
def test_outlier_rates_over_100_fleets() -> None:
    assert sum(bool(flagged_units(seed)) for seed in range(100)) <= 4
    found = [flagged_units(seed, {7: 250.0, 8: 250.0}) for seed in range(100)]
    assert sum(f == {7, 8} for f in found) >= 94  # 98 expected, sigma 1.4


def test_a_single_bad_value_is_flagged() -> None:
    rows, _ = fleet(4, units=10)
    y = rows.y.copy()
    y[57] += 150.0
    day = rows.day_of_row()
    bad = nest(y, np.sqrt(rows.s2), rows.unit_of_day()[day], day)
    found = find_outliers(bad, fit(bad, intervals=False))
    assert list(np.flatnonzero(found.value_flagged)) == [57]


@pytest.mark.parametrize(
    ("weight", "factor"),
    [(0.05, 2.4903), (0.1, 2.7015), (0.2, 2.8594), (0.3, 2.9250), (0.4, 2.9589)],
)
def test_ewma_factors_equal_the_published_table(weight: float, factor: float) -> None:
    """Lucas and Saccucci, Technometrics 32 (1990): mean run length 370.4."""
    assert ewma_factor(weight) == pytest.approx(factor, abs=1e-3)


def test_ewma_run_lengths_for_shifts_equal_the_published_values() -> None:
    assert ewma_run_length(0.2, 2.8594, 1.0) == pytest.approx(9.8, abs=0.05)
    assert ewma_run_length(0.2, 2.8594, 2.0) == pytest.approx(3.6, abs=0.05)


def alarms(baseline: int, later: int, seeds: int, shift: float = 0.0) -> tuple[float, float]:
    """Return shares of units with an EWMA alarm, and of points with a Shewhart alarm."""
    rng = np.random.default_rng(1)
    ewma = shewhart = 0
    for _ in range(seeds):
        variance = 64.0 + 25.0 + np.exp(rng.uniform(np.log(2), np.log(12), baseline + later)) ** 2
        step = np.where(np.arange(baseline + later) < baseline, 0.0, shift * np.sqrt(64.0 + 25.0))
        y = 60.0 + step + np.sqrt(variance) * rng.standard_normal(baseline + later)
        made = chart(y, variance, np.arange(baseline + later), baseline=baseline)
        ewma += made.ewma_flagged.any()
        shewhart += made.shewhart_flagged.sum()
    return ewma / seeds, shewhart / (seeds * later)


def test_false_alarms_stay_below_10_percent_with_a_baseline_of_5() -> None:
    ewma, shewhart = alarms(5, 35, 400)
    assert ewma < 0.10
    assert shewhart < 0.006  # 0.3 % a point; alarms of one unit share the baseline
    assert alarms(5, 25, 400, shift=1.5)[0] == pytest.approx(0.56, abs=0.10)
    assert alarms(10, 25, 400, shift=1.5)[0] == pytest.approx(0.81, abs=0.08)


def test_chart_points_are_day_means_where_days_repeat() -> None:
    rows, _ = fleet(5, units=3, days=4, turns=3)
    result = fit(rows, intervals=False)
    made = points(rows, result)
    assert made.by_day
    w = 1.0 / (rows.s2[:3] + result.variances[2])
    assert made.value[0] == pytest.approx(np.sum(w * rows.y[:3]) / w.sum() + rows.centre)
    assert made.variance[0] == pytest.approx(result.variances[1] + 1.0 / w.sum())
    one_day, _ = fleet(5, units=3, days=1, turns=6)
    assert not points(one_day, fit(one_day, intervals=False)).by_day


def test_phase_one_has_no_flags_and_five_points_have_no_chart() -> None:
    y = np.array([0.0, 0.0, 0.0, 0.0, 1e6, 0.0])
    made = chart(y, np.ones(6), np.arange(6))
    assert not made.shewhart_flagged[:5].any()
    assert chart(y[:5], np.ones(5), np.arange(5)) is None


SLOPE = 3.0  # per year; much larger slopes add to the day variance and make sigmas conservative


def trend_fleet(seed: int, slope: float = SLOPE, units: int = 60):
    rows, _ = fleet(seed, units=units, days=6, turns=3)
    day = rows.day_of_row()
    time = 60.0 * (day % 6).astype(float)
    y = rows.y + slope * time / DAYS_PER_YEAR
    return nest(y, np.sqrt(rows.s2), rows.unit_of_day()[day], day), time


def test_trend_errors_agree_with_their_sigmas() -> None:
    """error/sigma over 300 units of 5 fleets: sigma of the standard deviation is 4 %."""
    z = []
    for seed in range(5):
        rows, time = trend_fleet(seed)
        made = trends(rows, time, fit(rows, intervals=False))
        z.append((made.slope - SLOPE) / made.sigma)
        assert made.fleet.mean == pytest.approx(SLOPE, abs=4 * made.fleet.mean_sigma)
    assert np.std(np.concatenate(z)) == pytest.approx(1.04, abs=0.13)


def test_trend_equals_dense_generalised_least_squares() -> None:
    rows, time = trend_fleet(1, units=4)
    result = fit(rows, intervals=False)
    made = trends(rows, time, result)
    mine = rows.unit_of_day()[rows.day_of_row()] == 2
    V = dense_covariance(rows, (0.0, *result.variances[1:]))[np.ix_(mine, mine)]
    X = np.stack([np.ones(mine.sum()), time[mine] / DAYS_PER_YEAR], axis=1)
    C = np.linalg.inv(X.T @ np.linalg.solve(V, X))
    slope = (C @ X.T @ np.linalg.solve(V, rows.y[mine]))[1]
    assert made.slope[2] == pytest.approx(slope, rel=1e-9)
    assert made.sigma[2] == pytest.approx(np.sqrt(C[1, 1]), rel=1e-9)


def test_trends_need_three_days_and_thirty_days_of_span() -> None:
    rows, time = trend_fleet(1, units=4)
    result = fit(rows, intervals=False)
    short = trends(rows, time / 20.0, result)  # 15 days
    assert np.isnan(short.slope).all()
    assert not short.significant.any()


def test_benjamini_hochberg_equals_statsmodels() -> None:
    from statsmodels.stats.multitest import multipletests

    p = np.random.default_rng(1).random(50) ** 3
    assert (benjamini_hochberg(p) == multipletests(p, 0.05, "fdr_bh")[0]).all()
    assert len(benjamini_hochberg(np.zeros(0))) == 0


def test_p_of_a_trend_is_the_two_sided_one_of_a_normal():
    slope, sigma = np.array([1.0, -4.0, 0.5, 9.0]), np.array([1.0, 2.0, 0.2, 1.0])
    found = _judge(slope, sigma, np.array([True, True, True, False]))
    np.testing.assert_allclose(found.p_value[:3], 2.0 * stats.norm.sf([1.0, 2.0, 2.5]), rtol=1e-12)
    assert np.isnan(found.p_value[3])
    assert not found.significant[3]
