"""Two recordings mixed into one log by their times are named; losses, jitter and groups are not."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rotcli.errors import LogError
from rotcli.logs import stream
from rotcli.logs.imu import read_imu
from rotcli.logs.stream import open_imu
from rotcli.logs.timing.mixed import RecordSpacing
from rotcli.rig.rig import default_rig
from tests.logs.lab_logs import rig

RECORDING = 0.01 * np.arange(6000)  # s: 60 s at 100 Hz


def _sorted_restart(phase, again=10.0):
    """Stamps of two recordings of 60 s, the second from `again` + phase s on, as sorting gives."""
    return np.sort(np.concatenate([RECORDING, RECORDING + again + phase]))


def _write(path, time):
    rng = np.random.default_rng(1)
    values = 1e-3 * rng.standard_normal((6, len(time)))
    values[5] += 9.81
    names = ["gyro_x [rad/s]", "gyro_y [rad/s]", "gyro_z [rad/s]"]
    names += ["accel_x [m/s^2]", "accel_y [m/s^2]", "accel_z [m/s^2]"]
    pq.write_table(pa.table({"time [s]": time, **dict(zip(names, values, strict=True))}), path)
    return path


@pytest.mark.parametrize("phase", [0.0, 0.001, 0.003, 0.005])
def test_recordings_mixed_by_a_restart_are_named_with_the_parts_of_one_recording(tmp_path, phase):
    path = _write(tmp_path / "mixed.parquet", _sorted_restart(phase))
    with pytest.raises(LogError) as caught:
        read_imu(path, default_rig())
    text = str(caught.value)
    assert "time: 2 records every 0.01 s in 10." in text
    assert "split the log there" in text
    assert "the clock started again" in text
    assert "sort" not in text  # that is what mixed the recordings
    start, end = text.rpartition("like ")[2].split(" s can")[0].split(" to ")
    part = _sorted_restart(phase)
    part = part[(part >= float(start)) & (part <= float(end))]
    np.testing.assert_allclose(np.diff(part), 0.01, atol=1e-9)  # the part named is of one recording
    assert part[-1] - part[0] > 9.0  # of 10 s
    assert read_imu(_write(tmp_path / "part.parquet", part), default_rig()).warnings == ()


def test_three_recordings_are_counted():
    time = np.sort(np.concatenate([RECORDING, RECORDING + 10.003, RECORDING + 20.007]))
    text = RecordSpacing(time).finding()
    assert "3 records every 0.01 s in" in text
    assert "one elsewhere: three recordings are mixed" in text


def test_a_long_log_is_looked_at_in_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr(stream, "CHUNK_SAMPLES", 700)
    spacing = RecordSpacing()
    time = _sorted_restart(0.003)
    for first in range(0, len(time), 700):
        spacing.add(time[first : first + 700])
    assert spacing.finding().startswith("2 records every 0.01 s in 10.")
    path = _write(tmp_path / "long.parquet", time)
    with pytest.raises(LogError, match="two recordings are mixed"):
        open_imu(path, default_rig(), in_memory_factor=0.0)


def test_the_stamps_are_used_where_the_rig_says_so(tmp_path):
    path = _write(tmp_path / "mixed.parquet", _sorted_restart(0.003))
    assert read_imu(path, rig(clock="stamps")).rows == 12000


def _lost(share):
    return RECORDING[np.random.default_rng(2).random(6000) >= share]


CLEAN = {
    "even": RECORDING,
    "1 % lost": _lost(0.01),
    "half lost at random": _lost(0.5),
    "a gap of 10 s": np.delete(RECORDING, slice(2000, 3000)),
    "jitter": RECORDING + np.random.default_rng(3).uniform(-0.004, 0.004, 6000),
    "groups of two": np.repeat(0.02 * np.arange(3000), 2) + np.tile([0.0, 2e-4], 3000),
    "groups of five": np.repeat(0.05 * np.arange(1200), 5) + np.tile(2e-4 * np.arange(5), 1200),
    "groups of 64": np.repeat(0.64 * np.arange(94), 64) + np.tile(1e-4 * np.arange(64), 94),
    "few records": RECORDING[:20],
}


@pytest.mark.parametrize("name", CLEAN)
def test_other_stamps_are_not_two_recordings(name):
    assert RecordSpacing(np.sort(CLEAN[name])).finding() == ""
