import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.imu import read_imu
from rotcli.logs.record import ImuLog, Segment, TableLog
from rotcli.rig.rig import default_rig
from rotcli.run.checks import judge
from rotcli.run.evidence.direction import check_direction
from rotcli.run.evidence.records import check_record_interval
from rotcli.run.evidence.stillness import check_still, warn_segment_shortened
from rotcli.run.evidence.wrong_unit import unit_cause
from rotcli.run.segments import find_segments, segment_between
from tests.logs.made_logs import DEG, drifting, imu, table
from tests.recorded import write_xsens_still

RIG = default_rig()
FIXTURES = Path(__file__).parents[2] / "fixtures"


def test_direction_axis_and_rate_are_compared_with_the_gyros():
    log, _ = table([(10, 60)])
    segment = find_segments(log)[0]
    # A turn-on bias of 1 deg/s is allowed.
    assert check_direction(imu(60, (0.3, -0.2, 11.0)), log, RIG, segment) == ()

    def error(gyros):
        (finding,) = check_direction(imu(60, gyros), log, RIG, segment)
        with pytest.raises(LogError) as caught:
            judge("calibrate", [finding])
        return finding.code, str(caught.value)

    code, text = error((0, 0, -10))
    assert code == "rotation-sense"
    assert "opposite sense; set [table] direction = -1" in text
    code, text = error((10, 0, 0.1))
    assert code == "rotation-axis"
    assert "gyros (10, 0, 0.1) deg/s about another axis; check [table] axis" in text
    code, text = error((0, 0, 20))
    assert code == "rotation-rate"
    assert "not the same rate; check the units" in text
    code, text = error((0.1, 0, 0.02))
    assert code == "rotation-rate"
    assert "the gyros do not sense the rotation; check for a defect or a wrong log" in text
    assert "raw counts" in error((32768, 32760, 32900))[1]


def test_the_difference_of_the_rates_is_reported_with_its_limit_in_deg_per_s():
    log, _ = table([(10, 60)])
    segment = find_segments(log)[0]
    (finding,) = check_direction(imu(60, (0, 0, 20)), log, RIG, segment)
    assert (finding.unit, finding.value) == ("deg/s", pytest.approx(10.0, rel=1e-6))
    assert "table 10 deg/s, gyros (0, 0, 20) deg/s" in finding.text
    for beyond, count in ((-0.01, 0), (0.01, 1)):
        near = imu(60, (0, 0, 10.0 + finding.limit + beyond))
        assert len(check_direction(near, log, RIG, segment)) == count


def test_the_gyro_with_another_unit_is_named_by_its_channel_of_the_log():
    # The third axis of the mounting frame, that of the table, is the second channel.
    rig = RIG.override({"imu": {"mount": [[0, 1, 0], [0, 0, 1], [1, 0, 0]]}})
    noise = np.random.default_rng(0).standard_normal((6000, 3))
    noise[:, 2] /= DEG
    log = replace(imu(60), gyro=noise)
    says = "gyro_y is in deg/s and read as rad/s; set [imu] scale = { gyro = [1, 0.0174533, 1] }"
    assert says in unit_cause(log, rig, 57.3)


@pytest.mark.parametrize(
    ("alone", "factor", "figure", "advice"),
    [
        (True, 1 / DEG, None, "gyro_z is in deg/s and read as rad/s; set [imu] scale = { gyro = ["),
        (True, DEG, None, "gyro_z is in rad/s and read as deg/s; set [imu] scale = { gyro = ["),
        (False, 1 / DEG, 0.3, "the gyros are in deg/s and read as rad/s; set [imu] units = { gyro"),
        (False, DEG, 0.3, "the gyros are in rad/s and read as deg/s; set [imu] units = { gyro"),
        (False, 1 / DEG, 0.3 / DEG, "the table angle is in rad and read as deg; set [table] units"),
        (False, 1 / DEG, None, 'units = { gyro = "deg/s" }, or [table] units = "rad", whichever'),
    ],
)
def test_a_factor_of_57_names_the_unit_and_the_line_that_corrects_it(alone, factor, figure, advice):
    log, _ = table([(10, 60)])
    segment = find_segments(log)[0]
    right = imu(60, (0.3, -0.2, 10.0))
    noise = 0.3 * DEG / 60.0 / np.sqrt(right.interval)  # 0.3 deg/sqrt(h)
    gyro = right.gyro + noise * np.random.default_rng(0).standard_normal(right.gyro.shape)
    gyro[:, 2 if alone else slice(None)] *= factor
    rig = RIG if figure is None else RIG.override({"imu": {"angle_random_walk": figure}})
    (finding,) = check_direction(replace(right, gyro=gyro), log, rig, segment)
    assert finding.code == "rotation-rate"
    assert advice in finding.text
    if alone:  # the advice, followed: a reading is multiplied by its scale
        numbers = finding.text.partition("gyro = [")[2].partition("]")[0]
        corrected = replace(right, gyro=gyro * [float(x) for x in numbers.split(", ")])
        assert check_direction(corrected, log, rig, segment) == ()


