"""Reading the temperature of an IMU log or of a thermometer's log."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.files.columns import write_columns
from rotcli.logs.imu import read_imu
from rotcli.logs.temperature import read_temperature
from rotcli.rig.rig import default_rig, rig_from_dict

TIME = np.arange(0, 120, 0.1)


def imu_log(path, temperature=None, name="temperature [degC]"):
    rng = np.random.default_rng(1)
    columns = {"time [s]": TIME}
    for kind, unit in (("gyro", "rad/s"), ("accel", "m/s^2")):
        for axis in "xyz":
            columns[f"{kind}_{axis} [{unit}]"] = 1e-3 * rng.standard_normal(len(TIME))
    columns["accel_z [m/s^2]"] = columns["accel_z [m/s^2]"] + 9.8
    if temperature is not None:
        columns[name] = temperature
    write_columns(path, columns)
    return path


def read(path, rig=None, **keys):
    rig = rig or default_rig()
    return read_temperature(read_imu(str(path), rig), rig, **keys)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("temperature [degC]", 20 + TIME / 60),
        ("temperature [K]", 293.15 + TIME / 60),
        ("temperature [degF]", 68 + 1.8 * TIME / 60),
        ("Temp", 20 + TIME / 60),
    ],
)
def test_a_column_is_read_in_its_unit(tmp_path, suffix, name, values):
    found = read(imu_log(tmp_path / f"imu.{suffix}", values, name))
    np.testing.assert_allclose(found.at(np.array([30.0, 90.0])), [20.5, 21.5], atol=1e-3)
    assert found.rows == len(TIME)
    assert len(found.time) == 120
    assert found.slope(np.array([30.0]), np.array([90.0]))[0] * 60 == pytest.approx(1.0, rel=1e-3)


def test_a_log_without_temperature_has_none(tmp_path):
    assert read(imu_log(tmp_path / "imu.csv")) is None


def test_the_rig_names_column_and_unit(tmp_path):
    rig = rig_from_dict(
        {"imu": {"columns": {"temperature": "chip"}, "units": {"temperature": "K"}}}
    )
    found = read(imu_log(tmp_path / "imu.csv", 300 + 0 * TIME, "chip"), rig)
    np.testing.assert_allclose(found.celsius, 26.85)
    with pytest.raises(LogError, match="chip"):
        read(imu_log(tmp_path / "other.csv"), rig)


def test_steps_of_a_coarse_thermometer_are_filtered(tmp_path):
    rng = np.random.default_rng(3)
    true = 20 + 5 * TIME / 60
    coarse = np.round(true + 0.5 * rng.standard_normal(len(TIME)))
    path = imu_log(tmp_path / "imu.csv", coarse)
    inner = slice(20, 100)
    filtered, raw = read(path), read(path, tau=0.0)
    exact = 20 + 5 * filtered.time / 60
    assert np.std((filtered.celsius - exact)[inner]) < 0.5 * np.std((raw.celsius - exact)[inner])


def test_a_thermometers_log_is_read_with_its_usual_headings(tmp_path):
    path = imu_log(tmp_path / "imu.csv")
    lines = ["Time (s),Processor (degC),Gyroscope and Accelerometer (degC)"]
    lines += [f"{t},{30 + t / 60},{25 + t / 60}" for t in range(0, 121, 5)]
    own = tmp_path / "temperature.csv"
    own.write_text("\n".join(lines))
    found = read(path, log=own)
    assert found.at(np.array([60.0]))[0] == pytest.approx(26.0, abs=0.02)  # of the gyros


@pytest.mark.parametrize(
    ("header", "rows", "message"),
    [
        ("time,pressure", "0,1\n1,2", "no temperature column"),
        ("when,temperature", "0,20\n1,21", "no time column"),
        ("time,temperature [furlong]", "0,20\n1,21", "no temperature column"),
        ("time,temperature", "0,20\n1,5000", "row 3: temperature: 5000 degC is not a temperature"),
        ("time,temperature", "0,20\n1,x", "not a number"),
    ],
)
def test_a_wrong_thermometers_log_is_one_error(tmp_path, header, rows, message):
    path = imu_log(tmp_path / "imu.csv")
    own = tmp_path / "t.csv"
    own.write_text(f"{header}\n{rows}\n")
    with pytest.raises(LogError, match=message):
        read(path, log=own)


def test_a_temperature_that_ends_early_is_an_error(tmp_path):
    path = imu_log(tmp_path / "imu.csv", 20 + 0 * TIME)
    with pytest.raises(LogError, match="check the clocks"):
        read(path).at(np.array([0.0, 500.0]))
