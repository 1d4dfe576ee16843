"""Time of every kind: each log is read right, or one message says the line that solves it."""

import numpy as np
import pytest

from rotcli.logs.imu import read_imu
from tests.logs.lab_logs import AXES, PLAIN, T, advice, columns, readings, rig, right, write


def test_stamps_of_arrival_are_counted_and_nothing_is_lost(tmp_path):
    rng = np.random.default_rng(2)
    gyro, accel = readings(rate=200.0)
    t = np.arange(3000) * 0.005
    stamps = {
        "latency": t + np.abs(rng.normal(0.0, 1e-3, 3000)),
        "bursts": np.ceil((t + 1e-9) / 0.016) * 0.016 + 1e-4 * np.arange(3000) % 3e-4,
        "batches": np.ceil((t + 1e-9) / 0.11) * 0.11 + 1e-6 * (np.arange(3000) % 22),
    }
    for name, late in stamps.items():
        late = np.maximum.accumulate(late)
        path = write(tmp_path / f"{name}.csv", PLAIN, columns(late, gyro, accel))
        log = right(read_imu(path, rig(units={"gyro": "rad/s"})), rate=200.0)
        (warning,) = log.warnings
        assert 'The records are counted; set [imu] clock = "count" to confirm' in warning
        confirmed = rig(units={"gyro": "rad/s"}, clock="count")
        assert right(read_imu(path, confirmed), rate=200.0).warnings == ()


def test_lost_samples_are_gaps_though_the_stamps_jitter(tmp_path):
    rng = np.random.default_rng(3)
    gyro, accel = readings()
    kept = np.sort(rng.choice(3000, 2900, replace=False))
    kept[0], kept[-1] = 0, 2999
    stamps = (T + rng.normal(0.0, 3e-4, 3000))[kept]
    path = write(tmp_path / "lost.csv", PLAIN, columns(stamps, gyro[kept], accel[kept]))
    log = read_imu(path, rig(), max_gap=None)
    assert log.samples == 3000
    assert any("samples), first after" in text for text in log.warnings)


def test_a_coarse_tick_of_the_stamps_is_not_the_sampling_interval(tmp_path):
    gyro, accel = readings(6000)
    t = np.arange(6000) * 0.01
    for name, stamps in (
        ("tick", np.floor(t * 128) / 128),
        ("float32", (80000.0 + t).astype(np.float32).astype(float)),
    ):
        path = write(tmp_path / f"{name}.csv", PLAIN, columns(stamps, gyro, accel))
        log = right(read_imu(path, rig()), samples=6000)
        assert not any("gap" in text for text in log.warnings)


def test_repeated_stamps_are_kept_and_identical_records_dropped(tmp_path):
    gyro, accel = readings()
    stamps = T.copy()
    stamps[50:3000:50] = stamps[49:2999:50]
    path = write(tmp_path / "dup.csv", PLAIN, columns(stamps, gyro, accel), form="%.9g")
    right(read_imu(path, rig()))
    twice = np.sort(np.concatenate([np.arange(3000), [500, 1700]]))
    path = write(tmp_path / "rows.csv", PLAIN, columns(T[twice], gyro[twice], accel[twice]))
    log = right(read_imu(path, rig()))
    assert any("2 identical records repeat the one before. They are dropped" in t
               for t in log.warnings)  # fmt: skip


def test_counters_that_wrap_are_unrolled_and_a_restart_is_named(tmp_path):
    gyro, accel = readings()
    k = np.arange(3000)
    for name, cells in (
        ("time [us]", [str((2**32 - 15_000_000 + 10_000 * i) % 2**32) for i in k]),
        ("time [s]", [f"{(604800 - 15 + 0.01 * i) % 604800:.2f}" for i in k]),
        ("time [ms]", [str((2**24 - 15_000 + 10 * i) % 2**24) for i in k]),
    ):
        path = write(tmp_path / "wrap.csv", [name, *AXES], columns(cells, gyro, accel))
        log = right(read_imu(path, rig()))
        assert any("starts again after" in text and "unrolled" in text for text in log.warnings)
    stamps = np.where(k < 1500, T, T - 14.987)
    path = write(tmp_path / "reboot.csv", PLAIN, columns(stamps, gyro, accel))
    text = advice(path)
    assert "row 1502: time: time goes back by" in text
    assert "probably a restart of the logger; split the log at this row" in text
    right(read_imu(path, rig(clock="count")))