@pytest.mark.parametrize(("every", "found"), [(1, False), (290, False), (890, True), (1250, True)])
def test_half_a_turn_between_records_of_the_table_is_an_error(every, found):
    log, _ = table([(0, 30), (20, 90)])  # 50 records per second: 290 records are 116 deg
    thinned = replace(log, time=log.time[::every], angle=log.angle[::every])
    gyros = imu(120, (0.0, 0.0, 20.0))
    findings = check_record_interval(gyros, thinned, np.array([0.0, 0.0, 1.0]))
    assert [f.code for f in findings] == ["record-interval"] * found
    if found:
        assert findings[0].value == pytest.approx(every * 0.02 * 20.0, rel=0.01)
        assert "Log the table faster" in findings[0].text


@pytest.mark.parametrize(("interval", "found"), [(0, True), (199, True), (200, False)])
def test_two_hundred_intervals_of_the_table_are_searched_for_half_a_turn(interval, found):
    log = TableLog("table.csv", np.arange(300.0), np.zeros(300), 1.0)
    time = 0.1 * np.arange(3000)
    gyro = np.zeros((3000, 3))
    gyro[(time > interval - 0.01) & (time < interval + 1.01), 2] = 200.0 * DEG
    gyros = ImuLog("imu.csv", time, gyro, np.zeros((3000, 3)), 0.1)
    findings = check_record_interval(gyros, log, np.array([0.0, 0.0, 1.0]))
    assert len(findings) == found
    for finding in findings:
        assert (finding.value, finding.limit) == pytest.approx((200.0, 180.0))
        assert f"the gyros turn 200 deg from {interval} to {interval + 1} s" in finding.text


@pytest.mark.parametrize(("gap", "found"), [(1.99, True), (2.01, False)])
def test_a_gap_between_records_of_the_table_is_no_slow_table(gap, found):
    times = np.concatenate([np.arange(50.0), 49.0 + gap + np.arange(50.0)])
    log = TableLog("table.csv", times, np.zeros(100), 1.0)
    time = 0.1 * np.arange(1000)
    gyro = np.zeros((1000, 3))
    gyro[(time > 49.0) & (time < 49.0 + gap), 2] = 170.0 * DEG
    gyros = ImuLog("imu.csv", time, gyro, np.zeros((1000, 3)), 0.1)
    assert bool(check_record_interval(gyros, log, np.array([0.0, 0.0, 1.0]))) == found


def test_an_imu_that_points_down_is_named_instead_of_the_direction():
    log, _ = table([(10, 60)])
    upright = imu(60, (0, 0, -10))
    down = replace(upright, accel=-upright.accel)
    (finding,) = check_direction(down, log, RIG, find_segments(log)[0])
    assert (
        "the IMU points down; set [imu] mount = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]" in finding.text
    )


def test_slow_turning_with_a_large_bias_is_no_error():
    log, _ = table([(0.1, 60)])
    assert check_direction(imu(60, (0.5, 0.2, -1.0)), log, RIG, find_segments(log)[0]) == ()


def test_noise_and_drift_are_no_false_alarm():
    for seed in range(200):
        assert check_still(drifting(seed), Segment(0.0, 59.99)) == ()


def test_slow_and_noiseless_logs_are_no_false_alarm():
    for seed in range(50):
        log = drifting(seed)
        slow = ImuLog("i", log.time[::100], log.gyro[::100], log.accel[::100], 1.0)
        assert check_still(slow, Segment(0.0, 59.0)) == ()
    assert check_still(imu(60), Segment(0.0, 59.99)) == ()


def test_knocks_and_motion_are_reported():
    log = drifting(1)
    knock = log.gyro.copy()
    knock[3000:3050, 1] += 5 * DEG * np.sin(np.arange(50) * 2 * np.pi / 10)
    shaken = ImuLog("imu.csv", log.time, knock, log.accel, 0.01)
    (finding,) = check_still(shaken, Segment(0.0, 59.99))
    assert finding.code == "segment-disturbed"
    assert "was disturbed near 30 s (gyro_y vibrates by" in finding.text
    tilted = log.accel.copy()
    tilted[3000:, 0] += 0.17  # m/s^2: a degree
    (finding,) = check_still(ImuLog("i", log.time, log.gyro, tilted, 0.01), Segment(0.0, 59.99))
    assert "(accel_x changes by 0.17" in finding.text
    turned = log.gyro.copy()
    turned[3000:3200, 2] += 2 * DEG
    (finding,) = check_still(ImuLog("i", log.time, turned, log.accel, 0.01), Segment(0.0, 59.99))
    assert finding.code == "segment-moving"
    assert re.search(r"is not still: gyro_z deviates by .* deg/s near 3\d", finding.text)


