"""Sigma of a calibration against the exact variance under the simulator's own noise generator.

The estimates are linear in the readings, and the generator is linear in its white draws, so the
variance of the estimates is a sum of squares: no draws, no chance.
"""

import numpy as np
import pytest

from rotcli.models.mean_covariance import IntervalNoise, SlowNoise, fit_gls, predict
from rotcli.models.sensors import NoiseFigures
from rotcli.rig.profile import read_profile
from rotcli.units import DEG, PPM

INTERVAL, SEGMENT, RAMP, WINDOW = 0.02, 60.0, 1.0, 300.0  # s


def _segments(rates):
    """Return starts and ends (k,), s, of segments of a minute, with ramps between the rates."""
    start, now = [], 0.0
    for k, rate in enumerate(rates):
        now += RAMP if k and rate != rates[k - 1] else 0.0
        start.append(now)
        now += SEGMENT
    return np.array(start), np.array(start) + SEGMENT


def _weights(rates, figures):
    """Return the sigmas that are claimed (2,), and the weights (2, k) of the segment means."""
    start, end = _segments(rates)
    noise = IntervalNoise(start, end, SlowNoise.from_figures(figures), figures.white)
    horizon = noise.horizon(float(end[-1]), float(end[-1]) + WINDOW)
    design = np.column_stack([rates, np.ones(len(rates))])
    S = noise.covariance()
    unit = [
        predict(fit_gls(design, z, S), np.eye(2), np.array([0.0, 1.0]), horizon)
        for z in np.eye(len(rates))
    ]
    return np.sqrt(np.diag(unit[0].covariance)), np.column_stack([p.value for p in unit])


def _exact(rates, figures, weights, *, of_bias):
    """Return the exact sigma of one estimate with weights (k,): white, flicker and random walk."""
    start, end = _segments(rates)
    n = round((end[-1] + WINDOW) / INTERVAL)
    a = np.zeros(n)
    per_segment = round(SEGMENT / INTERVAL)
    for weight, first in zip(weights, start, strict=True):
        a[round(first / INTERVAL) :][:per_segment] = weight / per_segment
    variance = figures.white**2 / INTERVAL * (a @ a)  # a bias is that of the window, without white
    if of_bias:
        window = round(WINDOW / INTERVAL)
        a[-window:] -= 1.0 / window
    # Flicker: unit white noise, running for n samples before, through (1 - z^-1)^(-1/2).
    k = np.arange(1, 2 * n)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    spectrum = np.conj(np.fft.rfft(response, 4 * n)) * np.fft.rfft(np.append(np.zeros(n), a), 4 * n)
    gain = np.fft.irfft(spectrum, 4 * n)[: 2 * n]
    variance += figures.bias_instability**2 * (gain @ gain)
    steps = np.cumsum(a[::-1])[::-1][1:]  # a step of the walk shifts all samples after it
    variance += figures.rate_random_walk**2 * INTERVAL * (steps @ steps)
    return float(np.sqrt(variance))


@pytest.mark.parametrize("imu", ["nav440", "mti-g"])
@pytest.mark.parametrize("rates", [(0.0, 100.0), (0.0, 50.0, 0.0, -50.0, 0.0)])
def test_the_sigma_is_that_of_the_generator(imu, rates):
    figures = NoiseFigures(**read_profile(imu).gyro.noise)
    rates = np.array(rates) * DEG
    claimed, weights = _weights(rates, figures)
    column = _exact(rates, figures, weights[0], of_bias=False)
    bias = _exact(rates, figures, weights[1], of_bias=True)
    # One record of history gives contrasts of flicker noise 0.995 of their variance.
    assert column / claimed[0] == pytest.approx(1.0, abs=3e-3)
    assert bias / claimed[1] == pytest.approx(1.0, abs=4e-3)
    assert 40.0 * PPM < column < 115.0 * PPM
