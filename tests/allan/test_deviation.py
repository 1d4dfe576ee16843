import itertools

import allantools
import numpy as np
import pytest
from allantools import ci

from rotcli.allan.deviation import (
    averaging_factors,
    degrees_of_freedom,
    deviation,
    limits,
    mean_second_difference,
    overlapping_variance,
    phase_from_rate,
)


def rate_of(n, seed=0):
    rng = np.random.default_rng(seed)
    return 9.8 + rng.standard_normal(n) + np.cumsum(0.01 * rng.standard_normal(n))


@pytest.mark.parametrize("n", [99, 5000, 200_001])
def test_the_overlapping_deviation_is_that_of_allantools(n):
    phase = phase_from_rate(rate_of(n), 0.01)
    factors = averaging_factors(n, None, 0.01)
    taus, expected, _, _ = allantools.oadev(
        phase, rate=100.0, data_type="phase", taus=factors * 0.01
    )
    assert np.allclose(taus, factors * 0.01, rtol=1e-15)
    # 1e-12: both sum the same squares, in another order.
    assert np.allclose(deviation(phase, factors, 0.01, "oadev"), expected, rtol=1e-12, atol=0.0)


def test_rates_give_the_deviation_that_allantools_takes_from_them():
    rate = rate_of(30_000)
    factors = averaging_factors(30_000, None, 0.01)
    _, expected, _, _ = allantools.oadev(rate, rate=100.0, data_type="freq", taus=factors * 0.01)
    found = deviation(phase_from_rate(rate, 0.01), factors, 0.01, "oadev")
    assert np.allclose(found, expected, rtol=1e-12, atol=0.0)


def test_an_alternating_phase_gives_the_closed_value():
    phase = np.arange(1000) % 2.0
    # Second differences are +-2 at odd m, 0 at even m: variance 4 / (2 m^2 interval^2).
    found = overlapping_variance(phase, np.array([1, 2, 3]), 0.5)
    assert np.allclose(found, [8.0, 0.0, 8.0 / 9.0], rtol=1e-15)


def test_a_ramp_gives_the_closed_value_and_mean_second_difference():
    interval, slope = 0.1, 3.0
    phase = phase_from_rate(slope * interval * np.arange(5000), interval)
    factors = np.array([1, 7, 100, 1500])
    tau = factors * interval
    # 1e-9: the phase of a ramp has 1e5 of its second difference at m = 1.
    assert np.allclose(overlapping_variance(phase, factors, interval), (slope * tau) ** 2 / 2, 1e-9)
    assert np.allclose(mean_second_difference(phase, factors), slope * tau**2, 1e-9)


def test_the_telescoped_mean_is_the_mean_of_the_second_differences():
    phase = phase_from_rate(rate_of(3000), 0.01)
    factors = np.array([1, 2, 17, 400, 1000])
    direct = [np.mean(phase[2 * m :] - 2 * phase[m:-m] + phase[: -2 * m]) for m in factors]
    # Sums of 3000 values of size 10 lose five of sixteen digits.
    assert np.allclose(mean_second_difference(phase, factors), direct, rtol=0, atol=1e-11)


def test_degrees_of_freedom_are_greenhalls():
    compared = 0
    for estimator, alpha, n in itertools.product(
        ("oadev", "adev", "mdev"), (2, 0, -1, -2), (30, 101, 1001, 100_001)
    ):
        for m in (1, 2, 3, 5, 10, 33, 34, 100, 300, 333, 3000, 10_000, 33_333):
            if 3 * m > n - 1:
                continue
            try:
                expected = ci.edf_greenhall(
                    alpha=alpha,
                    d=2,
                    m=m,
                    N=n,
                    overlapping=estimator != "adev",
                    modified=estimator == "mdev",
                )
            except NotImplementedError:  # its case of few white-phase differences
                continue
            if alpha == 0 and estimator != "mdev" and 3 * m <= 100:
                continue  # the next test
            # The same formulas: rounding only, which finite filters blow up to 1e-10.
            assert degrees_of_freedom(estimator, alpha, m, n) == pytest.approx(expected, rel=1e-9)
            compared += 1
    assert compared > 320


