from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.checks import check_cut
from rotcli.logs.files import read_imu
from rotcli.logs.record import ImuLog, Stretch, TableLog
from rotcli.logs.rig import default_rig, rig_from_dict
from rotcli.logs.segments import (
    angle_at,
    check_direction,
    check_still,
    find_stretches,
    navigation_window,
    rotation_stretches,
    static_stretch,
    stretch_between,
)

DEG = np.pi / 180
RIG = default_rig()
Z = np.array([0.0, 0.0, 1.0])
FIXTURES = Path(__file__).parents[2] / "fixtures"


def table(plan, *, acceleration=50.0, grain=0.0, jitter=0.0, interval=0.02):
    """A table log of (deg/s, s) legs with ramps at `acceleration` deg/s^2; the legs' limits too."""
    times, rates, limits, now = [0.0], [plan[0][0]], [], plan[0][0]
    for rate, seconds in plan:
        if rate != now:
            times.append(times[-1] + abs(rate - now) / acceleration)
            rates.append(rate)
            now = rate
        limits.append((times[-1], times[-1] + seconds))
        times.append(times[-1] + seconds)
        rates.append(rate)
    time = np.arange(0, times[-1], interval)
    knots = np.concatenate([[0], np.cumsum(0.5 * np.diff(times) * (np.add(rates[1:], rates[:-1])))])
    leg = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2)
    into = time - np.array(times)[leg]
    slope = np.diff(rates) / np.maximum(np.diff(times), 1e-12)
    angle = knots[leg] + np.array(rates)[leg] * into + 0.5 * slope[leg] * into**2
    if grain:
        angle = np.rint(angle / grain) * grain
    stamps = time + np.random.default_rng(5).uniform(-jitter, jitter, len(time))
    return TableLog("table.csv", stamps, angle * DEG, interval, len(time)), limits


def sweep(amplitude, period, seconds=120.0):
    time = np.arange(0, seconds, 0.02)
    angle = amplitude * period / (2 * np.pi) * np.sin(2 * np.pi * time / period)
    return TableLog("table.csv", time, angle * DEG, 0.02)


def imu(seconds, rate_dps=(0.0, 0.0, 0.0), noise=0.0, seed=0):
    n = round(seconds * 100)
    rng = np.random.default_rng(seed)
    gyro = np.array(rate_dps) * DEG + noise * rng.normal(size=(n, 3))
    accel = np.array([0.0, 0.0, 9.8]) + noise * rng.normal(size=(n, 3))
    return ImuLog("imu.csv", np.arange(n) * 0.01, gyro, accel, 0.01, rows=n)


@pytest.mark.parametrize("grain", [0.0, 1e-5, 0.01])
@pytest.mark.parametrize("jitter", [0.0, 0.001])
@pytest.mark.parametrize("rate", [0.1, 1.0, 10.0, 100.0, 300.0, -30.0])
def test_still_and_turning_stretches_are_found_without_their_ramps(rate, jitter, grain):
    log, limits = table([(0, 60), (rate, 60), (0, 20), (-rate, 30)], grain=grain, jitter=jitter)
    found = find_stretches(log)
    assert len(found) == 4
    # The ends are known to where a ramp of 50 deg/s^2 leaves the encoder's grain or the angle
    # that 1 ms of time jitter is worth; two records at least.
    for stretch, (start, end), true in zip(found, limits, (0, rate, 0, -rate), strict=True):
        slack = 0.045 + np.sqrt(2 * (2 * grain + 2 * jitter * abs(rate)) / 50)
        assert abs(stretch.start - start) < slack
        assert abs(stretch.end - end) < slack
        assert stretch.angle == pytest.approx(stretch.rate * stretch.duration)
        # A sliver of ramp; one grain over half a minute; and of time stamps that scatter evenly by
        # 1 ms, 0.58 ms sqrt(12 / 1500) / 30 s = 1.7e-6 for the line through them, six sigma.
        rel = 2e-6 + 0.01 * jitter
        assert stretch.rate / DEG == pytest.approx(true, rel=rel, abs=grain / 30)
        assert (stretch.rate == 0.0) == (true == 0)


