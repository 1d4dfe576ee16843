"""Stamps and text of unusual forms: dates, days, single wrong stamps, comments, row numbers."""

import gzip
import json

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.files.time_text import is_stamp, nanoseconds
from rotcli.logs import stream
from rotcli.logs.imu import read_imu
from rotcli.logs.inspect import inspect_log
from rotcli.logs.stream import open_imu
from rotcli.rig.rig import default_rig
from tests.logs.lab_logs import PLAIN, T, advice, columns, readings, rig, right, write

DATES = [
    "05.03.2024 10:00:{:06.3f}",
    "05-Mar-2024 10:00:{:06.3f}",
    "3/5/2024 10:00:{:06.3f} AM",
    "2024/03/05 10:00:{:06.3f}",
    "2024-03-05T10:00:{:06.3f}+02:00",
    "10:00:{:06.3f}",
    "00:{:06.3f}",
]


@pytest.mark.parametrize("form", DATES)
def test_dates_of_many_programs_are_read(tmp_path, form):
    gyro, accel = readings()
    cells = columns([form.format(t) for t in T], gyro, accel)
    log = right(read_imu(write(tmp_path / "d.csv", ("time", *PLAIN[1:]), cells), default_rig()))
    assert log.time[-1] - log.time[0] == pytest.approx(29.99, abs=1e-6)


def test_the_forms_of_stamps_differ_from_numbers():
    assert nanoseconds(["10:00:00:250"])[0] == 36_000_250_000_000
    assert nanoseconds(["13.03.2024 00:00:00,5"])[0] == 1_710_288_000_500_000_000
    assert not any(map(is_stamp, ("12.5", "-3", "1e5", "12.05.2", "")))


