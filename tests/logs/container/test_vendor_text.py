"""Text of vendors: heads that name the columns, counters, messages of several kinds in one file."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.files.formats.novatel import IMU_SCALES
from rotcli.logs.imu import read_imu
from rotcli.rig.rig import default_rig
from tests.logs.lab_logs import G, columns, readings, right, write


def test_a_3_space_log_is_read_by_the_fields_of_its_head(tmp_path):
    gyro, accel = readings()
    fields = ["int(ChipTimeUS)", *(f"float(RawGyro{a})" for a in "XYZ")]
    fields += [*(f"float(RawCompass{a})" for a in "XYZ"), *(f"float(RawAccel{a})" for a in "XYZ")]
    head = '# Data format: "' + ",".join(f"%{field}" for field in fields) + '"\n'
    stamps = [str(90_000 + 10_000 * k) for k in range(3000)]
    cells = [stamps, *gyro.T, *np.zeros((3, 3000)), *(accel / G).T]
    log = right(read_imu(write(tmp_path / "y.txt", [], cells, head=head), default_rig()))
    np.testing.assert_allclose(log.accel, accel, rtol=1e-9)
    assert log.warnings == ()


def test_an_older_xsens_export_counts_its_records(tmp_path):
    gyro, accel = readings()
    head = "// Start Time: 0\n// Sample rate: 100.0Hz\n// Scenario: 4.9\n"
    names = ["Counter", *(f"Acc_{a}" for a in "XYZ"), *(f"Gyr_{a}" for a in "XYZ")]
    counts = [f"{(65_000 + k) % 65_536:5d}" for k in range(3000) if k not in (700, 701)]
    kept = np.delete(np.arange(3000), [700, 701])
    cells = [counts, *accel[kept].T, *gyro[kept].T]
    path = write(tmp_path / "x.txt", names, cells, head=head, delimiter="\t", end="\t")
    log = right(read_imu(path, default_rig()))
    assert "starts again after 2^16 ticks" in log.warnings[0]
    assert "1 gap (2 samples)" in log.warnings[1]


def _checked(body):
    total = 0
    for letter in body.encode():
        total ^= letter
    return f"${body}*{total:02X}\n"


def test_messages_of_other_kinds_among_those_of_the_imu_are_passed(tmp_path):
    gyro, accel = readings()
    lines = []
    for k, values in enumerate(np.hstack([accel, gyro])):
        if k % 20 == 7:
            lines.append(f"{0.01 * k:.2f}," + _checked("VNGPS,1,2,3"))
        body = "VNYMR,0,0,0,0,0,0," + ",".join(f"{v:+.7f}" for v in values)
        lines.append(f"{0.01 * k:.2f}," + _checked(body))
    path = tmp_path / "vn.txt"
    path.write_text("".join(lines))
    right(read_imu(path, default_rig()))
    _, rad, metre = IMU_SCALES[58]
    counts = np.diff(np.rint(np.cumsum(np.hstack([accel / metre, gyro / rad]) * 0.01, axis=0)),
                     axis=0, prepend=0.0).astype(int)  # fmt: skip
    lines = []
    for k, (ax, ay, az, wx, wy, wz) in enumerate(counts.tolist()):
        stamp = f"2300,{100 + 0.01 * k:.2f}"
        if k % 20 == 7:
            lines.append(f"#BESTPOSA,COM1,0,50.0,FINESTEERING,{stamp},0,0,0;1,2,3*0123abcd\n")
        values = f"{az},{-ay},{ax},{wz},{-wy},{wx}"
        lines.append(f"%RAWIMUSXA,{stamp};00,58,{stamp},00000077,{values}*0123abcd\n")
    path = tmp_path / "nov.asc"
    path.write_text("".join(lines))
    right(read_imu(path, default_rig()))
    lines[2000] = lines[2000][:40] + "\n"
    path.write_text("".join(lines))
    with pytest.raises(LogError, match=r"row 2001: .* the row is truncated"):
        read_imu(path, default_rig())


def test_columns_of_a_vectornav_csv_are_known(tmp_path):
    gyro, accel = readings()
    names = [
        "TimeStartup",
        *(f"UncompAccel.{a}" for a in "XYZ"),
        *(f"UncompGyro.{a}" for a in "XYZ"),
    ]
    stamps = [str(10**9 + 10**7 * k) for k in range(3000)]
    time, *rest = columns(stamps, gyro, accel)
    path = write(tmp_path / "v.csv", names, [time, *rest[3:], *rest[:3]])
    log = right(read_imu(path, default_rig()))
    np.testing.assert_allclose(log.accel, accel, rtol=1e-9)
