"""The filter on log records: noise figures, calibration, windows, warnings."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.record import ImuLog
from rotcli.models.sensors import TriadErrors
from rotcli.observe.document import names_of, unreliable_estimates
from rotcli.observe.observability import TableMotion, analyse
from rotcli.observe.zupt import Options, filter_log, has_single_rate
from rotcli.observe.zupt.checks.window import dominant_rate
from rotcli.observe.zupt.model import InitialSigma
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG, DEG_PER_HOUR
from tests.observe.zupt_runs import FIGURES, SITE, simulated


@pytest.mark.parametrize(
    ("axis", "pitch", "roll"), [("y", 0, 0), ("y", 30, 0), ("x", 0, 0), ("x", 0, 30), ("z", 30, 0)]
)
def test_biases_of_a_simulated_log_lie_within_four_sigma(axis, pitch, roll):
    imu, table, rig, profile = simulated(axis, pitch, roll, legs=((300.0, 10.0),), seed=7)
    matrix = np.outer(profile.gyro.matrix @ rig.table.axis, rig.table.axis)
    result = filter_log(imu, table, rig, Options(), TriadErrors(matrix))
    found, sigma = result.estimates.values[-1, 6:12], result.estimates.sigma[-1, 6:12]
    truth = np.concatenate([profile.accel.bias, profile.gyro.bias])
    assert (np.abs(found - truth) < 4.0 * sigma).all()
    assert result.calibrated
    assert result.rate == pytest.approx(10.0 * DEG, rel=1e-6)


def test_without_a_calibration_the_scale_states_keep_the_sigmas_honest():
    imu, table, rig, profile = simulated("z", 30.0)
    truth = profile.gyro.bias
    bare = filter_log(imu, table, rig, Options(scale=0.0))
    honest = filter_log(imu, table, rig, Options(scale=3e-3))

    def miss(result):
        e = result.estimates
        return np.abs((e.values[-1, 9:12] - truth) / e.sigma[-1, 9:12]).max()

    assert miss(honest) < 2.0 < 3.0 < miss(bare)
    assert any("no gyro calibration" in text for text in bare.warnings)
    assert not honest.warnings
    from_rig = filter_log(imu, table, rig.override({"imu": {"scale_sigma": 3000.0}}), Options())
    np.testing.assert_array_equal(from_rig.estimates.values, honest.estimates.values)
    unasked = filter_log(imu, table, rig, Options())
    np.testing.assert_array_equal(unasked.estimates.values, honest.estimates.values)
    (text,) = unasked.warnings
    assert "no [imu] scale_sigma: 3000 ppm is assumed" in text
    ideal = filter_log(imu, table, rig.override({"imu": {"scale_sigma": 0.0}}), Options())
    np.testing.assert_array_equal(ideal.estimates.values, bare.estimates.values)


HAND_MADE = """
name = "hand-made"
[gyro]
angle_random_walk = 0.4
bias_instability = 5.0
bias = [60.0, -40.0, -120.0]
scale = [800.0, -600.0, 1500.0]
installation = { xy = 300.0, xz = -400.0, yx = -200.0, yz = 350.0, zx = 150.0, zy = -250.0 }
[accel]
velocity_random_walk = 0.03
bias_instability = 1e-4
bias = [-0.002, 0.001, 0.003]
"""


@pytest.mark.parametrize("still", [0.0, 60.0])
@pytest.mark.parametrize("axis", ["z", "y"])
def test_what_an_uncalibrated_gyro_leaves_for_use_lies_within_four_sigma(tmp_path, still, axis):
    path = tmp_path / "hand.toml"
    path.write_text(HAND_MADE)
    profile = read_profile(str(path))
    figures = {
        "angle_random_walk": 0.4,
        "bias_instability": 5.0,
        "velocity_random_walk": 0.03,
        "accel_bias_instability": 1e-4,
    }
    rig = rig_from_dict(
        {
            "site": SITE,
            "attitude": {"pitch": 5.0, "roll": -3.0, "azimuth": 20.0},
            "table": {"axis": axis},
            "imu": figures,
        }
    )
    legs = (Leg(still),) if still else ()
    column = profile.gyro.matrix @ rig.table.axis
    truth = np.concatenate([profile.accel.bias, profile.gyro.bias, column])
    used = 0
    for seed in range(3):
        legs_now = (*legs, Leg(120.0, 20.0 * DEG))
        made = simulate(Scenario(profile, legs_now, rig=rig, seed=seed))
        result = filter_log(made.imu, made.table, rig, Options())
        motion = TableMotion(tuple(rig.table.axis), 20.0 * DEG, 5.0 * DEG, -3.0 * DEG, 20.0 * DEG)
        bad = unreliable_estimates(result, analyse(motion))
        use = np.array([name not in bad for name in names_of(result)[6:]])
        miss = (result.estimates.values[-1, 6:] - truth) / result.estimates.sigma[-1, 6:]
        assert (np.abs(miss) < 4.0)[use].all()
        used += use.sum()
        if not still:  # one rate: 1500 ppm of 20 deg/s look like 108 deg/h
            assert (
                f"a single rate does not separate it from {names_of(result)[14]}"
                in bad["gyro_bias_z"]
            )
        bare = filter_log(made.imu, made.table, rig, Options(scale=0.0))
        miss = (bare.estimates.values[-1, 6:] - truth[:6]) / bare.estimates.sigma[-1, 6:]
        assert np.abs(miss).max() > 3.0  # without the states the same log misleads
    assert used >= 3


def test_a_table_that_goes_back_and_forth_turns():
    assert dominant_rate(np.repeat([0.17, -0.17], [100, 90])) == pytest.approx(0.17)
    assert dominant_rate(np.repeat([0.17, -0.17], [90, 100])) == pytest.approx(-0.17)
    sweep = dominant_rate(0.5 * np.sin(np.arange(0.0, 60.0, 0.1)))
    assert abs(sweep) == pytest.approx(0.5 * np.sqrt(0.5), rel=0.05)  # the median size of a sine
    assert dominant_rate(np.repeat([0.0, 0.17], [95, 5])) == 0.0
    imu, table, rig, _ = simulated(legs=((40.0, 10.0), (40.0, -10.0)))
    assert abs(filter_log(imu, table, rig, Options()).rate) == pytest.approx(10 * DEG, rel=0.01)


def test_a_still_log_needs_no_table_log():
    imu, table, rig, _ = simulated("z", 0.0, legs=((60.0, 0.0),))
    alone, together = filter_log(imu, None, rig, Options()), filter_log(imu, table, rig, Options())
    assert alone.rate == together.rate == 0.0
    np.testing.assert_allclose(alone.estimates.values, together.estimates.values, atol=1e-12)


def test_a_bias_far_from_the_prior_is_warned_about():
    imu, table, rig, _ = simulated("z", 0.0, legs=((60.0, 0.0),))
    narrow = InitialSigma(gyro=100.0 * DEG_PER_HOUR)
    result = filter_log(imu, table, rig, Options(initial=narrow))
    (text,) = result.warnings
    # 1800 deg/h over 100, less what the narrow prior contains back.
    assert "gyro biases changed by 17 initial sigmas; raise their initial sigma" in text
    # What the prior contains back of one bias goes into the others: nothing is to be used.
    bad = unreliable_estimates(result, analyse(TableMotion(axis=None)))
    assert set(bad) == set(names_of(result)[3:])
    assert all("raise their initial sigma" in reason for reason in bad.values())
    assert not filter_log(imu, table, rig, Options()).warnings


def test_a_table_that_moves_otherwise_than_said_is_refused():
    imu, table, rig, _ = simulated("z", 0.0, legs=((60.0, 10.0),))
    with pytest.raises(LogError, match="about another axis; check"):
        filter_log(imu, table, rig.override({"table": {"axis": "x"}}), Options())
    stop = simulated("z", 0.0, legs=((30.0, 0.0), (30.0, 10.0)))[0]
    with pytest.raises(LogError, match=r"is not still: gyro_. deviates"):
        filter_log(stop, None, rig, Options())


def test_one_rate_is_named_as_the_reason_why_a_lever_arm_stays_unknown():
    imu, table, rig, _ = simulated(legs=((60.0, 20.0),))
    result = filter_log(imu, table, rig, Options(estimate_lever_arm=True))
    assert any(
        "a single rate (20 deg/s) does not separate lever arm" in text for text in result.warnings
    )
    two = simulated(legs=((30.0, 20.0), (30.0, 60.0)))
    result = filter_log(*two[:3], Options(estimate_lever_arm=True))
    assert not any("single rate" in text for text in result.warnings)
    # The rig's arm is part of what is estimated.
    stored = rig.override({"imu": {"lever_arm": [0.03, 0.0, -0.02]}})
    complete = filter_log(two[0], two[1], stored, Options(estimate_lever_arm=True)).estimates
    # Both start within 0.1 m of the truth: a thousandth of that is the prior's pull.
    np.testing.assert_allclose(
        complete.values[-1, 12:14], result.estimates.values[-1, 12:14], atol=2e-4
    )
    assert has_single_rate(np.full(100, 0.3))
    assert has_single_rate(np.full(100, -0.3))
    assert not has_single_rate(np.repeat([0.0, 0.3], 50))


def test_a_table_off_its_attitude_is_warned_about():
    imu, table, rig, _ = simulated(pitch=30.0)
    off = rig.override({"attitude": {"pitch": 31.0}})
    result = filter_log(imu, table, off, Options(scale=3e-3))
    assert any("the table is 1 deg off [attitude]" in w for w in result.warnings)
    assert result.estimates.attitude_errors[-1, 0] == pytest.approx(-1.0 * DEG, abs=0.15 * DEG)
    unnamed = rig_from_dict({"site": SITE, "table": {"axis": "y"}, "imu": FIGURES})
    result = filter_log(imu, table, unnamed, Options(window=(0.0, 5.0)))
    assert any("[attitude] pitch, roll, azimuth is missing" in w for w in result.warnings)


def test_a_wrong_attitude_does_not_change_what_is_estimated_of_the_sensors():
    imu, table, rig, _ = simulated("z", 30.0, seed=3)
    right = filter_log(imu, table, rig, Options()).estimates.values[-1]
    off = rig.override({"attitude": {"pitch": 32.0}})
    found = filter_log(imu, table, off, Options()).estimates.values[-1]
    # One pass is off by 3e-5 m/s^2, 1 deg/h and 0.2 deg of azimuth; what stays is the prior's pull.
    np.testing.assert_allclose(found[6:9], right[6:9], atol=5e-6)
    np.testing.assert_allclose(found[9:12], right[9:12], atol=0.1 * DEG_PER_HOUR)
    assert found[5] == pytest.approx(right[5], abs=0.01 * DEG)
    # The table is 2 deg of pitch lower: about an axis turned 20 deg from east to south.
    turn = -2.0 * DEG * np.array([np.cos(20.0 * DEG), -np.sin(20.0 * DEG)])
    np.testing.assert_allclose(found[3:5] - right[3:5], turn, atol=0.005 * DEG)


def test_innovations_larger_than_the_sigmas_are_warned_about():
    imu, table, rig, _ = simulated()
    motion = TableMotion((0.0, 1.0, 0.0), 10.0 * DEG, 30.0 * DEG)
    for swing, verdict in ((0.0022, "optimistic"), (0.01, "inconsistent")):
        shaken = imu.accel * (1.0 + swing * np.sin(imu.time)[:, None])
        rough = ImuLog(imu.path, imu.time, imu.gyro, shaken, imu.interval)
        result = filter_log(rough, table, rig, Options(velocity_sigma=2e-3))
        assert result.nis_verdict == verdict
        (text,) = [w for w in result.warnings if "innovations exceed their sigma" in w]
        bad = unreliable_estimates(result, analyse(motion))
        everything = set(names_of(result)[3:]) == set(bad)
        assert everything == (verdict == "inconsistent") == ("do not use any estimate" in text)
        assert everything == ("the innovations contradict the sigmas" in bad["azimuth"])
    assert filter_log(imu, table, rig, Options()).nis_verdict == "consistent"
    fixed = filter_log(imu, table, rig, Options(velocity_sigma=2e-3))
    assert fixed.nis_verdict == "conservative"


def test_a_log_with_the_reference_figures_gives_the_reference_sigmas():
    figures = {
        "angle_random_walk": 3.0,
        "velocity_random_walk": 0.12,
        "gauss_markov_gyro_sigma": 24.0,
        "gauss_markov_gyro_time": 120.0,
        "gauss_markov_accel_sigma": 5e-4,
        "gauss_markov_accel_time": 120.0,
    }
    rig = rig_from_dict(
        {
            "site": {"latitude": 51.0},
            "attitude": {"pitch": 30.0, "roll": 0.0, "azimuth": 0.0},
            "table": {"axis": "y"},
            "imu": figures,
        }
    )
    made = simulate(Scenario(read_profile("ideal"), (Leg(600.0, 10.0 * DEG),), rig=rig))
    sigma = filter_log(
        made.imu, made.table, rig, Options(scale=0.0, velocity_sigma=2e-3)
    ).estimates.sigma[-1]
    expected = [0.0322, 0.0322, 1.426, 0.00047, 0.00052, 0.00046, 26.40, 25.50, 26.98]
    scale = np.repeat([DEG, 1.0, DEG_PER_HOUR], 3)
    # The list's own digits: 1 %, and the rounding of the accelerometers' last decimal.
    np.testing.assert_allclose(sigma[3:] / scale, expected, rtol=0.01, atol=0.6e-5)
