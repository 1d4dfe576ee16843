"""Vendors' logs: small files as their programs write them, and the faults that they may have."""

import gzip
import io
import math

import numpy as np
import pytest

from rotcli.errors import LogError, RigError
from rotcli.files.columns import write_columns
from rotcli.files.dialect import Dialect, RecordStream, records
from rotcli.files.formats import FORMATS
from rotcli.logs.imu import read_imu
from rotcli.logs.readings import file_columns, read_readings
from rotcli.rig.rig import rig_from_dict

ARCSEC = math.pi / 180 / 3600

XSENS_HEAD = """// Start Time: Unknown
// Update Rate: 100.0Hz
// Filter Profile: general (41.1)
// Firmware Version: 1.8.2
PacketCounter\tSampleTimeFine\tYear\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tMag_X
"""


def xsens(n=8, fine=4294967096, counter=65532):
    """Rows as MT Manager exports them; both counters start again on the way."""
    rows = [
        f"{(counter + i) % 65536:05d}\t{(fine + 100 * i) % 2**32 if fine is not None else ''}\t\t"
        f"0.0{i}\t-0.02\t9.81\t0.00{i}\t-0.002\t0.003\t-0.412\n"
        for i in range(n)
    ]
    return XSENS_HEAD + "".join(rows)


def kf_gins(n=6):
    return "".join(
        f" {456300.0 + 0.005 * i:.9f}   {1e-5 * i:.15f}  2.0e-05 -3.0e-05\t"
        f"{4e-3:.12f} 5.0e-03  {-9.8 * 0.005:.12f}\n"
        for i in range(n)
    )


def psins(n=6, dither=False):
    end = " 0" if dither else ""
    head = (
        "% PSINS-format SIMU log file. (DO NOT MODIFY!)\n% 2014-03-21 17:31:51  somebody\n"
        "%   [gf_x, gf_y, gf_z, af_x, af_y, af_z]\n\n"
        f"0.000000 0.000000 -90.600000 0.000000 0.000000 0.000000{end}\n"
        f"34.24604800 108.90966400 380.000 12.50000000 10.00000000 9.780327{end}\n"
        f"0.100000 0.200000 0.400000 125.000 125.000 250.000{end}\n\n"
    )
    jitter = [0, 50, -50]
    rows = [
        f"{i} -2 3 4 -5 {40000 + i}" + (f" {jitter[i % 3]}" if dither else "") for i in range(n)
    ]
    return head + "\n".join(rows) + "\n"


EUROC = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
    + "".join(
        f"{1403636579758555392 + 5_000_000 * i},-0.09{i},0.14,0.07,9.08,0.13,-3.69\n"
        for i in range(5)
    )
)


