"""Rates of the table over a window, and noise that does not fit the other axes."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotcli.observe.zupt.checks.window import (
    dominant_rate,
    has_single_rate,
    noise_warnings,
    rates_of,
)
from rotcli.rig.rig import default_rig


@pytest.mark.parametrize(("turning", "expected"), [(199, 0.0), (201, -0.5)])
def test_a_table_turns_that_does_so_for_a_tenth_of_the_time(turning, expected):
    rates = np.zeros(2000)
    rates[:turning] = -0.5
    rates[: turning // 4] = 0.5  # the prevailing sign counts
    assert dominant_rate(rates) == expected


def test_rates_within_a_tenth_are_one_rate():
    assert has_single_rate(np.linspace(0.95, 1.04, 100))
    assert not has_single_rate(np.linspace(0.8, 1.0, 100))
    assert has_single_rate(np.linspace(-5e-4, 5e-4, 100))  # still
    assert has_single_rate(np.where(np.arange(100) < 4, 0.0, -2.0))


def test_mean_rates_are_those_of_the_table_over_the_steps(monkeypatch):
    monkeypatch.setattr("rotcli.observe.zupt.checks.window.CHUNK_SAMPLES", 70)
    time = 0.01 * np.arange(1000)
    angle = 0.3 * time + 0.05 * time**2
    imu = SimpleNamespace(interval=0.01, times=lambda span: time[span])
    table = SimpleNamespace(time=time, angle=angle)
    monkeypatch.setattr(
        "rotcli.observe.zupt.checks.window.angle_at", lambda _, t: 0.3 * t + 0.05 * t**2
    )
    found = rates_of(imu, table, slice(100, 900), 10)
    assert len(found) == 79
    middle = 1.0 + 0.1 * (np.arange(79) + 0.5)
    np.testing.assert_allclose(found, 0.3 + 0.1 * middle, rtol=1e-9)
    np.testing.assert_array_equal(rates_of(imu, None, slice(100, 900), 10), np.zeros(79))


@pytest.mark.parametrize(
    ("factor", "warned"), [(1.0, False), (4.5, False), (9.8, True), (0.1, True)]
)
def test_a_channel_with_five_times_the_noise_of_the_others_is_named(factor, warned):
    rng = np.random.default_rng(3)
    chunk = SimpleNamespace(
        gyro=rng.standard_normal((20_000, 3)), accel=rng.standard_normal((20_000, 3))
    )
    chunk.accel[:, 1] *= factor
    imu = SimpleNamespace(path="imu.csv", chunks=lambda _: iter([chunk]))
    found = noise_warnings(imu, slice(0, 20_000), default_rig())
    assert len(found) == warned
    for text in found:
        stated = float(text.split("noise of accel_y is ")[1].split(" times")[0])
        assert stated == pytest.approx(factor, rel=0.03)