def test_several_rates_one_after_another_are_told_apart():
    log, _ = table([(10, 20), (20, 20), (20.2, 20), (-5, 20)])
    rates = [s.rate / DEG for s in find_stretches(log)]
    np.testing.assert_allclose(rates, [10, 20, 20.2, -5], rtol=1e-5)


@pytest.mark.parametrize("grain", [0.0, 1e-5, 0.01])
@pytest.mark.parametrize(("amplitude", "period"), [(100, 10), (10, 60), (1, 60), (5, 4)])
def test_sweeping_table_has_no_stretch(amplitude, period, grain):
    log = sweep(amplitude, period)
    if grain:
        angle = np.rint(log.angle / DEG / grain) * grain * DEG
        log = TableLog(log.path, log.time, angle, log.interval)
    assert find_stretches(log) == []


def test_wobble_of_a_real_table_does_not_break_a_stretch():
    # Hunting by 0.001 deg when still; when turning, once in 3 s a ripple of 0.005 deg: 0.1 %.
    log, _ = table([(0, 10), (10, 60)])
    ripple = np.where(log.time < 10, 0.001 * np.sin(20 * log.time), 0.005 * np.sin(2 * log.time))
    angle = log.angle + DEG * ripple
    found = find_stretches(TableLog("t", log.time, angle, 0.02))
    assert [round(s.rate / DEG, 4) for s in found] == [0, 10]
    assert found[1].duration > 59.5


def test_hours_of_a_table_that_keeps_its_rate_to_1e_5_deg_per_s_are_one_stretch():
    time = np.arange(0, 10800, 0.02)
    for rate in (0.0, 10.0):
        angle = rate * time + 1e-5 * time * (time / 10800)  # the rate drifts by 2e-5 deg/s
        (stretch,) = find_stretches(TableLog("t", time, angle * DEG, 0.02))
        assert stretch.duration > 10799
        assert stretch.rate / DEG == pytest.approx(rate, abs=2e-5)


def test_short_log_has_no_stretch():
    assert find_stretches(TableLog("t", np.arange(5) * 0.02, np.zeros(5), 0.02)) == []


def test_angle_of_a_sweep_is_interpolated_to_ten_digits():
    log = sweep(100, 10)
    time = np.arange(0, log.time[-1], 0.01)
    true = 1000 / (2 * np.pi) * np.sin(2 * np.pi * time / 10)
    # 159 deg (w h)^6 / 6! times the nodes' product (15 at the ends): 1e-11 deg.
    np.testing.assert_allclose(angle_at(log, time) / DEG, true, atol=2e-11)


def test_angle_keeps_its_digits_after_many_turns_and_across_drop_outs():
    time = np.delete(np.arange(5000) * 0.02, np.s_[1000:1100])
    log = TableLog("t", time, 100 * DEG * time + 1e4, 0.02)
    at = np.arange(0, 99.99, 0.01)
    np.testing.assert_allclose(angle_at(log, at), 100 * DEG * at + 1e4, rtol=1e-15, atol=4e-12)


def test_angle_of_a_very_short_log_is_a_lower_order():
    log = TableLog("t", np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 4.0]), 1.0)
    np.testing.assert_allclose(angle_at(log, np.array([0.5, 1.5])), [0.25, 2.25])


def test_half_an_interval_past_the_log_the_encoder_grain_stays_small():
    rng = np.random.default_rng(0)
    time = np.arange(200) * 0.02
    for sign in (1, -1):
        grainy = 10 * time + 0.01 * (rng.random(200) - 0.5)
        log = TableLog("t", time, sign * grainy * DEG, 0.02)
        at = np.array([-0.01, 3.99])
        # Weights 2.19, -2.19, 1.31, -0.31 on errors up to 0.005 deg.
        np.testing.assert_allclose(angle_at(log, at) / DEG, sign * 10 * at, atol=0.03)
    log = sweep(100, 10)
    at = np.array([log.time[-1] + 0.01])
    true = 1000 / (2 * np.pi) * np.sin(2 * np.pi * at / 10)
    # 159 deg (w h)^4 0.27 = 1.1e-6 deg
    np.testing.assert_allclose(angle_at(log, at) / DEG, true, atol=1.2e-6)