def put(tmp_path, text, name="imu.txt"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def rig(form=None, **imu):
    return rig_from_dict({"imu": {**({"format": form} if form else {}), **imu}})


def test_every_format_names_its_source_and_all_six_axes():
    for loaded in FORMATS.values():
        assert loaded.title
        assert loaded.source
        names = loaded.rig.get("columns", {"gyro_x": 1, "gyro_z": 1, "accel_y": 1})
        assert {"gyro_x", "gyro_z", "accel_y"} <= set(names)


def test_xsens_fine_time_is_ticks_of_100_us_that_start_again(tmp_path):
    log = read_imu(put(tmp_path, xsens()), rig("xsens"))
    assert log.time[0] == 429496.7096
    # Two rows before the counter starts again at 2^32, six after it.
    np.testing.assert_allclose(np.diff(log.time), 0.01, atol=1e-9)
    np.testing.assert_array_equal(log.gyro[:, 0], np.arange(8) / 1000)
    np.testing.assert_array_equal(log.gyro[0], [0.0, -0.002, 0.003])
    np.testing.assert_array_equal(log.accel[3], [0.03, -0.02, 9.81])
    assert log.sampling == "instant"
    (warning,) = log.warnings
    assert "starts again after 2^32 ticks in row 8. It is unrolled" in warning


def test_xsens_without_fine_time_counts_packets_at_the_update_rate(tmp_path):
    log = read_imu(put(tmp_path, xsens(fine=None)), rig("xsens"))
    assert log.time[0] == 655.32
    np.testing.assert_allclose(np.diff(log.time), 0.01, atol=1e-9)
    lines = xsens(fine=None).splitlines(keepends=True)
    lost = read_imu(put(tmp_path, "".join(lines[:9] + lines[10:])), rig("xsens"))
    assert any("1 gap (1 sample)" in text for text in lost.warnings)
    with pytest.raises(
        LogError, match=r"no SampleTimeFine and no update rate in the comments; set .imu. rate"
    ):
        read_imu(put(tmp_path, xsens(fine=None).replace("Update", "Filter")), rig("xsens"))


@pytest.mark.parametrize("sign", [",", ";", " "])
def test_xsens_may_be_exported_with_another_delimiter(tmp_path, sign):
    plain = xsens().replace("\t\t", "\t2024\t")
    log = read_imu(put(tmp_path, plain.replace("\t", sign)), rig("xsens"))
    np.testing.assert_array_equal(log.gyro[0], [0.0, -0.002, 0.003])


FORMS = {
    "line ends of Windows": xsens().replace("\n", "\r\n").encode(),
    "no line end": xsens().rstrip("\n").encode(),
    "byte order mark": b"\xef\xbb\xbf" + xsens().encode(),
    "Latin letters in a comment": xsens().replace("Unknown", "M\xfcnchen").encode("latin-1"),
    "gzip": gzip.compress(xsens().encode()),
    "a comment amid the records": xsens().replace("00000\t", "// paused\n00000\t").encode(),
    "an empty line amid the records": xsens().replace("00000\t", "\n00000\t").encode(),
    "a delimiter at each end": xsens().replace("-0.412\n", "-0.412\t\n").encode(),
}


@pytest.mark.parametrize("name", FORMS)
def test_the_same_log_in_other_dress_reads_the_same(tmp_path, name):
    log = read_imu(put(tmp_path, FORMS[name]), rig("xsens"))
    expected = read_imu(put(tmp_path, xsens(), "plain.txt"), rig("xsens"))
    np.testing.assert_array_equal(log.time, expected.time)
    np.testing.assert_array_equal(log.gyro, expected.gyro)
    np.testing.assert_array_equal(log.accel, expected.accel)


def test_kf_gins_contains_increments_on_axes_forward_right_down(tmp_path):
    setup = rig("kf-gins")
    assert setup.imu.sampling == "increment"
    log = read_imu(put(tmp_path, kf_gins()), setup)
    assert log.sampling == "average"
    assert log.time[0] == 456300.0
    assert log.interval == pytest.approx(0.005, rel=1e-8)  # at 4.6e5 s stamps have 6e-11 s
    # Right, forward, up: y, x and -z of the log, increments over 5 ms.
    np.testing.assert_allclose(log.gyro[2], [4e-3, 4e-3, 6e-3], rtol=1e-8)
    np.testing.assert_allclose(log.accel[0], [1.0, 0.8, 9.8], rtol=1e-8)


def test_a_rig_may_overrule_what_its_format_says(tmp_path):
    own = rig("kf-gins", mount=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], units={"gyro": "deg"})
    log = read_imu(put(tmp_path, kf_gins()), own)
    np.testing.assert_allclose(log.accel[0], [0.8, 1.0, -9.8], rtol=1e-8)
    np.testing.assert_allclose(log.gyro[0, 1], math.radians(4e-3), rtol=1e-8)


def test_psins_integers_take_the_factors_of_the_head(tmp_path):
    found = read_readings(put(tmp_path, psins()), rig("psins"))
    assert found.increments
    np.testing.assert_allclose(found.time, 12.5 + 0.01 * np.arange(1, 7), rtol=1e-15)
    g = 9.780327
    expected = [0, -2 * 0.2 * ARCSEC, 3 * 0.4 * ARCSEC, 4 * 125e-6 * g, -5 * 125e-6 * g]
    np.testing.assert_allclose(found.values[:5, 0], expected, rtol=1e-14)
    np.testing.assert_allclose(found.values[5, 3], 40003 * 250e-6 * g, rtol=1e-14)


def test_psins_may_carry_the_dither_of_its_clock(tmp_path):
    found = read_readings(put(tmp_path, psins(dither=True)), rig("psins"))
    np.testing.assert_allclose(
        found.time - 12.5, [0.01, 0.02005, 0.03, 0.04, 0.05005, 0.06], atol=1e-12
    )


def test_euroc_reads_with_its_format_and_without(tmp_path):
    path = put(tmp_path, EUROC, "data.csv")
    for setup in (rig("euroc"), rig()):
        log = read_imu(path, setup)
        np.testing.assert_allclose(np.diff(log.time), 0.005, atol=1e-6)
        np.testing.assert_array_equal(log.gyro[2], [-0.092, 0.14, 0.07])
        np.testing.assert_array_equal(log.accel[2], [9.08, 0.13, -3.69])


