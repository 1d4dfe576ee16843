"""A channel is one row of the table: what reads logs needs to know nothing else of it."""

import json
import subprocess
import sys

import numpy as np
import pytest

# A row is added before anything that uses the table is imported.
READ_WITH_A_NEW_ROW = """
import sys, json
from rotcli.files import channels
row = channels.Channel("chamber", "chamber", "temperature", 1e3, "degC", "chamber", optional=True,
                       names=("chamber", "t_chamber"))
channels.OPTIONAL += (row,)
channels.IMU_CHANNELS += (row,)
channels.BY_NAME["chamber"] = row
from rotcli.logs.imu import read_imu
from rotcli.logs.readings import file_columns, read_readings
from rotcli.logs.stream import open_imu
from rotcli.rig.rig import default_rig, rig_from_dict
log = read_imu(sys.argv[1], default_rig())
part = log.crop(1.0, 2.0)
streamed = open_imu(sys.argv[1], default_rig(), in_memory_factor=0.0)
named = rig_from_dict({"imu": {"columns": {"chamber": "other"}, "units": {"chamber": "degC"}}})
print(json.dumps({
    "log": log.column("chamber").tolist(),
    "part": part.column("chamber").tolist(),
    "streamed": streamed.crop(-1.0, 1e9).column("chamber").tolist(),
    "temperature": log.temperature is None,
    "written": list(file_columns(read_readings(sys.argv[1], default_rig()))),
    "named": read_imu(sys.argv[1], named).column("chamber").tolist(),
}))
"""


def test_a_new_channel_is_found_scaled_cropped_streamed_and_written(tmp_path):
    n = 400
    rng = np.random.default_rng(1)
    kelvin, other = 300.0 + 0.01 * np.arange(n), 20.0 + 0.5 * np.arange(n)
    names = [
        "time [s]",
        *(f"gyro_{a} [rad/s]" for a in "xyz"),
        *(f"accel_{a} [m/s^2]" for a in "xyz"),
    ]
    values = np.column_stack(
        [0.01 * np.arange(n), 1e-3 * rng.normal(size=(n, 6)) + [0, 0, 0, 0, 0, 9.8], kelvin, other]
    )
    path = tmp_path / "imu.csv"
    header = ",".join([*names, "T_chamber [K]", "other"])
    np.savetxt(path, values, fmt="%.6f", delimiter=",", header=header, comments="")
    run = [sys.executable, "-c", READ_WITH_A_NEW_ROW, str(path)]
    found = json.loads(subprocess.run(run, capture_output=True, text=True, check=True).stdout)
    celsius = kelvin - 273.15
    assert found["log"] == pytest.approx(celsius, abs=1e-6)
    assert found["part"] == pytest.approx(celsius[100:201], abs=1e-6)
    assert found["streamed"] == pytest.approx(celsius, abs=1e-6)
    assert found["temperature"] is True
    assert "chamber [degC]" in found["written"]
    assert found["named"] == pytest.approx(other)