def test_angle_beyond_the_log_is_refused():
    log, _ = table([(0, 10)])
    assert angle_at(log, np.array([-0.01, 9.99])).shape == (2,)
    with pytest.raises(
        LogError, match=r"table.csv: the table log spans 0 to 9.98 s but its angle is"
    ):
        angle_at(log, np.array([0.0, 10.5]))


def test_named_stretch_keeps_its_limits_and_loses_its_ramps():
    log, _ = table([(0, 20), (10, 20)])
    assert stretch_between(log, 1.0, 20.0) == Stretch(1.0, 20.0)
    turning = stretch_between(log, 19.5, 40.0)
    assert turning.start == pytest.approx(20.2, abs=0.05)
    assert turning.end == 40.0
    assert turning.rate / DEG == pytest.approx(10, rel=1e-6)


def test_named_stretch_that_is_neither_still_nor_even_is_refused():
    log, _ = table([(0, 20), (10, 20)])
    what = (
        r"neither keeps still nor turns at one rate from 10 to 30 s: it moves through 9\d.* deg at"
    )
    with pytest.raises(LogError, match=what):
        stretch_between(log, 10, 30)
    with pytest.raises(LogError, match=r"lies outside the table log, which spans 0 to 40\.18 s"):
        stretch_between(log, 30, 60)
    with pytest.raises(LogError, match=r"only 6 records from 1 to 1.1 s"):
        stretch_between(log, 1.0, 1.1)


def test_stages_are_found_when_the_rig_names_none():
    log, limits = table([(0, 60), (10, 60), (0, 60)])
    whole = imu(180)
    assert static_stretch(RIG, log, whole) == find_stretches(log)[0]
    (turning,) = rotation_stretches(RIG, log, whole)
    assert turning.rate / DEG == pytest.approx(10)
    assert navigation_window(RIG, log, whole) == (turning.start, turning.end)
    assert turning.end == pytest.approx(limits[1][1], abs=0.05)


def test_stages_of_a_still_log():
    still, _ = table([(0, 100)])
    for log in (None, still):
        static = static_stretch(RIG, log, imu(100))
        assert (static.start, static.end) == (0.0, 60.0)
        assert navigation_window(RIG, log, imu(100))[0] == 60.0
    assert static_stretch(RIG, None, imu(30)).end == pytest.approx(29.99)
    with pytest.raises(LogError, match=r"nothing is left to navigate: calibration ends at 29.99 s"):
        navigation_window(RIG, None, imu(30))


def test_stages_follow_the_rig():
    log, _ = table([(0, 60), (10, 200)])
    whole = imu(260)
    rig = rig_from_dict({"stages": {"static": [0, 50], "rotation": [70, 130]}})
    assert static_stretch(rig, log, whole) == Stretch(0.0, 50.0)
    (turning,) = rotation_stretches(rig, log, whole)
    assert (turning.start, turning.end) == (70.0, 130.0)
    assert navigation_window(rig, log, whole) == (130.0, pytest.approx(259.99))
    named = rig.override({"stages": {"navigation": [140, 200]}})
    assert navigation_window(named, log, whole) == (140.0, 200.0)


def test_stages_that_cannot_be_are_refused():
    log, _ = table([(0, 60), (10, 60)])
    whole = imu(120)

    def rig(**stages):
        return rig_from_dict({"stages": stages})

    with pytest.raises(
        LogError, match=r"turns 3\d\d.* deg from 70 to 100 s, which .stages. static"
    ):
        static_stretch(rig(static=[70, 100]), log, whole)
    with pytest.raises(LogError, match=r"is still from 10 to 50 s, which .stages. rotation calls"):
        rotation_stretches(rig(rotation=[10, 50]), log, whole)
    with pytest.raises(LogError, match=r"140 to 300 s lies outside what the logs cover"):
        navigation_window(rig(navigation=[140, 300]), log, whole)
    with pytest.raises(LogError, match="0 to 300 s lies outside the IMU log"):
        static_stretch(rig(static=[0, 300]), None, whole)
    with pytest.raises(LogError, match=r"imu.csv: a turning stretch is needed; give the table log"):
        rotation_stretches(RIG, None, whole)
    with pytest.raises(
        LogError, match=r"never turns at one rate for 5 s or more \(it moves through 0"
    ):
        rotation_stretches(RIG, table([(0, 60)])[0], whole)
    with pytest.raises(LogError, match="the table is never still for 5 s or more"):
        static_stretch(RIG, table([(10, 60)])[0], whole)
    late = TableLog("table.csv", log.time + 1000, log.angle, 0.02)
    with pytest.raises(
        LogError, match=r"they do not overlap; check the clocks and .table. time_offset"
    ):
        static_stretch(RIG, late, whole)


