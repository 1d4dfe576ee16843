"""Estimators: Kalibr, OpenVINS, ORB-SLAM3, LIO-SAM, VINS-Mono and VINS-Fusion, ROS messages.

Units and formulas follow the code of each program: densities for Kalibr, OpenVINS, ORB-SLAM3 and
LIO-SAM (rpng/open_vins NoiseManager.h, TixiaoShan/LIO-SAM imuPreintegration.cpp), per-sample
values for VINS (integration_base.h) and variances per message for ROS (sensor_msgs/Imu).
"""

import numpy as np

from rotcli.export.intrinsics import intrinsics
from rotcli.export.numbers import Numbers
from rotcli.export.numbers import write_number as _n
from rotcli.export.target import Body, Format
from rotcli.models.noise_numbers import (
    ACCEL_WALK_DENSITY,
    GYRO_WALK_DENSITY,
    KALIBR_KEYS,
    midpoint_sample,
    sample_variance,
    walk_rate_per_step,
)
from rotcli.units import FloatArray

_YAML_1_0 = "%YAML:1.0"  # OpenCV's FileStorage insists on it in the first line


def matrix_lines(name: str, matrix: FloatArray, indent: str) -> list[str]:
    """Return a matrix as YAML: a name, then one list per row."""
    rows = [f"{indent}  - [{', '.join(_n(v) for v in row)}]" for row in np.asarray(matrix) + 0.0]
    return [f"{indent}{name}:", *rows]


def _four(numbers: Numbers, indent: str = "") -> list[str]:
    (gyro, accel), (gyro_walk, accel_walk) = numbers.single("white"), numbers.single("walk")
    return [
        f"{indent}{KALIBR_KEYS['accel', 'white']}: {_n(accel)}  # m/s^2/sqrt(Hz), N",
        f"{indent}{KALIBR_KEYS['accel', 'walk']}: {_n(accel_walk)}  # {ACCEL_WALK_DENSITY}, K",
        f"{indent}{KALIBR_KEYS['gyro', 'white']}: {_n(gyro)}  # rad/s/sqrt(Hz), N",
        f"{indent}{KALIBR_KEYS['gyro', 'walk']}: {_n(gyro_walk)}  # {GYRO_WALK_DENSITY}, K",
    ]


_NO_INTRINSICS = (
    "the nine elements of the gyro matrix are not all known: calibrated sensors assumed"
)
_NO_ACCEL = "the accelerometer matrix is not known: the identity is written"


def kalibr(numbers: Numbers) -> Body:
    """Return imu.yaml of Kalibr; with all of N known, the model scale-misalignment."""
    lines = ["rostopic: /imu0", f"update_rate: {_n(numbers.rate)}  # Hz", *_four(numbers)]
    known = intrinsics(numbers.figures)
    if known is None:
        return Body(lines, [_NO_INTRINSICS])
    lines += ["model: scale-misalignment", "gyroscopes:"]
    lines += matrix_lines("M", known.gyro_lower, "  ")
    lines += matrix_lines("C_gyro_i", known.gyro_rotation, "  ")
    lines += matrix_lines("A", known.g_sensitivity, "  ")
    lines += ["accelerometers:", *matrix_lines("M", known.accel, "  ")]
    notes = ["gyroscopes: reading = M C_gyro_i w + A f + bias; the frame is the accelerometers'"]
    return Body(lines, notes if known.accel_known else [*notes, _NO_ACCEL])


def openvins(numbers: Numbers) -> Body:
    """Return kalibr_imu_chain.yaml of OpenVINS, model kalibr."""
    known = intrinsics(numbers.figures)
    eye = np.eye(3)
    lines = ["imu0:", *matrix_lines("T_i_b", np.eye(4), "  "), *_four(numbers, "  ")]
    lines += ["  rostopic: /imu0", "  time_offset: 0.0", f"  update_rate: {_n(numbers.rate)}"]
    lines += ['  model: "kalibr"']
    lines += matrix_lines("Tw", eye if known is None else known.gyro_lower, "  ")
    lines += matrix_lines("R_IMUtoGYRO", eye if known is None else known.gyro_rotation, "  ")
    lines += matrix_lines("Ta", eye if known is None else known.accel, "  ")
    lines += matrix_lines("R_IMUtoACC", eye, "  ")
    lines += matrix_lines("Tg", np.zeros((3, 3)) if known is None else known.g_sensitivity, "  ")
    if known is None:
        return Body(lines, [_NO_INTRINSICS])
    notes = ["Tw is Kalibr's gyroscopes M, R_IMUtoGYRO its C_gyro_i, Tg its A, Ta accelerometers M"]
    return Body(lines, notes if known.accel_known else [*notes, _NO_ACCEL])


