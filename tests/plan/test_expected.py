"""A plan shows what navigation to expect with the rig's IMU."""

import pytest

from rotcli.errors import ResultError
from rotcli.files.results.expected_runs import expected_fields, expected_table
from rotcli.plan.api import PlanOptions, plan_sequence
from rotcli.plan.expected import plan_expectation
from rotcli.rig.rig import rig_from_dict

FIGURES = {
    "angle_random_walk": 0.4,
    "bias_instability": 15.66,
    "rate_random_walk": 0.35,
    "velocity_random_walk": 0.048,
    "accel_bias_instability": 4.5e-4,
    "scale_sigma": 800.0,
}


def _fields(figures: dict[str, float], rate: float) -> dict:
    return expected_fields(plan_expectation(rig_from_dict({"imu": figures}), rate))


def test_a_plan_shows_the_verified_rms_of_each_mode_and_rate():
    found = _fields(FIGURES, 50.0)
    runs = {(run["mode"], round(run["rate_dps"])): run["rms"] for run in found["runs"]}
    # A prior of 800 ppm and no accelerometer bias.
    for rate, horizontal, azimuth in ((10, 498.6, 1.65), (50, 359.0, 6.99), (100, 345.1, 13.89)):
        partial = runs["partial", rate]
        assert partial["horizontal_m"] == pytest.approx(horizontal, rel=0.01)
        assert partial["azimuth_deg"] == pytest.approx(azimuth, rel=0.01)
    assert runs["full", 50]["horizontal_m"] == pytest.approx(279.0, rel=0.01)
    table = expected_table(found)
    assert [row[0] for row in table.rows] == ["conventional", *["partial"] * 3, *["full"] * 3]


def test_missing_figures_are_named():
    figures = {key: value for key, value in FIGURES.items() if key != "rate_random_walk"}
    found = _fields(figures, 50.0)
    assert found["reason"] == "[imu] lacks rate_random_walk"
    assert found["runs"] == []


def test_partial_needs_the_prior_of_the_axis_column():
    figures = {key: value for key, value in FIGURES.items() if key != "scale_sigma"}
    found = _fields(figures, 50.0)
    partial = [run for run in found["runs"] if run["mode"] == "partial"]
    assert {run["reason"] for run in partial} == {"[imu] scale_sigma is missing"}
    table = expected_table(found)
    assert table.shown[1][3] == "-"
    assert "partial about z at 10 deg/s: [imu] scale_sigma is missing." in table.note


def test_the_figure_of_a_plan_shows_the_expected_error_over_time_and_rate():
    result = plan_sequence(rig_from_dict({"imu": FIGURES}), PlanOptions(axes=3, time=300.0))
    labels = [axis.get_ylabel() for axis in result.figure().axes]
    assert sum("expected" in label for label in labels) == 2
    assert [row[2] for row in result.tables()[1].rows[1:4]] == pytest.approx([10.0, 50.0, 100.0])


def test_a_plan_without_noise_figures_has_no_figure():
    result = plan_sequence(rig_from_dict({}), PlanOptions(axes=3, time=300.0))
    with pytest.raises(ResultError, match="lacks angle_random_walk"):
        result.figure()


def test_of_three_scale_sigmas_the_largest_counts():
    one, three = (
        {(run["mode"], run["rate_dps"]): run["rms"]["azimuth_deg"] for run in found["runs"]}
        for found in (
            _fields(FIGURES, 50.0),
            _fields({**FIGURES, "scale_sigma": [200.0, 800.0, 400.0]}, 50.0),
        )
    )
    assert one == pytest.approx(three)
