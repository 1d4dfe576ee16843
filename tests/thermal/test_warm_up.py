"""Warm-up after power-on: amplitude, time constant, acceptance and the bias after it."""

import numpy as np
import pytest
from scipy.integrate import quad

from rotcli.models.mean_covariance import IntervalNoise, SlowNoise
from rotcli.models.slow_noise import simulate_slow_noise
from rotcli.thermal.warm_up import allan_minimum, decay_means, decay_slopes, fit_warm_up
from tests.scale.sets import DPH, MTIG, NAV440

STEP = 2.0


def record(minutes, block, figures):
    start = np.arange(0, 60.0 * minutes, block)
    end = start + block
    return start, end, IntervalNoise(start, end, SlowNoise.from_figures(figures), figures.white)


def test_block_means_of_the_decay_equal_quadrature():
    got = decay_means(np.array([10.0]), np.array([40.0]), 25.0)
    assert got[0] == pytest.approx(quad(lambda t: np.exp(-t / 25), 10, 40)[0] / 30, rel=1e-12)
    up, down = (
        decay_means(np.array([10.0]), np.array([40.0]), 25 * np.exp(h)) for h in (1e-5, -1e-5)
    )
    slope = decay_slopes(np.array([10.0]), np.array([40.0]), 25.0)
    assert slope[0] == pytest.approx((up - down)[0] / 2e-5, rel=1e-6)


def test_an_exact_warm_up_is_measured():
    start, end, noise = record(30, 10, NAV440)
    z = 20 * DPH + 200 * DPH * decay_means(start, end, 300.0)
    found = fit_warm_up(start, end, z, noise)
    assert found.tau == pytest.approx(300.0, rel=1e-5)
    assert found.amplitude / DPH == pytest.approx(200.0, rel=1e-5)
    assert found.constant(noise.horizon(1800, 2100)).value[0] / DPH == pytest.approx(20.0, abs=1e-3)
    assert found.sigma_ln_tau == pytest.approx(0.27, rel=0.1)
    assert found.amplitude_sigma / DPH == pytest.approx(27, rel=0.1)
    assert found.constant(noise.horizon(1800, 2100)).sigma[0] / DPH == pytest.approx(14.2, rel=0.02)
    assert found.accepted
    assert found.time_within(20 * DPH) == pytest.approx(300 * np.log(10), rel=1e-4)
    assert found.time_within(300 * DPH) == 0.0


def test_a_constant_bias_has_no_warm_up():
    start, end, noise = record(30, 10, NAV440)
    found = fit_warm_up(start, end, np.zeros(len(start)) + DPH * np.cos(start), noise)
    assert not found.accepted
    assert "gain" in found.reasons
    assert fit_warm_up(start[:4], end[:4], np.zeros(4), record(40 / 60, 10, NAV440)[2]) is None


def test_the_gain_is_the_chi_squared_that_the_warm_up_takes_from_a_constant():
    start, end, noise = record(30, 10, NAV440)
    S = noise.covariance()
    rng = np.random.default_rng(3)
    z = np.linalg.cholesky(S) @ rng.standard_normal(len(start))
    z += 100 * DPH * decay_means(start, end, 300.0)
    found = fit_warm_up(start, end, z, noise)
    inverse = np.linalg.inv(S)
    ones = np.ones(len(z))
    residual = z - (ones @ inverse @ z) / (ones @ inverse @ ones)
    assert found.chi2 > 1.0
    assert found.gain == pytest.approx(residual @ inverse @ residual - found.chi2, rel=1e-6)


def test_a_warm_up_longer_than_half_the_record_is_refused():
    start, end, noise = record(30, 10, NAV440)
    found = fit_warm_up(start, end, 4000 * DPH * decay_means(start, end, 1300.0), noise)
    assert "record" in found.reasons


def test_a_bias_over_temperature_is_not_time():
    start, end, noise = record(30, 10, NAV440)
    T = 20 + 15 * (1 - decay_means(start, end, 300.0))
    z = 30 * DPH * T
    assert fit_warm_up(start, end, z, noise).accepted
    t = (T - T.mean()) / 8
    explained = fit_warm_up(start, end, z + 1e-9 * DPH * start, noise, t[:, None])
    assert explained is None or not explained.accepted


def test_the_smallest_allan_deviation_is_near_the_flicker_floor():
    floor = 15.66 * np.sqrt(2 * np.log(2) / np.pi)
    assert allan_minimum(NAV440) / DPH == pytest.approx(floor, rel=0.06)
    assert allan_minimum(NAV440) / DPH > floor


def campaign(amplitude, minutes, seeds, figures=NAV440, block=10, seed=30):
    rng = np.random.default_rng(seed)
    start, end, noise = record(minutes, block, figures)
    length = 60 * minutes
    n = round((length + 300) / STEP)
    horizon = noise.horizon(length, length + 300)
    out = []
    for _ in range(seeds):
        series = simulate_slow_noise(rng, n, STEP, SlowNoise.from_figures(figures))
        z = series[: round(length / STEP)].reshape(len(start), -1).mean(axis=1)
        z = z + figures.white / np.sqrt(block) * rng.standard_normal(len(z))
        z = z + amplitude * DPH * decay_means(start, end, 300.0)
        found = fit_warm_up(start, end, z, noise)
        if found is None:
            out.append([0, 0, np.nan, np.nan, np.nan, np.nan])
            continue
        c = found.constant(horizon)
        out.append(
            [
                found.accepted,
                found.gain,
                found.tau / 300,
                np.log(found.tau / 300) / found.sigma_ln_tau,
                (found.amplitude / DPH - amplitude) / (found.amplitude_sigma / DPH),
                (c.value[0] - series[round(length / STEP) :].mean()) / c.sigma[0],
            ]
        )
    return np.array(out)


@pytest.mark.campaign
def test_a_warm_up_of_200_deg_per_hour_is_found_always():
    got = campaign(200, 30, 300)
    assert got[:, 0].mean() > 0.96
    assert np.median(got[:, 1]) == pytest.approx(61, rel=0.1)
    np.testing.assert_allclose(
        np.quantile(got[:, 2], [0.16, 0.5, 0.84]), [0.78, 0.99, 1.34], rtol=0.1
    )
    np.testing.assert_allclose(got[:, 3:].std(axis=0), [1.03, 1.06, 0.97], atol=0.13)


@pytest.mark.campaign
def test_smaller_warm_ups_are_found_as_often_as_published():
    assert campaign(60, 30, 300)[:, 0].mean() == pytest.approx(0.26, abs=0.08)
    none = campaign(0, 30, 300)
    assert none[:, 0].mean() <= 0.01
    assert np.mean(none[:, 1] > 10) <= 0.02


@pytest.mark.campaign
def test_a_noisy_gyro_finds_a_warm_up_of_400_deg_per_hour_in_an_hour():
    got = campaign(400, 60, 200, MTIG, 20)
    got = got[got[:, 1] > 10]
    np.testing.assert_allclose(np.quantile(got[:, 2], [0.16, 0.84]), [0.74, 1.48], rtol=0.15)
