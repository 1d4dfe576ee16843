from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.record import ImuLog
from rotcli.run.still.copies import find_copies
from rotcli.run.still.motion import _turning, quiet_levels
from rotcli.run.still.record import _spike_finding, still_record
from rotcli.run.still.scan import scan
from rotcli.run.still.spikes import Spikes, _block_spikes, find_spikes
from rotcli.units import DEG

INTERVAL = 0.01


def still_log(seconds=100.0, seed=0, missing=None, sigma=0.002):
    n = round(seconds / INTERVAL)
    rng = np.random.default_rng(seed)
    gyro = 0.05 + sigma * rng.standard_normal((n, 3))
    accel = np.array([0.0, 0.0, 9.8]) + 0.02 * rng.standard_normal((n, 3))
    return ImuLog(
        path="still.csv",
        time=INTERVAL * np.arange(n),
        gyro=gyro,
        accel=accel,
        interval=INTERVAL,
        missing=missing,
    )


def flags(n, *spans):
    result = np.zeros(n, dtype=bool)
    for first, last in spans:
        result[first:last] = True
    return result


def spans(record):
    return [(segment.start, segment.stop) for segment in record.segments]


def codes(record):
    return [finding.code for finding in record.findings]


def text(record, code):
    (found,) = [finding.text for finding in record.findings if finding.code == code]
    return found


def test_a_still_log_is_used_completely_and_silently():
    record = still_record(still_log())
    assert (spans(record), record.findings, record.share) == ([(0, 10_000)], (), 1.0)


@pytest.mark.parametrize("seed", range(20))
def test_white_noise_is_never_taken_for_motion(seed):
    record = still_record(still_log(300.0, seed))
    assert (spans(record), record.findings) == ([(0, 30_000)], ())


def test_drift_is_not_motion():
    log = still_log(1000.0)
    n = len(log.time)
    rng = np.random.default_rng(5)
    log.gyro[:, 0] += 0.02 * np.linspace(0, 1, n) + np.cumsum(rng.standard_normal(n)) * 2e-5
    assert spans(still_record(log)) == [(0, n)]


@pytest.mark.parametrize("rate", [2.0, 10.0, 100.0])
def test_a_steadily_turning_segment_is_excluded(rate):
    log = still_log()
    log.gyro[3000:, 2] += rate * DEG
    record = still_record(log)
    ((first, last),) = spans(record)
    assert first == 0
    # Motion is judged by the second, and a jump may lie in either of two.
    assert 2800 <= last <= 3000
    assert "motion" in text(record, "excluded-samples")
    assert record.share == last / 10_000


def test_the_rate_of_rest_is_that_of_segments_of_five_blocks():
    # Turning points of an oscillation last a block or two; the bias of the gyros is 0.1 rad/s.
    rates = np.full((60, 3), 0.0)
    rates[5:30, 1] = 0.1
    rates[31:45, 1] = 0.125
    moving = ~flags(60, (5, 30), (31, 45), (50, 52))
    np.testing.assert_array_equal(_turning(rates, moving), flags(60, (31, 45)))
    only = ~flags(60, (50, 52))
    assert not _turning(rates, only).any()


def test_shaking_splits_the_log_and_both_parts_are_used():
    log = still_log()
    log.accel[4000:4100, 0] += 2.0 * np.sin(np.arange(100))
    record = still_record(log)
    assert spans(record) == [(0, 4000), (4100, 10_000)]
    assert [finding.text for finding in record.findings] == [
        "still.csv: motion (100 samples, first at 40 s) excluded. 99 s (99.0 %) from 0 to 99.99 s "
        "are used, 2 segments whose squares are pooled"
    ]
    assert record.lengths == (4000, 5900)


def test_a_long_gap_splits_the_log_and_a_short_one_does_not():
    record = still_record(still_log(missing=flags(10_000, (2000, 2003))))
    assert (spans(record), codes(record)) == ([(0, 10_000)], [])
    assert record.gap_lengths("gyro_x").tolist() == [3]
    record = still_record(still_log(missing=flags(10_000, (2000, 2003), (7000, 7006))))
    assert spans(record) == [(0, 7000), (7006, 10_000)]
    assert "gaps (6 samples, first at 70 s)" in text(record, "excluded-samples")
    assert record.gap_lengths("gyro_x").tolist() == [3]


def test_up_to_one_sample_in_twenty_is_interpolated():
    n = 10_000
    lost = flags(n, *((k, k + 1) for k in range(25, n, 25)))
    record = still_record(still_log(missing=lost))
    assert spans(record) == [(0, n)]
    assert record.gap_lengths("accel_z").tolist() == [1] * 399
    lost = flags(n, *((k, k + 1) for k in range(500, 8000, 12)))
    record = still_record(still_log(missing=lost))
    assert spans(record)[-1] == (7989, n)
    assert record.gap_lengths("accel_z").size == 0


