"""Exported values of the NAV440 against the design's table, computed there by hand."""

import ast
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from rotcli.errors import ResultError
from rotcli.export.figures import collect
from rotcli.export.formats import all_formats, render
from rotcli.export.numbers import Settings
from tests.export import documents


def text(name: str, *docs, **settings) -> str:
    return render(name, collect(docs or (documents.allan(),)), Settings(**settings)).text


def yaml_values(exported: str) -> dict[str, float]:
    """Return `key: number` lines; a number of YAML 1.1 has a point and a signed exponent."""
    pattern = r"^\s*([\w.]+): ([-+]?[0-9]+\.[0-9]*(?:e[-+][0-9]+)?)(?:\s|$)"
    return {key: float(value) for key, value in re.findall(pattern, exported, re.MULTILINE)}


def printed(value: float, digits: int) -> str:
    return f"{value:.{digits}e}"


@pytest.mark.parametrize(
    ("name", "key", "expected"),
    [
        ("kalibr", "gyroscope_noise_density", "1.163553e-04"),
        ("kalibr", "gyroscope_random_walk", "1.696848e-06"),
        ("kalibr", "accelerometer_noise_density", "8.0e-04"),
        ("kalibr", "update_rate", "1.0e+02"),
        ("openvins", "gyroscope_noise_density", "1.163553e-04"),
        ("openvins", "gyroscope_random_walk", "1.696848e-06"),
        ("orb-slam3", "IMU.NoiseGyro", "1.163553e-04"),
        ("orb-slam3", "IMU.NoiseAcc", "8.0e-04"),
        ("orb-slam3", "IMU.GyroWalk", "1.696848e-06"),
        ("orb-slam3", "IMU.Frequency", "1.0e+02"),
        ("lio-sam", "imuAccNoise", "8.0e-04"),
        ("lio-sam", "imuGyrNoise", "1.163553e-04"),
        ("lio-sam", "imuGyrBiasN", "1.696848e-06"),
        ("lio-sam", "imuGravity", "9.8083e+00"),
        ("vins", "gyr_n", "1.645512e-03"),
        ("vins", "acc_n", "1.131371e-02"),
        ("vins", "gyr_w", "1.696848e-05"),
        ("vins", "g_norm", "9.8083e+00"),
    ],
)
def test_estimator_value_equals_the_table(name: str, key: str, expected: str) -> None:
    digits = len(expected.split(".")[1].split("e")[0])
    assert printed(yaml_values(text(name))[key], digits) == expected


def test_all_six_keys_of_every_yaml_format_are_numbers_for_yaml_1_1() -> None:
    assert set(yaml_values(text("vins"))) == {"acc_n", "gyr_n", "acc_w", "gyr_w", "g_norm"}
    assert len([k for k in yaml_values(text("kalibr")) if k.endswith(("density", "walk"))]) == 4
    assert text("openvins").startswith("%YAML:1.0\n")
    assert text("orb-slam3").startswith("%YAML:1.0\n")


def test_ros_covariances_are_variances_per_message() -> None:
    exported = text("ros")
    gyro = ast.literal_eval(re.search(r"angular_velocity_covariance: (.*)", exported)[1])
    accel = ast.literal_eval(re.search(r"linear_acceleration_covariance: (.*)", exported)[1])
    assert [printed(gyro[k], 6) for k in (0, 4, 8)] == ["1.353855e-06"] * 3
    assert [printed(accel[k], 1) for k in (0, 4, 8)] == ["6.4e-05"] * 3
    assert sum(map(bool, gyro)) == 3
    assert "orientation_covariance: [-1.0, 0.0" in exported


def test_ekf_noise_is_a_comment_with_its_default() -> None:
    exported = text("px4", documents.allan(), documents.triad())
    values = dict(re.findall(r"# (EKF2_\w+) (\S+) \(default", exported))
    assert printed(float(values["EKF2_GYR_NOISE"]), 4) == "1.1636e-03"
    assert printed(float(values["EKF2_GYR_B_NOISE"]), 4) == "1.6968e-05"
    assert not re.search(r"^1\t1\tEKF2", exported, re.MULTILINE)


def test_gnss_ins_sim_drift_makes_the_walk_at_this_rate() -> None:
    namespace: dict = {}
    exec(text("gnss-ins-sim"), namespace)
    errors = namespace["imu_err"]
    assert errors["gyro_b_stability"] == pytest.approx([3.5] * 3, rel=1e-9)
    assert (errors["gyro_b_corr"] >= 1e12).all()
    assert errors["gyro_arw"] == pytest.approx([0.4] * 3, rel=1e-9)
    assert errors["accel_vrw"] == pytest.approx([0.048] * 3, rel=1e-9)