@pytest.mark.parametrize("form", ["T%H:%M:%S.%fZ", "T%H:%M:%S.%f", " %H:%M:%S.%f", "/", "hms", "m"])
def test_dates_and_times_of_day_are_read(tmp_path, form):
    from datetime import datetime, timedelta

    gyro, accel = readings()
    start = datetime(2025, 10, 11, 9, 59, 50)
    stamps = [start + timedelta(milliseconds=10 * k) for k in range(3000)]
    if form == "hms":
        cells = [s.strftime("%H:%M:%S.%f")[:-3] for s in stamps]
    elif form == "m":
        cells = [f"{s.minute + 60 * s.hour}:{s.second:02d}.{s.microsecond // 1000:03d}"
                 for s in stamps]  # fmt: skip
    elif form == "/":
        cells = [s.strftime("%Y/%m/%d %H:%M:%S.%f") for s in stamps]
    else:
        cells = [s.strftime(f"%Y-%m-%d{form}") for s in stamps]
    path = write(tmp_path / "iso.csv", ["time", *AXES], columns(cells, gyro, accel))
    right(read_imu(path, rig()))


def test_stamps_with_too_few_digits_say_so(tmp_path):
    gyro, accel = readings()
    cells = [str(1593335798 + k // 100) for k in range(3000)]
    path = write(tmp_path / "epoch.csv", ["time", *AXES], columns(cells, gyro, accel))
    text = advice(path)
    assert "time stamps have steps of 1 s for" in text
    assert 'set [imu] clock = "count", or write more digits' in text
    assert "row" not in text.split(": ", 1)[1].partition("rows each")[0]
    # Thirty steps of 1 s show the rate to 0.5 %.
    log = read_imu(path, rig(clock="count"))
    assert 1.0 / log.interval == pytest.approx(100.0, rel=5e-3)
    path = write(tmp_path / "sci.csv", ["time [ns]", *AXES],
                 columns(["1.59334e+18"] * 3000, gyro, accel))  # fmt: skip
    assert 'clock = "count" and [imu] rate' in advice(path)
    right(read_imu(path, rig(clock="count", rate=100.0)))
    names = ["sec", "nanosec", *AXES]
    pair = [[str(1593335798 + k // 100) for k in range(3000)],
            [str(k % 100 * 10_000_000) for k in range(3000)]]  # fmt: skip
    path = write(tmp_path / "ros.csv", names, [*pair, *gyro.T, *accel.T])
    right(read_imu(path, rig()))
    right(read_imu(path, rig(columns={"time": ["sec", "nanosec"]})))
    assert 'columns = { time = ["sec", "nanosec"] }' in advice(path, rig(columns={"time": "sec"}))


@pytest.mark.parametrize("parts", [("sec", "nsec", 10_000_000), ("a", "b", 10_000),
                                   ("a", "b", 10_000_000), ("secs", "ms", 10)])  # fmt: skip
def test_seconds_since_power_on_are_no_gps_week(tmp_path, parts):
    gyro, accel = readings()
    seconds, part, step = parts
    pair = [[str(k // 100) for k in range(3000)], [str(k % 100 * step) for k in range(3000)]]
    path = write(tmp_path / "uptime.csv", [seconds, part, *AXES], [*pair, *gyro.T, *accel.T])
    for names in ([seconds, part], [1, 2]):
        log = right(read_imu(path, rig(columns={"time": names})))
        assert log.interval == pytest.approx(0.01, rel=1e-9)


def test_a_log_without_time_takes_the_rate_of_the_rig(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "none.csv", AXES, columns(T, gyro, accel)[1:])
    assert "no time column" in advice(path)
    assert "set [imu] rate" in advice(path)
    right(read_imu(path, rig(rate=100.0)))
    lost = np.delete(np.arange(3000), [1000, 1001])
    cells = columns([str(k + 3) for k in lost], gyro[lost], accel[lost])
    path = write(tmp_path / "counter.csv", ["Packet number", *AXES], cells)
    assert "Packet number counts records; set [imu] rate" in advice(path)
    for setup in (rig(rate=100.0), rig(rate=100.0, columns={"time": "Packet number"})):
        log = right(read_imu(path, setup))
        assert np.flatnonzero(log.missing).tolist() == [1000, 1001]
    named = write(tmp_path / "named.csv", ["time", *AXES], cells)
    assert "time counts records (steps of 1)" in advice(named)


def test_an_xsens_export_counts_packets_at_its_sampling_rate(tmp_path):
    gyro, accel = readings()
    head = "// Start Time: Unknown\n// Sampling Rate: 100Hz\n"
    names = ["PacketCounter", "SampleTimeFine", *(f"Acc_{a}" for a in "XYZ")]
    names += [f"Gyr_{a}" for a in "XYZ"]
    cells = [[f"{k:05d}" for k in range(3000)], [""] * 3000, *accel.T, *gyro.T]
    path = write(tmp_path / "mtw.txt", names, cells, delimiter="\t", head=head)
    for setup in (rig(format="xsens"), rig()):
        right(read_imu(path, setup))
