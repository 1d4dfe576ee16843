"""Warnings and expected alarms of the analysis of a fleet."""

import math

import pandas as pd
import pytest
from scipy.stats import norm

from rotcli.fleet.estimate import _charts, _warn_mixed_rates
from rotcli.fleet.variance.components import fit
from rotcli.fleet.variance.likelihood import minimise
from rotcli.fleet.variance.profile import Profile
from rotcli.run.findings import Finding
from tests.fleet.fleets import fleet


@pytest.mark.parametrize(
    ("name", "rates", "warned"),
    [
        ("Kgz", [100.0, 100.5], False),
        ("Kgz", [100.0, -101.5], True),
        ("Kgz", [100.0, -100.0], False),
        ("bias_z", [100.0, 101.5], False),
        ("Kgz", [math.nan], False),
    ],
)
def test_scale_factors_at_rates_more_than_a_percent_apart_are_named(name, rates, warned):
    findings: list[Finding] = []
    _warn_mixed_rates(name, pd.DataFrame({"rate": rates}), findings)
    assert [f.code for f in findings] == (["mixed-rates"] if warned else [])


def test_the_expected_alarms_are_those_of_the_points_after_the_baseline():
    rows, _ = fleet(2, units=3, days=9, turns=2)
    made, by_day, (shewhart, ewma) = _charts(rows, fit(rows), 5)
    assert by_day
    assert len(made) == 3
    # Three sigma of a normal variable, 9 - 5 points of each unit; both charts alarm as often.
    assert shewhart == pytest.approx(3 * 4 * 2.0 * norm.sf(3.0), rel=1e-6)
    assert ewma == pytest.approx(shewhart, rel=1e-4)


def test_the_gain_over_zero_of_a_certain_component_is_its_square_in_sigmas():
    rows, _ = fleet(5, units=60, days=4, turns=4)
    free = (True, True, True)
    best, minimum = minimise(rows, free)
    profile = Profile(rows, free, best, minimum)
    low, high = (math.sqrt(v) for v in profile.interval(0, 100.0))
    # The 95 % interval of the standard deviation is 3.92 sigma wide, not quite symmetric.
    in_sigmas = math.sqrt(best[0]) / ((high - low) / 3.92)
    assert in_sigmas > 8.0
    assert profile.gain_at_zero(0) == pytest.approx(in_sigmas**2, rel=0.1)
