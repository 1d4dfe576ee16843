"""`rotcli inspect`: everything about a log on one screen, and a rig that reads it."""

import json

import numpy as np

from rotcli.logs import inspect, stream
from rotcli.logs.imu import read_imu, write_columns
from rotcli.rig.rig import read_rig
from tests.logs.lab_logs import AXES, T, columns, readings, write

DEG = np.pi / 180


def test_a_clean_run_has_no_problems_and_shows_its_segments(rotcli, turning):
    done = rotcli("inspect", turning / "imu.parquet", turning / "table.parquet")
    assert done.status == 0, done.err
    assert done.out.count("no problems") == 2
    assert "gyro_x [rad/s]" in done.out
    assert ": still" in done.out
    assert ": 60 deg/s" in done.out
    assert "gyro rates per table rate" in done.out
    assert "warnings" not in done.out


def test_all_problems_are_listed_at_once_each_with_its_line(rotcli, tmp_path):
    gyro, accel = readings()
    raw = np.rint(np.hstack([gyro / DEG * 131, accel / 9.80665 * 4096]))
    cells = [[str(k) for k in range(3000)], *([f"{v:.0f}" for v in c] for c in raw.T)]
    path = write(tmp_path / "odd.csv", ["sample", *AXES], cells)
    done = rotcli("inspect", path)
    assert done.status == 0
    assert "1. no time column; sample counts records; set [imu] rate = 100.0" in done.out
    assert "2. the readings are integers: raw counts" in done.out
    one = rotcli("allan", path)
    assert one.status == 1
    assert "2 problems: (1) no time column" in one.err


def test_the_starter_rig_reads_the_log(rotcli, tmp_path):
    gyro, accel = readings()
    stamps = np.where(T < 15.0, T, T - 14.987)
    path = write(tmp_path / "imu.csv", ["time", *AXES], columns(stamps, gyro, accel / 9.80665))
    rig = tmp_path / "starter.toml"
    done = rotcli("inspect", path, "--write-rig", rig)
    assert done.status == 0, done.err
    text = rig.read_text()
    assert 'clock = "count"  # time goes back' in text
    assert "# latitude = ?" in text
    log = read_imu(path, read_rig(rig))
    assert log.samples == 3000
    np.testing.assert_allclose(log.accel, accel, rtol=1e-6)
    again = rotcli("inspect", path, "--write-rig", rig)
    assert again.status == 1
    assert "exists; choose another name" in again.err


def test_the_result_is_json_with_machine_readable_lines(rotcli, tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "imu.csv", AXES, columns(T, gyro, accel)[1:])
    out = tmp_path / "i.json"
    assert rotcli("inspect", path, "-o", out).status == 0
    doc = json.loads(out.read_text())
    (log,) = doc["logs"]
    assert doc["kind"] == "inspection"
    assert log["problems"][0]["rig"] == {"imu": {"rate": 100.0}}
    assert log["clock"]["records"] == 3000
    assert [row["channel"] for row in log["channels"]] == ["time", *AXES]


def test_reversed_and_wrongly_scaled_runs_are_named(rotcli, tmp_path):
    t = np.arange(0.0, 60.0, 0.02)
    angle = np.where(t < 20, 0.0, 20 * (t - 20))
    rate = np.where(t < 20, 0.0, -20.0)
    rng = np.random.default_rng(1)
    gyro = rng.normal(0.0, 0.05, (len(t), 3)) + np.outer(rate, [0, 0, 1])
    names = ["time [s]", *(f"gyro_{a} [rad/s]" for a in "xyz"), *(f"accel_{a} [g]" for a in "xyz")]
    accel = rng.normal(0.0, 1e-3, (len(t), 3)) - [0, 0, 1]
    write_columns(tmp_path / "imu.csv", dict(zip(names, [t, *gyro.T, *accel.T], strict=True)))
    write_columns(tmp_path / "table.csv", {"time [s]": t, "angle [deg]": angle})
    done = rotcli("inspect", tmp_path / "imu.csv", tmp_path / "table.csv")
    assert "57.3 times the table rate" in done.out
    assert "opposite sense, and gravity along the axis is reversed too" in done.out
    assert 'set [imu] frame = "frd"; if the accelerometers report gravity' in done.out


def test_logs_that_do_not_overlap_get_the_offset(rotcli, tmp_path):
    gyro, accel = readings()
    names = ["time [s]", *(f"gyro_{a} [rad/s]" for a in "xyz"), *AXES[3:]]
    write(tmp_path / "imu.csv", names, columns(1.7e9 + T, gyro, accel), form="%.15g")
    write(tmp_path / "table.csv", ["time [s]", "angle [deg]"], [T, 0 * T])
    done = rotcli("inspect", tmp_path / "imu.csv", tmp_path / "table.csv")
    assert "set [table] time_offset = 1700000000.000000" in done.out


def test_of_a_long_log_the_start_is_described_and_all_of_it_searched(rotcli, tmp_path, monkeypatch):
    gyro, accel = readings()
    path = tmp_path / "imu.parquet"
    names = ["time [s]", *(f"{axis} [rad/s]" for axis in AXES[:3]), *AXES[3:]]
    content = dict(zip(names, [T, *gyro.T, *accel.T], strict=True))
    write_columns(path, content)
    complete = json.loads(rotcli("inspect", path, "-o", "-").out)["logs"][0]
    monkeypatch.setattr(stream, "MAX_IN_MEMORY_RECORDS", 200)
    monkeypatch.setattr(inspect, "MAX_IN_MEMORY_RECORDS", 200)
    begun = json.loads(rotcli("inspect", path, "-o", "-").out)["logs"][0]
    assert begun["clock"] == complete["clock"]
    means = "mean gyro rates at the start (deg/s)"
    assert begun["readings"][means] == complete["readings"][means]
    assert "the first 1000 of 3000 samples" in begun["warnings"][0]
    assert not complete["warnings"]
    content["accel_z"] = np.append(content["accel_z"][:-1], np.nan)
    write_columns(path, content)
    assert "row 3000: accel_z: nan" in rotcli("inspect", path).out
