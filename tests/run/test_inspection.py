"""What inspection says of readings, and of the clocks of an IMU log and a table log."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.logs.record import ImuLog, TableLog
from rotcli.rig.rig import default_rig
from rotcli.run.inspection import compare_logs, examine_readings

DEG = np.pi / 180


def turning(lag=0.0, ppm=0.0, sense=1.0, seed=1):
    """An IMU on a table that turns twice, 40 s apart; its clock lags and differs in rate."""
    rng = np.random.default_rng(seed)
    knots = np.array([0, 10, 11, 30, 31, 60, 61, 80, 81, 100.0])
    rates = np.array([0, 0, 20, 20, 0, 0, -30, -30, 0, 0.0])
    fine = np.arange(0.0, 100.0, 1e-3)
    angle = np.cumsum(np.interp(fine, knots, rates)) * 1e-3
    t = np.arange(10_000) * 0.01
    true = (t - lag) / (1.0 + ppm * 1e-6)
    gyro = 0.003 * rng.normal(size=(len(t), 3))
    gyro[:, 2] += sense * np.interp(true, knots, rates) * DEG
    accel = np.array([0.0, 0.0, 9.8]) + 0.01 * rng.normal(size=(len(t), 3))
    imu = ImuLog("imu.csv", t, gyro, accel, 0.01, rows=len(t))
    stamps = np.arange(0.0, 100.0, 0.02)
    return imu, TableLog("t.csv", stamps, np.interp(stamps, fine, angle) * DEG, 0.02, len(stamps))


def number(text):
    return float(text.split(" ")[0])


@pytest.mark.parametrize(("lag", "ppm"), [(0.0, 0.0), (0.025, 0.0), (0.0, 1000.0)])
def test_lag_and_clock_rate_are_shown_with_the_line_that_corrects_them(lag, ppm):
    facts, notes = compare_logs(*turning(lag, ppm), default_rig())
    # Of clocks that differ in rate it is the lag at some time between the changes of rate.
    low, high = (1e3 * lag + t * ppm * 1e-3 for t in (10.0, 81.0))
    assert low - 2.0 < number(facts["lag of the gyro log (ms)"]) < high + 2.0
    rate = facts["clock rate difference (ppm)"]
    assert number(rate) == pytest.approx(ppm, abs=60.0) if ppm else rate.startswith("not")
    assert bool(notes) == bool(lag or ppm)
    if lag:
        assert "set [table] time_offset = 0.02" in notes[0]


def test_a_table_of_constant_rate_shows_no_lag():
    imu, table = turning()
    still = replace(table, angle=20.0 * DEG * table.time)
    rate = replace(imu, gyro=imu.gyro * [1, 1, 0] + [0, 0, 20 * DEG])
    facts, _ = compare_logs(rate, still, default_rig())
    assert facts["lag of the gyro log"].startswith("not shown")


def test_readings_at_rest_and_repeated_rows_are_examined():
    imu, table = turning()
    facts, notes = examine_readings(imu, default_rig(), table)
    assert notes == []
    assert facts["rows equal to the row before (%)"] == 0.0
    assert facts["largest gyro reading (deg/s)"] == pytest.approx(30.5, abs=0.5)
    coarse = replace(imu, gyro=np.rint(imu.gyro / (0.1 * DEG)) * 0.1 * DEG)
    assert examine_readings(coarse, default_rig())[0]["gyro resolution (deg/s)"] == 0.1
    (note,) = examine_readings(replace(imu, accel=imu.accel / 9.80665), default_rig())[1]
    assert "expected 9.8. It is 1 in g" in note
    twice = replace(imu, gyro=np.repeat(imu.gyro[::2], 2, 0), accel=np.repeat(imu.accel[::2], 2, 0))
    facts, notes = examine_readings(twice, default_rig())
    assert facts["rows equal to the row before (%)"] == pytest.approx(50.0, abs=0.1)
    assert "each reading is logged 2 times" in notes[0]
    fast = replace(imu, gyro=imu.gyro + 10 * DEG)
    assert "at rest" in examine_readings(fast, default_rig())[1][0]
    assert examine_readings(fast, default_rig(), replace(table, angle=table.time))[1] == []
