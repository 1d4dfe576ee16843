"""What the IMU did against what the table's log says."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.plausible import check_rest_readings, check_spans
from rotcli.logs.record import ImuLog, TableLog
from rotcli.rig.rig import Rig
from rotcli.run.checks import CHECK_BY_CODE
from rotcli.run.evidence.direction import check_oscillation
from rotcli.run.evidence.stillness import warn_not_covered
from rotcli.run.motion import angle_range, encoder_noise, max_angle_deviation, motion_between
from rotcli.run.recording import check_motion
from rotcli.run.table_angle import angle_at
from rotcli.units import DEG, DEG_PER_ROOT_HOUR

UP = np.array([0.0, 0.0, 1.0])
TIME = np.arange(0.0, 30.0, 0.01)


def swinging(turn, amplitude=20.0, period=6.0, seed=1):
    """Return an IMU and a table swinging in (deg/s, s); `turn` makes gyros of the table's rate."""
    rng = np.random.default_rng(seed)
    w = 2.0 * np.pi / period
    rate = amplitude * DEG * np.cos(w * TIME)
    gyro = turn(rate) + 1e-3 * rng.normal(size=(len(TIME), 3))
    angle = amplitude * DEG / w * np.sin(w * TIME)
    imu = ImuLog("imu", TIME, gyro, np.tile(9.8 * UP, (len(TIME), 1)), 0.01)
    return imu, TableLog("table", TIME[::2], angle[::2], 0.02)


def along(*axis, factor=1.0, bias=0.05):
    return lambda rate: bias + factor * np.outer(rate, axis)


def test_a_swing_with_biases_and_scale_factor_is_followed():
    for seed in range(20):
        imu, table = swinging(along(0.01, -0.01, 1.01), amplitude=3.0 + seed, seed=seed)
        assert check_oscillation(imu, table, Rig(), 0.0, 30.0) == ()


@pytest.mark.parametrize(
    ("turn", "says"),
    [
        (along(1, 0, 0), "about another axis; check [table] axis and [imu] mount"),
        (along(0, 0, -1), "opposite sense; set [table] direction = -1"),
        (along(0, 0, 1, factor=1 / DEG), "not the same rate; check the units of both logs"),
        (along(0, 0, 1, factor=DEG), "not the same rate; check the units of both logs"),
    ],
)
def test_a_swing_about_another_axis_or_by_another_factor_is_refused(turn, says):
    imu, table = swinging(turn)
    (finding,) = check_oscillation(imu, table, Rig(), 0.0, 30.0)
    assert says in finding.text
    assert CHECK_BY_CODE[finding.code].observe == "error"


@pytest.mark.parametrize(("sampling", "lead"), [("instant", 0.0), ("average", 0.005)])
def test_the_factor_of_a_swing_is_that_of_the_same_times(sampling, lead):
    # A hundredth of a second is a tenth of a radian of it: a factor of 0.995.
    w, stamps = 2.0 * np.pi / 0.6, np.arange(-1.0, 31.0, 0.001)
    gyro = 0.3 * 20.0 * DEG * np.outer(np.cos(w * (TIME - lead)), UP)
    imu = ImuLog("imu", TIME, gyro, np.tile(9.8 * UP, (len(TIME), 1)), 0.01, sampling=sampling)
    table = TableLog("table", stamps, 20.0 * DEG / w * np.sin(w * stamps), 0.001)
    (finding,) = check_oscillation(imu, table, Rig(), 0.0, 29.0)
    assert finding.value == pytest.approx(0.3, rel=1e-3)


def test_one_rate_a_still_table_and_a_second_of_it_report_nothing():
    wrong = along(1, 0, 0)
    imu, table = swinging(wrong, amplitude=0.5)
    assert check_oscillation(imu, table, Rig(), 0.0, 30.0) == ()
    imu, table = swinging(wrong)
    assert check_oscillation(imu, table, Rig(), 0.0, 0.9) == ()


def test_a_segment_touched_and_clocks_apart_are_reported_of_a_log_that_turns():
    rng = np.random.default_rng(2)
    rate = np.where(TIME > 15.0, 20.0 * DEG, 0.0)
    stamps = np.arange(-1.0, 31.0, 0.01)
    angle = 20.0 * DEG * np.maximum(stamps - 15.005, 0.0)
    gyro = np.outer(rate, UP) + 1e-3 * rng.normal(size=(len(TIME), 3))
    accel = 9.8 * UP + 1e-3 * rng.normal(size=(len(TIME), 3))
    imu = ImuLog("imu", TIME, gyro, accel, 0.01)

    def findings(shift=0.0):
        table = TableLog("table", stamps - shift, angle, 0.01)
        return check_motion("observe", imu, table, Rig(), motion_between(table, 0.0, TIME[-1]))

    assert findings() == ()
    assert "set [table] time_offset = 0.05" in findings(0.05)[0].text
    gyro[700:750, 0] += 0.03
    (finding,) = findings()
    assert (finding.code, finding.severity) == ("segment-disturbed", "warning")


def test_a_span_that_the_other_log_does_not_hold_is_reported():
    assert warn_not_covered("imu", (0.0, 60.0), (0.5, 59.5)) == ()
    (finding,) = warn_not_covered("imu", (0.0, 60.0), (0.0, 20.0))
    assert finding.text.startswith("imu: only 0 to 20 s of 0 to 60 s is used because the table")


