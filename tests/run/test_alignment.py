"""Clocks and sense of the logs over their complete length."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from rotcli.logs.record import ImuLog, TableLog
from rotcli.rig.rig import TableSettings, rig_from_dict
from rotcli.run.alignment.checks import (
    _drift_in_words,
    _lag_in_words,
    check_alignment,
    check_lag,
)
from rotcli.run.alignment.correlation import correlate
from rotcli.run.alignment.lag import Lag, bias_step, find_in_series, find_lag
from rotcli.run.alignment.series import _MAX_LAG_DURATION, Series, _liveliest_part, rate_series
from rotcli.run.evidence.repeats import Repeats
from rotcli.units import DEG

UP = np.array([0.0, 0.0, 1.0])
RIG = rig_from_dict({"attitude": {"pitch": 0.0, "roll": 0.0, "azimuth": 0.0}})
TIME = np.arange(0.0, 200.0, 0.01)


def rate_at(t):
    """Still, 20 deg/s from 40 s, still from 120 s, -10 deg/s from 160 s; ramps of a second."""
    knots = [0, 40, 41, 120, 121, 160, 161, 400]
    return np.interp(t, knots, np.array([0, 0, 20, 20, 0, 0, -10, -10]) * DEG)


def run(lag=0.0, drift=0.0, sign=1.0, gravity=9.8, seed=1):
    """Return gyros that lag a table by lag + drift * t, and their table log."""
    rng = np.random.default_rng(seed)
    gyro = 1e-3 * rng.standard_normal((len(TIME), 3)) + [0.001, -0.002, 0.003]
    gyro[:, 2] += sign * rate_at(TIME - lag - drift * TIME)
    accel = np.tile([0.0, 0.0, gravity], (len(TIME), 1)) + 1e-3 * rng.normal(size=(len(TIME), 3))
    stamps = np.arange(-60.0, 300.0, 0.02)
    angle = np.concatenate([[0.0], np.cumsum(0.02 * rate_at(stamps[:-1] + 0.01))])
    return ImuLog("imu", TIME, gyro, accel, 0.01), TableLog("table", stamps, angle, 0.02)


@pytest.mark.parametrize("lag", [0.0, 0.3, -8.0, 25.0])
def test_a_lag_of_any_size_is_found(lag):
    found = find_lag(*run(lag), UP)
    assert found.lag == pytest.approx(lag, abs=max(4.0 * found.sigma, 1e-3))


def test_a_clock_of_another_rate_is_found_and_named_with_offset_and_rate():
    imu, table = run(lag=0.1, drift=2e-3)
    found = find_lag(imu, table, UP)
    assert found.drifts
    assert found.drift == pytest.approx(2e-3, abs=4.0 * found.drift_sigma)
    (finding,) = check_alignment(imu, table, RIG)
    assert finding.code == "clock-lag-large"
    assert "the clocks differ by 20" in finding.text
    assert finding.unit == "ppm"
    assert finding.value == pytest.approx(2e3, abs=4e6 * found.drift_sigma)
    assert finding.limit == pytest.approx(50.0)  # ppm: crystals differ by 30
    rate, offset = (
        float(finding.text.split(f"{key} = ")[1].split()[0])
        for key in ("clock_rate", "time_offset")
    )
    assert rate == pytest.approx(2e3, abs=4e6 * found.drift_sigma)
    # The advice, followed, works: as the reader applies it.
    time = table.time + 1e-6 * rate * (table.time - table.time[0]) + offset
    assert check_alignment(imu, replace(table, time=time), RIG) == ()


def test_a_clock_that_is_corrected_in_part_gets_the_total_rate_and_offset():
    imu, table = run(lag=0.1, drift=2e-3)
    part = rig_from_dict({"table": {"clock_rate": 1500.0, "time_offset": 0.3}})
    origin = table.time[0]
    time = table.time + 1.5e-3 * (table.time - origin) + 0.3
    (finding,) = check_alignment(imu, replace(table, time=time), part)
    rate, offset = (
        float(finding.text.split(f"{key} = ")[1].split()[0])
        for key in ("clock_rate", "time_offset")
    )
    time = table.time + 1e-6 * rate * (table.time - origin) + offset
    assert check_alignment(imu, replace(table, time=time), RIG) == ()


def test_a_bias_that_steps_with_the_rate_is_no_lag():
    imu, table = run()
    stepped = replace(imu, gyro=imu.gyro.copy())
    stepped.gyro[TIME < 40.0, 2] += 1.0 * DEG
    found = find_lag(stepped, table, UP)
    assert abs(found.largest) > 4.0 * found.sigma  # alone, the fit of a lag takes it for one
    (finding,) = check_alignment(stepped, table, RIG)
    assert finding.code == "ramp-step"
    assert "changes by 1 deg/s near 40" in finding.text
    assert finding.value == pytest.approx(50_000.0, rel=0.05)  # ppm: 1 of 20 deg/s
    stepped.gyro[TIME < 40.0, 2] -= 0.8 * DEG  # 10,000 ppm: as scale factor errors of MEMS gyros
    assert check_alignment(stepped, table, RIG) == ()


def test_copied_rows_are_named_in_place_of_the_lag_that_they_cause():
    imu, table = run()
    order = np.concatenate([np.arange(2000), np.arange(1500, len(TIME) - 500)])
    copied = replace(imu, gyro=imu.gyro[order], accel=imu.accel[order])
    found = check_alignment(copied, table, RIG)
    assert [f.code for f in found] == ["copied-rows", "clock-lag-large"]
    for finding in found:
        assert (
            "500 rows repeat earlier rows bit for bit (20 to 24.99 s as from 15 s)" in finding.text
        )
        assert "time_offset" not in finding.text


def test_rows_written_twice_are_named_and_no_lag_of_them():
    imu, table = run()
    order = 2 * (np.arange(len(TIME)) // 2)
    stored = replace(imu, gyro=imu.gyro[order], accel=imu.accel[order])
    (finding,) = check_alignment(stored, table, RIG)
    assert finding.code == "repeated-rows"
    assert "the sensor measures at 50 Hz, and each reading is logged 2 times" in finding.text


def test_clean_clocks_and_crystals_of_30_ppm_raise_no_alarm():
    for seed in range(20):
        assert check_alignment(*run(drift=30e-6 if seed % 2 else 0.0, seed=seed), RIG) == ()


def test_the_opposite_sense_is_named_with_the_direction_to_set():
    imu, table = run(sign=-1.0)
    (finding,) = check_alignment(imu, table, RIG)
    assert finding.code == "rotation-sense"
    assert "set [table] direction = -1" in finding.text
    (finding,) = check_alignment(imu, table, RIG.override({"table": {"direction": -1}}))
    assert "set [table] direction = 1" in finding.text


def test_the_opposite_sense_with_reversed_gravity_is_an_imu_upside_down():
    (finding,) = check_alignment(*run(sign=-1.0, gravity=-9.8), RIG)
    assert "the IMU points down; set [imu] mount" in finding.text


@pytest.mark.parametrize(("scale", "named"), [(0.4975, 0), (0.5025, 1), (1.99, 1), (2.01, 0)])
def test_a_lag_is_that_of_gyros_within_a_factor_of_two_of_the_table(scale, named):
    imu, table = run(lag=0.1)
    imu.gyro[:, 2] *= scale
    found = check_lag(imu, table, UP)
    assert [f.code for f in found] == ["clock-lag-large"] * named


@pytest.mark.parametrize("noise", [1e-3, 0.05])
def test_the_limit_of_a_lag_is_a_third_of_a_sample_or_four_sigma(noise):
    imu, table = run(lag=0.1)
    imu.gyro[:] += noise * np.random.default_rng(2).standard_normal(imu.gyro.shape)
    sigma = find_lag(imu, table, UP).sigma
    (finding,) = check_lag(imu, table, UP)
    assert (finding.unit, finding.value) == ("ms", pytest.approx(100.0, abs=4e3 * sigma))
    assert finding.limit == pytest.approx(1e3 * max(0.01 / 3.0, 4.0 * sigma))


def test_the_words_of_a_clock_have_offset_rate_and_lags_at_the_changes():
    # One clock after the other: 1 + rate is the product; a tenth shows it.
    table = TableLog("table", np.array([-60.0, 300.0]), np.zeros(2), 0.02)
    found = Lag(0.1, 1e-3, 1.0, 1e-6, 0.99, 2e-3, 3e-5, centre=100.0, first=40.0, last=160.0)
    settings = TableSettings(time_offset=1.5, clock_rate=0.1)
    text = _drift_in_words(found, table, settings)
    assert "differ by 2000 ppm (sigma 30 ppm)" in text
    assert "by -20.0 ms at 40 s and by 220.0 ms at 160 s" in text
    assert "clock_rate = 102200.0 and time_offset = 1.2800" in text  # 1.5 + 0.1 - 0.32


@pytest.mark.parametrize(
    ("sigma", "offset"), [(0.02, "1.623"), (2e-4, "1.6235"), (2e-5, "1.62346"), (0.0, "1.62346")]
)
def test_the_offset_to_set_has_the_digits_of_its_sigma(sigma, offset):
    imu, _ = run()
    found = Lag(0.123456, sigma, 1.0, 1e-6, 0.99)
    text = _lag_in_words(found, imu, 1.5, Repeats())
    assert text.endswith(f"set [table] time_offset = {offset}")
    assert (
        f"lags the table log by 123.46 ms (sigma {1e3 * sigma:.2f} ms, one sample is 10 ms)" in text
    )


def test_the_share_that_the_table_explains_is_that_of_the_variance():
    imu, table = run()
    imu.gyro[:] += 0.5 * np.random.default_rng(2).standard_normal(imu.gyro.shape)
    found = find_lag(imu, table, UP)
    # In blocks of ten samples the noise has 0.025, the rate what it has.
    signal = np.var(rate_at(TIME))
    assert found.explained == pytest.approx(signal / (signal + 0.025), abs=0.02)


def test_a_step_of_the_bias_at_a_change_of_the_rate_is_found_with_its_time():
    imu, table = run()
    imu.gyro[TIME < 40.0, 2] += 1.0 * DEG
    step = bias_step(rate_series(imu, table, UP))
    assert step.time == pytest.approx(40.0, abs=0.3)  # three blocks of a tenth of a second
    assert step.size == pytest.approx(-1.0 * DEG, rel=0.05)
    assert step.rate_change == pytest.approx(20.0 * DEG, rel=0.05)


@pytest.mark.parametrize(("sampling", "start"), [("instant", -0.005), ("average", 0.0)])
def test_blocks_begin_where_the_interval_of_their_first_sample_does(sampling, start):
    # The first mean is of an interval before the log.
    imu, table = run()
    series = rate_series(replace(imu, sampling=sampling), table, UP)
    assert series.edges[0] == pytest.approx(start, abs=1e-12)
    assert series.width == pytest.approx(0.1)


def test_the_part_of_a_long_log_lies_an_hour_to_either_side_of_the_change():
    time = np.arange(0.0, 30000.0, 0.5)
    rate = np.where(time < 9000.0, 0.0, 20.0 * DEG)
    imu = ImuLog("imu", time, np.outer(rate, UP), np.zeros((len(time), 3)), 0.5)
    series = rate_series(imu, TableLog("table", time, np.cumsum(rate) * 0.5, 0.5), UP)
    assert series.edges[0] == pytest.approx(9000.0 - 3600.0, abs=2.5)
    assert series.edges[-1] == pytest.approx(9000.0 + 3600.0, abs=2.5)


def test_a_step_of_the_bias_far_from_a_ramp_is_no_lag():
    imu, table = run()
    imu.gyro[7000:, 2] += 0.3 * DEG
    assert check_alignment(imu, table, RIG) == ()


@pytest.mark.parametrize("noise", [1e-3, 0.5])
@pytest.mark.parametrize("seed", range(8))
def test_the_correlation_over_shifts_is_that_of_the_blocks_they_share(seed, noise):
    """Against correlations computed shift by shift; the table log covers a part of the blocks."""
    rng = np.random.default_rng(seed)
    n, width = 240, 0.1
    edges = width * np.arange(n + 1.0)
    stamps = np.arange(rng.uniform(-3.0, 6.0), rng.uniform(17.0, 30.0), 0.02)
    angle = 0.02 * np.cumsum(np.cumsum(0.02 * rng.standard_normal(len(stamps))))
    sign = 1.0 if seed % 2 else -1.0
    moved = np.interp(edges - 0.7, stamps, angle)
    measured = sign * np.diff(moved) / width + noise * rng.standard_normal(n)
    series = Series(TableLog("table", stamps, angle, 0.02), edges, measured)
    covered = (edges[:-1] >= stamps[0]) & (edges[1:] <= stamps[-1])
    rates = series.rates(0.0)
    expected = {}
    for shift in range(1 - n, n):
        k = np.arange(max(0, -shift), min(n, n - shift))
        k = k[covered[k]]
        if len(k) >= n / 3:
            expected[shift] = np.corrcoef(rates[k], measured[k + shift])[0, 1]
    best = max(np.abs(list(expected.values())))
    near = [shift for shift, value in expected.items() if abs(value) >= best - 2e-3]
    lag, correlation = correlate(series)
    found = round(lag / width)
    assert abs(found) == min(abs(shift) for shift in near)
    assert correlation == pytest.approx(expected[found], abs=1e-9)


@pytest.mark.parametrize("at", [60.0, 9000.0, 29900.0])
def test_a_long_log_is_searched_for_its_lag_where_the_rate_changes_most(at):
    # Two hours at most are used: they must contain the change, at the start, amid, at the end.
    time = np.arange(0.0, 30000.0, 0.5)
    rate = np.where(time < at, 0.0, 20.0 * DEG)
    table = TableLog("table.csv", time, np.cumsum(rate) * 0.5, 0.5)
    start, end = _liveliest_part(table, 0.0, 30000.0, 1.0)
    assert 0.0 <= start < at < end <= 30000.0
    assert end - start == pytest.approx(_MAX_LAG_DURATION)


def test_a_shift_that_fits_worse_than_no_lag_is_not_taken():
    # The second pulse is a little lower: shifted by their distance, one is still like the other.
    time = np.arange(0.0, 300.0, 0.01)
    knots = [0, 60, 61, 100, 101, 160, 161, 200, 201, 400]
    rate = np.interp(time, knots, np.array([0, 0, 20, 20, 0, 0, 18, 18, 0, 0]) * DEG)
    rng = np.random.default_rng(4)
    gyro = 1e-3 * rng.standard_normal((len(time), 3))
    gyro[:, 2] += rate
    accel = np.tile([0.0, 0.0, 9.8], (len(time), 1))
    angle = cumulative_trapezoid(rate, time, initial=0.0)
    imu = ImuLog("imu", time, gyro, accel, 0.01)
    series = rate_series(imu, TableLog("table", time, angle, 0.01), UP)
    found = find_in_series(series, 100.0)
    assert found.lag == pytest.approx(0.0, abs=max(4.0 * found.sigma, 1e-3))
