"""Long IMU logs read piece by piece."""

import re

import numpy as np
import pyarrow.parquet as pq
import pytest

from rotcli.errors import LogError
from rotcli.logs import chunk_values, stream
from rotcli.logs.imu import read_imu, write_columns
from rotcli.logs.record import ImuLog
from rotcli.logs.stream import StreamedImuLog, open_imu
from rotcli.rig.rig import default_rig, rig_from_dict

NAMES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


def columns(n=1000, dt=0.01, seed=0):
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((6, n))
    return {"time": dt * np.arange(n), **dict(zip(NAMES, values, strict=True))}


RIG = rig_from_dict({"imu": {"units": {"gyro": "rad/s"}}})


def streamed(path, rig, **more):
    return open_imu(path, rig, in_memory_factor=0.0, **more)


def joined(path, rig=None, **more):
    loaded = streamed(path, rig or RIG, **more)
    parts = list(loaded.chunks(slice(0, loaded.samples)))
    assert len(parts) > 1
    return loaded, (
        np.concatenate([getattr(p, k) for p in parts]) for k in ("time", "gyro", "accel")
    )


def same(loaded, complete):
    """Compare a stream with the log that is loaded, in every way it can be asked."""
    assert (loaded.path, loaded.rows, loaded.samples) == (
        complete.path,
        complete.rows,
        complete.samples,
    )
    assert (loaded.sampling, loaded.interval) == (
        complete.sampling,
        pytest.approx(complete.interval, 1e-12),
    )
    np.testing.assert_allclose(loaded.time, complete.time[[0, -1]], atol=1e-9)
    for limits in ((0.0, 1e9), (1.234, 5.678), (-5.0, 3.0), (4.0, 4.0)):
        assert loaded.between(*limits) == complete.between(*limits)
        assert loaded.within(*limits) == complete.within(*limits)
    for limits in ((-1e9, 1e9), (2.0, 3.501), (5.5, 5.505), (1e8, 1e9)):
        part, expected = loaded.crop(*limits), complete.crop(*limits)
        np.testing.assert_allclose(part.time, expected.time, atol=1e-9)
        np.testing.assert_allclose(part.gyro, expected.gyro, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(part.accel, expected.accel, rtol=0.0, atol=1e-9)
        lost = [np.zeros(p.samples, bool) if p.missing is None else p.missing
                for p in (part, expected)]  # fmt: skip
        np.testing.assert_array_equal(*lost)
    span = slice(150, 777)
    for name in NAMES:
        found, expected = np.full((2, 627), np.nan)
        loaded.fill(found, name, span)
        complete.fill(expected, name, span)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(expected, complete.column(name)[span])


# Bytes of readings that are kept: all, those of 500 records (a text is longer than expected), none.
@pytest.fixture(autouse=True, params=[10**6, 500 * 6 * 8, 0], ids=lambda size: f"keep {size}")
def small_pieces(monkeypatch, request):
    monkeypatch.setattr(stream, "CHUNK_SAMPLES", 137)
    monkeypatch.setattr(chunk_values, "MAX_KEPT_BYTES", request.param)
    return request.param


@pytest.mark.parametrize("name", ["imu.parquet", "imu.csv", "imu.csv.gz"])
def test_the_pieces_together_are_the_complete_log(tmp_path, name):
    path = tmp_path / name
    write_columns(path, columns(9000))
    if name == "imu.parquet":  # row groups that begin within a batch, the last of one record
        table = pq.read_table(path)
        pq.write_table(table, path, row_group_size=857)
    complete = read_imu(path, RIG)
    loaded, (time, gyro, accel) = joined(path)
    np.testing.assert_array_equal(time, complete.time)
    np.testing.assert_array_equal(gyro, complete.gyro)
    np.testing.assert_array_equal(accel, complete.accel)
    assert loaded.warnings == ()
    same(loaded, complete)


RIGS = [
    {},
    {"sampling": "increment"},
    {"sampling": "average", "clock": "stamps"},
    {"sampling": "increment", "clock": "stamps"},
    {"mount": [[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]},
]


STAMPS = [
    *(("jitter", imu) for imu in RIGS),
    *(("even", imu) for imu in RIGS[:2]),
    *(("drift", imu) for imu in (RIGS[0], RIGS[3])),
]


@pytest.mark.parametrize(("stamps", "imu"), STAMPS, ids=str)
def test_gaps_and_stamps_of_every_kind_read_as_from_a_log_that_is_loaded(tmp_path, imu, stamps):
    """The even clock is found from pieces, and stamps are interpolated where there is none."""
    path = tmp_path / "imu.parquet"
    data = columns(9000)
    rng = np.random.default_rng(1)
    k = np.arange(9000)
    if stamps == "jitter":
        data["time"] = data["time"] + rng.uniform(-2e-3, 2e-3, 9000)
    if stamps == "drift":  # 2e-3 faster at the end: no straight line
        data["time"] = 0.01 * k + 1e-5 * k * k / 9000
    kept = np.ones(9000, dtype=bool)
    kept[rng.integers(20, 8900, 12)] = False
    kept[[136, 137, 138, 500, 501]] = False
    write_columns(path, {name: value[kept] for name, value in data.items()})
    rig = rig_from_dict({"imu": {"gyro_range": 150.0, **imu}})
    complete, loaded = read_imu(path, rig), streamed(path, rig)
    same(loaded, complete)
    numbers = re.compile(r"\d+\.?\d*(e-?\d+)?")
    # The largest deviation is a bound, or known at the pieces' ends only.
    assert [numbers.sub("", w) for w in loaded.warnings] == [
        numbers.sub("", w) for w in complete.warnings
    ]


def test_a_log_is_loaded_or_streamed_by_its_length(tmp_path, monkeypatch):
    path = tmp_path / "imu.parquet"
    write_columns(path, columns())
    assert isinstance(stream.open_imu(path, default_rig()), ImuLog)
    monkeypatch.setattr(stream, "MAX_IN_MEMORY_RECORDS", 999)
    reported = []
    loaded = stream.open_imu(path, default_rig(), progress=reported.append)
    assert isinstance(loaded, StreamedImuLog)
    assert reported == sorted(reported)
    assert reported[-1] == 1.0


def test_clipped_samples_are_counted_over_all_pieces(tmp_path):
    path = tmp_path / "imu.csv"
    write_columns(path, columns())
    rig = rig_from_dict({"imu": {"gyro_range": 120.0, "accel_range": 3.0}})
    assert streamed(path, rig).warnings == read_imu(path, rig).warnings != ()


def test_units_mount_and_increments_are_applied(tmp_path):
    path = tmp_path / "imu.csv"
    data = columns()
    data = {"time [ms]": 1e3 * data.pop("time"), **data}
    write_columns(path, data)
    rig = rig_from_dict(
        {"imu": {"sampling": "increment", "mount": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]}}
    )
    complete = read_imu(path, rig)
    _, (_, gyro, accel) = joined(path, rig)
    np.testing.assert_allclose(gyro, complete.gyro, rtol=1e-9)
    np.testing.assert_allclose(accel, complete.accel, rtol=1e-9)


def test_gaps_within_and_between_pieces_are_bridged_by_straight_lines(tmp_path):
    path = tmp_path / "imu.parquet"
    data = columns()
    kept = np.ones(1000, dtype=bool)
    kept[[50, 51, 137, 138]] = False  # records 135 and after make the second piece
    write_columns(path, {name: value[kept] for name, value in data.items()})
    loaded, (time, gyro, _) = joined(path)
    np.testing.assert_allclose(time, data["time"], atol=1e-9)
    x = data["gyro_x"]
    np.testing.assert_allclose(gyro[50, 0], x[49] + (x[52] - x[49]) / 3)
    assert len(gyro) == 1000
    assert any("2 gaps (4 samples), first after 0.49 s (2)" in text for text in loaded.warnings)


def test_too_long_a_gap_names_its_row(tmp_path):
    path = tmp_path / "imu.csv"
    kept = np.r_[0:300, 320:1000]
    write_columns(path, {name: value[kept] for name, value in columns().items()})
    with pytest.raises(
        LogError, match=r"row 302: time: 20 samples missing from 2.99 to 3.2 s, limit 5"
    ):
        streamed(path, default_rig())


@pytest.mark.parametrize("name", ["imu.csv", "imu.parquet"])
def test_a_number_that_is_not_finite_names_its_row(tmp_path, name):
    path = tmp_path / name
    data = columns()
    data["accel_y"][500] = np.nan
    write_columns(path, data)
    row = 502 if name.endswith("csv") else 501
    with pytest.raises(LogError, match=f"row {row}: accel_y"):
        streamed(path, default_rig())


def test_text_in_a_cell_names_its_row(tmp_path):
    path = tmp_path / "imu.csv"
    write_columns(path, columns())
    lines = path.read_text().splitlines()
    lines[700] = lines[700].rsplit(",", 1)[0] + ",broken"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(LogError, match="row 701: accel_z: 'broken' is not a number"):
        streamed(path, default_rig())


def test_time_that_goes_back_between_pieces_is_an_error(tmp_path):
    path = tmp_path / "imu.parquet"
    data = columns()
    data["time"][137:] -= 0.5
    write_columns(path, data)
    with pytest.raises(LogError, match=r"row 138: time: time goes back by 0\.49 s"):
        streamed(path, default_rig())


def test_an_empty_log_is_an_error(tmp_path):
    path = tmp_path / "imu.parquet"
    write_columns(path, {name: value[:0] for name, value in columns().items()})
    with pytest.raises(LogError, match="no data rows"):
        streamed(path, default_rig())


@pytest.mark.parametrize("sampling", ["instant", "increment"])
def test_stamps_that_jitter_have_no_gaps_in_pieces_either(tmp_path, sampling):
    rng = np.random.default_rng(4)
    given = columns(1500)
    given["time"] = given["time"] + 0.003 * rng.uniform(-1.0, 1.0, 1500)
    write_columns(tmp_path / "imu.parquet", given)
    rig = rig_from_dict({"imu": {"clock": "stamps", "sampling": sampling}})
    complete = read_imu(tmp_path / "imu.parquet", rig)
    loaded, (time, gyro, _) = joined(tmp_path / "imu.parquet", rig)
    assert complete.missing is None
    assert all(part.missing is None for part in loaded.chunks(slice(0, loaded.samples)))
    np.testing.assert_allclose(time, complete.time, atol=1e-9)
    # Sums from another start round otherwise.
    np.testing.assert_allclose(gyro, complete.gyro, atol=1e-9)


@pytest.mark.parametrize("name", ["imu.parquet", "imu.csv"])
@pytest.mark.parametrize("sampling", ["instant", "increment"])
def test_a_log_whose_readings_are_kept_is_decoded_once(
    tmp_path, monkeypatch, small_pieces, name, sampling
):
    passes = []
    load_chunks = stream.load_chunks

    def counted(*args, **more):
        passes.append(args)
        return load_chunks(*args, **more)

    monkeypatch.setattr(stream, "load_chunks", counted)
    write_columns(tmp_path / name, columns())
    rig = rig_from_dict({"imu": {"sampling": sampling}})
    loaded = streamed(tmp_path / name, rig)
    complete = read_imu(tmp_path / name, rig)
    for start in (0.0, 3.0, 9.0):
        np.testing.assert_allclose(
            loaded.crop(start, 9.5).gyro, complete.crop(start, 9.5).gyro, rtol=1e-9
        )
        found = np.empty(100)
        loaded.fill(found, "accel_y", slice(200, 300))
        np.testing.assert_allclose(found, complete.accel[200:300, 1], rtol=1e-9)
    assert len(passes) == (1 if small_pieces == 10**6 else 7)
    again = loaded.crop(0.0, 9.5).accel  # the kept readings are not changed by a use
    np.testing.assert_allclose(again, complete.crop(0.0, 9.5).accel, rtol=1e-9)


def test_a_log_is_streamed_where_the_memory_for_its_readings_is_not_granted(tmp_path, monkeypatch):
    path = tmp_path / "imu.csv"
    write_columns(path, columns())
    monkeypatch.setattr(chunk_values, "MAX_KEPT_BYTES", 10**18)
    np.testing.assert_array_equal(
        streamed(path, RIG).crop(2.0, 4.0).gyro[0], read_imu(path, RIG).gyro[200]
    )


def test_a_temperature_is_kept_with_the_readings(tmp_path):
    path = tmp_path / "imu.parquet"
    data = {**columns(), "temperature [degC]": 20.0 + 1e-3 * np.arange(1000)}
    write_columns(path, data)
    loaded = streamed(path, RIG)
    part = loaded.crop(2.0, 4.0)
    np.testing.assert_allclose(part.temperature, data["temperature [degC]"][200:401], rtol=1e-12)
    np.testing.assert_array_equal(part.accel[:, 2], data["accel_z"][200:401])


@pytest.mark.parametrize("imu", [{"clock": "count"}, {}])
def test_a_log_whose_records_are_counted_at_a_known_rate_reads_as_from_a_log_that_is_loaded(
    tmp_path, monkeypatch, imu
):
    monkeypatch.setattr(stream, "CHUNK_SAMPLES", 97)
    path = tmp_path / "log.parquet"
    channels = columns(n=2000)
    time = channels.pop("time")
    write_columns(path, {"time": np.round(time, 1), **channels} if imu else channels)
    rig = rig_from_dict({"imu": {"units": {"gyro": "rad/s"}, "rate": 100.0, **imu}})
    loaded = streamed(path, rig)
    assert isinstance(loaded, StreamedImuLog)
    complete = read_imu(path, rig)
    same(loaded, complete)
    assert loaded.warnings == complete.warnings


def test_equal_stamps_of_a_long_log_are_refused_before_its_readings_are_loaded(
    tmp_path, monkeypatch
):
    path = tmp_path / "log.parquet"
    write_columns(path, {**columns(n=3000), "time": np.full(3000, 5.0)})
    with pytest.raises(LogError, match="all 3000 time stamps are 5") as loaded:
        read_imu(path, RIG)

    def fail(*args):
        raise AssertionError("the log is loaded")

    monkeypatch.setattr(stream, "read_described", fail)
    with pytest.raises(LogError) as found:
        streamed(path, RIG)
    assert (str(found.value), found.value.problems) == (str(loaded.value), loaded.value.problems)