def test_seconds_and_parts_of_a_second_take_the_unit_of_their_name_or_size(tmp_path):
    gyro, accel = readings()
    k = np.arange(3000)
    for names, size in ((("tv_sec", "tv_usec"), 10**4), (("S", "MS"), 10), (("a", "b"), 10**7)):
        stamps = [[str(1_700_000_000 + i // 100) for i in k], [str(i % 100 * size) for i in k]]
        path = write(tmp_path / "p.csv", [*names, *PLAIN[1:]], [*stamps, *gyro.T, *accel.T])
        setup = default_rig() if names[0] == "tv_sec" else rig(columns={"time": list(names)})
        assert not any("time" in text for text in right(read_imu(path, setup)).warnings)


def test_days_are_asked_for_and_read(tmp_path):
    gyro, accel = readings()
    cells = columns([f"{v:.12f}" for v in 45000 + T / 86400], gyro, accel)
    path = write(tmp_path / "x.csv", ("time", *PLAIN[1:]), cells)
    assert 'set [imu] units = { time = "d" }' in advice(path)
    right(read_imu(path, rig(units={"time": "d"})))
    assert inspect_log(path, default_rig()).rig == {"imu": {"units": {"time": "d"}}}


@pytest.mark.parametrize(("row", "stamp"), [(777, 0.0), (777, 99999.0), (0, -9e5)])
def test_a_single_wrong_stamp_is_named_and_is_no_restart(tmp_path, row, stamp):
    gyro, accel = readings()
    time = T.copy()
    time[row] = stamp
    path = write(tmp_path / "w.csv", PLAIN, columns(time, gyro, accel))
    text = advice(path)
    assert f"row {row + 2}: time: time " in text
    assert "does not fit the rows around it; remove this row" in text
    right(read_imu(path, rig(clock="count")))


@pytest.mark.parametrize("stamp", [2e11, -2e11])
def test_a_stamp_that_no_clock_shows_is_no_single_wrong_one(tmp_path, stamp):
    gyro, accel = readings()
    time = T.copy()
    time[777] = stamp
    text = advice(write(tmp_path / "w.csv", PLAIN, columns(time, gyro, accel)))
    assert "time goes back by 2e+11 s" in text
    assert "does not fit the rows around it" not in text


def test_records_out_of_order_are_no_restart(tmp_path):
    gyro, accel = readings()
    time = T.copy()
    for k in (300, 900, 1500, 2100):
        time[[k, k + 1]] = time[[k + 1, k]]
    path = write(tmp_path / "w.csv", PLAIN, columns(time, gyro, accel))
    text = advice(path)
    assert "time goes back in 4 rows, first by 0.01 s in row 303: records out of order" in text
    assert "restart" not in text
    right(read_imu(path, rig(clock="count")))


def test_a_counter_of_several_messages_is_counted_at_the_rate(tmp_path):
    gyro, accel = readings()
    counts = [str(3 * i // 2) for i in range(3000)]
    path = write(tmp_path / "c.csv", ("Packet number", *PLAIN[1:]), columns(counts, gyro, accel))
    assert "set [imu] rate = 100.0, with the sampling rate" in advice(path)
    right(read_imu(path, rig(rate=100)))
    named = read_imu(path, rig(rate=100, columns={"time": "Packet number"}))
    assert "increases unevenly, so it counts other records" in right(named).warnings[0]


def test_comments_amid_the_records_are_passed_or_named(tmp_path, monkeypatch):
    gyro, accel = readings()
    for row in (50, 2900):
        path = write(tmp_path / "c.csv", PLAIN, columns(T, gyro, accel))
        lines = path.read_text().splitlines()
        lines.insert(row, "# the operator was here")
        path.write_text("\n".join(lines) + "\n")
        right(read_imu(path, default_rig()))
    with monkeypatch.context() as patch, pytest.raises(LogError) as caught:
        patch.setattr(stream, "MAX_IN_MEMORY_TEXT", {"csv": 1000})
        open_imu(path, default_rig())
    assert 'row 2901: a comment line; set [imu] comment = "#"' in str(caught.value)


def test_rows_that_are_no_records_are_counted_in_one_message(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "r.csv", PLAIN, columns(T, gyro, accel))
    lines = path.read_text().splitlines()
    for row in (2000, 2100, 2200):
        lines.insert(row, "PAUSE")
    path.write_text("\n".join(lines) + "\n")
    assert "row 2001: 1 values, the header has 7: no record" in advice(path)
    assert "2 later rows are like it" in advice(path)


def test_row_numbers_types_and_units_about_the_names_are_passed(tmp_path):
    gyro, accel = readings()
    cells = columns(T, gyro, accel)
    bare = [name.partition(" ")[0] for name in PLAIN]
    units = "s," + "rad/s," * 3 + "m/s^2,m/s^2,m/s^2\n"
    types = ",".join(["float"] * 7) + "\n"
    numbers = [str(k + 1) for k in range(3000)]
    right(read_imu(write(tmp_path / "n.csv", PLAIN, [numbers, *cells]), default_rig()))
    for head, below in ((units, ""), ("", units), ("", units + types), ("", types)):
        path = write(tmp_path / "u.csv", bare, cells, head=head)
        text = path.read_text().replace("accel_z\n", "accel_z\n" + below, 1)
        path.write_text(text)
        log = right(read_imu(path, default_rig()))
        assert (log.warnings == ()) == bool(head or units in below)


def test_long_preambles_and_utf_16_without_a_mark_are_read(tmp_path):
    gyro, accel = readings()
    head = "".join(f"line {k} of the preamble, {k} in all\n" for k in range(4000))
    path = write(tmp_path / "l.csv", PLAIN, columns(T, gyro, accel), head=head)
    right(read_imu(path, default_rig()))
    text = write(tmp_path / "p.csv", PLAIN, columns(T, gyro, accel)).read_text()
    for encoding in ("utf-16-le", "utf-16-be"):
        (tmp_path / "u.csv").write_bytes(text.encode(encoding))
        right(read_imu(tmp_path / "u.csv", default_rig()))


def test_blank_cells_may_be_written_as_nan_and_begin_late(tmp_path):
    gyro, accel = readings()
    angle = [(t, f"{20 * t:.3f}") for t in T[::2] + 0.003]
    imu = [",".join([f"{t:.2f}", *(f"{v:.9g}" for v in (*w, *f)), "NaN"])
           for t, w, f in zip(T, gyro, accel, strict=True)]  # fmt: skip
    table = [",".join([f"{t:.3f}", *["NaN"] * 6, a]) for t, a in angle]
    path = tmp_path / "m.csv"
    path.write_text("\n".join([",".join([*PLAIN, "angle [deg]"]), *imu, *table]) + "\n")
    right(read_imu(path, default_rig()))


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (b"PK\x03\x04" + bytes(200), "a ZIP archive"),
        (b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(200), "a MATLAB file"),
        (b"\x89HDF\r\n\x1a\n" + bytes(200), "an HDF5 file"),
        (b"BZh91AY&SY" + bytes(200), "compressed by bzip2"),
        (json.dumps([{"time": k, "gyro_x": 1.0} for k in range(9)], indent=0).encode(), "JSON"),
        (b"".join(b"t=%d gx=0.1 gy=0.2\n" % k for k in range(9)), "a name and a value"),
    ],
)
def test_other_kinds_of_files_are_named(tmp_path, content, kind):
    for packed in (False, True):
        if packed and not content.startswith((b"[", b"t")):
            continue
        path = tmp_path / "x.bin"
        path.write_bytes(gzip.compress(content) if packed else content)
        with pytest.raises(LogError, match=kind):
            read_imu(path, default_rig())
