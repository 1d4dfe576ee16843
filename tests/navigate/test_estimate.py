"""Navigation of simulated logs: exact where the input is, and right in sign where it is not."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotcli.errors import RigError
from rotcli.models.sensors import TriadErrors
from rotcli.navigate.estimate import continue_angles, navigate, still_gyro_biases, warn_wrong_rate
from rotcli.navigate.place import prepare
from rotcli.rig.rig import rig_from_dict
from rotcli.simulate.estimate import simulate

DEG = np.pi / 180
NONE = TriadErrors()


def _run(scenario, laboratory, *, need_static=False, **rig):
    made = simulate(scenario)
    stages = {name: [list(w) for w in windows] for name, windows in made.stages.items()}
    named = {k: v if k == "rotation" else v[0] for k, v in stages.items()}
    kept = scenario.rig.effective()
    kept = {**kept, "stages": named, **rig}
    return prepare(made.imu, made.table, rig_from_dict(kept), need_static=need_static)


@pytest.mark.parametrize("sampling", ["instant", "increment"])
@pytest.mark.parametrize("axis", ["x", "z"])
@pytest.mark.parametrize("rate", [10.0, 100.0])
def test_an_error_free_log_with_lever_arm_comes_out_without_error(
    papers_run, laboratory, axis, rate, sampling
):
    scenario = papers_run(
        rate=rate,
        static=0.0,
        rotation=10.0,
        navigation=300.0,
        table={"axis": axis},
        imu={"sampling": sampling, "lever_arm": [0.05, -0.03, 0.02]},
        attitude={"pitch": 5.0, "roll": -3.0, "azimuth": 20.0},
    )
    result = navigate(*_run(scenario, laboratory), NONE, mode="full")
    # Encoder steps of 1e-5 deg over 5 cm move the starting velocity by 1e-7 m/s: 0.03 mm in
    # 300 s; they show directly in the attitude.
    assert np.abs(result.errors[:, :3]).max() < 1e-4
    # The velocity is that of the axis, not of the IMU next to it (up to 0.1 m/s): what the
    # encoder's steps leave of a rate, 1e-5 deg within 20 ms over 5 cm, is 4e-7 m/s.
    assert np.abs(result.errors[:, 3:6]).max() < 2e-6
    assert np.abs(result.errors[:, 6:]).max() < 1e-5 * DEG
    assert result.rate == pytest.approx(rate * DEG, rel=1e-6)


def test_an_azimuth_gyro_bias_turns_the_azimuth_the_other_way(papers_run, laboratory):
    # A gyro that reads 36 deg/h too much about up (anticlockwise) shows azimuth falling.
    scenario = papers_run(rate=0.0, rotation=0.0, navigation=100.0)
    run = _run(scenario, laboratory)
    result = navigate(*run, TriadErrors(bias=np.array([0, 0, -36 * DEG / 3600])), mode="partial")
    assert result.errors[-1, 8] / DEG == pytest.approx(-1.0, rel=1e-4)


@pytest.mark.parametrize(
    ("axis", "column", "sign"), [(0, 1, 1.0), (1, 0, -1.0)], ids=["gyro_x", "gyro_y"]
)
def test_a_horizontal_gyro_bias_grows_as_the_cube_of_time(
    papers_run, laboratory, axis, column, sign
):
    scenario = papers_run(rate=0.0, rotation=0.0, navigation=100.0)
    bias = np.zeros(3)
    bias[axis] = -10 * DEG / 3600  # taken out although it is not there: reads 10 deg/h too much
    result = navigate(*_run(scenario, laboratory), TriadErrors(bias=bias), mode="partial")
    d = 10 * DEG / 3600
    # eps' = d, v' = -g eps_E northwards for a tilt about east: dp = -+ g d t^3 / 6.
    moved = result.errors[-1, 1 - column if axis == 1 else 0]
    expected = 9.81 * d * 100.0**3 / 6
    assert abs(moved) == pytest.approx(expected, rel=0.01)
    assert np.sign(moved) == -sign
    tilt = result.errors[-1, 6 + axis]
    assert tilt == pytest.approx(d * 100.0, rel=0.01)


def test_an_accelerometer_bias_grows_as_the_square_of_time_and_turning_modulates_it(
    papers_run, laboratory
):
    bias = TriadErrors(bias=np.array([0.01, 0.0, 0.0]))
    still = _run(papers_run(rate=0.0, rotation=0.0, navigation=100.0), laboratory)
    found = navigate(*still, NONE, bias, mode="partial")
    assert found.errors[-1, 1] == pytest.approx(-0.5 * 0.01 * 100.0**2, rel=0.01)
    # Five turns of 20 s at 18 deg/s: after complete turns no velocity is left, R16 table 1.
    turning = _run(papers_run(rate=18.0, rotation=1.0, navigation=100.0), laboratory)
    modulated = navigate(*turning, NONE, bias, mode="partial")
    assert np.abs(modulated.errors[-1, 3:5]).max() < 1e-3 * 0.01 * 100.0


def test_the_biases_of_the_still_minute_are_those_of_the_sensors(papers_run, laboratory):
    run, place = _run(
        papers_run("nav440", rate=0.0, rotation=0.0, navigation=10.0, seed=2),
        laboratory,
        need_static=True,
    )
    found = still_gyro_biases(run, place.base).bias / DEG * 3600
    # One minute: white noise 3 deg/h, flicker 12 deg/h; four sigma.
    np.testing.assert_allclose(found, [120.0, -90.0, 60.0], atol=52.0)


def test_height_may_be_fixed(papers_run, laboratory):
    run = _run(papers_run(rate=0.0, rotation=0.0, navigation=100.0), laboratory)
    bias = TriadErrors(bias=np.array([0.01, 0.0, 0.02]))
    free = navigate(*run, NONE, bias, mode="partial")
    kept = navigate(*run, NONE, bias, mode="partial", hold_height=True)
    assert free.errors[-1, 2] == pytest.approx(-100.0, rel=0.01)
    assert np.abs(kept.errors[:, 2]).max() < 1e-4
    # 100 s of the Schuler swing take off (t/T)^2/12 = 0.13 %; falling adds Coriolis force.
    assert kept.errors[-1, 1] == pytest.approx(-50.0 * (1 - 0.0013), rel=2e-4)


def test_what_the_rig_leaves_out_is_levelled_or_assumed_with_a_warning(papers_run, laboratory):
    scenario = papers_run(
        rate=0.0,
        rotation=0.0,
        navigation=10.0,
        attitude={"pitch": 3.0, "roll": -2.0, "azimuth": 0.0},
    )
    run, place = _run(scenario, laboratory, attitude={})
    assert place.pitch / DEG == pytest.approx(3.0, abs=1e-6)
    assert place.roll / DEG == pytest.approx(-2.0, abs=1e-6)
    assert any("levelled by the accelerometers" in w for w in run.warnings)
    assert any("azimuth: taken as 0" in w for w in run.warnings)


def test_without_a_site_navigation_is_refused(papers_run):
    made = simulate(papers_run(rate=0.0, rotation=0.0, navigation=10.0))
    with pytest.raises(RigError, match=r"\[site\] latitude: missing"):
        prepare(made.imu, None, rig_from_dict({}), need_static=True)


def test_a_sweeping_table_has_no_one_rate(papers_run, laboratory):
    from dataclasses import replace

    from rotcli.rig.scenario import Leg

    scenario = papers_run(static=60.0, rotation=0.0)
    sweep = Leg(60.0, sweep=50 * DEG, period=10.0, stage="navigation")
    run, place = _run(replace(scenario, legs=(*scenario.legs, sweep)), laboratory)
    assert not run.constant_rate
    result = navigate(run, place, NONE, mode="full")
    assert np.abs(result.errors[:, :3]).max() < 1e-4


@pytest.mark.parametrize("pitch", [80.0, 89.9])
def test_attitude_errors_of_a_vertical_body_stay_as_small_as_they_are(
    papers_run, laboratory, pitch
):
    # A bias of 36 deg/h along the body's right axis turns it by 1 deg in 100 s: all pitch.
    scenario = papers_run(
        rate=0.0,
        rotation=0.0,
        navigation=100.0,
        attitude={"pitch": pitch, "roll": 0.0, "azimuth": 70.0},
    )
    run, place = _run(scenario, laboratory)
    bias = np.array([-36 * DEG / 3600, 0.0, 0.0])
    result = navigate(run, place, TriadErrors(bias=bias), mode="partial")
    # The Schuler loop takes w_s^2 t^2 / 6 = 0.26 %.
    assert result.errors[-1, 6] / DEG == pytest.approx(1.0 - 0.0026, rel=5e-4)
    # Earth rate couples 1 deg of pitch into the others: 0.5 deg x 0.42 deg at most.
    assert np.abs(result.errors[-1, 7:]).max() / DEG < (0.005 if pitch > 85 else 0.05)
    assert any("rotation vector" in warning for warning in run.warnings) == (pitch > 85)


def test_angles_that_pass_half_a_turn_continue_from_chunk_to_chunk():
    steps = np.array([[0.3], [0.01], [-0.5]]) + 0.2 * np.random.default_rng(3).standard_normal(500)
    angles = np.cumsum(steps, axis=1)
    wrapped = (angles + np.pi) % (2.0 * np.pi) - np.pi
    before = np.zeros(3)
    for first in range(0, 500, 50):
        before = continue_angles(wrapped[:, first : first + 50], before)
        np.testing.assert_array_equal(before, wrapped[:, first + 49])
    np.testing.assert_allclose(wrapped, angles, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("rate", "limit"), [(0.0, 0.1), (100.0, 0.2), (-100.0, 0.2)])
def test_a_mean_rate_beyond_a_tenth_of_a_degree_and_a_thousandth_of_the_rate_is_reported(
    rate, limit
):
    run = SimpleNamespace(rate=rate * DEG, imu=SimpleNamespace(path="imu.csv"))
    assert warn_wrong_rate(run, np.array([0.0, 0.99 * limit * DEG, 0.0])) == ()
    assert len(warn_wrong_rate(run, np.array([0.0, -1.01 * limit * DEG, 0.0]))) == 1
