"""Readings that were interpolated to a higher rate: the sensor's rate is found, and N is right."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy import signal

from rotcli.allan.survey.interpolated import interpolated_shape, source_rate

FS, DT = 100.0, 0.01


def interpolated(rate, seconds=1000.0, *, late=0.0, offset=0.0, seed=0, white=0.01):
    """Return readings (n,) of white noise at a rate (Hz), interpolated to 100 Hz."""
    rng = np.random.default_rng(seed)
    time = (np.arange(int(seconds * rate) + 3) - late) / rate
    readings = offset + white * rng.standard_normal(len(time))
    return np.interp(DT * np.arange(int(seconds * FS)), time, readings)


@pytest.mark.parametrize("rate", [2.0, 5.0, 12.5, 25.0, 100.0 / 3.0, 50.0])
def test_the_rate_is_found_behind_rounding(rate):
    exact = interpolated(rate)
    assert source_rate(exact, DT) == pytest.approx(rate)
    assert source_rate(exact.round(4), DT) == pytest.approx(rate)
    if rate > 5.0:
        single = interpolated(rate, offset=9.81).astype(np.float32).astype(float)
        assert source_rate(single, DT) == pytest.approx(rate)


@pytest.mark.parametrize("rate", [10.0, 25.0])
def test_readings_between_those_of_the_log_have_the_same_rate(rate):
    assert source_rate(interpolated(rate, late=0.3), DT) == pytest.approx(rate)


@pytest.mark.parametrize("rate", [7.3, 23.7, 31.0])
def test_a_rate_that_does_not_divide_that_of_the_log_is_found_within_two_percent(rate):
    assert source_rate(interpolated(rate), DT) == pytest.approx(rate, rel=0.02)
    # Rounding hides it: no rate is better than a wrong one.
    assert source_rate(interpolated(rate).round(4), DT) is None


def test_other_readings_are_not_interpolated():
    rng = np.random.default_rng(1)
    white = rng.standard_normal(100_000)
    smooth = [np.convolve(white, np.ones(n) / n) for n in (2, 4, 8)]
    b, a = signal.butter(2, 5.0, fs=FS)
    for readings in (white, np.cumsum(white), *smooth, signal.lfilter(b, a, white)):
        assert source_rate(readings, DT) is None


@pytest.mark.parametrize("rate", [25.0, 23.7])
def test_the_density_is_that_of_linear_interpolation(rate):
    """A Welch density by scipy against that of the triangle; sinc^4 at low frequencies."""
    white = 0.01
    readings = interpolated(rate, 20_000.0, white=white)
    frequency, density = signal.welch(readings, FS, nperseg=1024)
    shape = interpolated_shape(frequency, rate, DT)
    inside = (frequency > 1.0) & (shape > 1e-3)
    ratio = density[inside] / (2.0 * white**2 / rate * shape[inside])
    # 3900 overlapping segments: 2 % for each bin, 0.15 % for the mean of all.
    assert ratio.mean() == pytest.approx(1.0, abs=6e-3)
    assert np.all(np.abs(ratio - 1.0) < 0.12)
    low = frequency < 0.15 * rate
    np.testing.assert_allclose(shape[low], np.sinc(frequency[low] / rate) ** 4, rtol=0.02)


@pytest.mark.parametrize(("rate", "shown"), [(25.0, "25"), (23.7, "23.")])
def test_the_command_names_the_rate_and_measures_the_noise_of_the_sensor(
    rotcli, tmp_path, rate, shown
):
    deg, n = np.pi / 180.0, 0.3  # deg/sqrt(h)
    columns = {"time [s]": DT * np.arange(60_000)}
    for k, axis in enumerate("xyz"):
        white = n * deg / 60.0 * np.sqrt(rate)
        columns[f"gyro_{axis} [rad/s]"] = interpolated(rate, 600.0, seed=k, white=white)
    for k, axis in enumerate("xyz"):
        gravity = 9.81 if axis == "z" else 0.0
        columns[f"accel_{axis} [m/s^2]"] = interpolated(
            rate, 600.0, seed=3 + k, white=0.004, offset=gravity
        )
    log = tmp_path / "imu.parquet"
    pq.write_table(pa.table(columns), log)
    done = rotcli("allan", log, "-o", tmp_path / "allan.json")
    assert done.status == 0
    warned = [line for line in done.err.splitlines() if "warning: " in line]
    assert len(warned) == 1, warned
    assert f"interpolated: the sensor measures at about {shown}" in warned[0]
    document = json.loads((tmp_path / "allan.json").read_text())
    assert {f["code"] for f in document["findings"]} == {"interpolated-samples"}
    for k in "xyz":
        axis = document["axes"][f"gyro_{k}"]
        assert axis["spectrum"]["source_rate_hz"] == pytest.approx(rate, rel=0.02)
        found = axis["coefficients"]["random_walk"]
        assert abs(found["value"] - n) < 3.2 * found["sigma"]
        assert axis["coefficients"]["bias_instability"]["value"] is None
