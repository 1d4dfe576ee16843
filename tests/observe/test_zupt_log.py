"""The filter on log records: noise figures, calibration, windows, warnings."""

import numpy as np
import pytest

from rotcli.errors import LogError, RigError, RotcliError
from rotcli.logs.record import ImuLog, TableLog
from rotcli.models.sensors import TriadErrors
from rotcli.observe.document import names_of, unreliable_estimates
from rotcli.observe.observability import TableMotion, analyse
from rotcli.observe.zupt import Options, filter_log, has_single_rate, noise_from_rig
from rotcli.observe.zupt.checks.window import dominant_rate
from rotcli.observe.zupt.model import InitialSigma, Noise
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG, DEG_PER_HOUR, PPM

SITE = {"latitude": 51.08, "height": 1100.0}
FIGURES = {
    "angle_random_walk": 3.0,
    "velocity_random_walk": 0.12,
    "rate_random_walk": 2.6,
    "bias_instability": 8.3,
    "accel_bias_instability": 1.8e-3,
}


def simulated(axis="y", pitch=30.0, roll=0.0, legs=((100.0, 10.0),), seed=0, imu=None, **more):
    """Records of a simulated mti-g log, its rig and its profile."""
    rig = rig_from_dict(
        {
            "site": SITE,
            "attitude": {"pitch": pitch, "roll": roll, "azimuth": 20.0},
            "table": {"axis": axis},
            "imu": imu or FIGURES,
        }
    )
    profile = read_profile("mti-g")
    scenario = Scenario(
        profile, tuple(Leg(t, r * DEG) for t, r in legs), rig=rig, seed=seed, **more
    )
    made = simulate(scenario)
    return made.imu, made.table, rig, profile


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
    for seed in range(5):
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
    assert used >= 5


def test_a_residual_scale_factor_is_shown_with_what_the_calibration_removed():
    imu, table, rig, profile = simulated("z", 30.0, legs=((30.0, 0.0), (60.0, 20.0), (60.0, -20.0)))
    column = profile.gyro.matrix @ rig.table.axis
    removed = TriadErrors(np.outer(column + 500.0 * PPM, rig.table.axis))
    options = Options(scale=1000.0 * PPM)
    e = filter_log(imu, table, rig, options, removed).estimates
    assert (np.abs(e.values[-1, 12:] - column) < 4.0 * e.sigma[-1, 12:]).all()
    assert (np.abs(e.values[-1, 12:] - column - 500.0 * PPM) > 300.0 * PPM).any()


def test_a_calibration_is_applied_first_and_its_biases_are_part_of_the_estimates():
    imu, table, rig, profile = simulated()
    matrix = np.outer(profile.gyro.matrix @ rig.table.axis, rig.table.axis)
    plain = filter_log(imu, table, rig, Options(), TriadErrors(matrix))
    near = profile.gyro.bias + 30.0 * DEG_PER_HOUR
    shifted = filter_log(
        imu, table, rig, Options(), TriadErrors(matrix, near), TriadErrors(bias=profile.accel.bias)
    )
    a, b = (r.estimates.values[-1, 6:12] for r in (plain, shifted))
    # The prior of 500 deg/h and 0.02 m/s^2 is centred elsewhere: a hundredth of the shift.
    np.testing.assert_allclose(a[3:], b[3:], atol=10.0 * DEG_PER_HOUR)
    np.testing.assert_allclose(a[:3], b[:3], atol=1e-4)


def test_what_is_left_after_a_calibration_counts_in_the_gyros_own_scale():
    """The gyro reads (I + N) w + d: what is estimated of w is N larger in d."""
    imu, table, rig, _ = simulated("z", 30.0, legs=((100.0, 0.0),))
    large = TriadErrors(np.diag([0.2, 0.0, 0.0]))
    plain = filter_log(imu, table, rig, Options())
    scaled = filter_log(imu, table, rig, Options(), large).estimates.values[-1, 9]
    # 750 deg/h of bias and 13 of Earth rate are read as (b + w) / 1.2 - w; back in the gyro's own
    # terms that is b less a fifth of the Earth's rate, 1.2 times what the filter contains.
    b = plain.estimates.values[-1, 9]
    assert scaled == pytest.approx(b, abs=6.0 * DEG_PER_HOUR)
    assert abs(b) > 500.0 * DEG_PER_HOUR  # so that a fifth of it would show


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