def test_a_format_of_ones_own_needs_no_code(tmp_path):
    text = (
        "ACME logger 3\nserial 17\n! comment\n10;0;1;2;3;0,5\n"
        "! another\n" + "".join(f"{20 + 10 * i};{i};1;2;-1000;3;4\n" for i in range(5))
    ).replace("10;0;1;2;3;0,5\n", "")
    own = {
        "columns": dict(
            zip(("time", "gyro_x", "gyro_y", "gyro_z", "accel_z", "accel_x", "accel_y"),
                range(1, 8), strict=True)
        ),
        "units": {"time": "ms", "gyro": "deg/s", "accel": "mg"},
        "delimiter": ";",
        "comment": "!",
        "skip": 2,
    }  # fmt: skip
    setup = rig(**own)
    log = read_imu(put(tmp_path, text), setup)
    np.testing.assert_allclose(log.time, 0.02 + 0.01 * np.arange(5), atol=1e-12)
    np.testing.assert_allclose(log.gyro[:, 0], np.radians(np.arange(5.0)), rtol=1e-15)
    np.testing.assert_allclose(log.accel[0, 2], -9.80665, rtol=1e-15)
    assert rig_from_dict(setup.effective()) == setup


def test_a_named_header_below_skipped_lines_is_found_by_names(tmp_path):
    text = "export of today\nt\tgx\tgy\tgz\tax\tay\taz\n" + "".join(
        f"{0.01 * i:.2f}\t{i}\t2\t3\t4\t5\t6\n" for i in range(4)
    )
    names = dict(
        zip(("time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"),
            ("t", "gx", "gy", "gz", "ax", "ay", "az"), strict=True)
    )  # fmt: skip
    log = read_imu(put(tmp_path, text), rig(columns=names, skip=1, delimiter="\t"))
    np.testing.assert_array_equal(log.gyro[:, 0], np.arange(4.0))


@pytest.mark.parametrize(
    ("text", "form"),
    [(xsens(), "xsens"), (kf_gins(), "kf-gins"), (psins(dither=True), "psins"), (EUROC, "euroc")],
)
@pytest.mark.parametrize("name", ["c.parquet", "c.csv", "c.csv.gz"])
def test_a_converted_log_gives_the_same_record_with_the_same_rig(tmp_path, text, form, name):
    original = put(tmp_path, text)
    write_columns(tmp_path / name, file_columns(read_readings(original, rig(form))))
    a, b = read_imu(original, rig(form)), read_imu(tmp_path / name, rig(form))
    np.testing.assert_array_equal(a.time, b.time)
    np.testing.assert_array_equal(a.gyro, b.gyro)
    np.testing.assert_array_equal(a.accel, b.accel)
    assert a.sampling == b.sampling
    assert b.warnings == tuple(text for text in a.warnings if "unrolled" not in text)


@pytest.mark.parametrize(("text", "form"), [(xsens(), "xsens"), (psins(), "psins")])
def test_a_vendors_log_without_a_format_is_recognized(tmp_path, text, form):
    path = put(tmp_path, text)
    found = read_readings(path, rig(sampling="increment") if form == "psins" else rig())
    np.testing.assert_array_equal(found.values, read_readings(path, rig(form)).values)


def test_numbers_without_a_header_say_how_to_count_columns(tmp_path):
    with pytest.raises(LogError, match=r"set \[imu\] columns = \{ time = 1"):
        read_imu(put(tmp_path, "0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n"), rig())


def test_a_table_log_is_still_reported_when_a_format_is_named(tmp_path):
    path = put(tmp_path, "time,angle\n0,1\n1,2\n")
    with pytest.raises(LogError, match=r"this looks like a table log"):
        read_imu(path, rig("xsens"))


def test_an_unknown_format_names_the_known_ones():
    with pytest.raises(RigError, match=r"not a known format; similar: psins"):
        rig("psin")


@pytest.mark.parametrize("block", [1, 7, 64, 1 << 20])
def test_cleaning_in_blocks_of_any_size_gives_the_same_records(monkeypatch, block):
    monkeypatch.setattr("rotcli.files.dialect._BLOCK", block)
    text = b"skip me\n%head\n  1   2\t 3 \r\n%  c 4\n\n4 5  6\n 7 8 9"
    dialect = Dialect(" ", comment="%")
    cleaned = RecordStream(io.BytesIO(text), dialect, 2).read()
    rows = [line.split() for line in cleaned.decode().splitlines() if line]
    assert rows == [["1", "2", "3"], ["4", "5", "6"], ["7", "8", "9"]]
    assert b"  " not in cleaned
    numbered = list(records(io.BytesIO(text), dialect, 2))
    assert numbered == [(3, rows[0]), (6, rows[1]), (7, rows[2])]
