"""Lag of the thermometer and heating against cooling on a ramp."""

import numpy as np
import pytest
from scipy.signal import lfilter

from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.sensors import NoiseFigures
from rotcli.models.slow_noise import simulate_slow_noise
from rotcli.thermal.fit import ThermalProblem, fit_basis, fit_orders
from rotcli.thermal.lag import compare_directions, direction_column, fit_lag
from tests.scale.sets import DEG, DPH, NAV440
from tests.thermal.sets import true_bias

QUIET = NoiseFigures(white=0.05 * DEG / 60, bias_instability=DPH, rate_random_walk=0.03 * DPH)
START = 20.0 * np.arange(240)
STEP = 2.0
TIME = np.arange(0, 4800, STEP) + STEP / 2
RAMP = 40 - np.abs(TIME - 2400) / 60 + 20  # 20, 60, 20 degC at 1 degC/min


def means(series):
    return series.reshape(240, -1).mean(axis=1)


def ramp(z=None, figures=NAV440, measured=RAMP):
    """Still blocks of 20 s on the ramp; heating as the gradient of the block temperatures."""
    T = means(measured)
    z = np.zeros(240) if z is None else z
    log = Blocks(START, START + 20, 0 * T, np.column_stack([z] * 3), T, np.gradient(T, 20.0))
    return ThermalProblem((log,), 2, figures)


def noise(rng, figures):
    slow = means(simulate_slow_noise(rng, len(TIME), STEP, SlowNoise.from_figures(figures)))
    return slow + figures.white / np.sqrt(20.0) * rng.standard_normal(240)


def lagged_thermometer(lag):
    """The temperature behind a first-order lag (s), from rest at 20 degC."""
    a = np.exp(-STEP / lag)
    return 20 + lfilter([1 - a], [1, -a], RAMP - 20)


def test_the_columns_of_a_ramp_have_the_published_sigmas():
    p = ramp()
    fit = fit_orders(p, 3, None)
    test = compare_directions(fit)
    assert test.rate_sigma / DPH / 60 == pytest.approx(6.49, rel=0.01)
    both = np.column_stack([p.heating, direction_column(p.heating)])
    sigma = fit_basis(p, fit.bias_basis, None, both).gls.sigma[-2:] / DPH
    np.testing.assert_allclose(sigma / [60, 1], [18.2, 31.6], rtol=0.01)


def test_soaks_have_no_direction():
    heating = np.array([1.0, 0.05, -0.05, -1.0]) / 60
    np.testing.assert_array_equal(direction_column(heating), [0.5, 0, 0, -0.5])


def test_a_ramp_in_one_direction_is_not_tested():
    p = ramp()
    log = p.logs[0]
    half = Blocks(
        *(getattr(log, n)[:118] for n in ("start", "end", "rate", "mean", "temperature", "heating"))
    )
    assert compare_directions(fit_orders(ThermalProblem((half,), 2, NAV440), 3, None)) is None


def test_an_exact_lag_is_measured():
    T = lagged_thermometer(60.0)
    p = ramp(means(true_bias(RAMP)), QUIET, T)
    found = fit_lag(fit_orders(p, 3, None))
    # The gradient over 20 s blocks rounds the turn of the ramp: a tenth of a sigma.
    assert found.lag == pytest.approx(60.0, abs=0.6)
    assert found.sigma == pytest.approx(3.9, rel=0.05)


def test_a_constant_temperature_has_no_lag():
    p = ramp()
    log = p.logs[0]
    flat = Blocks(log.start, log.end, log.rate, log.mean, log.temperature, 0 * log.heating)
    assert fit_lag(fit_orders(ThermalProblem((flat,), 2, NAV440), 3, None)) is None


@pytest.mark.campaign
def test_the_lag_of_a_quiet_gyro_has_the_published_scatter():
    rng = np.random.default_rng(60)
    T = lagged_thermometer(60.0)
    exact = means(true_bias(RAMP))
    lags, sigmas, without, using = [], [], [], []
    for _ in range(300):
        p = ramp(exact + noise(rng, QUIET), QUIET, T)
        fit = fit_orders(p, 3, None)
        found = fit_lag(fit)
        lags.append(found.lag)
        sigmas.append(found.sigma)
        without.append(fit.gls.chi2 / 240)
        using.append(found.chi2 / 240)
    assert np.mean(lags) == pytest.approx(60.1, abs=0.8)
    assert np.std(lags) == pytest.approx(3.9, rel=0.12)
    assert np.std((np.array(lags) - 60) / sigmas) == pytest.approx(1.0, abs=0.1)
    assert np.mean(without) == pytest.approx(2.05, abs=0.1)
    assert np.mean(using) == pytest.approx(0.99, abs=0.03)


@pytest.mark.campaign
def test_heating_against_cooling_is_seen_by_chance_in_one_percent():
    rng = np.random.default_rng(61)
    exact = means(true_bias(RAMP))
    shift = 40 * DPH * direction_column(ramp().heating)
    chance, power = [], []
    for _ in range(400):
        e = exact + noise(rng, NAV440)
        chance.append(compare_directions(fit_orders(ramp(e), 3, None)).significant)
        power.append(compare_directions(fit_orders(ramp(e + shift), 3, None)).significant)
    assert np.mean(chance) <= 0.03
    assert np.mean(power) > 0.6


def test_heating_against_cooling_is_measured_on_a_ramp_of_two_rates():
    # 1 degC/min up, a soak, 2 degC/min down: rate term and offset are separate columns.
    T = np.interp(TIME, [0, 2400, 3600, 4800], [20, 60, 60, 20])
    blocks_T = means(T)
    heating = np.where(START < 2400, 1 / 60, np.where(START < 3600, 0.0, -1 / 30))
    rate_term, offset = 600 * DPH, 30 * DPH
    z = means(true_bias(T)) + rate_term * heating + offset * np.sign(heating) / 2
    log = Blocks(START, START + 20, 0 * z, np.column_stack([z] * 3), blocks_T, heating)
    fit = fit_orders(ThermalProblem((log,), 2, QUIET), 3, None)
    test = compare_directions(fit)
    # Largest difference at the fastest rate: 2 a (1/30) + b.
    assert test.largest / DPH == pytest.approx(600 * 2 / 30 + 30, rel=1e-3)
    assert test.significant
    assert test.largest_sigma > 0


def test_the_lag_counts_in_the_scale_factor_as_well():
    # Turning blocks alone carry the lag: the bias is constant, the scale factor is not.
    T = lagged_thermometer(60.0)
    rate = np.where(np.arange(240) % 2, 50.0, -50.0) * DEG
    z = means(2e-5 * (RAMP - 20)) * rate  # 20 ppm/degC
    log = Blocks(START, START + 20, rate, np.column_stack([z] * 3), means(T), means(_rates(T)))
    found = fit_lag(fit_orders(ThermalProblem((log,), 2, QUIET, 50 * DEG), 1, 1))
    # The bias of order 1 is fitted to zero; its slope adds nothing to the column.
    assert found.lag == pytest.approx(60.0, abs=3.0)


def _rates(T):
    return np.gradient(T, STEP)