def test_times_since_1970_are_told_with_all_their_digits():
    log, _ = table([(0, 60), (10, 60)])
    late = replace(log, time=log.time + 1.7e9)
    gyros = imu(120)
    gyros = replace(gyros, time=gyros.time + 1.7e9)
    with pytest.raises(LogError) as caught:
        static_stretch(rig_from_dict({"stages": {"static": [0, 50]}}), late, gyros)
    assert str(caught.value) == (
        "imu.csv: the stretch 0 to 50 s lies outside the IMU log, which spans 1700000000 to "
        "1700000119.99 s (the times are on the clock of the log, which starts at 1700000000 s); "
        "name another under [stages]"
    )
    rig = rig_from_dict({"stages": {"static": [1.7e9 + 70, 1.7e9 + 80.25]}})
    with pytest.raises(LogError, match=r"from 1700000070 to 1700000080\.25 s, which .stages"):
        static_stretch(rig, late, gyros)
    rig = rig_from_dict({"stages": {"static": [1.7e9 + 20, 1.7e9 + 200]}})
    with pytest.raises(LogError, match=r"1700000200 s lies .* to 1700000119\.99 s; name"):
        static_stretch(rig, late, gyros)


def test_direction_axis_and_rate_are_compared_with_the_gyros():
    log, _ = table([(10, 60)])
    stretch = find_stretches(log)[0]
    check_direction(imu(60, (0.3, -0.2, 11.0)), log, Z, stretch)  # a turn-on bias of 1 deg/s
    with pytest.raises(
        LogError, match=r"turns the other way than .table. direction says; set dir.* -1"
    ):
        check_direction(imu(60, (0, 0, -10)), log, Z, stretch)
    with pytest.raises(
        LogError, match=r"feel \(10, 0, 0\.1\) deg/s: about another axis; correct .table"
    ):
        check_direction(imu(60, (10, 0, 0.1)), log, Z, stretch)
    with pytest.raises(LogError, match="not the same rate; check the units"):
        check_direction(imu(60, (0, 0, 10 * 180 / np.pi)), log, Z, stretch)


def test_slow_turning_with_a_large_bias_is_no_error():
    log, _ = table([(0.1, 60)])
    check_direction(imu(60, (0.5, 0.2, -1.0)), log, Z, find_stretches(log)[0])


def drifting(seed, seconds=60.0):
    """White noise, flicker-like drift and turn-on bias of the papers' coarser IMU (MTi-G)."""
    rng = np.random.default_rng(seed)
    n = round(seconds * 100)
    arw, rate_walk = 3.0 * DEG / 60, 2.6 * DEG / 3600  # rad/sqrt(s), rad/s/sqrt(s)
    gyro = arw * 10 * rng.normal(size=(n, 3)) + DEG * rng.normal(size=3)
    gyro += np.cumsum(rate_walk * 0.1 * rng.normal(size=(n, 3)), axis=0)
    accel = 0.002 * 10 * rng.normal(size=(n, 3)) + [0, 0, 9.8]
    accel += np.cumsum(8e-5 * 0.1 * rng.normal(size=(n, 3)), axis=0)
    return ImuLog("imu.csv", np.arange(n) * 0.01, gyro, accel, 0.01)


def test_noise_and_drift_are_no_false_alarm():
    for seed in range(200):
        assert check_still(drifting(seed), Stretch(0.0, 59.99)) == ()


