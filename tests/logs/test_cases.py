"""Logs as labs write them: each is read right, or one message says the line that solves it."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rotcli.errors import LogError
from rotcli.files.formats.novatel import IMU_SCALES
from rotcli.logs.imu import read_imu
from rotcli.logs.record import ImuLog
from rotcli.logs.stream import open_imu
from rotcli.logs.table import read_table
from rotcli.rig.rig import default_rig, rig_from_dict

DEG = np.pi / 180
G = 9.80665
N, VRW = 0.3, 0.05  # deg/sqrt(h), m/s/sqrt(h): the truth of every log here
AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


def rig(**imu):
    return rig_from_dict({"imu": imu}) if imu else default_rig()


def readings(n=3000, rate=100.0, n_gyro=N, seed=1):
    """White gyros (n, 3), rad/s, and accelerometers (n, 3), m/s^2, z up."""
    rng = np.random.default_rng(seed)
    gyro = n_gyro * DEG / 60 * np.sqrt(rate) * rng.normal(size=(n, 3)) + [3e-4, -5e-4, 1e-4]
    accel = VRW / 60 * np.sqrt(rate) * rng.normal(size=(n, 3)) + [0.05, -0.03, 9.8]
    return gyro, accel


def write(path, names, columns, *, delimiter=",", head="", end="", form="%.12g"):
    rows = zip(
        *([c if isinstance(c, str) else form % c for c in column] for column in columns),
        strict=True,
    )
    text = head + delimiter.join(names) + "\n" if names else head
    path.write_text(text + "".join(delimiter.join(row) + end + "\n" for row in rows))
    return path


def columns(t, gyro, accel):
    return [t, *gyro.T, *accel.T]


def random_walk(log, name="gyro_x"):
    """N in deg/sqrt(h) (or m/s/sqrt(h)) of means over 0.1 s."""
    values = log.column(name)
    m = max(1, round(0.1 / log.interval))
    means = values[: len(values) // m * m].reshape(-1, m).mean(axis=1)
    size = np.sqrt(0.5 * np.mean(np.diff(means) ** 2) * m * log.interval)
    return size * 60 / (DEG if name.startswith("gyro") else 1.0)


def right(log, rate=100.0, samples=3000, n=N):
    assert 1.0 / log.interval == pytest.approx(rate, rel=1e-3)
    assert log.samples == samples
    # 300 differences of means over 0.1 s: 7 % (1 sigma is 6 %, of one axis); three axes here.
    found = np.mean([random_walk(log, f"gyro_{a}") for a in "xyz"])
    assert found == pytest.approx(n, rel=0.1)
    return log


def advice(path, setup=None, **more):
    with pytest.raises(LogError) as caught:
        read_imu(path, setup or default_rig(), **more)
    text = str(caught.value)
    assert "sort" not in text
    assert "\n" not in text
    return text


T = np.arange(3000) * 0.01
PLAIN = ("time [s]", *AXES)


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
    assert "unknown unit 'x9999'; set [imu] units = { gyro = \"rad/s\" }" in advice(path)


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


def test_an_xsens_dot_log_is_read_in_microseconds_under_either_name(tmp_path):
    gyro, accel = readings()
    t = [str(4_000_000_000 + round(k * 1e6 / 120)) for k in range(3000)]
    names = ["PacketCounter", "SampleTimeFine", *(f"Euler_{a}" for a in "XYZ")]
    names += [f"Acc_{a}" for a in "XYZ"] + [f"Gyr_{a}" for a in "XYZ"]
    cells = [[str(k) for k in range(3000)], t, *3 * [["0.1"] * 3000], *accel.T, *(gyro / DEG).T]
    path = write(tmp_path / "dot.csv", names, cells)
    own = {"time": "us", "gyro": "deg/s"}
    for setup in (rig(), rig(format="xsens"), rig(format="xsens", units=own), rig(units=own)):
        # White noise for 100 Hz at 120 Hz.
        right(read_imu(path, setup), rate=120.0, n=N * np.sqrt(100 / 120))


def test_the_rig_overrides_the_unit_of_the_header_and_of_the_format(tmp_path):
    gyro, accel = readings()
    names = ["time [s]", *(f"gyro_{a} [rad/s]" for a in "xyz")]
    names += [f"accel_{a} [m/s^2]" for a in "xyz"]
    path = write(tmp_path / "a.csv", names, columns(T, gyro / DEG, accel))
    log = right(read_imu(path, rig(units={"gyro": "deg/s"})))
    assert "header unit of gyro is rad/s, [imu] units gyro is deg/s. The rig is used" in str(
        log.warnings
    )


def test_stamps_of_arrival_are_counted_and_nothing_is_lost(tmp_path):
    rng = np.random.default_rng(2)
    gyro, accel = readings(rate=200.0)
    t = np.arange(3000) * 0.005
    stamps = {
        "latency": t + np.abs(rng.normal(0.0, 1e-3, 3000)),
        "bursts": np.ceil((t + 1e-9) / 0.016) * 0.016 + 1e-4 * np.arange(3000) % 3e-4,
        "batches": np.ceil((t + 1e-9) / 0.11) * 0.11 + 1e-6 * (np.arange(3000) % 22),
    }
    for name, late in stamps.items():
        late = np.maximum.accumulate(late)
        path = write(tmp_path / f"{name}.csv", PLAIN, columns(late, gyro, accel))
        log = right(read_imu(path, rig(units={"gyro": "rad/s"})), rate=200.0)
        (warning,) = log.warnings
        assert 'The records are counted; set [imu] clock = "count" to confirm' in warning
        confirmed = rig(units={"gyro": "rad/s"}, clock="count")
        assert right(read_imu(path, confirmed), rate=200.0).warnings == ()


def test_lost_samples_are_gaps_though_the_stamps_jitter(tmp_path):
    rng = np.random.default_rng(3)
    gyro, accel = readings()
    kept = np.sort(rng.choice(3000, 2900, replace=False))
    kept[0], kept[-1] = 0, 2999
    stamps = (T + rng.normal(0.0, 3e-4, 3000))[kept]
    path = write(tmp_path / "lost.csv", PLAIN, columns(stamps, gyro[kept], accel[kept]))
    log = read_imu(path, rig(), max_gap=None)
    assert log.samples == 3000
    assert any("samples), first after" in text for text in log.warnings)


def test_a_coarse_tick_of_the_stamps_is_not_the_sampling_interval(tmp_path):
    gyro, accel = readings(6000)
    t = np.arange(6000) * 0.01
    for name, stamps in (
        ("tick", np.floor(t * 128) / 128),
        ("float32", (80000.0 + t).astype(np.float32).astype(float)),
    ):
        path = write(tmp_path / f"{name}.csv", PLAIN, columns(stamps, gyro, accel))
        log = right(read_imu(path, rig()), samples=6000)
        assert not any("gap" in text for text in log.warnings)


def test_repeated_stamps_are_kept_and_identical_records_dropped(tmp_path):
    gyro, accel = readings()
    stamps = T.copy()
    stamps[50:3000:50] = stamps[49:2999:50]
    path = write(tmp_path / "dup.csv", PLAIN, columns(stamps, gyro, accel), form="%.9g")
    right(read_imu(path, rig()))
    twice = np.sort(np.concatenate([np.arange(3000), [500, 1700]]))
    path = write(tmp_path / "rows.csv", PLAIN, columns(T[twice], gyro[twice], accel[twice]))
    log = right(read_imu(path, rig()))
    assert any("2 identical records repeat the one before. They are dropped" in t
               for t in log.warnings)  # fmt: skip


def test_counters_that_wrap_are_unrolled_and_a_restart_is_named(tmp_path):
    gyro, accel = readings()
    k = np.arange(3000)
    for name, cells in (
        ("time [us]", [str((2**32 - 15_000_000 + 10_000 * i) % 2**32) for i in k]),
        ("time [s]", [f"{(604800 - 15 + 0.01 * i) % 604800:.2f}" for i in k]),
        ("time [ms]", [str((2**24 - 15_000 + 10 * i) % 2**24) for i in k]),
    ):
        path = write(tmp_path / "wrap.csv", [name, *AXES], columns(cells, gyro, accel))
        log = right(read_imu(path, rig()))
        assert any("starts again after" in text and "unrolled" in text for text in log.warnings)
    stamps = np.where(k < 1500, T, T - 14.987)
    path = write(tmp_path / "reboot.csv", PLAIN, columns(stamps, gyro, accel))
    text = advice(path)
    assert "row 1502: time: time goes back by" in text
    assert "probably a restart of the logger; split the log at this row" in text
    right(read_imu(path, rig(clock="count")))


@pytest.mark.parametrize("form", ["T%H:%M:%S.%fZ", "T%H:%M:%S.%f", " %H:%M:%S.%f", "/", "hms", "m"])
def test_dates_and_times_of_day_are_read(tmp_path, form):
    from datetime import datetime, timedelta

    gyro, accel = readings()
    start = datetime(2025, 10, 11, 9, 59, 50)
    stamps = [start + timedelta(milliseconds=10 * k) for k in range(3000)]
    if form == "hms":
        cells = [s.strftime("%H:%M:%S.%f")[:-3] for s in stamps]
    elif form == "m":
        cells = [f"{s.minute + 60 * s.hour}:{s.second:02d}.{s.microsecond // 1000:03d}"
                 for s in stamps]  # fmt: skip
    elif form == "/":
        cells = [s.strftime("%Y/%m/%d %H:%M:%S.%f") for s in stamps]
    else:
        cells = [s.strftime(f"%Y-%m-%d{form}") for s in stamps]
    path = write(tmp_path / "iso.csv", ["time", *AXES], columns(cells, gyro, accel))
    right(read_imu(path, rig()))


def test_stamps_with_too_few_digits_say_so(tmp_path):
    gyro, accel = readings()
    cells = [str(1593335798 + k // 100) for k in range(3000)]
    path = write(tmp_path / "epoch.csv", ["time", *AXES], columns(cells, gyro, accel))
    text = advice(path)
    assert "time stamps have steps of 1 s for" in text
    assert 'set [imu] clock = "count", or write more digits' in text
    assert "row" not in text.split(": ", 1)[1].partition("rows each")[0]
    # Thirty steps of 1 s show the rate to 0.5 %.
    log = read_imu(path, rig(clock="count"))
    assert 1.0 / log.interval == pytest.approx(100.0, rel=5e-3)
    path = write(tmp_path / "sci.csv", ["time [ns]", *AXES],
                 columns(["1.59334e+18"] * 3000, gyro, accel))  # fmt: skip
    assert 'clock = "count" and [imu] rate' in advice(path)
    right(read_imu(path, rig(clock="count", rate=100.0)))
    names = ["sec", "nanosec", *AXES]
    pair = [[str(1593335798 + k // 100) for k in range(3000)],
            [str(k % 100 * 10_000_000) for k in range(3000)]]  # fmt: skip
    path = write(tmp_path / "ros.csv", names, [*pair, *gyro.T, *accel.T])
    right(read_imu(path, rig()))
    right(read_imu(path, rig(columns={"time": ["sec", "nanosec"]})))
    assert 'columns = { time = ["sec", "nanosec"] }' in advice(path, rig(columns={"time": "sec"}))


def test_a_log_without_time_takes_the_rate_of_the_rig(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "none.csv", AXES, columns(T, gyro, accel)[1:])
    assert "no time column" in advice(path)
    assert "set [imu] rate" in advice(path)
    right(read_imu(path, rig(rate=100.0)))
    lost = np.delete(np.arange(3000), [1000, 1001])
    cells = columns([str(k + 3) for k in lost], gyro[lost], accel[lost])
    path = write(tmp_path / "counter.csv", ["Packet number", *AXES], cells)
    assert "Packet number counts records; set [imu] rate" in advice(path)
    for setup in (rig(rate=100.0), rig(rate=100.0, columns={"time": "Packet number"})):
        log = right(read_imu(path, setup))
        assert np.flatnonzero(log.missing).tolist() == [1000, 1001]
    named = write(tmp_path / "named.csv", ["time", *AXES], cells)
    assert "time counts records (steps of 1)" in advice(named)


def test_an_xsens_export_counts_packets_at_its_sampling_rate(tmp_path):
    gyro, accel = readings()
    head = "// Start Time: Unknown\n// Sampling Rate: 100Hz\n"
    names = ["PacketCounter", "SampleTimeFine", *(f"Acc_{a}" for a in "XYZ")]
    names += [f"Gyr_{a}" for a in "XYZ"]
    cells = [[f"{k:05d}" for k in range(3000)], [""] * 3000, *accel.T, *gyro.T]
    path = write(tmp_path / "mtw.txt", names, cells, delimiter="\t", head=head)
    for setup in (rig(format="xsens"), rig()):
        right(read_imu(path, setup))


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


@pytest.mark.parametrize(
    "head",
    ["sep=,\n", "# PicoQuake\n# rate = 100 Hz\n\n", "FILE_INFO\nSep=comma\n\nModel,GX3\n\nDATA\n"],
)
def test_lines_above_the_header_are_passed(tmp_path, head):
    gyro, accel = readings()
    path = write(tmp_path / "head.csv", PLAIN, columns(T, gyro, accel), head=head)
    right(read_imu(path, rig()))


@pytest.mark.parametrize(
    ("unit", "size"), [("dps", DEG), ("mdps", DEG / 1e3), ("deg/sec", DEG), ("rad/sec", 1.0)]
)
def test_the_units_of_data_sheets_are_known(tmp_path, unit, size):
    gyro, accel = readings()
    names = ["time [s]", *(f"gyro_{a} [{unit}]" for a in "xyz"), *AXES[3:]]
    right(read_imu(write(tmp_path / "u.csv", names, columns(T, gyro / size, accel)), rig()))


def test_decimal_commas_and_a_comma_after_each_row_are_read(tmp_path):
    gyro, accel = readings()
    cells = [[f"{v:.9g}".replace(".", ",") for v in column] for column in
             columns(T, gyro, accel)]  # fmt: skip
    path = write(tmp_path / "de.csv", PLAIN, cells, delimiter=";")
    for setup in (rig(), rig(delimiter=";"), rig(delimiter=";", decimal=",")):
        right(read_imu(path, setup))
    path = write(tmp_path / "end.csv", PLAIN, columns(T, gyro, accel), end=",")
    right(read_imu(path, rig()))


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


def test_sentences_with_checksums_are_read(tmp_path):
    gyro, accel = readings()
    rows = [
        f"{t:.3f},$VNYMR,+100.9,-007.3,+000.7,-00.1,-00.2,+00.5,{a[0]:+.5f},{a[1]:+.5f},"
        f"{a[2]:+.5f},{w[0]:+.7f},{w[1]:+.7f},{w[2]:+.7f}*{k % 256:02X}\n"
        for k, (t, w, a) in enumerate(zip(T, gyro, accel, strict=True))
    ]
    path = tmp_path / "vn.txt"
    path.write_text("".join(rows))
    named = dict(zip(("time", *AXES), (1, 12, 13, 14, 9, 10, 11), strict=True))
    for setup in (rig(), rig(format="vectornav"), rig(columns=named)):
        right(read_imu(path, setup))
    path.write_text("".join(row.partition(",")[2] for row in rows))
    assert "no time column" in advice(path)
    right(read_imu(path, rig(rate=100.0)))


@pytest.mark.parametrize("message", ["RAWIMUSA", "RAWIMUSXA"])
def test_novatel_counts_take_the_scale_of_their_imu(tmp_path, message):
    gyro, accel = readings()
    _, one, other = IMU_SCALES[13]  # IMU-FSAS
    w, f = np.rint(gyro / 100 / one).astype(int), np.rint(accel / 100 / other).astype(int)
    info = "00,13," if message == "RAWIMUSXA" else ""
    path = tmp_path / "imu.asc"
    path.write_text(
        "".join(
            f"%{message},1815,{407772 + t:.3f};{info}1815,{407772 + t:.9f},00000077,"
            f"{a[2]},{-a[1]},{a[0]},{g[2]},{-g[1]},{g[0]}*9e3779b1\n"
            for t, g, a in zip(T, w, f, strict=True)
        )
    )
    setup = rig()
    if message == "RAWIMUSA":
        text = advice(path)
        assert "not the type of the IMU; set [imu] scale" in text
        assert "for IMU-FSAS" in text
        setup = rig(scale={"gyro": one, "accel": other})
    log = right(read_imu(path, setup))
    assert log.sampling == "average"
    # Increments are counts: half a count of 1.9e-9 rad in 10 ms.
    np.testing.assert_allclose(log.gyro, gyro, atol=100 * one)


def test_two_logs_in_one_file_with_blank_cells_are_both_read(tmp_path):
    gyro, accel = readings()
    rows = [f"{t:.3f},{','.join(format(v, '.9g') for v in (*w, *a))}," for t, w, a in
            zip(T, gyro, accel, strict=True)]  # fmt: skip
    angles = [f"{t:.3f},,,,,,,{20 * t:.4f}" for t in T[::4] + 0.001]
    path = tmp_path / "both.csv"
    lines = sorted([*rows, *angles], key=lambda row: float(row.partition(",")[0]))
    head = ",".join(["time [s]", *AXES, "angle [deg]"])
    path.write_text("\n".join([head, *lines, ""]))
    right(read_imu(path, rig()))
    table = read_table(path, default_rig())
    np.testing.assert_allclose(table.angle, 20 * DEG * table.time, atol=0.03 * DEG)
    arrays = [pa.array([float(c) if c else None for c in column]) for column in
              zip(*(line.split(",") for line in lines), strict=True)]  # fmt: skip
    pq.write_table(pa.table(arrays, names=head.split(",")), tmp_path / "both.parquet")
    right(read_imu(tmp_path / "both.parquet", rig()))


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


def table_log(path, names, cells, head="", **more):
    return write(path, names, cells, head=head, **more)


TT = np.arange(1600) * 0.04
ANGLE = np.where(TT < 20, 0.0, 20 * (TT - 20))  # deg: still, then 20 deg/s


def test_a_table_log_of_rates_is_integrated(tmp_path):
    rate = np.where(TT < 20, 0.0, 20.0)
    path = table_log(tmp_path / "t.csv", ["time [s]", "rate [deg/s]"], [TT, rate])
    table = read_table(path, default_rig())
    assert 'It is integrated; set [table] quantity = "rate"' in table.warnings[0]
    # The trapezoid across the step is off by half a record's turn, 0.4 deg.
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=0.41)
    quiet = rig_from_dict({"table": {"quantity": "rate"}})
    assert read_table(path, quiet).warnings == ()


def test_encoder_counts_and_other_wraps_are_recognised(tmp_path):
    counts = np.floor(ANGLE / 360 * 4096) % 4096
    path = table_log(tmp_path / "c.csv", ["time [s]", "encoder"], [TT, counts], form="%.10g")
    with pytest.raises(LogError, match=r"encoder counts; set \[table\] counts_per_turn = 4096"):
        read_table(path, default_rig())
    table = read_table(path, rig_from_dict({"table": {"counts_per_turn": 4096}}))
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=360 / 4096)
    wrapped = ANGLE % 327.68
    path = table_log(tmp_path / "w.csv", ["time [s]", "angle [deg]"], [TT, wrapped])
    table = read_table(path, default_rig())
    assert "starts again after 327.68 deg, not after a turn" in table.warnings[0]
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=1e-6)
    named = read_table(path, rig_from_dict({"table": {"wrap": 327.68}}))
    assert named.warnings == ()
    np.testing.assert_allclose(named.angle, table.angle)


def test_one_record_outside_the_range_is_named_and_omitted(tmp_path):
    wrapped = ANGLE % 360
    wrapped[700] = 4711.0
    path = table_log(tmp_path / "o.csv", ["time [s]", "angle [deg]"], [TT, wrapped])
    table = read_table(path, default_rig())
    assert "angle is 4711 deg in row 702, outside of the range" in table.warnings[0]
    np.testing.assert_allclose(table.angle / DEG, np.delete(ANGLE, 700), atol=1e-6)


def test_the_one_of_three_columns_that_moves_is_the_axis(tmp_path):
    names = ["time [s]", "outer [deg]", "middle [deg]", "inner [deg]"]
    cells = [TT, 0 * TT + 3.0, 0 * TT, ANGLE % 360]
    table = read_table(table_log(tmp_path / "m.csv", names, cells), default_rig())
    assert 'only inner moves. It is used; set [table] column = "inner"' in table.warnings[0]
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=1e-6)


def test_table_logs_take_the_same_dialects(tmp_path):
    cells = [[f"{v:.6f}".replace(".", ",") for v in column] for column in (TT, ANGLE)]
    path = table_log(
        tmp_path / "d.csv", ["Zeit", "Winkel"], cells, head="Tisch 7\n\n", delimiter=";"
    )
    setup = {"columns": {"time": "Zeit", "angle": "Winkel"}, "units": "deg"}
    table = read_table(path, rig_from_dict({"table": setup}))
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=1e-6)


def test_unlabelled_degrees_that_wrap_at_360_are_reported(tmp_path):
    path = table_log(tmp_path / "n.csv", ["time", "angle"], [TT, (ANGLE % 360).round(3)])
    with pytest.raises(LogError, match=r'after 360 .*: degrees; set \[table\] units = "deg"'):
        read_table(path, default_rig())


def test_still_gyros_without_a_unit_are_read_in_degrees_where_radians_are_absurd(tmp_path):
    gyro, accel = readings()
    path = write(tmp_path / "bare.csv", ["time", *AXES], columns(T, gyro / DEG, accel / G))
    log = right(read_imu(path, rig()))
    assert any('read as deg/s; set [imu] units = { gyro = "deg/s" }' in t for t in log.warnings)
    moving = accel + np.outer(np.sin(3 * T), [2, 1, 0])
    path = write(tmp_path / "moving.csv", ["time", *AXES], columns(T, gyro / DEG, moving))
    assert any("rad/s is assumed" in text for text in read_imu(path, rig()).warnings)


def test_an_open_quotation_mark_is_an_error_in_short_and_long_logs(tmp_path):
    gyro, accel = readings()
    for row in (5, 2900):
        path = write(tmp_path / "quote.csv", PLAIN, columns(T, gyro, accel))
        lines = path.read_text().splitlines()
        lines[row] = lines[row].replace(",", ',"', 1)
        path.write_text("\n".join(lines) + "\n")
        text = advice(path)
        assert "quotation mark is not closed" in text or "is not a number" in text


def test_brackets_that_say_counts_lead_to_the_scale(tmp_path):
    path = table_log(tmp_path / "c.csv", ["time [s]", "Position (counts)"],
                     [TT, np.floor(ANGLE / 360 * 4096) % 4096])  # fmt: skip
    with pytest.raises(LogError, match=r"encoder counts; set \[table\] counts_per_turn"):
        read_table(path, default_rig())
