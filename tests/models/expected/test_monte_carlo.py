"""Expected errors against a nonlinear mechanization with noise that was running before the log.

The simulation shares the noise figures with the expectation, not its mathematics: flicker noise
is white noise through a filter with 14 record lengths of history, the errors are those of the
strapdown mechanization. Limits are in standard errors of a mean of RMS^2 over its expected value;
the standard error is that of the quadratic form.
"""

import numpy as np
import pytest

from rotcli.models.expected.errors import expected_errors
from rotcli.models.expected.statistics import (
    VERTICAL,
    ExpectedStatistics,
    expected_statistics,
    run_p_value,
)
from rotcli.units import DEG
from tests.models.expected.runs import PROFILES, navigate_noise, run, simulate_noise

INTERVAL = 0.05  # s
LENGTH = 421.0  # s
SETUPS = [
    ("conventional", 0.0, "z"),
    *((mode, rate, "z") for mode in ("partial", "full") for rate in (10.0, 50.0, 100.0)),
    ("full", 30.0, "y"),
    ("full", 30.0, "x"),
]


def _observed(errors: np.ndarray) -> np.ndarray:
    """Return the RMS (11,) of errors (n, 9)."""
    square = np.mean(errors**2, axis=0)
    return np.sqrt(np.concatenate([square, [square[0] + square[1], square[3] + square[4]]]))


def _scores(statistics: ExpectedStatistics, observed: np.ndarray) -> np.ndarray:
    """Return the standard scores (11,) of the mean of RMS^2 / expected^2 over seeds."""
    forms = statistics.forms
    deviation = np.sqrt((2.0 * forms.lam**2 * (1.0 + 2.0 * forms.delta2)).sum(axis=1))
    ratio = np.mean(observed**2, axis=0) / statistics.rms**2
    return (ratio - 1.0) / (deviation / forms.mean / np.sqrt(len(observed)))


def _many(profile: str, seeds: int, setups: list) -> dict:
    """Return statistics and observed RMS (seeds, 11) of each set-up; the seeds are shared."""
    found: dict = {setup: [] for setup in setups}
    for seed in range(seeds):
        noise = simulate_noise(profile, seed, INTERVAL, LENGTH)
        for mode, rate, axis in setups:
            errors = navigate_noise(profile, mode, rate, noise, INTERVAL, axis=axis)
            found[mode, rate, axis].append(_observed(errors))
    return {
        (mode, rate, axis): (
            expected_statistics(expected_errors(*run(profile, mode, rate, axis))),
            np.array(observed),
        )
        for (mode, rate, axis), observed in found.items()
    }


def test_a_few_runs_of_each_mode_have_the_expected_mean_squares():
    setups = [("conventional", 0.0, "z"), ("partial", 100.0, "z"), ("full", 10.0, "z")]
    for statistics, observed in _many("NAV440", 12, setups).values():
        assert np.all(np.abs(_scores(statistics, observed)) < 3.5)  # 33 correlated scores
        p = np.array([statistics.p_values(rms) for rms in observed])
        assert np.nanmin(p) > 1e-4


@pytest.mark.campaign
@pytest.mark.parametrize("profile", list(PROFILES))
def test_over_320_seeds_mean_squares_and_exceedance_are_the_expected_ones(profile):
    runs, small = [], {0.05: [], 0.01: [], 1e-3: []}
    for (_mode, _rate, axis), (statistics, observed) in _many(profile, 320, SETUPS).items():
        judged = [k for k in range(11) if axis == "z" or k not in VERTICAL]
        # 99 scores with seeds in common.
        assert np.all(np.abs(_scores(statistics, observed)[judged]) < 3.5)
        p = np.array([statistics.p_values(rms) for rms in observed])
        runs += [run_p_value(row) for row in p]
        for level, shares in small.items():
            shares.append(np.nanmean(p < level))
    # 2880 runs of 320 seeds: errors of one run and set-ups of one seed are correlated.
    assert np.mean(small[0.05]) == pytest.approx(0.05, abs=0.012)
    assert np.mean(small[0.01]) == pytest.approx(0.01, abs=0.004)
    assert np.mean(small[1e-3]) < 0.0025
    assert np.mean(np.array(runs) < 1e-3) < 0.003
    assert np.mean(np.array(runs) < 1e-2) < 0.016


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("profile", "mode", "rate", "duration"),
    [
        ("NAV440", "full", 50.0, 600.0),
        ("NAV440", "conventional", 0.0, 600.0),
        ("NAV440", "full", 20.0, 1200.0),
        ("MTi-G", "conventional", 0.0, 600.0),
    ],
)
def test_the_propagation_is_valid_up_to_its_limits(profile, mode, rate, duration):
    # 40 seeds, 11 correlated scores; samples of 0.1 s.
    statistics = expected_statistics(expected_errors(*run(profile, mode, rate, "z", duration)))
    assert statistics.valid.all()
    observed = []
    for seed in range(40):
        noise = simulate_noise(profile, seed, 0.1, duration + 121.0)
        errors = navigate_noise(profile, mode, rate, noise, 0.1, duration=duration)
        observed.append(_observed(errors))
    scores = _scores(statistics, np.array(observed))
    judged = [k for k in range(11) if k not in VERTICAL or not statistics.reasons[k]]
    assert np.all(np.abs(scores[judged]) < 3.5)


def test_beyond_its_limits_the_expectation_is_null_and_says_why():
    tilted = expected_statistics(expected_errors(*run("MTi-G", "partial", 100.0, "y")))
    assert not tilted.valid.any()
    assert "velocity error reaches" in tilted.reasons[0]
    leaning = expected_statistics(expected_errors(*run("NAV440", "partial", 100.0, "x")))
    assert all(leaning.reasons)
    long = expected_statistics(expected_errors(*run("NAV440", "full", 10.0, "z", 1500.0)))
    assert list(np.flatnonzero(~long.valid)) == list(VERTICAL)
    assert "free height over 1500 s" in long.reasons[2]


def test_height_of_second_order_is_given_without_p_value():
    statistics = expected_statistics(expected_errors(*run("MTi-G", "conventional", 0.0)))
    assert statistics.valid.all()
    p = statistics.p_values(statistics.rms)
    assert list(np.flatnonzero(np.isnan(p))) == list(VERTICAL)
    assert "second order in the tilt" in statistics.reasons[2]


@pytest.mark.campaign
@pytest.mark.parametrize("profile", list(PROFILES))
@pytest.mark.parametrize("mode", ["partial", "full"])
def test_a_wrong_attitude_of_the_rig_has_the_expected_mean_squares(profile, mode):
    sigma = np.array([0.1, 0.1, 1.0]) * DEG
    statistics = expected_statistics(expected_errors(*run(profile, mode, 30.0), sigma))
    rng = np.random.default_rng(7)
    observed = []
    for seed in range(200):
        noise = simulate_noise(profile, seed, INTERVAL, LENGTH)
        wrong = sigma * rng.standard_normal(3)
        errors = navigate_noise(profile, mode, 30.0, noise, INTERVAL, rig_error=wrong)
        observed.append(_observed(errors))
    scores = _scores(statistics, np.array(observed))
    judged = [k for k in range(11) if k not in VERTICAL]
    assert np.all(np.abs(scores[judged]) < 3.5)
    horizontal = {"NAV440 full": 573.5, "NAV440 partial": 644.4, "MTi-G full": 1785.0}
    expected = horizontal.get(f"{profile} {mode}", 2088.0)
    assert statistics.rms[9] == pytest.approx(expected, rel=0.01)