def test_a_second_full_of_spikes_is_motion():
    log = still_log()
    log.gyro[5000:5060, 1] += 0.5
    record = still_record(log)
    assert codes(record) == ["excluded-samples"]
    assert "motion" in record.findings[0].text


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_large_spike_splits_the_log_and_is_reported_with_axis_and_time(sign):
    log = still_log()
    log.gyro[:] -= 0.05
    log.gyro[6000, 2] = sign * 0.5
    record = still_record(log)
    assert spans(record) == [(0, 6000), (6001, 10_000)]
    found = text(record, "spikes")
    assert f"still.csv: gyro_z: 1 spike, the largest {'-' * (sign < 0)}28.6 deg/s (" in found
    # 0.5 rad/s over 0.002 rad/s, which the median of 100 blocks estimates to 1 %.
    sigmas, _, rest = found.partition("deg/s (")[2].partition(" ")
    assert float(sigmas) == pytest.approx(250.0, rel=0.03)
    assert rest.startswith("sigma) at 60 s")
    record = still_record(log, despike=True)
    assert spans(record) == [(0, 10_000)]
    assert record.spikes["gyro_z"].tolist() == [6000]
    assert record.gap_lengths("gyro_z").tolist() == [1]
    assert record.gap_lengths("gyro_x").size == 0
    assert "interpolated" in text(record, "spikes")


def test_spikes_and_zero_rows_are_those_of_the_span():
    log = still_log()
    log.gyro[6000, 2] += 0.5
    for values in (log.gyro, log.accel):
        values[7000:7003] = 0.0
    span = slice(2000, 9000)
    found, _, zeros = find_spikes(log, span, scan(log, span, None, None))
    assert found["gyro_z"].samples.tolist() == [4000, 5000, 5001, 5002]
    assert found["accel_z"].samples.tolist() == [5000, 5001, 5002]
    np.testing.assert_array_equal(zeros, flags(7000, (5000, 5003)))


@pytest.mark.parametrize(("length", "spikes"), [(5, 6), (6, 0)])
def test_a_disturbance_of_more_than_five_samples_is_no_spike_next_to_one(length, spikes):
    values = np.zeros(1000)
    values[100] = -1.0
    values[300 : 300 + length] = 1.0
    at, deviation = _block_spikes(values, 0.01)
    np.testing.assert_array_equal(at, np.flatnonzero(values)[:spikes])
    np.testing.assert_array_equal(deviation, values[at])


def test_the_quiet_level_is_that_of_one_judged_block_in_ten():
    statistics = scan(still_log(), slice(0, 10_000), None, None)
    square = np.tile((0.01 * np.arange(102.0)) ** 2, (6, 1))
    square[:, -1] = 0.0
    statistics = replace(statistics, square=square, digit=np.array([0.0, 0.19, 0.21, 0, 0, 0]))
    levels = quiet_levels(statistics, np.arange(102) < 101)
    np.testing.assert_allclose(levels, [0.1, 0.1, 0.105, 0.1, 0.1, 0.1], rtol=1e-12)


def test_small_spikes_remain_and_their_share_of_the_noise_is_said():
    log = still_log()
    places = np.arange(250, 10_000, 500)
    log.accel[places, 0] += 15 * 0.02
    record = still_record(log)
    assert spans(record) == [(0, 10_000)]
    (finding,) = record.findings
    assert (finding.code, finding.value) == ("spikes", 20.0)
    # 20 spikes of 15 sigma in 10,000 samples: sqrt(1 + 20 * 225 / 10000) - 1.
    assert "increase the white noise by 2" in finding.text


@pytest.mark.parametrize(("rise", "says"), [(0.995e-3, "split the log"), (1.005e-3, "by 0.1 %")])
def test_spikes_that_add_a_thousandth_to_the_noise_are_named_with_their_share(rise, says):
    sigmas = np.full(4, np.sqrt(((1.0 + rise) ** 2 - 1.0) * 10_000 / 4))
    spikes = Spikes(np.array([10, 20, 30, 40]), sigmas, 0.002)
    span = slice(0, 10_000)
    found = _spike_finding(still_log(), span, "gyro_x", spikes, None, flags(10_000))
    assert says in found.text


def test_gaussian_noise_has_no_spikes_and_a_coarse_digit_neither():
    rng = np.random.default_rng(3)
    log = still_log(3000.0)
    log.gyro[:] = np.round(0.0004 * rng.standard_normal(log.gyro.shape), 3)
    record = still_record(log)
    assert record.findings == ()
    assert not record.spikes