@pytest.mark.parametrize(
    ("channel", "size", "unit", "code"),
    [
        (0, 0.5, "m/s^2", "segment-disturbed"),
        (2, -3.0, "m/s^2", "segment-moving"),
        (4, 0.5, "deg/s", "segment-disturbed"),
        (5, 3.0, "deg/s", "segment-moving"),
    ],
)
def test_the_size_of_a_motion_is_reported_in_its_unit(channel, size, unit, code):
    log = imu(60)
    values, factor = (log.accel, 1.0) if channel < 3 else (log.gyro, DEG)
    values[3000 : 3500 if code == "segment-moving" else None, channel % 3] += factor * size
    (finding,) = check_still(log, Segment(0.0, 59.99))
    assert (finding.code, finding.unit) == (code, unit)
    assert finding.value == pytest.approx(abs(size), rel=1e-6)
    if code == "segment-moving":
        assert finding.limit == pytest.approx(1.0)


@pytest.mark.parametrize(("samples", "found"), [(599, 0), (600, 1)])
def test_a_segment_of_less_than_three_seconds_is_not_judged(samples, found):
    log = imu(6)
    log.gyro[300:400, 1] += 10.0 * DEG
    fast = ImuLog("imu", 0.005 * np.arange(600), log.gyro, log.accel, 0.005)
    assert len(check_still(fast, Segment(0.0, 0.005 * (samples - 1)))) == found


@pytest.mark.parametrize("rate", [3.0, -90.0])
def test_a_segment_that_turns_for_the_most_part_is_reported_by_where_it_begins_to(rate):
    log = drifting(1)
    gyro = log.gyro.copy()
    gyro[2000:, 2] += rate * DEG
    shown = "(2.9|3.0|3 )" if rate == 3.0 else "(89.9|90)"  # the gyro drifts by hundredths
    what = rf"is not still: from about (19|20)(\.\d)? s on it turns at {shown}.* deg/s in gyro_z"
    (finding,) = check_still(ImuLog("i", log.time, gyro, log.accel, 0.01), Segment(0.0, 59.99))
    assert re.search(what, finding.text)
    gyro = log.gyro.copy()
    gyro[:4000, 2] += rate * DEG
    (finding,) = check_still(ImuLog("i", log.time, gyro, log.accel, 0.01), Segment(0.0, 59.99))
    assert "is not still: from about 0 s on it turns" in finding.text


def test_a_named_segment_that_is_cut_by_more_than_a_second_is_reported():
    log, _ = table([(0, 60), (10, 60)])
    cut = segment_between(log, 0.0, 70.0)
    (finding,) = warn_segment_shortened("table.csv", (0.0, 70.0), cut)
    assert finding.text.startswith("table.csv: only 0 to 59.98 s of the segment 0 to 70 s is used")
    assert finding.text.endswith("; there the table is still")
    (finding,) = warn_segment_shortened(
        "table.csv", (55.0, 119.0), segment_between(log, 55.0, 119.0)
    )
    assert finding.text.endswith("; there the table turns at constant rate")
    assert warn_segment_shortened("table.csv", (0.0, 60.5), segment_between(log, 0.0, 60.5)) == ()
    assert warn_segment_shortened("table.csv", None, cut) == ()


def test_real_still_log_is_still(tmp_path):
    log = read_imu(write_xsens_still(tmp_path), RIG)
    assert log.warnings == ()
    assert check_still(log, Segment(0.5, 51.5)) == ()
    assert check_still(log, Segment(0.5, 2.0)) == ()  # too short to say
    # The recording's stamps: 5148 rows, 100 Hz to 1e-4.
    assert len(log.time) == 5148
    assert log.interval == pytest.approx(0.01, rel=2e-4)


def test_real_log_taken_up_by_hand_is_not_still(tmp_path):
    log = read_imu(write_xsens_still(tmp_path), RIG)
    # As the recording goes on after 52 s: lifted and turned at 40 deg/s for two seconds.
    gyro = log.gyro.copy()
    gyro[4900:5100, 1] += 40 * DEG
    moved = ImuLog("x", log.time, gyro, log.accel, log.interval)
    (finding,) = check_still(moved, Segment(0.5, 51.5))
    assert finding.code == "segment-moving"
    assert re.search(r"gyro_y deviates by 40.* deg/s near 49", finding.text)