def test_averaged_samples_and_a_window_are_respected():
    averages = {**FIGURES, "sampling": "average"}
    imu, table, rig, profile = simulated(legs=((80.0, 60.0),), imu=averages)
    assert imu.sampling == "average"
    matrix = np.outer(profile.gyro.matrix @ rig.table.axis, rig.table.axis)
    result = filter_log(imu, table, rig, Options(window=(10.0, 70.0)), TriadErrors(matrix))
    assert result.settings.samples_are_means
    assert (result.start, result.end) == pytest.approx((10.0, 70.0), abs=0.011)
    assert result.estimates.time[-1] == pytest.approx(70.0, abs=0.11)
    miss = result.estimates.values[-1, 9:12] - profile.gyro.bias
    assert (np.abs(miss) < 4.0 * result.estimates.sigma[-1, 9:12]).all()


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


def test_noise_figures_come_from_the_rig_or_are_said_to_be_assumed():
    noise, warnings = noise_from_rig(rig_from_dict({}))
    assert noise == Noise()
    assert "assumed" in warnings[0]
    assert "accel_bias_instability 0.0005 m/s^2" in warnings[0]
    noise, warnings = noise_from_rig(rig_from_dict({"imu": FIGURES}))
    assert not warnings
    # 2 sigma^2 / T is the walk's K^2 with what the instability adds.
    drive = 2.0 * noise.gyro_markov_sigma**2 / noise.gyro_correlation_time
    K, B = 2.6 * DEG_PER_HOUR, 8.3 * DEG_PER_HOUR
    assert drive == pytest.approx(K**2 + 2.0 * (3.0 * B) ** 2 / 120.0)
    datasheet, _ = noise_from_rig(rig_from_dict({"imu": {"bias_instability": 24.0}}))
    assert datasheet.gyro_markov_sigma == pytest.approx(24.0 * DEG_PER_HOUR)
    assert noise.accel_markov_sigma == pytest.approx(6.0 * 1.8e-3)
    markov = {
        **FIGURES,
        "gauss_markov_gyro_sigma": [10.0, 10.0, 10.0],
        "gauss_markov_gyro_time": 30.0,
    }
    noise, _ = noise_from_rig(rig_from_dict({"imu": markov}))
    expected = 2.0 * (10.0 * DEG_PER_HOUR) ** 2 / 30.0
    assert 2.0 * noise.gyro_markov_sigma**2 / noise.gyro_correlation_time == pytest.approx(expected)
    assert rig_from_dict({"imu": {"scale_sigma": 500.0}}).imu.scale_sigma == 500.0 * PPM


def test_logs_and_options_that_cannot_work_are_refused():
    imu, table, rig, _ = simulated(legs=((20.0, 10.0),))
    with pytest.raises(RigError, match=r"rig: site: latitude is missing; set \[site\] latitude"):
        filter_log(imu, table, rig_from_dict({}), Options())
    with pytest.raises(LogError, match="the window 5 to 50 s is not within the time of both logs"):
        filter_log(imu, table, rig, Options(window=(5.0, 50.0)))
    with pytest.raises(LogError, match="contains 11 samples, fewer than two updates of 10"):
        filter_log(imu, table, rig, Options(window=(5.0, 5.1)))
    with pytest.raises(RotcliError, match="smoothing needs the slaved azimuth"):
        filter_log(imu, table, rig, Options(smooth=True, slave_azimuth=False))
    apart = TableLog(table.path, table.time + 100.0, table.angle, table.interval)
    with pytest.raises(LogError, match="shares no time with the table log"):
        filter_log(imu, apart, rig, Options())


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
