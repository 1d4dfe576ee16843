"""Recorded logs are read as they are."""

from itertools import pairwise

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.imu import read_imu
from rotcli.logs.table import read_table
from rotcli.rig.rig import default_rig, read_rig, rig_from_dict
from tests.recorded import downloaded, shared


@pytest.mark.parametrize("name", ["yaw_slow", "pitch_slow"])
def test_the_swinging_mpu6050_is_read_as_its_logger_wrote_it(name):
    folder = shared("data", "uiuc_mpu6050_swing", name)
    rig = read_rig(folder / "rig.toml")
    log = read_imu(folder / "imu.csv", rig, max_gap=None)
    table = read_table(folder / "table.csv", rig)
    assert 1.0 / log.interval == pytest.approx(100.0, rel=2e-3)
    text = (folder / "imu.csv").read_text().splitlines()[1:]
    stamps = [line.partition(",")[0] for line in text]
    twice = [a == b for a, b in pairwise(text)]
    # Every record that is no repetition is a sample; skipped stamps are gaps.
    assert log.rows == len(text) - sum(twice)
    span = float(stamps[-1]) - float(stamps[0])
    assert log.samples == pytest.approx(span / log.interval + 1, abs=1)
    assert any("identical record" in warning for warning in log.warnings) == any(twice)
    assert np.all(np.diff(table.time) > 0.0)
    assert np.ptp(table.angle) > np.radians(170.0)


def test_the_recorded_xsens_log_causes_no_warning_of_its_layout():
    log = read_imu(shared("data", "xsens_mti_multiposition.csv"), default_rig(), max_gap=None)
    assert 1.0 / log.interval == pytest.approx(100.0, rel=1e-3)
    assert not any("unit" in text or "counted" in text or "count" in text for text in log.warnings)


# File; [imu] keys; records, rate in Hz; size of gravity at the start, m/s^2, where it is at rest.
OTHER_DEVICES = [
    ("data_ngimu/sensors.csv", {}, 499, 49.91, 9.91),
    ("data_xio3/Inertial.csv", {}, 500, 49.91, 9.78),
    ("data_xio/00033_CalInertialAndMag.csv", {"rate": 256}, 12626, 256.0, None),
    ("data_xsens.txt", {}, 953, 50.0, None),
    ("data_xsens2.txt", {}, 3511, 120.0, 9.74),
    ("walking_xsens_upperLeg.txt", {}, 3511, 120.0, 9.79),
    ("data_yei.txt", {}, 2715, 109.95, 9.82),
]


@pytest.mark.parametrize(("name", "keys", "records", "rate", "gravity"), OTHER_DEVICES)
def test_recorded_logs_of_other_devices_are_read(name, keys, records, rate, gravity):
    log = read_imu(downloaded(name), rig_from_dict({"imu": keys}), max_gap=None)
    assert log.rows == records
    assert 1.0 / log.interval == pytest.approx(rate, rel=1e-3)
    if gravity is not None:  # accelerometers as they come: to 2 %
        size = float(np.median(np.linalg.norm(log.accel[:40], axis=1)))
        assert size == pytest.approx(gravity, rel=0.02)


def test_recorded_counts_without_a_header_lead_to_columns_scale_and_rate():
    path = downloaded("data_polulu.txt")
    columns = {"accel_x": 1, "accel_y": 2, "accel_z": 3, "gyro_x": 4, "gyro_y": 5, "gyro_z": 6}
    with pytest.raises(LogError, match=r"no time column .* raw counts \(gravity is 164\d\d counts"):
        read_imu(path, rig_from_dict({"imu": {"columns": columns}}))
    scale = {"gyro": 0.00875, "accel": 6.1e-5}  # of the data sheet: deg/s and g per count
    keys = {"columns": columns, "rate": 100, "scale": scale}
    log = read_imu(path, rig_from_dict({"imu": keys | {"units": {"gyro": "deg/s", "accel": "g"}}}))
    assert log.samples == 3653
    assert np.linalg.norm(log.accel[:100].mean(axis=0)) == pytest.approx(9.8, rel=0.02)
