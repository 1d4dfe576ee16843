"""Logs as labs write them, made for the tests of this folder: names, units, dialects."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.imu import read_imu
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


def table_log(path, names, cells, head="", **more):
    return write(path, names, cells, head=head, **more)


TT = np.arange(1600) * 0.04
ANGLE = np.where(TT < 20, 0.0, 20 * (TT - 20))  # deg: still, then 20 deg/s
