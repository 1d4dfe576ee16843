"""Quotation marks: right ones change nothing, a misplaced one is named with its row."""

import io

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.container import quotes
from rotcli.logs.container.opening import open_log
from rotcli.logs.imu import read_imu
from rotcli.logs.stream import open_imu
from rotcli.rig.rig import default_rig, rig_from_dict

NAMES = "time [s],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]," + ",".join(
    f"accel_{a} [m/s^2]" for a in "xyz"
)


def _rows(count=400):
    rng = np.random.default_rng(1)
    for k in range(count):
        values = [0.01 * k, *rng.normal(0, 1e-3, 3), *(rng.normal(0, 1e-2, 2)), 9.81]
        yield [f"{v:.9f}" for v in values]


def _write(path, rows, head=NAMES, sign=","):
    path.write_text("\n".join([head, *(sign.join(row) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_quoted_cells_are_the_same_log(tmp_path, end):
    rows = list(_rows())
    plain = read_imu(_write(tmp_path / "plain.csv", rows), default_rig())
    head = ",".join(f'"{name}"' for name in NAMES.split(","))
    text = end.join([head, *(",".join(f'"{v}"' for v in row) for row in rows)]) + end
    (tmp_path / "quoted.csv").write_text(text, newline="")
    quoted = read_imu(tmp_path / "quoted.csv", default_rig())
    np.testing.assert_array_equal(plain.gyro, quoted.gyro)


@pytest.mark.parametrize("cell", ['"{}', '{}"', '""{}', '1"{}', '"{}"1', '"""{}'])
@pytest.mark.parametrize("column", [0, 3, 6])
@pytest.mark.parametrize("k", [0, 200, 399])
def test_a_misplaced_mark_is_named_with_its_row(tmp_path, cell, column, k):
    rows = list(_rows())
    rows[k][column] = cell.format(rows[k][column])
    path = _write(tmp_path / "imu.csv", rows)
    for read in (read_imu, open_imu):
        with pytest.raises(LogError) as error:
            read(path, default_rig())
        assert f"row {k + 2}: " in str(error.value)
        assert "\n" not in str(error.value)


def test_marks_in_a_comment_are_no_cells(tmp_path):
    rows = list(_rows())
    path = _write(tmp_path / "imu.csv", rows)
    text = path.read_text().splitlines()
    text.insert(200, '# the 5" rod')
    path.write_text("\n".join(text) + "\n")
    rig = rig_from_dict({"imu": {"comment": "#"}})
    assert read_imu(path, rig).samples == 400


def test_a_stream_is_checked_across_its_blocks(tmp_path):
    rows = list(_rows())
    rows[100][2] = '"' + rows[100][2] + '"'
    header = open_log(_write(tmp_path / "imu.csv", rows))
    data = (tmp_path / "imu.csv").read_bytes()
    for size in (1, 7, 100, 4096):
        stream = quotes.CheckedStream(io.BytesIO(data), header)
        assert b"".join(iter(lambda s=stream, n=size: s.read(n), b"")) == data
    _write(tmp_path / "imu.csv", [*rows[:300], ['"' + rows[300][0], *rows[300][1:]], *rows[301:]])
    data = (tmp_path / "imu.csv").read_bytes()
    for size in (1, 7, 100, 4096, -1):
        stream = quotes.CheckedStream(io.BytesIO(data), header)
        with pytest.raises(LogError, match="row 302"):
            while stream.read(size):
                pass


def test_doubled_marks_within_a_text_are_right():
    boundary = quotes._boundaries(",")
    assert quotes._first_fault(b'1,"2",3\n"a ""b"" c",2\n', boundary) is None
    assert quotes._first_fault(b'1,2\n1,2\n"1,2\n', boundary) == 2
    assert quotes._first_fault(b'1,2\n1,"2"5\n', boundary) == 1