def test_slow_and_noiseless_logs_are_no_false_alarm():
    for seed in range(50):
        log = drifting(seed)
        slow = ImuLog("i", log.time[::100], log.gyro[::100], log.accel[::100], 1.0)
        assert check_still(slow, Stretch(0.0, 59.0)) == ()
    assert check_still(imu(60), Stretch(0.0, 59.99)) == ()


def test_knocks_and_motion_are_told():
    log = drifting(1)
    knock = log.gyro.copy()
    knock[3000:3050, 1] += 5 * DEG * np.sin(np.arange(50) * 2 * np.pi / 10)
    shaken = ImuLog("imu.csv", log.time, knock, log.accel, 0.01)
    (warning,) = check_still(shaken, Stretch(0.0, 59.99))
    assert "is not still: a scatter of" in warning
    assert "in gyro_y near 30 s" in warning
    tilted = log.accel.copy()
    tilted[3000:, 0] += 0.17  # m/s^2: a degree
    (warning,) = check_still(ImuLog("i", log.time, log.gyro, tilted, 0.01), Stretch(0.0, 59.99))
    assert "a change of 0.17" in warning
    turned = log.gyro.copy()
    turned[3000:3200, 2] += 2 * DEG
    with pytest.raises(LogError, match=r"is not still: near 3\d.* deg/s in gyro_z beyond its mean"):
        check_still(ImuLog("i", log.time, turned, log.accel, 0.01), Stretch(0.0, 59.99))


@pytest.mark.parametrize("rate", [3.0, -90.0])
def test_a_stretch_that_turns_for_the_most_part_is_told_by_where_it_begins_to(rate):
    log = drifting(1)
    gyro = log.gyro.copy()
    gyro[2000:, 2] += rate * DEG
    shown = "(2.9|3.0|3 )" if rate == 3.0 else "(89.9|90)"  # the gyro drifts by hundredths
    what = rf"is not still: from about (19|20)(\.\d)? s on it turns at {shown}.* deg/s in gyro_z"
    with pytest.raises(LogError, match=what):
        check_still(ImuLog("i", log.time, gyro, log.accel, 0.01), Stretch(0.0, 59.99))
    gyro = log.gyro.copy()
    gyro[:4000, 2] += rate * DEG
    with pytest.raises(LogError, match=r"is not still: from about 0 s on it turns"):
        check_still(ImuLog("i", log.time, gyro, log.accel, 0.01), Stretch(0.0, 59.99))


def test_a_named_stretch_that_is_cut_by_more_than_a_second_is_told():
    log, _ = table([(0, 60), (10, 60)])
    cut = stretch_between(log, 0.0, 70.0)
    (warning,) = check_cut("table.csv", (0.0, 70.0), cut)
    assert warning.startswith("table.csv: of the stretch 0 to 70 s only 0 to 60 s")
    assert warning.endswith(" is used, where the table keeps still")
    (warning,) = check_cut("table.csv", (55.0, 119.0), stretch_between(log, 55.0, 119.0))
    assert warning.endswith("to 119 s is used, where the table turns at one rate")
    assert check_cut("table.csv", (0.0, 60.5), stretch_between(log, 0.0, 60.5)) == ()
    assert check_cut("table.csv", None, cut) == ()


def test_real_still_log_is_still():
    log = read_imu(FIXTURES / "xsens_still.csv", RIG)
    assert log.warnings == ()
    assert check_still(log, Stretch(0.5, 51.5)) == ()
    assert check_still(log, Stretch(0.5, 2.0)) == ()  # too short to say
    # The recording's stamps: 5148 rows, 100 Hz to 1e-4.
    assert len(log.time) == 5148
    assert log.interval == pytest.approx(0.01, rel=2e-4)


def test_real_log_taken_up_by_hand_is_not_still():
    log = read_imu(FIXTURES / "xsens_still.csv", RIG)
    # As the recording goes on after 52 s: lifted and turned at 40 deg/s for two seconds.
    gyro = log.gyro.copy()
    gyro[4900:5100, 1] += 40 * DEG
    with pytest.raises(LogError, match=r"not still: near 49.* s 40.* deg/s in gyro_y"):
        check_still(ImuLog("x", log.time, gyro, log.accel, log.interval), Stretch(0.5, 51.5))
