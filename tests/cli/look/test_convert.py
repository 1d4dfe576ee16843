"""Vendors' logs through the commands: converted, and navigated as they are."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.logs.container.test_formats import EUROC, kf_gins, psins, put, xsens

SITE = "[site]\nlatitude = 51.08\n[attitude]\npitch = 0\nroll = 0\nazimuth = 0\n"
STAGES = "[stages]\nstatic = [101, 110]\nnavigation = [110, 130]\n"
ARCSEC = np.pi / 180 / 3600
G = 9.80665


@pytest.mark.parametrize(
    ("text", "form", "rows", "reported"),
    [
        (xsens(), "xsens", 8, "samples, 429496.71 to 429496.78 s\n"),
        (EUROC, "euroc", 5, "samples"),
        (
            kf_gins(),
            "kf-gins",
            6,
            'its rig: [imu] sampling = "increment", mount = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]\n',
        ),
        (psins(), "psins", 6, 'its rig: [imu] sampling = "increment"\n'),
    ],
)
def test_convert_writes_parquet_and_says_what_the_rig_needs(
    rotcli, tmp_path, text, form, rows, reported
):
    done = rotcli("convert", put(tmp_path, text), "--format", form, "-o", tmp_path / "imu.parquet")
    assert (done.status, done.out) == (0, "")
    assert reported in done.err
    table = pq.read_table(tmp_path / "imu.parquet")
    assert table.num_rows == rows
    units = ("rad/s", "m/s^2") if form in ("xsens", "euroc") else ("rad", "m/s")
    assert table.column_names[0] == "time [s]"
    assert table.column_names[1] == f"gyro_x [{units[0]}]"
    assert table.column_names[6] == f"accel_z [{units[1]}]"


def test_a_log_that_cannot_be_converted_leaves_no_file(rotcli, tmp_path):
    path = put(tmp_path, xsens().replace("9.81\t0.004", "x\t0.004"))
    done = rotcli("convert", path, "--format", "xsens", "-o", tmp_path / "imu.parquet")
    assert done.status == 1
    assert "imu.txt: row 10: Acc_Z: 'x' is not a number" in done.err
    assert not (tmp_path / "imu.parquet").exists()
    assert rotcli("convert", path, "--format", "bosch", "-o", tmp_path / "a.csv").status == 2


@pytest.fixture(scope="module")
def readings():
    """Still increments of 10 ms on a level table facing north, with some noise: (n, 3) each."""
    rng = np.random.default_rng(5)
    w = 7.292115e-5 * np.array([0.0, np.cos(np.radians(51.08)), np.sin(np.radians(51.08))])
    n = 3100
    gyro = (w + rng.normal(0.0, 2e-4, (n, 3))) * 0.01
    accel = (np.array([0.0, 0.0, 9.811]) + rng.normal(0.0, 1e-3, (n, 3))) * 0.01
    return 100.0 + 0.01 * np.arange(1, n + 1), gyro, accel


def _plain(time, gyro, accel, *, increments):
    units = ("rad", "m/s") if increments else ("rad/s", "m/s^2")
    head = ["time", *(f"gyro_{a} [{units[0]}]" for a in "xyz")]
    head += [f"accel_{a} [{units[1]}]" for a in "xyz"]
    rows = np.column_stack([time, gyro, accel])
    return "\n".join([",".join(head), *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n"


def _as_xsens(time, gyro, accel):
    head = "// Update Rate: 100.0Hz\nPacketCounter\tSampleTimeFine\t"
    head += "\t".join(f"{s}_{a}" for s in ("Acc", "Gyr") for a in "XYZ") + "\n"
    rows = [
        f"{i % 65536:05d}\t{round(t * 1e4)}\t" + "\t".join(repr(v) for v in (*f, *w)) + "\n"
        for i, (t, w, f) in enumerate(
            zip(time, (gyro / 0.01).tolist(), (accel / 0.01).tolist(), strict=True)
        )
    ]
    return head + "".join(rows)


def _as_euroc(time, gyro, accel):
    rows = np.column_stack([gyro / 0.01, accel / 0.01]).tolist()
    return EUROC.split("\n")[0] + "\n" + "".join(
        f"{round(t * 1e9)}," + ",".join(map(repr, row)) + "\n"
        for t, row in zip(time, rows, strict=True)
    )  # fmt: skip


def _as_kf_gins(time, gyro, accel):
    turned = [1.0, 1.0, -1.0]
    rows = np.column_stack([gyro[:, [1, 0, 2]] * turned, accel[:, [1, 0, 2]] * turned])
    return "".join(
        f"{t:.4f} " + " ".join(map(repr, row)) + "\n"
        for t, row in zip(time, rows.tolist(), strict=True)
    )


def _as_psins(time, gyro, accel):
    scales = np.repeat([1e-4 * ARCSEC, 1e-3 * 1e-6 * G], 3)
    complete = np.diff(
        np.rint(np.cumsum(np.hstack([gyro, accel]), axis=0) / scales), axis=0, prepend=0.0
    ).astype(int)
    head = "% PSINS-format SIMU log file.\n0 0 0 0 0 0\n"
    head += f"51.08 0 0 {time[0] - 0.01} 10.0 {G}\n1e-4 1e-4 1e-4 1e-3 1e-3 1e-3\n\n"
    return head + "\n".join(" ".join(map(str, row)) for row in complete.tolist()) + "\n"


@pytest.mark.parametrize(
    ("form", "write", "increments"),
    [
        ("xsens", _as_xsens, False),
        ("euroc", _as_euroc, False),
        ("kf-gins", _as_kf_gins, True),
        ("psins", _as_psins, True),
    ],
)
def test_navigate_takes_a_vendors_log_as_it_takes_a_plain_one(
    rotcli, tmp_path, readings, form, write, increments
):
    time, gyro, accel = readings
    scale = 1.0 if increments else 0.01
    results = {}
    logs = {
        "plain.csv": _plain(time, gyro / scale, accel / scale, increments=increments),
        "vendor.txt": write(time, gyro, accel),
    }
    for name, text in logs.items():
        vendor = name == "vendor.txt"
        imu = f'format = "{form}"' if vendor else 'sampling = "increment"' * increments
        (tmp_path / "rig.toml").write_text(f"{SITE}[imu]\n{imu}\n{STAGES}")
        out = tmp_path / f"{name}.json"
        log = put(tmp_path, text, name)
        done = rotcli("navigate", log, "--mode", "conventional", "-o", out)
        assert done.status == 0, done.err
        results[name] = json.loads(out.read_text())
    ours, theirs = results["vendor.txt"]["rms"], results["plain.csv"]["rms"]
    assert results["vendor.txt"]["inputs"][0]["rows"] == len(time)
    assert theirs["horizontal_m"] > 0.01
    # PSINS integers round the running sums: velocity by 5e-9 m/s, angles by 2e-10 rad.
    scale = 1e-5 if form == "psins" else 1e-9
    for key, value in theirs.items():
        assert ours[key] == pytest.approx(value, abs=scale * max(theirs.values())), key


def test_a_table_log_is_converted_too(rotcli, tmp_path):
    t = np.arange(500) * 0.02
    rows = "".join(f"{a:.2f};{b:.4f}\n".replace(".", ",") for a, b in zip(t, 90 * t % 360,
                                                                       strict=True))  # fmt: skip
    path = put(tmp_path, "time [s];position [deg]\n" + rows, "table.csv")
    done = rotcli("convert", path, "-o", tmp_path / "table.parquet")
    assert done.status == 0, done.err
    table = pq.read_table(tmp_path / "table.parquet")
    assert table.column_names == ["time [s]", "angle [rad]"]
    np.testing.assert_allclose(table.column(1).to_numpy(), np.radians(90 * t), atol=1e-6)


def test_convert_lists_the_rig_keys_that_described_the_old_file_only(rotcli, tmp_path):
    rows = "".join(f"{i},{i % 7 + 100},3,4,5,6,16384\n" for i in range(200))
    path = put(tmp_path, "n,a,b,c,d,e,f\n" + rows, "log.csv")
    names = dict(zip(("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"), "abcdef",
                     strict=True))  # fmt: skip
    columns = ", ".join(f'{k} = "{v}"' for k, v in names.items())
    (tmp_path / "rig.toml").write_text(
        f"[imu]\nrate = 100\ncolumns = {{ {columns} }}\nscale = {{ gyro = 0.01, accel = 6e-4 }}\n"
        'units = { gyro = "deg/s", accel = "m/s^2" }\n'
    )
    done = rotcli("convert", path, "-o", tmp_path / "new.csv")
    assert "; remove from its rig: [imu] columns, units, scale, rate\n" in done.err
    (tmp_path / "rig.toml").unlink()
    again = rotcli("convert", tmp_path / "new.csv", "-o", tmp_path / "same.csv")
    assert again.status == 0, again.err
    assert (tmp_path / "same.csv").read_bytes() == (tmp_path / "new.csv").read_bytes()
