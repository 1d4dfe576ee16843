"""Columns, units and values: each log is read right, or one message says the line for it."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.imu import read_imu
from rotcli.logs.record import ImuLog
from rotcli.logs.stream import open_imu
from tests.logs.lab_logs import (
    AXES,
    DEG,
    PLAIN,
    VRW,
    G,
    T,
    advice,
    columns,
    random_walk,
    readings,
    rig,
    right,
    write,
)


def test_brackets_that_are_no_unit_are_part_of_the_name(tmp_path):
    gyro, accel = readings()
    px4 = [f"gyro_rad[{k}]" for k in range(3)] + [f"accelerometer_m_s2[{k}]" for k in range(3)]
    cells = columns([str(int(1e7 + 1e4 * k)) for k in range(3000)], gyro, accel)
    path = write(tmp_path / "px4.csv", ["timestamp", *px4], cells)
    named = dict(zip(("time", *AXES), ["timestamp", *px4], strict=True))
    units = {"time": "us", "gyro": "rad/s", "accel": "m/s^2"}
    right(read_imu(path, rig(columns=named, units=units)))
    right(read_imu(path, rig()))
    mip = [f"{a} Gyro [x8005]" for a in "XYZ"] + [f"{a} Accel [x8004]" for a in "XYZ"]
    path = write(tmp_path / "mip.csv", ["GPS TOW", *mip], columns(137649.8 + T, gyro, accel / G))
    short = {f"gyro_{a.lower()}": f"{a} Gyro" for a in "XYZ"}
    short |= {f"accel_{a.lower()}": f"{a} Accel" for a in "XYZ"}
    units = {"gyro": "rad/s", "accel": "g"}
    log = right(read_imu(path, rig(columns={"time": "GPS TOW", **short}, units=units)))
    assert log.accel[:, 2].mean() == pytest.approx(9.8, rel=1e-3)
    right(read_imu(path, rig()))
    odd = [name.replace("x8005", "x9999") for name in mip]
    path = write(tmp_path / "odd.csv", ["GPS TOW", *odd], columns(T, gyro, accel / G))
    log = right(read_imu(path, rig(units={"accel": "g"})))
    assert "the gyro columns have no unit" in log.warnings[0]
    word = [name.replace("x8005", "furlong") for name in mip]
    path = write(tmp_path / "word.csv", ["GPS TOW", *word], columns(T, gyro, accel / G))
    assert "unknown unit 'furlong'; set [imu] units = { gyro = \"rad/s\" }" in advice(path)


def test_units_in_parentheses_are_read_for_tactical_gyros_too(tmp_path):
    gyro, accel = readings(n_gyro=0.003)
    names = ["Time (s)", *(f"Gyro {a} (deg/s)" for a in "XYZ")]
    names += [f"Accel {a} (m/s^2)" for a in "XYZ"]
    path = write(tmp_path / "paren.csv", names, columns(T, gyro / DEG, accel))
    named = dict(zip(("time", *AXES), names, strict=True))
    for setup in (rig(columns=named), rig()):
        right(read_imu(path, setup), n=0.003)


def test_gyros_without_a_unit_cause_a_warning_that_names_the_line(tmp_path):
    gyro, accel = readings(n_gyro=0.003)
    path = write(tmp_path / "bare.csv", ["time", *AXES], columns(T, gyro / DEG, accel))
    (warning,) = read_imu(path, rig()).warnings
    assert 'no unit. rad/s is assumed; set [imu] units = { gyro = "rad/s" }' in warning
    assert right(read_imu(path, rig(units={"gyro": "deg/s"})), n=0.003).warnings == ()


@pytest.mark.parametrize("rate", [50.0, 100.0, 200.0, 500.0])
def test_increments_are_recognised_at_every_rate(tmp_path, rate):
    gyro, accel = readings(rate=rate)
    path = write(
        tmp_path / "inc.csv", ["time", *AXES], columns(T * 100 / rate, gyro / rate, accel / rate)
    )
    assert 'set [imu] sampling = "increment"' in advice(path)
    right(read_imu(path, rig(sampling="increment")), rate=rate)


def test_increments_of_one_triad_only_follow_their_unit(tmp_path):
    gyro, accel = readings()
    names = ["time [s]", *(f"gyro_{a} [deg]" for a in "xyz")]
    names += [f"accel_{a} [m/s^2]" for a in "xyz"]
    path = write(tmp_path / "mixed.csv", names, columns(T, gyro / DEG / 100, accel))
    assert "unit of the gyros is deg, so they contain increments; set [imu] sampling" in advice(
        path
    )
    log = right(read_imu(path, rig(sampling="increment")))
    assert random_walk(log, "accel_x") == pytest.approx(VRW, rel=0.2)


def test_the_rig_overrides_the_unit_of_the_header_and_of_the_format(tmp_path):
    gyro, accel = readings()
    names = ["time [s]", *(f"gyro_{a} [rad/s]" for a in "xyz")]
    names += [f"accel_{a} [m/s^2]" for a in "xyz"]
    path = write(tmp_path / "a.csv", names, columns(T, gyro / DEG, accel))
    log = right(read_imu(path, rig(units={"gyro": "deg/s"})))
    assert "header unit of gyro is rad/s, [imu] units gyro is deg/s. The rig is used" in str(
        log.warnings
    )


def test_a_log_of_gyros_is_read_where_gyros_are_needed(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "g.csv", ["time [s]", *AXES[:3]], columns(T, gyro, accel)[:4])
    assert 'set [imu] channels = ["gyro"]' in advice(path)
    for log in (read_imu(path, rig(channels=["gyro"])), open_imu(path, rig(), channels=AXES[:3])):
        assert isinstance(log, ImuLog)
        assert right(log).channels == AXES[:3]
    path = write(tmp_path / "z.csv", ["time [s]", "gyro_z"], [T, gyro[:, 2]])
    assert read_imu(path, rig(channels=["gyro_z"])).channels == ("gyro_z",)


def test_accelerometers_in_a_second_file_at_another_rate_are_interpolated(tmp_path):
    gyro, _ = readings()
    t = np.arange(0.0, 30.0, 0.016)
    accel = np.stack([np.sin(t), np.cos(t), 9.8 + 0.1 * np.sin(2 * t)], axis=1)
    path = write(tmp_path / "g.csv", ["time [s]", *AXES[:3]], [T, *gyro.T])
    write(tmp_path / "a.csv", ["time [s]", *AXES[3:]], [t, *accel.T])
    log = read_imu(path, rig(accel_log="a.csv"))
    assert log.channels == AXES
    # Cubic interpolation of sines at 16 ms: 3/128 h^4 of the fourth derivative, 1.6 here.
    np.testing.assert_allclose(log.accel[:, 2], 9.8 + 0.1 * np.sin(2 * log.time), atol=1e-8)


def test_raw_counts_are_recognised_and_scaled(tmp_path):
    gyro, accel = readings()
    for offset in (0, 32768):
        raw = np.rint(np.hstack([gyro / DEG * 131 * 64, accel / G * 4096])) + offset
        cells = [T, *([f"{v:.0f}" for v in column] for column in raw.T)]
        path = write(tmp_path / "raw.csv", ["time [s]", *AXES], cells)
        text = advice(path)
        assert "raw counts" in text
        assert "scale = { gyro = 1.0, accel = " in text
        assert ("offset = 32768" in text) == bool(offset)
        scale = {"gyro": 1 / 131 / 64, "accel": 1 / 4096}
        setup = {"scale": scale, "units": {"gyro": "deg/s", "accel": "g"}}
        setup |= {"offset": offset} if offset else {}
        log = right(read_imu(path, rig(**setup)))
        assert log.accel[:, 2].mean() == pytest.approx(9.8, rel=1e-3)


def test_accelerometers_in_g_without_a_unit_are_read_as_g(tmp_path):
    gyro, accel = readings()
    for unit, size in (("g", G), ("mg", G / 1e3)):
        path = write(tmp_path / "g.csv", ["time", *AXES], columns(T, gyro, accel / size))
        log = read_imu(path, rig(units={"gyro": "rad/s"}))
        assert log.accel[:, 2].mean() == pytest.approx(9.8, rel=1e-3)
        assert f'set [imu] units = {{ accel = "{unit}" }}' in log.warnings[0]


def test_two_imus_in_one_log_are_not_mixed(tmp_path):
    first, second = readings(seed=1), readings(seed=2)
    gyro, accel = (np.stack(pair, axis=1).reshape(-1, 3) for pair in zip(first, second,
                                                                       strict=True))  # fmt: skip
    t = [str(60_000_000 + 10_000 * (k // 2) + 4600 * (k % 2)) for k in range(6000)]
    names = ["TimeUS", "I", *(f"Gyr{a}" for a in "XYZ"), *(f"Acc{a}" for a in "XYZ")]
    cells = [t, [str(k % 2) for k in range(6000)], *gyro.T, *accel.T]
    path = write(tmp_path / "ardu.csv", names, cells)
    log = right(read_imu(path, rig()))
    assert "2 IMUs (I = 0, 1). The records of 0 are used; set [imu] instance" in log.warnings[0]
    other = right(read_imu(path, rig(instance=1)))
    np.testing.assert_allclose(other.gyro, second[0], rtol=1e-9)
    assert "there are 0, 1" in advice(path, rig(instance=7))


def test_linear_acceleration_is_rejected_in_words(tmp_path):
    gyro, accel = readings()
    names = ["time [s]", *AXES[:3], *(f"{name} [m/s^2]" for name in AXES[3:])]
    path = write(tmp_path / "lin.csv", names, columns(T, gyro, accel - accel.mean(axis=0)))
    assert "gravity is missing: linear acceleration" in advice(path)


def test_a_forward_right_down_imu_needs_one_word(tmp_path):
    gyro, accel = readings()
    frd = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    path = write(tmp_path / "frd.csv", PLAIN, columns(T, gyro @ frd, accel @ frd))
    np.testing.assert_allclose(read_imu(path, rig(frame="frd")).accel, accel, rtol=1e-9)
    path = write(tmp_path / "down.csv", PLAIN, columns(T, gyro, -accel))
    np.testing.assert_allclose(read_imu(path, rig(reports_gravity=True)).accel, accel, rtol=1e-9)


def test_all_problems_of_columns_and_units_are_in_one_message(tmp_path):
    gyro, accel = readings()
    names = ["t0", *(f"rot{a} [furlong]" for a in "xyz"), *AXES[3:]]
    names[1:4] = [f"gyro_{a} [furlong]" for a in "xyz"]
    path = write(tmp_path / "bad.csv", names, columns([f"x{k}" for k in T], gyro, accel))
    text = advice(path, rig(columns={"time": "stamp"}))
    assert text.partition(": ")[2].startswith("2 problems: (1) no column stamp")
    assert "(2) gyro_x [furlong]: unknown unit 'furlong'" in text


def test_still_gyros_without_a_unit_are_read_in_degrees_where_radians_are_absurd(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "bare.csv", ["time", *AXES], columns(T, gyro / DEG, accel / G))
    log = right(read_imu(path, rig()))
    assert any('read as deg/s; set [imu] units = { gyro = "deg/s" }' in t for t in log.warnings)
    moving = accel + np.outer(np.sin(3 * T), [2, 1, 0])
    path = write(tmp_path / "moving.csv", ["time", *AXES], columns(T, gyro / DEG, moving))
    assert any("rad/s is assumed" in text for text in read_imu(path, rig()).warnings)


def test_a_column_that_the_rig_names_and_the_log_lacks_is_an_error(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "plain.csv", PLAIN, columns(T, gyro, accel))
    for column in ("nonsense", 99):
        setup = rig(columns={"gyro_x": column})
        with pytest.raises(LogError, match=r"the log has gyro_x: remove \[imu\] columns gyro_x"):
            read_imu(path, setup)
    log = read_imu(path, rig(columns={"gyro_x": 3, "gyro_y": 2}))
    np.testing.assert_array_equal(log.gyro[:, 0], read_imu(path, rig()).gyro[:, 1])
    assert "gyro_x = 3 (gyro_y), gyro_y = 2 (gyro_x). The rig is used" in log.warnings[0]


def test_three_names_of_three_kinds_are_no_triad_but_have_the_line_for_the_rig(tmp_path):
    gyro, accel = readings()
    names = ["t", "Gyr_X", "GyroY", "wz", "ax", "ay", "az"]
    path = write(tmp_path / "mixed.csv", names, columns(T, gyro, accel))
    text = advice(path)
    line = 'set [imu] columns = { gyro_x = "Gyr_X", gyro_y = "GyroY", gyro_z = "wz" }'
    assert line in text
    named = {"gyro_x": "Gyr_X", "gyro_y": "GyroY", "gyro_z": "wz"}
    right(read_imu(path, rig(columns=named)))
    twice = [*names, "gy"]
    path = write(tmp_path / "twice.csv", twice, [*columns(T, gyro, accel), gyro.T[1]])
    assert '"wz"' not in advice(path)  # two columns for y
