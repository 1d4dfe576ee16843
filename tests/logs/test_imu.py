import gzip
import io

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rotcli.errors import LogError, ResultError
from rotcli.logs.imu import read_imu, write_columns
from rotcli.logs.table import read_table
from rotcli.rig.rig import default_rig, rig_from_dict

RIG = default_rig()
NAMES = ("time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
HEADER = ",".join(NAMES)
DEG = np.pi / 180


def rows(n=10, dt=0.01):
    return [f"{i * dt:.2f},{i},2,3,4,5,9.8" for i in range(n)]


def text(lines, header=HEADER, end="\n"):
    return end.join([header, *lines, ""]).encode()


def put(tmp_path, content, name="imu.csv"):
    path = tmp_path / name
    path.write_bytes(content)
    return path


def changed(row, column, value):
    """The log with one cell changed; row as the user counts, header 1."""
    lines = rows()
    cells = lines[row - 2].split(",")
    cells[column] = value
    lines[row - 2] = ",".join(cells)
    return text(lines)


def test_plain_csv_is_read_in_si(tmp_path):
    log = read_imu(put(tmp_path, text(rows())), RIG)
    assert log.interval == 0.01
    np.testing.assert_array_equal(log.time, np.arange(10) * 0.01)
    np.testing.assert_array_equal(log.gyro[:, 0], np.arange(10.0))
    np.testing.assert_array_equal(log.accel[3], [4, 5, 9.8])
    assert log.gyro[:, 1].flags.c_contiguous
    assert (log.sampling, log.missing, log.rows, log.warnings) == ("instant", None, 10, ())


FORMS = {
    "crlf": text(rows(), end="\r\n"),
    "old line ends": text(rows(), end="\r"),
    "no line end": text(rows()).rstrip(),
    "byte order mark": b"\xef\xbb\xbf" + text(rows()),
    "spaces": text([r.replace(",", " , ") for r in rows()], HEADER.replace(",", " , ")),
    "quotes": text(rows(), ",".join(f'"{n}"' for n in NAMES)),
    "hash": text(rows(), "# " + HEADER),
    "other columns": text([r + ",on" for r in rows()], HEADER + ",state"),
    "semicolons": text(rows()).replace(b",", b";"),
    "tabs": text(rows()).replace(b",", b"\t"),
    "blanks": text(rows()).replace(b",", b" "),
    "UTF-16": text(rows()).decode().encode("utf-16"),
    "decimal commas": text(rows()).replace(b",", b";").replace(b".", b","),
    "a comma at each end": text([r + "," for r in rows()]),
    "a preamble": b"Logger 3\nserial,17\n\n" + text(rows()),
    "a line of Excel": b"sep=,\n" + text(rows()),
    "comments": b"# recorded today\n" + text([*rows(5), "# paused", *rows()[5:]]),
    "blank lines": text([r + "\n" for r in rows()]),
    "gzip": gzip.compress(text(rows())),
    "zstd": pa.compress(text(rows()), "zstd", asbytes=True),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_csv_gives_the_same_record(tmp_path, form):
    log = read_imu(put(tmp_path, FORMS[form], "imu.log"), RIG)
    np.testing.assert_array_equal(log.gyro[:, 0], np.arange(10.0))
    np.testing.assert_array_equal(log.accel[-1], [4, 5, 9.8])


def test_units_in_brackets(tmp_path):
    header = "time [ms],gyro_x [deg/s],gyro_y [deg/h],gyro_z [rpm],accel_x [g],accel_y [mg],accel_z"
    log = read_imu(put(tmp_path, text([f"{10 * i},1,3600,1,1,1,1" for i in range(5)], header)), RIG)
    np.testing.assert_allclose(log.gyro[0], [DEG, DEG, 2 * np.pi / 60], rtol=1e-15)
    np.testing.assert_allclose(log.accel[0], [9.80665, 0.00980665, 1.0], rtol=1e-15)
    assert log.interval == 0.01


def test_euroc_header_and_nanoseconds_since_1970(tmp_path):
    header = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    header += "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
    start = 1403636579758555392
    lines = [f"{start + i * 5000000},1,2,3,4,5,6" for i in range(100)]
    log = read_imu(put(tmp_path, text(lines, header)), RIG)
    # 0.24 us is one step of a float64 of 1.4e9 s.
    np.testing.assert_allclose(
        log.time - 1403636579.0, 0.758555392 + 0.005 * np.arange(100), atol=2.5e-7
    )
    np.testing.assert_array_equal(log.accel[7], [4, 5, 6])
    assert log.interval == pytest.approx(0.005, rel=1e-6)


def test_nanoseconds_lose_no_more_than_seconds_in_float64_do(tmp_path):
    stamps = [1403636579758555393 + i * 12345679 for i in range(200)]
    path = put(tmp_path, text([f"{t},0" for t in stamps], "time [ns],angle"))
    true = [t / 10**9 for t in stamps]  # integers divide to the nearest float
    assert np.abs(read_table(path, RIG).time - true).max() <= np.spacing(1.4e9)
    small = put(tmp_path, text([f"{i * 20},0" for i in range(50)], "time [ms],angle"))
    np.testing.assert_array_equal(read_table(small, RIG).time, np.arange(50) * 20 * 1e-3)


def test_nanoseconds_of_which_one_has_decimals_are_still_read(tmp_path):
    lines = [f"{1403636579758555392 + i * 20000000},0" for i in range(9)]
    lines[5] = lines[5].replace(",", ".5,")
    log = read_table(put(tmp_path, text(lines, "time [ns],angle")), RIG)
    np.testing.assert_allclose(np.diff(log.time), 0.02, atol=5e-7)


def test_rig_names_columns_and_units(tmp_path):
    rig = rig_from_dict(
        {
            "imu": {
                "columns": {"time": "t", "gyro_x": "Gyr X"},
                "units": {"time": "ms", "gyro": "deg/s", "accel": "g"},
            }
        }
    )
    header = HEADER.replace("gyro_x", "Gyr X").replace("time", "t")
    log = read_imu(put(tmp_path, text([f"{10 * i},1,2,3,0,0,1" for i in range(4)], header)), rig)
    np.testing.assert_allclose(log.gyro[0], np.array([1, 2, 3]) * DEG, rtol=1e-15)
    assert log.accel[0, 2] == 9.80665
    assert log.interval == 0.01


def test_the_rig_wins_over_the_header_with_a_warning(tmp_path):
    rig = rig_from_dict({"imu": {"units": {"gyro": "deg/s"}}})
    log = read_imu(put(tmp_path, text(rows(), HEADER.replace("gyro_x", "gyro_x [rad/s]"))), rig)
    assert log.gyro[2, 0] == pytest.approx(2.0 * DEG, rel=1e-15)
    assert "the header unit of gyro is rad/s, [imu] units gyro is deg/s. The rig" in log.warnings[0]


def test_parquet_metadata_unit_and_timestamps(tmp_path):
    stamps = pa.array(np.arange(5) * 10_000_000 + 1_700_000_000_000_000_000, pa.timestamp("ns"))
    arrays = [stamps] + [pa.array(np.full(5, float(i))) for i in range(6)]
    units = [None] + 3 * [b"deg/s"] + 3 * [None]
    fields = [
        pa.field(n, a.type, metadata={b"unit": u} if u else None)
        for n, a, u in zip(NAMES, arrays, units, strict=True)
    ]
    path = tmp_path / "imu.bin"
    pq.write_table(pa.table(arrays, schema=pa.schema(fields)), path)
    log = read_imu(path, RIG)
    np.testing.assert_allclose(log.gyro[0], np.array([0, 1, 2]) * DEG, rtol=1e-15)
    assert log.interval == pytest.approx(0.01, rel=1e-6)


def test_increments_become_averages(tmp_path):
    rig = rig_from_dict({"imu": {"sampling": "increment", "units": {"gyro": "deg"}}})
    log = read_imu(put(tmp_path, text(rows())), rig)
    assert log.sampling == "average"
    np.testing.assert_allclose(log.gyro[5], np.array([5, 2, 3]) * DEG / 0.01, rtol=1e-14)
    np.testing.assert_allclose(log.accel[5], np.array([4, 5, 9.8]) / 0.01, rtol=1e-14)


def test_rate_unit_on_increments_is_refused(tmp_path):
    rig = rig_from_dict({"imu": {"sampling": "increment"}})
    path = put(tmp_path, text(rows(), HEADER.replace("gyro_x", "gyro_x [deg/s]")))
    with pytest.raises(LogError, match=r"the gyro axes mix increments and rates .gyro_x in deg/s"):
        read_imu(path, rig)


def test_mount_turns_readings_into_the_mounting_frame(tmp_path):
    # The IMU's x axis lies along the mounting frame's y: what it reads there is measured along y.
    rig = rig_from_dict({"imu": {"mount": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]}})
    log = read_imu(put(tmp_path, text(rows())), rig)
    np.testing.assert_array_equal(log.gyro[7], [-2, 7, 3])


def test_short_gap_is_bridged_marked_and_reported(tmp_path):
    lines = rows(30)
    del lines[10:12]
    log = read_imu(put(tmp_path, text(lines)), RIG)
    np.testing.assert_allclose(log.gyro[:, 0], np.arange(30.0), rtol=1e-14)
    assert np.flatnonzero(log.missing).tolist() == [10, 11]
    assert log.warnings[0].endswith(
        "1 gap (2 samples), first after 0.09 s (2). "
        "They are interpolated; check the logger or exclude these parts"
    )


def test_long_gap_is_an_error_unless_every_gap_is_bridged(tmp_path):
    lines = rows(30)
    del lines[10:20]
    path = put(tmp_path, text(lines))
    what = r"imu.csv: row 12: time: 10 samples missing from 0.09 to 0.2 s, limit 5; split the log"
    with pytest.raises(LogError, match=what):
        read_imu(path, RIG)
    assert read_imu(path, RIG, max_gap=10).missing.sum() == 10
    assert read_imu(path, RIG, max_gap=None).missing.sum() == 10


def test_absurd_gap_is_an_error_even_so(tmp_path):
    with pytest.raises(
        LogError, match=r"samples missing from 0.09 to 1000000000 s.*split the log there"
    ):
        read_imu(put(tmp_path, text([*rows(), "1e9,1,2,3,4,5,6"])), RIG, max_gap=None)


def test_jitter_is_evened_out_and_reported(tmp_path):
    rng = np.random.default_rng(0)
    stamps = np.arange(200) * 0.01 + rng.uniform(-0.003, 0.003, 200)
    log = read_imu(put(tmp_path, text([f"{t:.6f},1,2,3,4,5,6" for t in stamps])), RIG)
    # The line through 200 stamps of 1.7 ms scatter is good to 0.25 ms at its ends (1 sigma).
    np.testing.assert_allclose(log.time, np.arange(200) * 0.01, atol=1e-3)
    assert "jitter by up to 0.003" in log.warnings[0]


def test_clock_that_drifts_is_taken_literally_and_reported(tmp_path):
    stamps = np.cumsum(0.01 * (1 + 0.3 * np.sin(np.arange(2000) / 200)))
    lines = [f"{t:.9f},{np.sin(t):.9f},2,3,4,5,6" for t in stamps]
    path = put(tmp_path, text(lines))
    log = read_imu(path, RIG)
    assert "They are used as logged" in log.warnings[0]
    # Cubic interpolation of a sine at 10 ms: 3/128 h^4 = 7e-10 at the worst spacing, 1e-9 printed.
    np.testing.assert_allclose(log.gyro[:, 0], np.sin(log.time), atol=3e-8)
    literal = rig_from_dict({"imu": {"clock": "stamps"}})
    assert read_imu(path, literal).warnings == ()


def test_clipped_samples_are_counted(tmp_path):
    rig = rig_from_dict({"imu": {"gyro_range": 400.0, "units": {"gyro": "deg/s"}}})
    lines = rows()
    lines[4] = "0.04,0,-400.0,0,0,0,0"
    lines[6] = "0.06,0,-400.1,0,0,0,0"
    log = read_imu(put(tmp_path, text(lines)), rig)
    assert log.warnings == (
        f"{log.path}: 2 gyro_y samples at or past the range of 400 deg/s, first at 0.04 s; "
        "exclude this part or turn more slowly",
    )


def parquet(tmp_path, **replaced):
    columns = {n: pa.array(np.arange(5.0)) for n in NAMES} | replaced
    path = tmp_path / "imu.parquet"
    pq.write_table(pa.table(columns), path)
    return path


STAMPS = {
    "ns": [1403636579758555392 + i * 5000000 for i in range(50)],
    "us": [1403636579758555 + i * 10000 for i in range(50)],
    "ms": [1403636579758 + i * 20 for i in range(50)],
    "ns from 0": [i * 1000000 for i in range(50)],
    "us from 0": [i * 10000 for i in range(50)],
    "ms from 0": [i * 10 for i in range(50)],
}


@pytest.mark.parametrize("unit", STAMPS)
def test_stamps_that_cannot_be_seconds_are_read_in_their_only_unit_with_a_warning(tmp_path, unit):
    imu = put(tmp_path, text([f"{t},1,2,3,4,5,6" for t in STAMPS[unit]]))
    table = put(tmp_path, text([f"{t},0" for t in STAMPS[unit]], "time,angle"), "table.csv")
    likely = unit[:2]
    for read, path, section in ((read_imu, imu, "imu"), (read_table, table, "table")):
        log = read(path, RIG)
        assert 1e-3 <= log.interval * (1 + 1e-6) <= 0.0201
        line = f'are read as {likely}; set [{section}] units = {{ time = "{likely}" }}'
        assert any(line in text for text in log.warnings)
        rig = rig_from_dict({section: {"units": {"time": likely}}})
        assert read(path, rig).interval == log.interval
        assert not any("has no unit" in text for text in read(path, rig).warnings)


def test_seconds_are_seconds_of_any_epoch_and_a_named_unit_is_believed(tmp_path):
    for start, step in ((1.7e9, 0.01), (0.0, 2e-5), (4e9, 9.0)):
        lines = [f"{start + i * step!r},0" for i in range(50)]
        read_table(put(tmp_path, text(lines, "time,angle")), RIG)
    slow = [f"{60 * i},0" for i in range(50)]
    assert read_table(put(tmp_path, text(slow, "time [s],angle")), RIG).interval == 60.0
    fast = [f"{i * 1e-6!r},0" for i in range(50)]
    with pytest.raises(LogError, match="are not a plausible sampling interval in s"):
        read_table(put(tmp_path, text(fast, "time,angle")), RIG)


# Beyond a million rad/s or m/s^2 a number is no reading, and refused.
finite = st.floats(-1e6, 1e6)


@given(st.lists(st.tuples(*6 * [finite]), min_size=2, max_size=30))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_csv_and_parquet_hold_every_number_exactly(tmp_path, values):
    columns = {"time": np.arange(len(values)) * 0.01}
    columns |= dict(zip(NAMES[1:], np.array(values).T, strict=True))
    for name in ("a.csv", "a.csv.gz", "a.csv.zst", "a.parquet"):
        write_columns(tmp_path / name, columns)
        log = read_imu(tmp_path / name, RIG)
        np.testing.assert_array_equal(np.hstack([log.gyro, log.accel]), np.array(values))
        np.testing.assert_array_equal(log.time, columns["time"])


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz", "a.csv.zst", "a.parquet"])
def test_same_columns_give_the_same_bytes(tmp_path, name):
    columns = {"time [s]": np.arange(50.0), "x": np.sin(np.arange(50.0))}
    write_columns(tmp_path / name, columns)
    first = (tmp_path / name).read_bytes()
    write_columns(tmp_path / name, columns)
    assert (tmp_path / name).read_bytes() == first
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_columns_go_to_a_stream_as_csv():
    stream = io.BytesIO()
    write_columns(stream, {"time [s]": np.array([0.0, 1.5])})
    assert stream.getvalue() == b"time [s]\n0\n1.5\n"


def test_columns_that_cannot_be_written_are_reported(tmp_path):
    with pytest.raises(ResultError, match=r"a.xls: unknown kind of file; name it .parquet"):
        write_columns(tmp_path / "a.xls", {"a": np.zeros(2)})
    with pytest.raises(ResultError, match="cannot be written: No such file or directory"):
        write_columns(tmp_path / "none" / "a.csv", {"a": np.zeros(2)})