def test_navego_and_psins_values_equal_the_table() -> None:
    navego = dict(re.findall(r"imu\.(\w+) = \[(\S+) ", text("navego")))
    assert printed(float(navego["arrw"]), 4) == "5.8333e-03"
    psins = text("psins", documents.allan(), documents.triad())
    arrays = dict(re.findall(r"^(\w+) = \[(.*)\];", psins, re.MULTILINE))
    values = [float(v) for v in arrays["dKGij"].split(";")]
    assert [f"{v:.4f}" for v in values] == [
        "-103.1324", "61.8794", "-72.1927", "82.5059", "-226.8913", "165.0118",
    ]  # fmt: skip
    assert f"{float(arrays['sqrtR0G'].split(';')[0]):.1f}" == "21.0"
    assert f"{float(arrays['wdb'].split(';')[0]):.3f}" == "81.577"
    assert "TauG = inf;" in psins


def test_biases_and_scale_factors_of_a_full_calibration_reach_gnss_ins_sim_and_psins() -> None:
    source, doc = documents.triad()
    micro_g = 1e-6 * 9.80665
    for axis, bias, square in (("x", 1e-2, 20.0), ("y", -2e-2, 0.0), ("z", 3e-2, -10.0)):
        doc["parameters"][f"accel_bias_{axis}"] = documents.quantity(bias, 1e-4, "m/s^2")
        doc["parameters"][f"Ka2_{axis}"] = documents.quantity(square, 1.0, "ug/g^2")
    namespace: dict = {}
    exec(text("gnss-ins-sim", documents.allan(), (source, doc)), namespace)
    assert namespace["imu_err"]["gyro_b"] == pytest.approx([120.0, -90.0, 60.0], rel=1e-9)
    assert namespace["imu_err"]["accel_b"] == pytest.approx([1e-2, -2e-2, 3e-2], rel=1e-9)
    psins = text("psins", documents.allan(), (source, doc))
    arrays = {
        key: [float(v) for v in row.split(";")]
        for key, row in re.findall(r"^(\w+) = \[(.*)\];", psins, re.MULTILINE)
    }
    assert arrays["eb"] == pytest.approx([120.0, -90.0, 60.0], rel=1e-9)
    assert arrays["db"] == pytest.approx([1e-2 / micro_g, -2e-2 / micro_g, 3e-2 / micro_g])
    assert arrays["KA2"] == pytest.approx([20.0, 0.0, -10.0], abs=1e-6)
    # The accelerometer frame is that of identity; the diagonal is that of the profile.
    assert arrays["dKGii"] == pytest.approx([900.0, -600.0, 1200.0], rel=1e-6)


def test_gazebo_noise_is_per_sample_and_its_drift_a_density() -> None:
    root = ET.fromstring("<root>" + text("gazebo") + "</root>")
    noise = root.find("sensor/imu/angular_velocity/z/noise")
    assert printed(float(noise.findtext("stddev")), 6) == "1.163553e-03"
    assert printed(float(noise.findtext("dynamic_bias_stddev")), 6) == "1.696848e-06"


def test_matlab_script_states_the_noise_type_and_percent() -> None:
    exported = text("matlab", documents.allan(), documents.triad())
    assert exported.count("'NoiseType', 'double-sided'") == 2
    assert "[100.09, 0.04, -0.11; -0.05, 99.94, 0.08; 0.03, -0.035, 100.12]" in exported
    bias = re.search(r"'BiasInstability', \[(\S+),", exported)[1]
    assert printed(float(bias), 6) == "7.592182e-05"


def matrix(exported: str, name: str) -> np.ndarray:
    lines = exported.splitlines()
    start = next(k for k, line in enumerate(lines) if line.strip() == f"{name}:")
    return np.array([ast.literal_eval(line.strip()[2:]) for line in lines[start + 1 : start + 4]])


