"""Faults of plain logs: one line that names the row and the column."""

import gzip

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rotcli.errors import LogError
from rotcli.logs.imu import read_imu
from rotcli.logs.table import read_table
from tests.logs.test_imu import HEADER, NAMES, RIG, changed, parquet, put, rows, text

FAULTS = {
    "text": (
        changed(5, 2, "abc"),
        r"row 5: gyro_y: 'abc' is not a number; correct or remove the row",
    ),
    "underscore": (changed(5, 2, "1_0"), r"row 5: gyro_y: '1_0' is not a number"),
    "hexadecimal": (changed(5, 2, "0x1"), r"row 5: gyro_y: '0x1' is not a number"),
    "empty cell": (changed(6, 4, ""), r"row 6: accel_x: an empty cell; correct or remove"),
    "nan": (changed(7, 1, "nan"), r"row 7: gyro_x: nan is not a finite number; correct or remove"),
    "inf": (changed(7, 1, "-inf"), r"row 7: gyro_x: -inf is not a finite number"),
    "overflow": (changed(7, 1, "1e999"), r"row 7: gyro_x: inf is not a finite number"),
    "nan time": (changed(7, 0, "nan"), r"row 7: time: nan is not a finite number"),
    "too few": (
        text([*rows(), "0.10,1,2"]),
        r"row 12: 3 values, the header has 7: the row is truncated",
    ),
    "too many": (
        changed(3, 2, "1,5"),
        r"row 3: 8 values, the header has 7: the row has one comma too many",
    ),
    "back": (
        changed(5, 0, "0.01"),
        r"row 5: time: time goes back by 0.01 s, probably a restart of the logger; split",
    ),
    "repeated": (changed(5, 0, "0.02"), r"row 5: time: time repeats the previous stamp in 1 row"),
    "blank before back": (
        text(["", *rows()[:3], "", "0.01,1,2,3,4,5,6"]),
        r"row 7: time: time goes back by 0.01 s",
    ),
    "empty": (b"", r"imu.csv: the file is empty"),
    "blank": (b"\n\n", r"the file is empty"),
    "header only": (text([]), r"no data rows below the header; at least 2 are needed"),
    "header without line end": (HEADER.encode(), r"no data rows below the header"),
    "one row": (text(rows(1)), r"only 1 data row below the header"),
    "binary": (bytes(range(256)) * 20, r"neither CSV .* nor Parquet; is this the right file\?"),
    "latin": ("time,gyro_x [°/s]\n1,2\n".encode("latin-1"), r"no columns gyro_y, gyro_z, accel_x"),
    "no header": (
        "\n".join(rows()).encode(),
        r"row 1: no header line, 7 columns of numbers; add one or set",
    ),
    "missing column": (
        text(rows(), HEADER.replace("gyro_y", "Gyr_Y")),
        r'no column gyro_y .*; set \[imu\] columns = \{ gyro_y = "Gyr_Y" \}',
    ),
    "twice": (
        text(rows(), HEADER.replace("gyro_y", "gyro_x [deg/s]")),
        r"gyro_x: two columns have",
    ),
    "unit": (
        text(rows(), HEADER.replace("gyro_y", "gyro_y [furlong]")),
        r"gyro_y \[furlong\]: unknown unit 'furlong'; set .* Known units: rad/s, deg/s",
    ),
    "table log": (
        b"time,angle\n0,0\n1,1\n",
        r"looks like a table log.*IMU_LOG TABLE_LOG swapped\?",
    ),
    "cut gzip": (gzip.compress(text(rows(999)))[:-20], r"the compressed file is truncated"),
    "cut zstd": (
        pa.compress(text(rows(999)), "zstd", asbytes=True)[:-20],
        r"the compressed file is truncated",
    ),
    "cut Parquet": (b"PAR1" + b"\x00" * 50, r"cannot be read: .*Parquet.*the file may be damaged"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_log_is_reported_in_one_line(tmp_path, fault):
    content, what = FAULTS[fault]
    path = put(tmp_path, content)
    with pytest.raises(LogError, match=what) as caught:
        read_imu(path, RIG)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) - len(str(path)) < 300


PARQUET_FAULTS = {
    "strings": ({"gyro_y": pa.array(list("abcde"))}, r"gyro_y: contains string, not numbers"),
    "nested": ({"gyro_y": pa.array([[1.0]] * 5)}, r"gyro_y: contains list<.*>, not numbers"),
    "booleans": ({"gyro_y": pa.array([True] * 5)}, r"gyro_y: contains bool, not numbers"),
    "null": ({"gyro_y": pa.array([1.0, None, 2, 3, 4])}, r"row 2: gyro_y: an empty cell \(null\)"),
    "nan": ({"gyro_y": pa.array([1, 2, 3, np.nan, 4])}, r"row 4: gyro_y: nan is not a finite"),
    "back": ({"time": pa.array([0.0, 1, 2, 1, 4])}, r"row 4: time: time goes back by 1 s"),
}


@pytest.mark.parametrize("fault", PARQUET_FAULTS)
def test_faulty_parquet_is_reported_with_its_record(tmp_path, fault):
    replaced, what = PARQUET_FAULTS[fault]
    with pytest.raises(LogError, match=what) as caught:
        read_imu(parquet(tmp_path, **replaced), RIG)
    assert "\n" not in str(caught.value)


def test_truncated_parquet_and_too_few_records(tmp_path):
    complete = parquet(tmp_path).read_bytes()
    with pytest.raises(LogError, match="the file may be damaged"):
        read_imu(put(tmp_path, complete[:-30], "a.parquet"), RIG)
    path = tmp_path / "b.parquet"
    pq.write_table(pa.table({n: pa.array([1.0]) for n in NAMES}), path)
    with pytest.raises(LogError, match="only 1 data row; at least 2 are needed"):
        read_imu(path, RIG)


def test_fault_far_down_a_long_log_is_found(tmp_path):
    lines = rows(60000)
    lines[50000] = lines[50000].replace(",2,", ",2x,")
    with pytest.raises(LogError, match="row 50002: gyro_y: '2x' is not a number"):
        read_imu(put(tmp_path, text(lines)), RIG)


def test_one_file_for_both_logs_is_reported(tmp_path):
    imu = put(tmp_path, text(rows()))
    with pytest.raises(LogError, match="are the same file, and it is an IMU log; name both logs"):
        read_table(imu, RIG, imu_log=imu)
    table = put(tmp_path, text(["0,0", "1,1"], "time,angle"), "table.csv")
    with pytest.raises(LogError, match="are the same file, and it is a table log"):
        read_imu(table, RIG, table_log=table)
    with pytest.raises(LogError, match="swapped"):
        read_imu(table, RIG, table_log=imu)


def test_unreadable_files_are_reported(tmp_path, monkeypatch):
    with pytest.raises(
        LogError, match=r"none\.csv: cannot be read: No such file or directory; check the path$"
    ):
        read_imu(tmp_path / "none.csv", RIG)
    with pytest.raises(LogError, match="cannot be read: Is a directory"):
        read_imu(tmp_path, RIG)

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    path = put(tmp_path, text(rows()))
    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(LogError, match=r"cannot be read: Permission denied; check the file.s perm"):
        read_imu(path, RIG)


def test_table_log_given_as_imu_log_the_other_way_round(tmp_path):
    with pytest.raises(
        LogError, match="looks like an IMU log; is the order IMU_LOG TABLE_LOG swapped"
    ):
        read_table(put(tmp_path, text(rows())), RIG)
