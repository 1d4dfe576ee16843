"""Text of every dialect, and lines of vendors: each is read right or says how."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rotcli.files.formats.novatel import IMU_SCALES
from rotcli.logs.imu import read_imu
from rotcli.logs.table import read_table
from rotcli.rig.rig import default_rig
from tests.logs.lab_logs import AXES, DEG, PLAIN, N, T, advice, columns, readings, rig, right, write


def test_an_xsens_dot_log_is_read_in_microseconds_under_either_name(tmp_path):
    gyro, accel = readings()
    t = [str(4_000_000_000 + round(k * 1e6 / 120)) for k in range(3000)]
    names = ["PacketCounter", "SampleTimeFine", *(f"Euler_{a}" for a in "XYZ")]
    names += [f"Acc_{a}" for a in "XYZ"] + [f"Gyr_{a}" for a in "XYZ"]
    cells = [[str(k) for k in range(3000)], t, *3 * [["0.1"] * 3000], *accel.T, *(gyro / DEG).T]
    path = write(tmp_path / "dot.csv", names, cells)
    own = {"time": "us", "gyro": "deg/s"}
    for setup in (rig(), rig(format="xsens"), rig(format="xsens", units=own), rig(units=own)):
        # White noise for 100 Hz at 120 Hz.
        right(read_imu(path, setup), rate=120.0, n=N * np.sqrt(100 / 120))


@pytest.mark.parametrize(
    "head",
    ["sep=,\n", "# PicoQuake\n# rate = 100 Hz\n\n", "FILE_INFO\nSep=comma\n\nModel,GX3\n\nDATA\n"],
)
def test_lines_above_the_header_are_passed(tmp_path, head):
    gyro, accel = readings()
    path = write(tmp_path / "head.csv", PLAIN, columns(T, gyro, accel), head=head)
    right(read_imu(path, rig()))


@pytest.mark.parametrize(
    ("unit", "size"), [("dps", DEG), ("mdps", DEG / 1e3), ("deg/sec", DEG), ("rad/sec", 1.0)]
)
def test_the_units_of_data_sheets_are_known(tmp_path, unit, size):
    gyro, accel = readings()
    names = ["time [s]", *(f"gyro_{a} [{unit}]" for a in "xyz"), *AXES[3:]]
    right(read_imu(write(tmp_path / "u.csv", names, columns(T, gyro / size, accel)), rig()))


def test_decimal_commas_and_a_comma_after_each_row_are_read(tmp_path):
    gyro, accel = readings()
    cells = [[f"{v:.9g}".replace(".", ",") for v in column] for column in
             columns(T, gyro, accel)]  # fmt: skip
    path = write(tmp_path / "de.csv", PLAIN, cells, delimiter=";")
    for setup in (rig(), rig(delimiter=";"), rig(delimiter=";", decimal=",")):
        right(read_imu(path, setup))
    path = write(tmp_path / "end.csv", PLAIN, columns(T, gyro, accel), end=",")
    right(read_imu(path, rig()))


def test_sentences_with_checksums_are_read(tmp_path):
    gyro, accel = readings()
    rows = [
        f"{t:.3f},$VNYMR,+100.9,-007.3,+000.7,-00.1,-00.2,+00.5,{a[0]:+.5f},{a[1]:+.5f},"
        f"{a[2]:+.5f},{w[0]:+.7f},{w[1]:+.7f},{w[2]:+.7f}*{k % 256:02X}\n"
        for k, (t, w, a) in enumerate(zip(T, gyro, accel, strict=True))
    ]
    path = tmp_path / "vn.txt"
    path.write_text("".join(rows))
    named = dict(zip(("time", *AXES), (1, 12, 13, 14, 9, 10, 11), strict=True))
    for setup in (rig(), rig(format="vectornav"), rig(columns=named)):
        right(read_imu(path, setup))
    path.write_text("".join(row.partition(",")[2] for row in rows))
    assert "no time column" in advice(path)
    right(read_imu(path, rig(rate=100.0)))


@pytest.mark.parametrize("message", ["RAWIMUSA", "RAWIMUSXA"])
def test_novatel_counts_take_the_scale_of_their_imu(tmp_path, message):
    gyro, accel = readings()
    _, one, other = IMU_SCALES[13]  # IMU-FSAS
    w, f = np.rint(gyro / 100 / one).astype(int), np.rint(accel / 100 / other).astype(int)
    info = "00,13," if message == "RAWIMUSXA" else ""
    path = tmp_path / "imu.asc"
    path.write_text(
        "".join(
            f"%{message},1815,{407772 + t:.3f};{info}1815,{407772 + t:.9f},00000077,"
            f"{a[2]},{-a[1]},{a[0]},{g[2]},{-g[1]},{g[0]}*9e3779b1\n"
            for t, g, a in zip(T, w, f, strict=True)
        )
    )
    setup = rig()
    if message == "RAWIMUSA":
        text = advice(path)
        assert "not the type of the IMU; set [imu] scale" in text
        assert "for IMU-FSAS" in text
        setup = rig(scale={"gyro": one, "accel": other})
    log = right(read_imu(path, setup))
    assert log.sampling == "average"
    # Increments are counts: half a count of 1.9e-9 rad in 10 ms.
    np.testing.assert_allclose(log.gyro, gyro, atol=100 * one)


def test_a_novatel_message_that_is_cut_short_is_named(tmp_path):
    message = "%RAWIMUSA,2000,345600.00;2000,345600.0{},00000077,1638,-20,30,1,2,3*aabbccdd\n"
    path = tmp_path / "imu.asc"
    path.write_text("".join(message.format(k) for k in range(9)) + "%RAWIMUSA,2000,3456*aabbccdd\n")
    assert "for LN200" in advice(path)
    assert "row 10" in advice(path, rig(scale={"gyro": 2.0**-19, "accel": 2.0**-14}))


def test_two_logs_in_one_file_with_blank_cells_are_both_read(tmp_path):
    gyro, accel = readings()
    rows = [f"{t:.3f},{','.join(format(v, '.9g') for v in (*w, *a))}," for t, w, a in
            zip(T, gyro, accel, strict=True)]  # fmt: skip
    angles = [f"{t:.3f},,,,,,,{20 * t:.4f}" for t in T[::4] + 0.001]
    path = tmp_path / "both.csv"
    lines = sorted([*rows, *angles], key=lambda row: float(row.partition(",")[0]))
    head = ",".join(["time [s]", *AXES, "angle [deg]"])
    path.write_text("\n".join([head, *lines, ""]))
    right(read_imu(path, rig()))
    table = read_table(path, default_rig())
    np.testing.assert_allclose(table.angle, 20 * DEG * table.time, atol=0.03 * DEG)
    arrays = [pa.array([float(c) if c else None for c in column]) for column in
              zip(*(line.split(",") for line in lines), strict=True)]  # fmt: skip
    pq.write_table(pa.table(arrays, names=head.split(",")), tmp_path / "both.parquet")
    right(read_imu(tmp_path / "both.parquet", rig()))


def test_an_open_quotation_mark_is_an_error_in_short_and_long_logs(tmp_path):
    gyro, accel = readings()
    for row in (5, 2900):
        path = write(tmp_path / "quote.csv", PLAIN, columns(T, gyro, accel))
        lines = path.read_text().splitlines()
        lines[row] = lines[row].replace(",", ',"', 1)
        path.write_text("\n".join(lines) + "\n")
        text = advice(path)
        assert "quotation mark is not" in text or "is not a number" in text
