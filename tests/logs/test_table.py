"""Table logs: long ones in pieces, and stamps that jitter."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rotcli.errors import LogError
from rotcli.logs import plausible
from rotcli.logs import table as table_log
from rotcli.logs.table import read_table
from rotcli.rig.rig import default_rig


def turning_table(path, records=1500, group=200):
    """Write a table log that wraps, drops out once and names its unit; return time and angle."""
    time = np.delete(0.02 * np.arange(records), np.arange(700, 712))
    angle = 100.0 * time + 20.0 * np.sin(time)
    wrapped = np.mod(angle + 180.0, 360.0) - 180.0
    table = pa.table({"time [s]": time, "angle [deg]": wrapped})
    pq.write_table(table, path, row_group_size=group)
    return time, angle


def test_a_long_table_log_is_read_in_pieces_and_says_the_same(tmp_path, monkeypatch):
    time, angle = turning_table(tmp_path / "table.parquet")
    loaded = read_table(tmp_path / "table.parquet", default_rig())
    for room, name, size in (
        (table_log, "_SPACING_RECORDS", 137),
        (plausible, "_CHUNK_RECORDS", 90),
    ):
        monkeypatch.setattr(room, name, size)
    monkeypatch.setattr(table_log, "CHUNK_SAMPLES", 71)
    pieces = read_table(tmp_path / "table.parquet", default_rig())
    assert pieces.rows == loaded.rows == len(time)
    np.testing.assert_array_equal(pieces.time, loaded.time)
    np.testing.assert_array_equal(pieces.angle, loaded.angle)
    # Rounding of complete turns in degrees.
    np.testing.assert_allclose(np.rad2deg(loaded.angle), angle, atol=1e-9)
    assert pieces.warnings == loaded.warnings
    assert "1 gap in the table log, longest 0.26 s after 13.98 s" in loaded.warnings[0]


def test_faults_of_a_long_table_log_are_reported_with_their_record(tmp_path, monkeypatch):
    monkeypatch.setattr(table_log, "_SPACING_RECORDS", 137)
    monkeypatch.setattr(table_log, "CHUNK_SAMPLES", 71)
    path = tmp_path / "table.parquet"
    time = 0.02 * np.arange(1000)
    time[800] = time[798]
    pq.write_table(pa.table({"time": time, "angle": time}), path, row_group_size=100)
    with pytest.raises(LogError, match=r"table.parquet: row 801: time: time goes back by 0.02 s"):
        read_table(path, default_rig())
    with pytest.raises(
        LogError, match=r"its 1000 records need 16000 bytes or more, the limit is 15000"
    ):
        read_table(path, default_rig(), max_bytes=15_000)


def test_a_tables_stamps_that_jitter_are_reported(tmp_path):
    time = 0.02 * np.arange(2000)
    even = tmp_path / "even.parquet"
    pq.write_table(pa.table({"time": time, "angle": 0.1 * time}), even)
    assert read_table(even, default_rig()).warnings == ()
    late = time + 0.004 * np.random.default_rng(1).uniform(-1.0, 1.0, 2000)
    path = tmp_path / "jitter.parquet"
    pq.write_table(pa.table({"time": late, "angle": 0.1 * time}), path)
    (reported,) = read_table(path, default_rig()).warnings
    assert "jitter.parquet: time stamps jitter by up to 0.004 s (RMS 0.0023 s)" in reported
    assert "around 50 Hz. The angle error is rate x jitter" in reported


def test_a_single_wrong_stamp_is_named_with_its_time(tmp_path):
    time = 0.02 * np.arange(2000)
    time[1500] += 0.005
    path = tmp_path / "wrong.parquet"
    pq.write_table(pa.table({"time": time, "angle": 0.1 * time}), path)
    (reported,) = read_table(path, default_rig()).warnings
    assert (
        "the time stamps near 30.005 s are off by up to 0.005 s; the others are even (50"
        in reported
    )
