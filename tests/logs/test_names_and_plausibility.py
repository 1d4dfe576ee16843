"""Names of columns and units by plausibility: many logs, one line each."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.describe.aliases import find_triads, find_triads_by_unit
from rotcli.logs.imu import read_imu
from rotcli.rig.rig import default_rig
from tests.logs.lab_logs import AXES, DEG, PLAIN, G, T, advice, columns, readings, rig, right, write

NAMES = [
    "xgyro ygyro zgyro xacc yacc zacc",
    "p q r ax ay az",
    "roll_rate pitch_rate yaw_rate ax ay az",
    "GYRO_XOUT GYRO_YOUT GYRO_ZOUT ACCEL_XOUT ACCEL_YOUT ACCEL_ZOUT",
    "gyroADC[0] gyroADC[1] gyroADC[2] accSmooth[0] accSmooth[1] accSmooth[2]",
    "dThetaX dThetaY dThetaZ dVelX dVelY dVelZ",
    "gyro_cal_x gyro_cal_y gyro_cal_z acc_cal_x acc_cal_y acc_cal_z",
    "wib_x wib_y wib_z fib_x fib_y fib_z",
    "ω_x ω_y ω_z a_x a_y a_z",
    "Gyro(X) Gyro(Y) Gyro(Z) Acc(X) Acc(Y) Acc(Z)",
    "S1_Gyroscope_X_CAL S1_Gyroscope_Y_CAL S1_Gyroscope_Z_CAL "
    "S1_Accelerometer_X_CAL S1_Accelerometer_Y_CAL S1_Accelerometer_Z_CAL",
    "Drehrate_X Drehrate_Y Drehrate_Z Beschleunigung_X Beschleunigung_Y Beschleunigung_Z",
    "imu/angular_velocity/x imu/angular_velocity/y imu/angular_velocity/z "
    "imu/linear_acceleration/x imu/linear_acceleration/y imu/linear_acceleration/z",
]


@pytest.mark.parametrize("names", NAMES)
def test_the_columns_of_many_programs_are_known(tmp_path, names):
    gyro, accel = readings()
    path = write(tmp_path / "a.csv", ["time", *names.split(" ")], columns(T, gyro, accel))
    log = right(read_imu(path, default_rig()))
    np.testing.assert_allclose(log.gyro, gyro, atol=1e-9)
    np.testing.assert_allclose(log.accel, accel, atol=1e-9)


def test_readings_that_are_not_those_of_the_sensor_are_no_triad():
    for word in ("gyro_bias", "FreeAcc", "userAcceleration", "gravity", "gyro_setpoint"):
        assert find_triads([f"{word}_{axis}" for axis in "xyz"], "gyro") == []
        assert find_triads([f"{word}_{axis}" for axis in "xyz"], "accel") == []
    assert find_triads(["yaw_rate", "x_rate", "z_rate"], "gyro") == []
    (triad,) = find_triads_by_unit(
        ["t", "X Axis", "Y Axis", "Z Axis"], ["s", "g", "g", "g"], "accel"
    )
    assert triad.columns == (1, 2, 3)


@pytest.mark.parametrize(
    ("size", "unit"), [(G, "g"), (G / 1000, "mg"), (0.01, "cm/s^2"), (0.3048, "ft/s^2")]
)
def test_accelerometers_are_read_in_the_unit_in_which_they_measure_gravity(tmp_path, size, unit):
    gyro, accel = readings()
    names = ["time [s]", *(f"gyro_{a} [rad/s]" for a in "xyz"), *AXES[3:]]
    path = write(tmp_path / "a.csv", names, columns(T, gyro, accel / size))
    log = read_imu(path, default_rig())
    np.testing.assert_allclose(log.accel, accel, rtol=1e-9)
    assert f"They are read as {unit}" in log.warnings[0]


def test_increments_are_recognised_where_they_look_like_accelerations(tmp_path):
    t = np.arange(600) * 0.1
    gyro, accel = readings(600, 10.0)
    path = write(tmp_path / "slow.csv", ["time", *AXES], columns(t, gyro * 0.1, accel * 0.1))
    assert 'increments; set [imu] sampling = "increment"' in advice(path)
    np.testing.assert_allclose(read_imu(path, rig(sampling="increment")).accel, accel, rtol=1e-9)
    gyro, accel = readings()
    cells = columns(T, gyro * 0.01, accel / G * 0.01)
    path = write(tmp_path / "gs.csv", ["time", *AXES], cells)
    assert "increments in g s; set [imu] sampling" in advice(path)
    setup = rig(sampling="increment", scale={"accel": 9.80665})
    np.testing.assert_allclose(read_imu(path, setup).accel, accel, rtol=1e-9)


def test_gyros_too_noisy_in_rad_and_deg_ask_for_their_unit(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "m.csv", ["time", *AXES], columns(T, gyro / DEG * 1000, accel))
    assert 'absurd; set [imu] units = { gyro = "mdeg/s" }' in advice(path)
    right(read_imu(path, rig(units={"gyro": "mdeg/s"})))


def test_counts_with_decimals_are_counts_too(tmp_path):
    gyro, accel = readings()
    cells = columns(T, gyro / DEG * 131, np.rint(accel / G * 16384) + 0.25)
    path = write(tmp_path / "c.csv", PLAIN[:4] + AXES[3:], cells)
    assert "numbers in no unit of acceleration: raw counts" in advice(path)


def test_channels_of_the_rig_leave_the_other_columns_unread(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "l.csv", PLAIN, columns(T, gyro, accel - [0.05, 0, 9.8]))
    assert 'linear acceleration; set [imu] channels = ["gyro"]' in advice(path)
    right(read_imu(path, rig(channels=["gyro"])))


def test_one_gyro_under_any_name_gets_its_line(tmp_path):
    gyro, _ = readings()
    path = write(tmp_path / "one.csv", ["time", "Gz [rad/s]"], [T, gyro[:, 2]])
    text = advice(path)
    assert 'set [imu] columns = { gyro_z = "Gz [rad/s]" } and [imu] channels = ["gyro_z"]' in text
    log = read_imu(path, rig(columns={"gyro_z": "Gz [rad/s]"}, channels=["gyro_z"]))
    np.testing.assert_allclose(log.gyro[:, 2], gyro[:, 2], atol=1e-12)
    path = write(tmp_path / "bare.csv", [], [gyro[:, 2]])
    setup = rig(columns={"gyro_z": 1}, channels=["gyro_z"], rate=100, units={"gyro": "rad/s"})
    np.testing.assert_allclose(read_imu(path, setup).gyro[:, 2], gyro[:, 2], atol=1e-12)


def test_records_without_a_header_get_a_line_with_the_triad_that_shows_gravity(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "n.csv", [], [T, *accel.T, *gyro.T])
    assert "columns = { time = 1, gyro_x = 5, gyro_y = 6, gyro_z = 7, accel_x = 2" in advice(path)


def test_a_second_file_of_accelerometers_may_name_its_columns_otherwise(tmp_path):
    gyro, accel = readings()
    write(tmp_path / "a.csv", ["Time (s)", "X", "Y", "Z"], [T[::2], *(accel[::2] / G).T])
    path = write(tmp_path / "g.csv", ["stamp", "r1", "r2", "r3"], [T, *gyro.T])
    names = {"time": "stamp", "gyro_x": "r1", "gyro_y": "r2", "gyro_z": "r3"}
    names |= {"accel_x": "X", "accel_y": "Y", "accel_z": "Z"}
    setup = rig(columns=names, accel_log="a.csv", units={"gyro": "rad/s", "accel": "g"})
    log = read_imu(path, setup)
    np.testing.assert_allclose(log.gyro, gyro[:-1], atol=1e-9)
    assert log.accel[:, 2].mean() == pytest.approx(9.8, rel=1e-3)
    assert log.warnings == ()


def test_sensors_in_separate_records_are_read_with_the_file_named_twice(tmp_path):
    gyro, accel = readings()
    rows = [
        (t, [f"{t:.3f}", *(f"{v:.9g}" for v in w), "", "", ""])
        for t, w in zip(T, gyro, strict=True)
    ]
    rows += [(t + 2e-3, [f"{t + 2e-3:.3f}", "", "", "", *(f"{v:.9g}" for v in f)])
             for t, f in zip(T, accel, strict=True)]  # fmt: skip
    lines = [",".join(row) for _, row in sorted(rows)]
    path = tmp_path / "s.csv"
    path.write_text("\n".join([",".join(PLAIN), *lines]) + "\n")
    assert 'in different records; set [imu] accel_log = "s.csv"' in advice(path)
    log = read_imu(path, rig(accel_log="s.csv"))
    assert log.samples == pytest.approx(len(T), abs=1)
    assert log.accel[:, 2].mean() == pytest.approx(9.8, rel=1e-3)


def test_a_column_that_alternates_may_number_the_imus(tmp_path):
    gyro, accel = readings()
    t = np.sort(np.concatenate([T, T + 0.0046]))
    cells = [t, ["12"[k % 2] for k in range(len(t))], *np.repeat(np.hstack([gyro, accel]), 2, 0).T]
    path = write(tmp_path / "two.csv", [PLAIN[0], "Channel", *PLAIN[1:]], cells)
    assert any(
        "Channel alternates (1, 2)" in text for text in read_imu(path, default_rig()).warnings
    )
    right(read_imu(path, rig(instance=1)))


def test_a_problem_of_a_column_by_its_plain_name_is_an_error_of_a_word_in_brackets(tmp_path):
    gyro, accel = readings()
    for inside, read in (("x8005", True), ("0", True), ("furlong", False), ("deg/ss", False)):
        names = [f"gyro_{a} [{inside}]" for a in "xyz"]
        path = write(tmp_path / "b.csv", ["time [s]", *names, *AXES[3:]], columns(T, gyro, accel))
        if read:
            right(read_imu(path, default_rig()))
        else:
            with pytest.raises(LogError, match=f"unknown unit '{inside}'"):
                read_imu(path, default_rig())
