"""Yield and percentiles against exact binomial tables and simulated truth."""

import numpy as np
import pytest
from scipy.stats import binomtest, norm

from rotcli.fleet.variance.components import fit, unit_means
from rotcli.fleet.variance.nested import nest
from rotcli.fleet.yields import clopper_pearson, estimate_yield, percentiles
from rotcli.models.conformity import Limits, verdict
from tests.fleet.fleets import fleet

LIMITS = Limits(-120.0, 120.0, "deg/h")
TRUTH = norm.cdf(2.0) - norm.cdf(-6.0)  # 0.9772


def yield_of(rng: np.random.Generator):
    s = np.exp(rng.uniform(np.log(5), np.log(40), 300))
    y = 60.0 + 30.0 * rng.standard_normal(300) + s * rng.standard_normal(300)
    rows = nest(y, s, np.arange(300), np.zeros(300))
    result = fit(rows, intervals=False)
    none = np.zeros(300, dtype=bool)
    return estimate_yield(rows, result, unit_means(rows, result), none, LIMITS)


@pytest.mark.parametrize(("count", "total"), [(0, 10), (3, 10), (10, 10), (286, 300)])
def test_clopper_pearson_equals_scipy(count: int, total: int) -> None:
    share = clopper_pearson(count, total)
    exact = binomtest(count, total).proportion_ci(0.95, method="exact")
    assert (share.lower, share.upper) == pytest.approx((exact.low, exact.high), abs=1e-12)


def test_true_yield_is_free_of_the_noise_that_biases_the_raw_count() -> None:
    """20 fleets: truth 0.9772, scatter 0.0069 each, so 4 sigma of the mean is 0.0062."""
    rng = np.random.default_rng(5)
    made = [yield_of(rng) for _ in range(20)]
    assert np.mean([y.true.value for y in made]) == pytest.approx(TRUTH, abs=0.0062)
    assert np.mean([y.raw.value for y in made]) == pytest.approx(0.955, abs=0.011)
    assert np.mean([y.true.upper - y.true.lower for y in made]) == pytest.approx(0.026, abs=0.004)
    covered = np.mean([y.true.lower <= TRUTH <= y.true.upper for y in made])
    assert covered >= 0.75  # 94 % expected; 3.5 sigma of 20 is 19 %


@pytest.mark.campaign
def test_yield_intervals_contain_the_truth() -> None:
    rng = np.random.default_rng(6)
    made = [yield_of(rng) for _ in range(300)]
    assert np.mean([y.true.lower <= TRUTH <= y.true.upper for y in made]) > 0.90
    assert np.mean([y.raw.lower <= TRUTH <= y.raw.upper for y in made]) < 0.60


def test_the_same_input_gives_the_same_interval() -> None:
    assert yield_of(np.random.default_rng(7)) == yield_of(np.random.default_rng(7))


def test_outlying_units_count_by_their_means() -> None:
    """Of 40 units one is far outside: 39/40 of the share of the others, and inside its limits."""
    rows, _ = fleet(3, units=40, shift={5: 500.0})
    flagged = np.arange(40) == 5
    used = rows.without(flagged)
    result = fit(used, intervals=False)
    made = estimate_yield(used, result, unit_means(rows, result), flagged, LIMITS)
    others = unit_means(used, result)
    clean = estimate_yield(used, result, others, np.zeros(39, dtype=bool), LIMITS)
    for name in ("value", "lower", "upper"):
        expected = getattr(clean.true, name) * 39 / 40
        assert getattr(made.true, name) == pytest.approx(expected, rel=1e-12)
    assert made.true.lower <= made.true.value <= made.true.upper
    assert made.failed >= 1


def test_verdicts_follow_the_guard_band() -> None:
    limits = Limits(None, 10.0, "deg/h", guard=2.0)
    assert [verdict(v, 1.0, limits) for v in (7.9, 8.1, 11.9, 12.1)] == [
        "pass", "undecided", "undecided", "fail",
    ]  # fmt: skip
    assert verdict(0.0, None, limits) == "undecided"
    assert verdict(-1e9, 1.0, limits) == "pass"
    assert verdict(10.0, 5.0, Limits(None, 10.0, "deg/h", guard=0.0)) == "pass"


def test_percentiles_of_the_units_are_free_of_measurement_noise() -> None:
    rows, _ = fleet(8, units=400, days=1, turns=1, s_range=(20.0, 40.0))
    result = fit(rows, intervals=False)
    made = {p.percent: p for p in percentiles(result, unit_means(rows, result).shrunk)}
    # N(60, 30^2 + vD + vR = 31.5^2): 5 % at 60 - 1.645 x 31.5; sigma of it about 4 here.
    assert made[5.0].value == pytest.approx(60 - 1.645 * 31.5, abs=14)
    assert made[50.0].value == pytest.approx(60, abs=8)
    assert made[5.0].lower < made[5.0].value < made[5.0].upper
    few, _ = fleet(8, units=5)
    result = fit(few, intervals=False)
    assert percentiles(result, unit_means(few, result).shrunk)[0].lower is None