def test_rows_of_zeros_are_named():
    log = still_log()
    log.gyro[7000:7003] = 0.0
    log.accel[7000:7003] = 0.0
    record = still_record(log)
    assert "3 rows of zeros, first at 70 s" in text(record, "zero-rows")
    assert spans(record) == [(0, 7000), (7003, 10_000)]


@pytest.mark.parametrize(("first", "length", "lag"), [(6000, 4000, 6000), (3777, 2001, 2100)])
def test_copied_rows_are_found_at_any_distance_and_excluded(first, length, lag):
    log = still_log()
    for values in (log.gyro, log.accel):
        values[first : first + length] = values[first - lag : first - lag + length]
    record = still_record(log)
    found = text(record, "copied-rows")
    assert found.startswith(f"still.csv: {length} rows repeat earlier rows in all readings")
    assert f"the first at {first / 100:.6g} s" in found
    kept = [(0, first), (first + length, 10_000)]
    assert spans(record) == [(a, b) for a, b in kept if b > a]


@pytest.mark.parametrize(("marks", "found"), [(4, False), (5, True), (6, True)])
def test_a_copy_of_five_marked_rows_is_found_completely(marks, found):
    log, span = still_log(), slice(0, 10_000)
    marked = scan(log, span, None, None).marks
    first, last = int(marked[10]), int(marked[9 + marks]) + 1
    for values in (log.gyro, log.accel):
        values[first + 5000 : last + 5000] = values[first:last]
    copied = find_copies(log, span, scan(log, span, None, None))
    expected = flags(10_000, (first + 5000, last + 5000)) if found else flags(10_000)
    np.testing.assert_array_equal(copied, expected)


def test_quantised_noise_has_no_copies():
    rng = np.random.default_rng(8)
    log = still_log(600.0)
    log.gyro[:] = np.round(1.2 * rng.standard_normal(log.gyro.shape)) * 0.001
    log.accel[:] = np.round(1.2 * rng.standard_normal(log.accel.shape)) * 0.01
    assert still_record(log).findings == ()


def test_clipped_samples_split_the_log():
    log = still_log()
    log.gyro[6000, 1] = -300 * DEG
    record = still_record(log, gyro_range=300 * DEG)
    assert spans(record)[0][1] <= 6000
    assert "clipped samples (1 samples, first at 60 s)" in text(record, "excluded-samples")
    log = still_log()
    log.accel[6000, 2] = 160.0
    assert "clipped" in text(still_record(log, accel_range=160.0), "excluded-samples")


def test_a_window_chooses_the_part():
    log = still_log()
    log.accel[4000:4100, 0] += 2.0 * np.sin(np.arange(100))
    record = still_record(log, window=(5.0, 40.0 - 0.01))
    assert (spans(record), record.findings) == ([(500, 4000)], ())
    record = still_record(log, window=(35.0, 44.0))
    (first, second) = spans(record)  # motion is judged by blocks of the window
    assert first[0] == 3500
    assert 3900 <= first[1] <= 4000
    assert 4100 <= second[0] <= 4200
    assert second[1] == 4401
    assert record.findings


def test_a_record_of_single_digits_is_not_taken_for_motion():
    log = still_log(300.0, sigma=0.0004)
    digit = 0.001
    log.gyro[:] = np.round(log.gyro / digit) * digit
    assert spans(still_record(log)) == [(0, 30_000)]


def test_too_short_a_window_is_rejected():
    with pytest.raises(LogError, match=r"still.csv: 51 samples from 1 to 1.5 s, which spans 0 to"):
        still_record(still_log(), window=(1.0, 1.5))


def test_times_since_1970_are_shown_with_all_their_digits():
    log = still_log()
    log.time[:] += 1.7e9
    with pytest.raises(LogError, match=r"spans 1700000000 to 1700000099\.99 s \(the times are on"):
        still_record(log, window=(1.0, 50.0))
    log.accel[4000:4100, 0] += 2.0 * np.sin(np.arange(100))
    found = text(still_record(log), "excluded-samples")
    assert "first at 1700000040 s" in found
    assert "1700000000 to 1700000099.99 s" in found


def test_a_log_in_motion_throughout_is_rejected():
    log = still_log(20.0)
    rng = np.random.default_rng(1)
    log.gyro[:] += np.repeat(rng.standard_normal((40, 3)), 50, axis=0)
    with pytest.raises(LogError, match="no still segment of 100 samples; excluded: motion"):
        still_record(log)


def test_a_log_that_consists_of_gaps_is_rejected():
    missing = flags(10_000, (0, 10_000))
    with pytest.raises(LogError, match=r"no still segment .* gaps \(10000 samples"):
        still_record(still_log(missing=missing))