@pytest.mark.parametrize("n", [101, 1001, 20_001])
@pytest.mark.parametrize("m", [1, 2, 3, 5, 10, 33])
def test_degrees_of_freedom_of_white_readings_are_those_of_their_covariance(m, n):
    """Second differences of a random walk of phase are correlated by triangles: exact sums."""

    def triangle(lag):
        return np.maximum(0.0, m - np.abs(lag))

    def correlation(lag):
        return 2.0 * triangle(lag) - triangle(lag - m) - triangle(lag + m)

    terms = n - 2 * m
    lag = np.arange(1, min(2 * m, terms))
    squares = terms * correlation(0.0) ** 2 + 2.0 * np.sum((terms - lag) * correlation(lag) ** 2)
    expected = (terms * correlation(0.0)) ** 2 / squares
    assert degrees_of_freedom("oadev", 0, m, n) == pytest.approx(expected, rel=2e-3 + 1.0 / n)
    if m == 1:
        assert degrees_of_freedom("oadev", 0, 1, n) == pytest.approx(2.0 / 3.0 * terms, rel=0.01)


def test_white_readings_scatter_by_their_degrees_of_freedom():
    factors, n = np.array([5, 9, 16]), 4000
    freedom = np.array([degrees_of_freedom("oadev", 0, int(m), n + 1) for m in factors])
    variances = np.array(
        [
            overlapping_variance(
                phase_from_rate(np.random.default_rng(seed).standard_normal(n), 1.0), factors, 1.0
            )
            for seed in range(1500)
        ]
    )
    # 1500 variances know their scatter to 3.7 %, and three of them do to 3 %: four sigma.
    scatter = variances.std(axis=0) / np.sqrt(2.0 / freedom) * factors
    assert scatter.mean() == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("alpha", [0, -1, -2])
def test_degrees_of_freedom_of_the_total_deviation_are_table_7_of_sp_1065(alpha):
    expected = ci.edf_totdev(1001, 100, alpha)
    assert degrees_of_freedom("totdev", alpha, 100, 1001) == pytest.approx(expected, rel=1e-12)


def test_few_quantization_differences_have_the_degrees_of_their_covariance():
    # m = 40 of 101 points: 21 differences, correlated at lag 40 only, which none has: 21.
    assert degrees_of_freedom("oadev", 2, 40, 101) == pytest.approx(21.0, rel=1e-12)
    # m = 20: 61 differences; correlations -4/6 at lag 20, 1/6 at lag 40.
    expected = 61.0 / (1 + 2 * (16 / 36 * (1 - 20 / 61) + 1 / 36 * (1 - 40 / 61)))
    assert degrees_of_freedom("oadev", 2, 20, 101) == pytest.approx(expected, rel=1e-12)


def test_limits_are_chi_squared_limits():
    low, high = limits(np.array([2.0]), np.array([10.0]))
    expected = ci.confidence_interval(2.0, 10.0)
    assert np.allclose([low[0], high[0]], expected, rtol=1e-12)


def test_default_cluster_times_are_15_a_decade_up_to_a_third():
    factors = averaging_factors(1_080_000, None, 0.01)
    assert factors[0] == 1
    assert factors[-1] <= 360_000 < factors[-1] * 10 ** (1 / 15) + 1
    assert len(factors) >= 60
    assert 14 <= np.sum((factors >= 1000) & (factors < 10_000)) <= 16


def test_named_cluster_times():
    assert averaging_factors(100, "octave", 0.01).tolist() == [1, 2, 4, 8, 16, 32]
    assert averaging_factors(100, "decade", 0.01).tolist() == [1, 2, 4, 10, 20]
    assert averaging_factors(100, "all", 0.01).tolist() == list(range(1, 34))
    assert averaging_factors(100, [0.3, 0.07], 0.01).tolist() == [7, 30]


@pytest.mark.parametrize(
    ("taus", "text"),
    [
        ([0.015], "0.015 s is no integer multiple of the sample interval 0.01 s"),
        ([0.0], "0 s is no integer multiple"),
        ([float("nan")], "nan s is no integer multiple"),
        ([1.0], "1 s is longer than half the record of 1 s"),
    ],
)
def test_a_time_that_does_not_suit_the_record_is_refused(taus, text):
    with pytest.raises(ValueError, match=text):
        averaging_factors(100, taus, 0.01)


def test_all_times_of_a_long_record_are_refused():
    with pytest.raises(ValueError, match="hours of work"):
        averaging_factors(1_000_000, "all", 0.01)


def test_an_estimator_that_cannot_reach_a_time_says_so():
    with pytest.raises(ValueError, match="mdev cannot be computed"):
        deviation(phase_from_rate(rate_of(100), 1.0), np.array([1, 45]), 1.0, "mdev")
