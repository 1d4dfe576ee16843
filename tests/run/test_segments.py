import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.record import Segment, TableLog
from rotcli.run.segments import check_inside, find_segments, segment_between
from rotcli.run.table_angle import angle_at
from tests.logs.made_logs import DEG, sweep, table


@pytest.mark.parametrize("grain", [0.0, 1e-5, 0.01])
@pytest.mark.parametrize("jitter", [0.0, 0.001])
@pytest.mark.parametrize("rate", [0.1, 1.0, 10.0, 100.0, 300.0, -30.0])
def test_still_and_turning_segments_are_found_without_their_ramps(rate, jitter, grain):
    log, limits = table([(0, 60), (rate, 60), (0, 20), (-rate, 30)], grain=grain, jitter=jitter)
    found = find_segments(log)
    assert len(found) == 4
    # The ends are known to where a ramp of 50 deg/s^2 leaves the encoder's grain or the angle
    # that 1 ms of time jitter is worth; two records at least.
    for segment, (start, end), true in zip(found, limits, (0, rate, 0, -rate), strict=True):
        slack = 0.045 + np.sqrt(2 * (2 * grain + 2 * jitter * abs(rate)) / 50)
        assert abs(segment.start - start) < slack
        assert abs(segment.end - end) < slack
        assert segment.angle == pytest.approx(segment.rate * segment.duration)
        # A sliver of ramp; one grain over half a minute; and of time stamps that scatter evenly by
        # 1 ms, 0.58 ms sqrt(12 / 1500) / 30 s = 1.7e-6 for the line through them, six sigma.
        rel = 2e-6 + 0.01 * jitter
        assert segment.rate / DEG == pytest.approx(true, rel=rel, abs=grain / 30)
        assert (segment.rate == 0.0) == (true == 0)


def test_a_segment_ends_one_record_before_a_kink_and_at_the_ends_of_the_log():
    log, _ = table([(0, 60), (20, 60)], acceleration=1e9)
    still, turning = find_segments(log)
    # The record at 60 s is the last one at rest and the first one that turns.
    np.testing.assert_allclose([still.start, still.end], [0.0, 59.98], atol=1e-9)
    np.testing.assert_allclose([turning.start, turning.end], [60.02, log.time[-1]], atol=1e-9)


def test_several_rates_one_after_another_are_reported_apart():
    log, _ = table([(10, 20), (20, 20), (20.2, 20), (-5, 20)])
    rates = [s.rate / DEG for s in find_segments(log)]
    np.testing.assert_allclose(rates, [10, 20, 20.2, -5], rtol=1e-5)


@pytest.mark.parametrize("grain", [0.0, 1e-5, 0.01])
@pytest.mark.parametrize(("amplitude", "period"), [(100, 10), (10, 60), (1, 60), (5, 4)])
def test_sweeping_table_has_no_segment(amplitude, period, grain):
    log = sweep(amplitude, period)
    if grain:
        angle = np.rint(log.angle / DEG / grain) * grain * DEG
        log = TableLog(log.path, log.time, angle, log.interval)
    assert find_segments(log) == []


def test_wobble_of_a_real_table_does_not_break_a_segment():
    # Hunting by 0.001 deg when still; when turning, once in 3 s a ripple of 0.005 deg: 0.1 %.
    log, _ = table([(0, 10), (10, 60)])
    ripple = np.where(log.time < 10, 0.001 * np.sin(20 * log.time), 0.005 * np.sin(2 * log.time))
    angle = log.angle + DEG * ripple
    found = find_segments(TableLog("t", log.time, angle, 0.02))
    assert [round(s.rate / DEG, 4) for s in found] == [0, 10]
    assert found[1].duration > 59.5


def test_hours_of_a_table_that_keeps_its_rate_to_1e_5_deg_per_s_are_one_segment():
    time = np.arange(0, 10800, 0.02)
    for rate in (0.0, 10.0):
        angle = rate * time + 1e-5 * time * (time / 10800)  # the rate drifts by 2e-5 deg/s
        (segment,) = find_segments(TableLog("t", time, angle * DEG, 0.02))
        assert segment.duration > 10799
        assert segment.rate / DEG == pytest.approx(rate, abs=2e-5)


def test_short_log_has_no_segment():
    assert find_segments(TableLog("t", np.arange(5) * 0.02, np.zeros(5), 0.02)) == []


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
        LogError, match=r"table.csv: the table log covers 0 to 9.98 s, but its angle is"
    ):
        angle_at(log, np.array([0.0, 10.5]))


def test_named_segment_keeps_its_limits_and_loses_its_ramps():
    log, _ = table([(0, 20), (10, 20)])
    assert segment_between(log, 1.0, 20.0) == Segment(1.0, 20.0)
    turning = segment_between(log, 19.5, 40.0)
    assert turning.start == pytest.approx(20.2, abs=0.05)
    assert turning.end == 40.0
    assert turning.rate / DEG == pytest.approx(10, rel=1e-6)


def test_named_segment_that_is_neither_still_nor_even_is_refused():
    log, _ = table([(0, 20), (10, 20)])
    what = (
        r"segment 10 to 30 s: the table is neither still nor turning at constant rate: it moves "
        r"through 9\d.* deg at"
    )
    with pytest.raises(LogError, match=what):
        segment_between(log, 10, 30)
    with pytest.raises(LogError, match=r"is outside the table log \(0 to 40\.18 s\)"):
        segment_between(log, 30, 60)
    with pytest.raises(LogError, match=r"segment 1 to 1.1 s: only 6 records"):
        segment_between(log, 1.0, 1.1)


@pytest.mark.parametrize(("early", "late"), [(0.0995, 0.0), (0.0, 0.0995)])
def test_a_named_segment_may_begin_or_end_a_tenth_of_a_second_outside(early, late):
    check_inside("t", "the log", (10.0 - early, 50.0 + late), (10.0, 50.0))
    with pytest.raises(LogError, match="is outside the log"):
        check_inside("t", "the log", (10.0 - 1.01 * early, 50.0 + 1.01 * late), (10.0, 50.0))
