import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.record import ImuLog
from rotcli.run.still import longest_still
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


def flags(n, *stretches):
    result = np.zeros(n, dtype=bool)
    for first, last in stretches:
        result[first:last] = True
    return result


def test_a_still_log_is_used_whole_without_a_word():
    found = longest_still(still_log())
    assert (found.first, found.last, found.warnings) == (0, 10_000, ())


@pytest.mark.parametrize("seed", range(20))
def test_white_noise_is_never_taken_for_motion(seed):
    found = longest_still(still_log(300.0, seed))
    assert found.last - found.first == 30_000


def test_drift_is_not_motion():
    log = still_log(1000.0)
    n = len(log.time)
    rng = np.random.default_rng(5)
    log.gyro[:, 0] += 0.02 * np.linspace(0, 1, n) + np.cumsum(rng.standard_normal(n)) * 2e-5
    found = longest_still(log)
    assert found.last - found.first == n


@pytest.mark.parametrize("rate", [2.0, 10.0, 100.0])
def test_a_steadily_turning_stretch_is_left_out(rate):
    log = still_log()
    log.gyro[3000:, 2] += rate * DEG
    found = longest_still(log)
    assert found.first == 0
    # Motion is told by the second, and a jump may lie in either of two.
    assert 2800 <= found.last <= 3000
    assert "motion" in found.warnings[0]
    assert "the longest clean stretch was used" in found.warnings[0]


def test_shaking_parts_the_log():
    log = still_log()
    log.accel[4000:4100, 0] += 2.0 * np.sin(np.arange(100))
    found = longest_still(log)
    assert (found.first, found.last) == (4100, 10_000)
    assert found.warnings == (
        "still.csv: motion (100 samples, first at 40 s): the longest clean stretch was used, "
        "41 to 99.99 s, 59.0% of the samples",
    )


def test_a_long_gap_parts_the_log_and_a_short_one_does_not():
    log = still_log(missing=flags(10_000, (2000, 2003)))
    assert longest_still(log).last == 10_000
    log = still_log(missing=flags(10_000, (2000, 2003), (7000, 7006)))
    found = longest_still(log)
    assert (found.first, found.last) == (0, 7000)
    assert "gaps (6 samples, first at 70 s)" in found.warnings[0]


def test_many_short_gaps_are_no_longer_bridged():
    missing = flags(10_000, *((k, k + 2) for k in range(500, 5000, 30)))
    found = longest_still(still_log(missing=missing))
    assert (found.first, found.last) == (4972, 10_000)


def test_clipped_samples_part_the_log():
    log = still_log()
    log.gyro[6000, 1] = -300 * DEG
    found = longest_still(log, gyro_range=300 * DEG)
    assert found.last <= 6000
    assert "clipped samples (1 samples, first at 60 s)" in found.warnings[0]
    log = still_log()
    log.accel[6000, 2] = 160.0
    assert "clipped" in longest_still(log, accel_range=160.0).warnings[0]


def test_a_window_chooses_the_part():
    log = still_log()
    log.accel[4000:4100, 0] += 2.0 * np.sin(np.arange(100))
    found = longest_still(log, window=(5.0, 40.0 - 0.01))
    assert (found.first, found.last, found.warnings) == (500, 4000, ())
    found = longest_still(log, window=(35.0, 44.0))
    assert found.first >= 3500
    assert found.last <= 4401
    assert found.warnings


def test_a_record_of_whole_last_digits_is_not_taken_for_motion():
    log = still_log(300.0, sigma=0.0004)
    digit = 0.001
    log.gyro[:] = np.round(log.gyro / digit) * digit
    found = longest_still(log)
    assert found.last - found.first == 30_000


def test_too_short_a_window_is_refused():
    with pytest.raises(LogError, match=r"still.csv: 51 samples from 1 to 1.5 s, which spans 0 to"):
        longest_still(still_log(), window=(1.0, 1.5))


def test_times_since_1970_are_told_with_all_their_digits():
    log = still_log()
    log.time[:] += 1.7e9
    with pytest.raises(LogError, match=r"spans 1700000000 to 1700000099\.99 s \(the times are on"):
        longest_still(log, window=(1.0, 50.0))
    log.accel[4000:4100, 0] += 2.0 * np.sin(np.arange(100))
    (warning,) = longest_still(log).warnings
    assert "first at 1700000040 s" in warning
    assert "1700000041 to 1700000099.99 s" in warning


def test_a_log_in_motion_throughout_is_refused():
    log = still_log(20.0)
    rng = np.random.default_rng(1)
    log.gyro[:] += np.repeat(rng.standard_normal((40, 3)), 50, axis=0)
    with pytest.raises(LogError, match="no still stretch of 100 samples or more: motion"):
        longest_still(log)


def test_a_log_that_is_lost_in_gaps_is_refused():
    missing = flags(10_000, (0, 10_000))
    with pytest.raises(LogError, match=r"no still stretch .* gaps \(10000 samples"):
        longest_still(still_log(missing=missing))