def test_slow_stamps_far_beyond_the_imu_log_are_refused_a_slow_table_is_not():
    imu = np.array([0.0, 60.0])
    with pytest.raises(
        LogError, match=r"spans 0 to 60000 s, the IMU log 0 to 60 s; .*set units time"
    ):
        check_spans("table", np.array([0.0, 60_000.0]), 20.0, imu)
    check_spans("table", np.array([0.0, 80.0]), 20.0, imu)
    check_spans("table", np.array([0.0, 60_000.0]), 0.02, imu)  # a table logged all day


def test_noise_far_below_the_rigs_is_reported_and_a_filtered_log_is_not():
    white = np.full(3, 3.0 * DEG_PER_ROOT_HOUR)
    sigma = white[0] / np.sqrt(0.01)
    rng = np.random.default_rng(3)
    for seed in range(50):
        gyro = sigma * np.random.default_rng(seed).normal(size=(600, 3))
        assert check_rest_readings("imu", gyro, 0.01, white) == []
    (reported,) = check_rest_readings("imu", DEG * gyro, 0.01, white)
    assert "times angle_random_walk of the rig; check [imu] units gyro" in reported
    # Smoothed over 0.3 s: next to no noise from sample to sample, all of it over seconds.
    smooth = np.stack(
        [np.convolve(c, np.full(30, 1 / 30), "same") for c in rng.normal(size=(3, 3000))]
    )
    assert check_rest_readings("imu", sigma * smooth.T, 0.01, white) == []
    assert check_rest_readings("imu", np.zeros((600, 3)), 0.01, white) == []


def test_the_range_of_an_angle_is_that_of_the_records_in_and_next_to_the_interval():
    time = np.arange(10.0)
    table = TableLog("t", time, time**2, 1.0)
    assert angle_range(table, 2.5, 6.5) == 7.0**2 - 2.0**2
    assert angle_range(table, 3.0, 6.0) == 6.0**2 - 2.0**2
    assert angle_range(table, -5.0, 20.0) == 9.0**2
    assert angle_range(table, 20.0, 21.0) == 0.0  # one record


def test_the_range_of_an_angle_is_that_of_means_over_a_second_with_the_last_second():
    angle = np.zeros(425)  # 8.5 s
    angle[-25:] = 1.0
    assert angle_range(table_of(angle), 0.0, 8.48) == pytest.approx(0.5)
    angle[:50] = -1.0
    assert angle_range(table_of(angle), 0.0, 8.48) == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("wrong", "expected"), [((3.0,), 0.0), ((3.0, 5.0), 3.0), ((3.0, 5.0, 4.0), 4.0)]
)
def test_one_wrong_record_is_no_deviation_two_are(wrong, expected):
    angle = 10.0 + 0.5 * 0.02 * np.arange(1000)
    angle[500 : 500 + len(wrong)] -= wrong
    found = max_angle_deviation(table_of(angle), 1.0, 19.0, 10.5, 0.5)
    assert found == pytest.approx(expected, abs=1e-9)


def test_the_noise_of_an_encoder_is_found_from_its_fourth_differences():
    sigma = 0.01 * DEG
    noise = sigma * np.random.default_rng(5).standard_normal(200_000)
    found = encoder_noise(table_of(5.0 * DEG * 0.02 * np.arange(200_000) + noise))
    assert found.sigma == pytest.approx(sigma, rel=8e-3)  # three sigma of the median
    assert found.resolution == pytest.approx(1e-3 * DEG + 4.0 * found.sigma)
    assert found.time_sigma == pytest.approx(0.0, abs=1e-12)


def test_the_noise_of_the_stamps_of_a_table_is_found_from_their_second_differences():
    time = 0.02 * np.arange(200_000) + 1e-3 * np.random.default_rng(6).standard_normal(200_000)
    found = encoder_noise(TableLog("t", time, np.zeros(200_000), 0.02))
    assert found.time_sigma == pytest.approx(1e-3, rel=0.015)


def test_the_angle_of_an_interval_is_that_of_its_rate():
    table = table_of(10.0 * DEG * 0.02 * np.arange(1000))
    motion = motion_between(table, 2.0, 17.0)
    assert motion.angle == pytest.approx(150.0 * DEG)
    assert motion.angle_range == pytest.approx(150.0 * DEG, abs=11.0 * DEG)  # means over a second


def table_of(angle):
    return TableLog("t", 0.02 * np.arange(len(angle)), angle, 0.02, rows=len(angle))


def test_many_angles_are_those_of_the_motion_also_when_they_are_asked_for_again():
    table = table_of((0.02 * np.arange(1000)) ** 3)
    time = np.linspace(1.0, 19.0, 5000)
    first = angle_at(table, time)
    np.testing.assert_allclose(first, time**3, rtol=1e-11)
    expected = first.copy()
    first *= 2.0  # the caller's own
    np.testing.assert_array_equal(angle_at(table, time), expected)
    time += 0.001
    np.testing.assert_allclose(angle_at(table, time), time**3, rtol=1e-11)


def test_another_table_with_the_same_times_has_its_own_angles():
    time = np.linspace(1.0, 19.0, 5000)
    np.testing.assert_allclose(angle_at(table_of(0.02 * np.arange(1000)), time), time, rtol=1e-12)
    other = angle_at(table_of(0.04 * np.arange(1000)), time)
    np.testing.assert_allclose(other, 2.0 * time, rtol=1e-12)


def test_a_table_that_does_not_turn_has_one_angle_also_across_a_gap_and_before_its_start():
    table = table_of(np.full(1000, 1.5))
    table.time[500:] += 5.0
    np.testing.assert_array_equal(angle_at(table, np.linspace(-0.01, 25.0, 101)), 1.5)
