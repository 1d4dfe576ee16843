"""Deterministic drift and slow noise: false alarms of noise alone, power and estimates of drift."""

from functools import partial

import numpy as np
import pytest

from rotcli.allan.survey.drift import BLOCKS, Drift, block_means, find_drifts, refine_step
from rotcli.models.sensors import NoiseFigures, noise
from rotcli.rig.profile import read_profile
from rotcli.units import DEG_PER_HOUR

LENGTH = 75.0  # s: a record of two hours
SECONDS = round(BLOCKS * LENGTH)
TIME = np.arange(SECONDS, dtype=float)


def blocks(values):
    return values.reshape(BLOCKS, -1).mean(axis=1)


def shaped_noise(rng, n, exponent):
    """Gaussian noise of the density f^-exponent, made by its Fourier transform."""
    spectrum = np.fft.rfft(rng.standard_normal(4 * n))
    frequency = np.fft.rfftfreq(4 * n)
    frequency[0] = frequency[1]
    return np.fft.irfft(spectrum * frequency ** (-0.5 * exponent), 4 * n)[:n]


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 1.5, 2.0])
def test_noise_of_any_slope_has_no_drift(exponent):
    rng = np.random.default_rng(int(10 * exponent))
    found = [find_drifts(blocks(shaped_noise(rng, SECONDS, exponent)), 0.0, LENGTH)
             for _ in range(100)]  # fmt: skip
    assert sum(map(bool, found)) == 0


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["mti-g", "nav440"])
def test_a_profile_has_a_drift_in_fewer_than_one_of_a_thousand_logs(name):
    figures = NoiseFigures(**read_profile(name).gyro.noise)
    false = sum(
        bool(find_drifts(blocks(noise(np.random.default_rng(s), SECONDS, 1.0, figures)), 0, LENGTH))
        for s in range(2000)
    )
    assert false <= 4  # 2 expected at the limit


def nav440(seed):
    figures = NoiseFigures(**read_profile("nav440").gyro.noise)
    return noise(np.random.default_rng(seed), SECONDS, 1.0, figures)


def test_a_step_is_found_with_size_and_time():
    sizes, z = [], []
    for seed in range(20):
        values = nav440(seed)
        values[3000:] += 120 * DEG_PER_HOUR
        refine = partial(refine_step, values, 0.0, 1.0)
        (drift,) = find_drifts(blocks(values), 0.0, LENGTH, refine=refine)
        assert drift.kind == "step"
        assert abs(drift.start - 3000) < 40
        sizes.append(drift.amplitude / DEG_PER_HOUR)
        z.append((drift.amplitude - 120 * DEG_PER_HOUR) / drift.sigma)
    # Flicker noise of 10 deg/h: the mean of 20 steps is known to 3 deg/h.
    assert np.mean(sizes) == pytest.approx(120.0, abs=10.0)
    assert 0.6 < np.std(z) < 1.6


def test_a_warm_up_is_found_with_size_and_time_constant():
    found = []
    for seed in range(20):
        values = nav440(seed) + 500 * DEG_PER_HOUR * np.exp(-TIME / 600.0)
        drifts = find_drifts(blocks(values), 0.0, LENGTH)
        assert drifts[0].kind == "exponential"
        found.append((drifts[0].amplitude / DEG_PER_HOUR, drifts[0].time))
    size, time = np.mean(found, axis=0)
    assert size == pytest.approx(500.0, rel=0.1)
    # The grid of time constants has steps of a factor 1.37.
    assert time == pytest.approx(600.0, rel=0.2)


def test_a_straight_line_is_left_to_the_rate_ramp():
    values = nav440(1) + 200 * DEG_PER_HOUR * TIME / SECONDS
    assert find_drifts(blocks(values), 0.0, LENGTH) == []


def test_a_drift_that_follows_the_temperature_is_named_as_such():
    temperature = 20.0 + 4.0 * np.sin(TIME / 900.0) ** 2 + 1e-4 * TIME
    z = []
    for seed in range(20):
        values = nav440(seed) + 30 * DEG_PER_HOUR * temperature
        (drift,) = find_drifts(blocks(values), 0.0, LENGTH, blocks(temperature))
        assert drift.kind == "temperature"
        z.append((drift.amplitude - 30 * DEG_PER_HOUR) / drift.sigma)
    assert abs(np.mean(z)) < 1.0
    assert 0.6 < np.std(z) < 1.6


def test_a_temperature_that_the_bias_does_not_follow_is_not_blamed():
    rng = np.random.default_rng(9)
    blamed = 0
    for seed in range(60):
        temperature = 20.0 + 0.01 * np.cumsum(rng.standard_normal(SECONDS))
        blamed += bool(find_drifts(blocks(nav440(seed)), 0.0, LENGTH, blocks(temperature)))
    assert blamed == 0


def test_the_values_of_a_drift_are_those_of_its_blocks():
    for drift in (
        Drift("step", 2.0, 0.1, start=1000.0),
        Drift("exponential", 2.0, 0.1, start=0.0, time=400.0),
    ):
        fine = np.arange(0.0, SECONDS, 0.5) + 0.25
        exact = blocks(drift.values(fine, None))
        # A step lies on one of 32 points a block.
        assert block_means(drift, 0.0, LENGTH, None) == pytest.approx(exact, abs=0.07)
    temperature = np.linspace(20.0, 25.0, BLOCKS)
    follows = Drift("temperature", 0.5, 0.1, reference=22.5)
    assert block_means(follows, 0.0, LENGTH, temperature)[-1] == pytest.approx(1.25)


def test_a_step_is_refined_to_the_average_in_which_it_lies():
    rng = np.random.default_rng(4)
    values = 0.1 * rng.standard_normal(1000)
    values[437:] += 1.0
    assert refine_step(values, 100.0, 1.0, near=530.0, reach=20.0) == 537.0
    assert refine_step(values, 0.0, 1.0, near=2000.0, reach=5.0) == 2000.0


def test_a_step_is_refined_among_five_averages():
    values = (np.arange(30) >= 10).astype(float)
    assert refine_step(values, 0.0, 1.0, near=10.3, reach=0.8) == 10.0