def orb_slam3(numbers: Numbers) -> Body:
    """Return the IMU keys of an ORB-SLAM3 settings file."""
    (gyro, accel), (gyro_walk, accel_walk) = numbers.single("white"), numbers.single("walk")
    lines = [
        f"IMU.NoiseGyro: {_n(gyro)}  # rad/s/sqrt(Hz), N",
        f"IMU.NoiseAcc: {_n(accel)}  # m/s^2/sqrt(Hz), N",
        f"IMU.GyroWalk: {_n(gyro_walk)}  # rad/s^2/sqrt(Hz), K",
        f"IMU.AccWalk: {_n(accel_walk)}  # m/s^3/sqrt(Hz), K",
        f"IMU.Frequency: {_n(numbers.rate)}  # Hz",
    ]
    return Body(lines, ["copy these keys into the settings file of the camera"])


def lio_sam(numbers: Numbers) -> Body:
    """Return the IMU keys of LIO-SAM's params.yaml."""
    (gyro, accel), (gyro_walk, accel_walk) = numbers.single("white"), numbers.single("walk")
    lines = [
        "lio_sam:",
        f"  imuAccNoise: {_n(accel)}  # m/s^2/sqrt(Hz), N",
        f"  imuGyrNoise: {_n(gyro)}  # rad/s/sqrt(Hz), N",
        f"  imuAccBiasN: {_n(accel_walk)}  # m/s^3/sqrt(Hz), K",
        f"  imuGyrBiasN: {_n(gyro_walk)}  # rad/s^2/sqrt(Hz), K",
        f"  imuGravity: {_n(numbers.gravity)}  # m/s^2",
    ]
    return Body(lines, [*_gravity_note(numbers), "ROS 2: put the keys under /**: ros__parameters"])


def _gravity_note(numbers: Numbers) -> list[str]:
    if numbers.figures.gravity is not None:
        return []
    return ["no input states the site: gravity is the standard 9.80665 m/s^2"]


def vins(numbers: Numbers) -> Body:
    """Return the IMU keys of VINS-Mono and VINS-Fusion.

    One step adds 2 (dt/2)^2 gyr_n^2 to the variance of the angle, half of the growth that
    independent samples of variance gyr_n^2 give; gyr_n = N sqrt(2 f) makes it N^2 per second. The
    bias step is (gyr_w dt)^2, so gyr_w = K sqrt(f).
    """
    f = numbers.rate
    (gyro, accel), (gyro_walk, accel_walk) = numbers.single("white"), numbers.single("walk")
    lines = [
        f"acc_n: {_n(midpoint_sample(accel, f))}  # m/s^2 per sample, N sqrt(2 f)",
        f"gyr_n: {_n(midpoint_sample(gyro, f))}  # rad/s per sample, N sqrt(2 f)",
        f"acc_w: {_n(walk_rate_per_step(accel_walk, f))}  # m/s^3 per step, K sqrt(f)",
        f"gyr_w: {_n(walk_rate_per_step(gyro_walk, f))}  # rad/s^2 per step, K sqrt(f)",
        f"g_norm: {_n(numbers.gravity)}  # m/s^2",
    ]
    notes = ["the values belong to this rate: another rate needs another export"]
    return Body(lines, [*notes, *_gravity_note(numbers)])


def ros(numbers: Numbers) -> Body:
    """Return the covariance fields of sensor_msgs/Imu: variances per message at the rate."""
    lines = ["orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"]
    names = ("angular_velocity_covariance", "linear_acceleration_covariance")
    for name, triad in zip(names, numbers.noise(), strict=True):
        one = triad.one(triad.white, numbers.settings.axes)
        density = np.where(np.isfinite(triad.white), triad.white, one)
        matrix = np.diag(sample_variance(density, numbers.rate))
        lines.append(f"{name}: [{', '.join(_n(v) for v in matrix.flat)}]")
    notes = [
        "variances per message at this rate, (rad/s)^2 and (m/s^2)^2; zero would mean unknown",
        "orientation_covariance[0] = -1: the message contains no orientation",
    ]
    return Body(lines, notes)


_NOISE = frozenset({"white", "walk"})
_INTRINSIC = frozenset({"gyro_scale", "gyro_installation", "accel_scale", "accel_installation"})
FORMATS = (
    Format(
        "kalibr", "Kalibr imu.yaml", "imu.yaml", _NOISE | _INTRINSIC | {"g_sensitivity"}, kalibr
    ),
    Format(
        "openvins",
        "OpenVINS kalibr_imu_chain.yaml",
        "kalibr_imu_chain.yaml",
        _NOISE | _INTRINSIC | {"g_sensitivity"},
        openvins,
        first=_YAML_1_0,
    ),
    Format("orb-slam3", "ORB-SLAM3 settings", "imu.yaml", _NOISE, orb_slam3, first=_YAML_1_0),
    Format("lio-sam", "LIO-SAM params.yaml", "params.yaml", _NOISE, lio_sam),
    Format("vins", "VINS-Mono and VINS-Fusion", "imu.yaml", _NOISE, vins, first=_YAML_1_0),
    Format("ros", "ROS sensor_msgs/Imu", "imu_covariance.yaml", frozenset({"white", "axes"}), ros),
)
