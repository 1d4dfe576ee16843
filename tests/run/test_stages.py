from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.record import Segment, TableLog
from rotcli.rig.rig import default_rig, rig_from_dict
from rotcli.run.segments import find_segments
from rotcli.run.stages import all_segments, navigation_window, still_segment, turning_segments
from tests.logs.made_logs import DEG, imu, table

RIG = default_rig()
UP = np.array([0.0, 0.0, 1.0])


def test_stages_are_found_when_the_rig_names_none():
    log, limits = table([(0, 60), (10, 60), (0, 60)])
    complete = imu(180)
    assert still_segment(RIG, log, complete) == find_segments(log)[0]
    (turning,) = turning_segments(RIG, log, complete)
    assert turning.rate / DEG == pytest.approx(10)
    assert navigation_window(RIG, log, complete) == (turning.start, turning.end)
    assert turning.end == pytest.approx(limits[1][1], abs=0.05)


def test_stages_of_a_still_log():
    still, _ = table([(0, 100)])
    for log in (None, still):
        static = still_segment(RIG, log, imu(100))
        assert (static.start, static.end) == (0.0, 60.0)
        assert navigation_window(RIG, log, imu(100))[0] == 60.0
    assert still_segment(RIG, None, imu(30)).end == pytest.approx(29.99)
    with pytest.raises(LogError, match=r"nothing remains to navigate: calibration ends at 29.99 s"):
        navigation_window(RIG, None, imu(30))


def test_stages_follow_the_rig():
    log, _ = table([(0, 60), (10, 200)])
    complete = imu(260)
    rig = rig_from_dict({"stages": {"static": [0, 50], "rotation": [70, 130]}})
    assert still_segment(rig, log, complete) == Segment(0.0, 50.0)
    (turning,) = turning_segments(rig, log, complete)
    assert (turning.start, turning.end) == (70.0, 130.0)
    assert navigation_window(rig, log, complete) == (130.0, pytest.approx(259.99))
    named = rig.override({"stages": {"navigation": [140, 200]}})
    assert navigation_window(named, log, complete) == (140.0, 200.0)


def test_stages_that_cannot_be_are_refused():
    log, _ = table([(0, 60), (10, 60)])
    complete = imu(120)

    def rig(**stages):
        return rig_from_dict({"stages": stages})

    with pytest.raises(
        LogError, match=r"static = \[70, 100\]: the table turns 3\d\d.* deg in it; choose a still"
    ):
        still_segment(rig(static=[70, 100]), log, complete)
    with pytest.raises(LogError, match=r"rotation = \[10, 50\]: the table is still in it"):
        turning_segments(rig(rotation=[10, 50]), log, complete)
    with pytest.raises(LogError, match=r"140 to 300 s is outside the time of the logs"):
        navigation_window(rig(navigation=[140, 300]), log, complete)
    with pytest.raises(LogError, match="0 to 300 s is outside the IMU log"):
        still_segment(rig(static=[0, 300]), None, complete)
    with pytest.raises(LogError, match=r"imu.csv: a turning segment is needed; give the table log"):
        turning_segments(RIG, None, complete)
    with pytest.raises(
        LogError, match=r"no turning segment of 5 s at constant rate \(the table moves through 0"
    ):
        turning_segments(RIG, table([(0, 60)])[0], complete)
    with pytest.raises(
        LogError, match="no still segment of 5 s; record one, or segments at two rates"
    ):
        still_segment(RIG, table([(10, 60)])[0], complete)
    late = TableLog("table.csv", log.time + 1000, log.angle, 0.02)
    with pytest.raises(
        LogError, match=r"they do not overlap; check the clocks and .table. time_offset"
    ):
        still_segment(RIG, late, complete)


def test_times_since_1970_are_reported_with_all_their_digits():
    log, _ = table([(0, 60), (10, 60)])
    late = replace(log, time=log.time + 1.7e9)
    gyros = imu(120)
    gyros = replace(gyros, time=gyros.time + 1.7e9)
    with pytest.raises(LogError) as caught:
        still_segment(rig_from_dict({"stages": {"static": [0, 50]}}), late, gyros)
    assert str(caught.value) == (
        "imu.csv: segment 0 to 50 s is outside the IMU log (1700000000 to "
        "1700000119.99 s) (the times are on the clock of the log, which starts at 1700000000 s); "
        "choose another one under [stages]"
    )
    rig = rig_from_dict({"stages": {"static": [1.7e9 + 70, 1.7e9 + 80.25]}})
    with pytest.raises(LogError, match=r"static = .*: the table turns"):
        still_segment(rig, late, gyros)
    rig = rig_from_dict({"stages": {"static": [1.7e9 + 20, 1.7e9 + 200]}})
    with pytest.raises(LogError, match=r"1700000200 s is .* to 1700000119\.99 s\); choose"):
        still_segment(rig, late, gyros)


def test_segments_of_a_short_log_have_its_limits_and_their_own_angle():
    log, _ = table([(10, 60), (0, 10)])
    first, second = all_segments(log, imu(65), UP)
    assert (first.start, first.end) == (0.0, pytest.approx(60.0, abs=0.05))
    assert first.angle == pytest.approx(10.0 * DEG * first.end, rel=1e-6)
    assert second.end == pytest.approx(64.99)
    assert len(all_segments(log, imu(62), UP)) == 2
    assert len(all_segments(log, imu(61), UP)) == 1  # less than a second of rest
    third = imu(65)
    third = replace(third, time=third.time + 30.0)
    first, _ = all_segments(log, third, UP)
    assert first.start == 30.0
    assert first.angle == pytest.approx(10.0 * DEG * first.duration, rel=1e-6)


@pytest.mark.parametrize(("duration", "trimmed"), [(2.99, 0.0), (3.02, 0.5)])
def test_ramps_that_a_coarse_encoder_hides_are_trimmed_where_two_and_a_half_seconds_remain(
    duration, trimmed
):
    log, _ = table([(0, 60), (10, 60)], acceleration=6.25, grain=1.0)
    end = find_segments(log)[0].end
    gyros = imu(40)
    time = end - duration + gyros.time
    gyros.gyro[time > end - 0.395, 2] += 1.0 * DEG
    still = all_segments(log, replace(gyros, time=time), UP)[0]
    assert (still.start, still.end) == pytest.approx((end - duration, end - trimmed))
