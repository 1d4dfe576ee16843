"""Logs whose numbers or names no logger writes are refused in one line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.container.opening import open_log
from rotcli.logs.imu import read_imu
from rotcli.logs.readings import read_readings
from rotcli.logs.stream import open_imu
from rotcli.rig.rig import default_rig
from tests.conftest import FIXTURES

HEAD = "time [ns],gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n"
ROOT = Path(__file__).parents[3]


def _write(path, stamps, value="9.81"):
    rng = np.random.default_rng(1)
    rows = rng.normal(0, 1e-3, (len(stamps), 5))
    lines = [
        f"{t}," + ",".join(f"{v:.9f}" for v in row) + f",{value}"
        for t, row in zip(stamps, rows, strict=True)
    ]
    path.write_text(HEAD + "\n".join(lines) + "\n")
    return path


def test_stamps_beyond_63_bits_are_no_clock(tmp_path):
    stamps = [17_000_000_000_000_000_000 + 10_000_000 * k for k in range(300)]
    path = _write(tmp_path / "imu.csv", stamps)
    for read in (read_imu, read_readings, open_imu):
        with pytest.raises(LogError, match=r"row 2: time: 1.7e.19 is beyond 63 bits"):
            read(path, default_rig())
    stamps = [1_700_000_000_000_000_000 + 10_000_000 * k for k in range(300)]
    assert read_imu(_write(path, stamps), default_rig()).samples == 300


def test_an_impossible_reading_is_refused_also_where_readings_are_converted(tmp_path):
    path = _write(tmp_path / "imu.csv", [10_000_000 * k for k in range(300)], "1e308")
    with pytest.raises(LogError, match=r"row 2: accel_z: 1e.308 .* is impossible"):
        read_readings(path, default_rig())


def test_a_name_that_the_locale_cannot_show_says_so(tmp_path):
    place = tmp_path / "Ünï"
    place.mkdir()
    log = place / "imu.parquet"
    log.write_bytes((FIXTURES / "nav440_rate_60" / "imu.parquet").read_bytes())
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "rotcli", "allan", "Ünï/imu.parquet"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.endswith(
        "the system encoding (ascii) is not UTF-8; set LC_ALL=C.UTF-8 or PYTHONUTF8=1\n"
    )


@pytest.mark.parametrize("indent", [None, 2])
def test_a_result_given_as_a_log_is_named_as_such(tmp_path, indent):
    path = tmp_path / "allan.json"
    path.write_text(json.dumps({"kind": "allan", "schema": 1, "rotcli": "0.2.0"}, indent=indent))
    with pytest.raises(LogError, match=r"is a rotcli result \(allan\), not a log"):
        open_log(path)
    path.write_text('{"kind": "other"}')
    assert open_log(path).kind == "csv"  # its columns are judged later


def test_a_rig_given_as_a_log_is_named_as_such(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text("# a rig\n[site]\nlatitude = 51.08\nlongitude = -114.13\n[imu]\nname = 'A'\n")
    with pytest.raises(LogError, match="is a rig, not a log; give the log"):
        read_imu(path, default_rig())