def test_kalibr_intrinsics_equal_the_table() -> None:
    exported = text("kalibr", documents.allan(), documents.triad())
    M, C = matrix(exported, "M"), matrix(exported, "C_gyro_i")
    expected_M = [
        [1.000900684, 0, 0],
        [-1.01479e-4, 0.999400440, 0],
        [-8.00469e-4, 4.51209e-4, 1.001199684],
    ]
    expected_C = [
        [0.999999316, 3.99640e-4, -1.09901e-3],
        [-3.98761e-4, 0.999999600, 8.00368e-4],
        [1.09933e-3, -7.99930e-4, 0.999999076],
    ]
    # Printed to 1e-9 on the diagonal and six digits elsewhere; the file has 10 digits.
    assert np.abs(M - expected_M).max() < 6e-10
    assert np.abs(C - expected_C).max() < 6e-9
    N = 1e-6 * np.array(documents.MATRIX)
    assert np.abs(M @ C - np.eye(3) - N).max() < 1e-9
    openvins = text("openvins", documents.allan(), documents.triad())
    assert np.array_equal(matrix(openvins, "Tw"), M)
    assert np.array_equal(matrix(openvins, "R_IMUtoGYRO"), C)


def test_walk_from_bias_is_written_only_where_the_walk_is_not_significant() -> None:
    doc = documents.allan(gyro_walk=None, gyro_limit=5.0)
    exported = text("kalibr", doc, walk_from="bias", navigation=3600.0)
    assert printed(yaml_values(exported)["gyroscope_random_walk"], 3) == "1.456e-06"
    assert "T = 3600 s" in exported
    measured = text("kalibr", walk_from="bias", navigation=3600.0)
    assert printed(yaml_values(measured)["gyroscope_random_walk"], 6) == "1.696848e-06"


def test_an_insignificant_walk_is_its_upper_limit_with_a_comment() -> None:
    exported = text("kalibr", documents.allan(gyro_walk=None, gyro_limit=0.35))
    assert printed(yaml_values(exported)["gyroscope_random_walk"], 6) == "1.696848e-06"
    assert (
        "gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z: K is not significant; its 95 %"
        in exported
    )


def test_max_rms_and_inflation_follow_their_definitions() -> None:
    source, doc = documents.allan()
    for axis, value in zip(documents.AXES[:3], (0.3, 0.4, 0.5), strict=True):
        doc["axes"][axis]["coefficients"]["random_walk"]["value"] = value
    unit = np.pi / 180 / 60
    rms = yaml_values(text("kalibr", (source, doc)))["gyroscope_noise_density"]
    worst = yaml_values(text("kalibr", (source, doc), axes="max"))["gyroscope_noise_density"]
    inflated = yaml_values(text("kalibr", (source, doc), inflate=10.0))["gyroscope_noise_density"]
    assert rms == pytest.approx(unit * np.sqrt((0.09 + 0.16 + 0.25) / 3), rel=1e-9)
    assert worst == pytest.approx(0.5 * unit, rel=1e-9)
    assert inflated == pytest.approx(10 * rms, rel=1e-9)


@pytest.mark.parametrize("name", list(all_formats()))
def test_every_format_names_source_hash_rate_rule_and_losses(name: str) -> None:
    docs = (documents.allan(), documents.triad())
    exported = render(name, collect(docs), Settings())
    for expected in ("allan.json", "a" * 64, "b" * 64, "NAV440", "100 Hz", "root mean square"):
        assert expected in exported.text
    assert "lost (no field in this format):" in exported.text
    assert render(name, collect(docs), Settings()).text == exported.text
    if name in ("vins", "ros", "px4"):
        assert "gyro installation errors" in exported.lost


def test_missing_and_wrong_inputs_are_one_line() -> None:
    with pytest.raises(ResultError, match=r"triad\.json: no gyro noise; add an allan result"):
        text("kalibr", documents.triad())
    source, doc = documents.allan(rig={"imu": {"name": "MTi-G"}})
    with pytest.raises(ResultError, match="name NAV440, but an earlier input has MTi-G"):
        text("kalibr", (source, doc), documents.triad())
    source, doc = documents.allan()
    doc["axes"]["gyro_x"]["coefficients"]["random_walk"]["unit"] = "deg/s"
    with pytest.raises(ResultError, match=r"gyro_x: 0\.4 in 'deg/s' is not a gyro random_walk"):
        text("kalibr", (source, doc))
    with pytest.raises(ResultError, match="not a valid allan result"):
        collect([(source, {"kind": "allan", "axes": {"gyro_x": {}}})])
    with pytest.raises(ResultError, match="kind navigation cannot be exported"):
        collect([(source, {"kind": "navigation"})])
    with pytest.raises(ResultError, match="no bias and no temperature model"):
        text("px4", documents.allan())
