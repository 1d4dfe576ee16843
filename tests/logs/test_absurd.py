"""Numbers that no clock, sensor or vehicle makes are refused at the door, by row and column."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.files.columns import write_columns
from rotcli.logs import stream
from rotcli.logs.imu import read_imu, read_reference
from rotcli.logs.table import read_table
from rotcli.logs.timing.clock import fit_sample_clock
from rotcli.rig.rig import Rig

NAMES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


def imu(path, n=400, **changed):
    rng = np.random.default_rng(1)
    columns = {"time [s]": 0.01 * np.arange(n)}
    columns |= {name: rng.normal(size=n) for name in NAMES}
    for name, (row, value) in changed.items():
        columns["time [s]" if name == "time" else name][row] = value
    write_columns(path, columns)
    return path


IMU = {
    "gyro": ({"gyro_y": (7, 1e200)}, "row 8: gyro_y: 1e\\+200 rad/s is impossible for a gyro"),
    "accel": ({"accel_z": (7, -1.7e308)}, "row 8: accel_z: -1.7e\\+308 m/s\\^2 is impossible for"),
    "the first of two": (
        {"accel_x": (9, 1e9), "gyro_z": (8, 1e9)}, "row 9: gyro_z: 1e\\+09 rad/s",
    ),
    "late": ({"time": (399, 1e300)}, "row 400: time: 1e\\+300 .* not a time of a clock"),
    "early": ({"time": (0, -1e17)}, "row 1: time: -1e\\+17 s is not a time of a clock"),
}  # fmt: skip


@pytest.mark.parametrize("name", IMU)
@pytest.mark.parametrize("loaded", [True, False])
def test_absurd_readings_and_times_are_refused(name, loaded, tmp_path, monkeypatch):
    changed, says = IMU[name]
    path = imu(tmp_path / "imu.parquet", **changed)
    monkeypatch.setattr(stream, "MAX_IN_MEMORY_RECORDS", 10**9 if loaded else 100)
    monkeypatch.setattr(stream, "CHUNK_SAMPLES", 100)
    with pytest.raises(LogError, match=says):
        stream.open_imu(path, Rig(), max_gap=None)


@pytest.mark.parametrize("loaded", [True, False])
def test_stamps_within_an_instant_are_refused(loaded, tmp_path, monkeypatch):
    path = imu(tmp_path / "imu.csv")
    columns = {"time [s]": 5e-320 * np.arange(1, 401)} | {name: np.ones(400) for name in NAMES}
    write_columns(path, columns)
    monkeypatch.setattr(stream, "MAX_IN_MEMORY_TEXT", {"csv": 10**9 if loaded else 100})
    with pytest.raises(LogError, match="inf records per second, expected 1 to 20000"):
        stream.open_imu(path, Rig())


def test_a_first_stamp_next_to_which_the_others_lose_their_digits_makes_no_line():
    time = np.concatenate([[-9e10], 1e-6 * np.arange(1, 200)])
    assert fit_sample_clock(time) is None


def test_absurd_angles_and_references_are_refused(tmp_path):
    table = tmp_path / "table.csv"
    time = {"time [s]": 0.02 * np.arange(50)}
    write_columns(table, {**time, "angle [deg]": 1e308 * (-1.0) ** np.arange(50)})
    with pytest.raises(
        LogError, match=r"row 2: angle: 1e\+308 deg is impossible for a table angle"
    ):
        read_table(table, Rig())
    path = tmp_path / "gnss.csv"
    for name, value, says in (
        (
            "latitude",
            42.3,
            "row 2: latitude: 42.3 rad is impossible .*; remove the row or set",
        ),
        (
            "v_east [m/s]",
            1e300,
            "row 2: v_east: 1e\\+300 m/s is impossible for a velocity of a vehicle",
        ),
        ("height [m]", -1e9, "row 2: height: -1e\\+09 m is impossible for a height of a vehicle"),
    ):
        write_columns(path, {**time, name: np.full(50, value)})
        with pytest.raises(LogError, match=says):
            read_reference(path)
    write_columns(path, {"time": 1e18 + 1e9 * np.arange(50), "v_up [m/s]": np.zeros(50)})
    with pytest.raises(LogError, match=r"set .reference. units = { time = .ns. }"):
        read_reference(path)
    with pytest.raises(LogError, match="raise the limit"):
        read_reference(path, max_bytes=100)


@pytest.mark.parametrize("digit", ["１", "٣"])
def test_digits_of_other_scripts_are_no_numbers(digit, tmp_path):
    path = tmp_path / "imu.csv"
    path.write_text("time," + ",".join(NAMES) + "\n" + f"0,1,1,1,1,1,{digit}\n1,1,1,1,1,1,1\n")
    with pytest.raises(LogError, match=f"row 2: accel_z: '{digit}' is not a number"):
        read_imu(path, Rig())
