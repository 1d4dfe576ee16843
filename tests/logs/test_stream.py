"""Long IMU logs read piece by piece."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs import stream
from rotcli.logs.files import read_imu, write_columns
from rotcli.logs.rig import default_rig, rig_from_dict
from rotcli.logs.stream import ImuStream

NAMES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


def columns(n=1000, dt=0.01, seed=0):
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((6, n))
    return {"time": dt * np.arange(n), **dict(zip(NAMES, values, strict=True))}


def joined(path, rig=None, **more):
    held = ImuStream(path, rig or default_rig(), **more)
    parts = list(held)
    return held, (np.concatenate([getattr(p, k) for p in parts]) for k in ("time", "gyro", "accel"))


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    monkeypatch.setattr(stream, "PIECE", 137)


@pytest.mark.parametrize("name", ["imu.parquet", "imu.csv", "imu.csv.gz"])
def test_the_pieces_together_are_the_whole_log(tmp_path, name):
    path = tmp_path / name
    write_columns(path, columns())
    whole = read_imu(path, default_rig())
    held, (time, gyro, accel) = joined(path)
    np.testing.assert_allclose(time, whole.time, atol=1e-9)
    np.testing.assert_array_equal(gyro, whole.gyro)
    np.testing.assert_array_equal(accel, whole.accel)
    assert (held.rows, held.time[0], held.warnings) == (1000, 0.0, [])
    assert held.time[1] == pytest.approx(9.99)


def test_units_mount_and_increments_are_applied(tmp_path):
    path = tmp_path / "imu.csv"
    data = columns()
    data = {"time [ms]": 1e3 * data.pop("time"), **data}
    write_columns(path, data)
    rig = rig_from_dict(
        {"imu": {"sampling": "increment", "mount": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]}}
    )
    whole = read_imu(path, rig)
    _, (_, gyro, accel) = joined(path, rig)
    np.testing.assert_allclose(gyro, whole.gyro, rtol=1e-9)
    np.testing.assert_allclose(accel, whole.accel, rtol=1e-9)


def test_gaps_within_and_between_pieces_are_bridged_by_straight_lines(tmp_path):
    path = tmp_path / "imu.parquet"
    data = columns()
    kept = np.ones(1000, dtype=bool)
    kept[[50, 51, 137, 138]] = False  # records 135 and after make the second piece
    write_columns(path, {name: value[kept] for name, value in data.items()})
    held, (time, gyro, _) = joined(path)
    np.testing.assert_allclose(time, data["time"], atol=1e-9)
    x = data["gyro_x"]
    np.testing.assert_allclose(gyro[50, 0], x[49] + (x[52] - x[49]) / 3)
    assert len(gyro) == 1000
    assert any("2 gaps (4 samples) bridged, after 0.49 s (2)" in text for text in held.warnings)


def test_too_long_a_gap_names_its_row(tmp_path):
    path = tmp_path / "imu.csv"
    kept = np.r_[0:300, 320:1000]
    write_columns(path, {name: value[kept] for name, value in columns().items()})
    with pytest.raises(LogError, match=r"row 302: time: 20 samples missing after 2.99 s"):
        list(ImuStream(path, default_rig()))


@pytest.mark.parametrize("name", ["imu.csv", "imu.parquet"])
def test_a_number_that_is_not_finite_names_its_row(tmp_path, name):
    path = tmp_path / name
    data = columns()
    data["accel_y"][500] = np.nan
    write_columns(path, data)
    row = 502 if name.endswith("csv") else 501
    with pytest.raises(LogError, match=f"row {row}: accel_y"):
        list(ImuStream(path, default_rig()))


def test_text_in_a_cell_names_its_row(tmp_path):
    path = tmp_path / "imu.csv"
    write_columns(path, columns())
    lines = path.read_text().splitlines()
    lines[700] = lines[700].rsplit(",", 1)[0] + ",broken"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(LogError, match="row 701: accel_z: 'broken' is not a number"):
        list(ImuStream(path, default_rig()))


def test_time_that_goes_back_between_pieces_is_an_error(tmp_path):
    path = tmp_path / "imu.parquet"
    data = columns()
    data["time"][137:] -= 0.5
    write_columns(path, data)
    with pytest.raises(LogError, match="row 138: time: time goes back"):
        list(ImuStream(path, default_rig()))


def test_an_empty_log_is_an_error(tmp_path):
    path = tmp_path / "imu.parquet"
    write_columns(path, {name: value[:0] for name, value in columns().items()})
    with pytest.raises(LogError, match="no rows of numbers"):
        list(ImuStream(path, default_rig()))
