"""Expected RMS before any test: the table's values from a profile, and what is missing by name."""

import numpy as np
import pytest

from rotcli.budget.api import BudgetOptions, budget_of, gather_sensor_errors
from rotcli.models.expected.motion import StillTable
from rotcli.models.expected.plan import PlannedSensors
from rotcli.models.expected.planned_runs import planned_expectation
from rotcli.models.mean_covariance import SlowNoise
from rotcli.rig.rig import default_rig
from rotcli.units import DEG


def _budget(**options):
    settings = BudgetOptions(**options)
    return budget_of(gather_sensor_errors(settings, default_rig()), settings)


def _run(result, mode, rate, axis="z"):
    runs = result.document["expected"]["runs"]
    return next(
        run
        for run in runs
        if run["mode"] == mode and run["axis"] == axis and abs(run["rate_dps"] - rate) < 1e-6
    )


@pytest.fixture(scope="module")
def nav440():
    return _budget(imu="nav440", axes=("z",), rate=50.0)


@pytest.mark.parametrize(
    ("mode", "rate", "horizontal", "azimuth"),
    [
        ("partial", 10.0, 524.8, 2.266),
        ("partial", 100.0, 433.2, 20.82),
        ("full", 10.0, 434.3, 0.7841),
        ("full", 50.0, 279.3, 0.7841),
        ("full", 100.0, 254.9, 0.7841),
    ],
)
def test_a_profile_gives_the_verified_expected_rms(nav440, mode, rate, horizontal, azimuth):
    rms = _run(nav440, mode, rate)["rms"]
    assert rms["horizontal_m"] == pytest.approx(horizontal, rel=0.01)
    assert rms["azimuth_deg"] == pytest.approx(azimuth, rel=0.01)


def test_conventional_navigation_is_first_and_needs_no_axis(nav440):
    run = _run(nav440, "conventional", 0.0, "still")
    assert run["rms"]["horizontal_m"] == pytest.approx(1827.0, rel=0.01)
    assert run["largest_source"] == "drift"
    # At the end: sigma of 3190 m on each axis, and b t^2/2 of the accelerometer biases.
    known = np.hypot(0.022, 0.026) * 300.0**2 / 2.0
    assert run["horizontal_m"][-1] == pytest.approx(np.hypot(3190.0 * 2**0.5, known), rel=0.02)


def test_a_calibrated_unbiased_sensor_has_no_column_and_no_accelerometer_bias():
    result = _budget(
        imu="mti-g",
        axes=("z",),
        rate=50.0,
        accel_bias=[0.0, 0.0, 0.0],
        gyro_scale=[0.0] * 3,
        gyro_installation=[0.0] * 6,
    )
    partial, full = (_run(result, mode, 50.0)["rms"] for mode in ("partial", "full"))
    # Nothing is left in: partial and full differ in the calibration's contrast alone.
    assert partial["horizontal_m"] == pytest.approx(full["horizontal_m"], rel=0.03)
    assert full["horizontal_m"] == pytest.approx(1715.0, rel=0.01)


def test_missing_noise_figures_are_named():
    result = _budget(gyro_bias=[1.0, 0.0, 0.0])
    expected = result.document["expected"]
    assert expected["runs"] == []
    assert "angle_random_walk" in expected["reason"]
    assert "accel_bias_instability" in expected["reason"]


def test_a_run_that_is_too_long_or_too_fast_is_null_with_its_reason():
    result = _budget(imu="nav440", axes=("z",), rate=100.0, duration=3600.0)
    run = _run(result, "full", 100.0)
    assert run["rms"]["horizontal_m"] is None
    assert "limit 2500" in run["reason"]
    table = next(t for t in result.tables() if t.title.startswith("Expected RMS"))
    assert "limit 2500" in table.note


def test_the_figure_shows_the_expected_error_over_time_and_rate(nav440):
    labels = [axis.get_ylabel() for axis in nav440.figure().axes]
    assert sum("expected" in label for label in labels) == 2


@pytest.mark.parametrize(("cone", "reason"), [(14.6, ""), (18.2, "tilts by 36 deg: approximate")])
def test_a_frame_that_tilts_by_more_than_30_deg_has_its_tilt_as_reason(cone, reason):
    # The computed frame turns about an axis at `cone` from the vertical: after half a turn its
    # vertical is at twice that.
    gyro, accel = (1e-6, SlowNoise(1e-7, 1e-9)), (1e-4, SlowNoise(1e-5))
    matrix = np.zeros((3, 3))
    matrix[0, 2] = np.tan(cone * DEG)
    planned = planned_expectation(
        PlannedSensors((gyro,), (accel,), matrix),
        StillTable(0.9, 0.0, 9.81, 0.0, 0.0, 0.0, np.array([0.0, 0.0, 1.0])),
        axes=("z",),
        rate=100.0 * DEG,
        duration=30.0,
    )
    reasons = {run.mode: run.reason for run in planned.runs if run.rate == 100.0 * DEG}
    assert reasons["partial"].endswith(reason)
    assert bool(reasons["partial"]) == bool(reason)
    assert reasons["full"] == ""
