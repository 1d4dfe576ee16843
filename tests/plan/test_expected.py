"""A plan shows what navigation to expect with the rig's IMU."""

import pytest

from rotcli.plan.expected import expected_fields, expected_table
from rotcli.rig.rig import rig_from_dict

FIGURES = {
    "angle_random_walk": 0.4,
    "bias_instability": 15.66,
    "rate_random_walk": 0.35,
    "velocity_random_walk": 0.048,
    "accel_bias_instability": 4.5e-4,
    "scale_sigma": 800.0,
}


def test_a_plan_shows_the_verified_rms_of_each_mode():
    found = expected_fields(rig_from_dict({"imu": FIGURES}), 50.0)
    by_mode = {run["mode"]: run for run in found["runs"]}
    # A prior of 800 ppm and no accelerometer bias: 359.0 m and 6.99 deg at 50 deg/s.
    assert by_mode["partial"]["horizontal_m"] == pytest.approx(359.0, rel=0.01)
    assert by_mode["partial"]["azimuth_deg"] == pytest.approx(6.99, rel=0.01)
    assert by_mode["full"]["horizontal_m"] == pytest.approx(279.0, rel=0.01)
    (table,) = expected_table(found)
    assert [row[0] for row in table.rows] == ["conventional", "partial", "full"]


def test_missing_figures_are_named():
    figures = {key: value for key, value in FIGURES.items() if key != "rate_random_walk"}
    found = expected_fields(rig_from_dict({"imu": figures}), 50.0)
    assert found["reason"] == "[imu] lacks rate_random_walk"
    assert expected_table(found) == []


def test_partial_needs_the_prior_of_the_axis_column():
    figures = {key: value for key, value in FIGURES.items() if key != "scale_sigma"}
    found = expected_fields(rig_from_dict({"imu": figures}), 50.0)
    assert found["runs"][1]["reason"] == "[imu] scale_sigma is missing"
    (table,) = expected_table(found)
    assert table.rows[1][1] is None
