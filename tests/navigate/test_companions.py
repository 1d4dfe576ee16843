"""Accelerometers of a window against the still segment: angle, sigma and level of the test."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from rotcli.models.base import FixedBase
from rotcli.models.expected.at_angle import AngleComparison
from rotcli.models.expected.sources import AccelSource, AxisSource, still_contrast
from rotcli.models.mean_covariance import SlowNoise
from rotcli.navigate.companions import accel_companions
from rotcli.navigate.residuals import StillAccelerometers, WindowResiduals
from rotcli.units import DEG
from tests.independent_noise import long_flicker

X = np.array([1.0, 0.0, 0.0])
BASE = FixedBase(51.0 * DEG, 9.81, np.eye(3))
WHITE, FLICKER = 8e-4, 4.5e-4  # m/s/sqrt(s), m/s^2: NAV440
STILL, START, SECONDS, STILL_ANGLE = 30.0, 70.0, 60, 0.3
ERRORS = np.random.default_rng(3).standard_normal((3, 3)) * 1.5e-3
SQUARE = 4e-3  # m/s^2 at 1 g


def source(bias=0.0, flicker=FLICKER):
    axes = (AxisSource(WHITE, SlowNoise(flicker), still_contrast(0.0, STILL)),)
    return AccelSource(axes, np.full(3, bias))


def force(angle):
    """Return the specific force (n, 3) of accelerometers that turn about the horizontal x."""
    f = np.stack([0.0 * angle, np.sin(angle), np.cos(angle)], axis=-1) * 9.81
    return f @ ERRORS.T + SQUARE * (f / 9.81) ** 2


def residuals(rate, noise=0.0):
    """Return the residuals of a window, means of a second over 200 instants."""
    start = np.arange(SECONDS)[:, None]
    fine = 0.4 + rate * DEG * (start + (np.arange(200) + 0.5) / 200.0)
    accel = force(fine).mean(axis=1) + noise
    middle = 0.4 + rate * DEG * (np.arange(SECONDS) + 0.5)
    zero = np.zeros(3)
    return WindowResiduals(
        START, 1.0, np.zeros((SECONDS, 3)), accel, np.full(SECONDS, rate * DEG), middle, zero
    )


def comparison(window, turning=9.81):
    blocks = window.start, window.length, window.rate, window.angle
    return AngleComparison.of(blocks, STILL_ANGLE, (3e-3 * turning, 1e-3 * turning), source())


def compare(rate, noise=0.0):
    window = residuals(rate, noise)
    return comparison(window).test(window.accel - force(np.array(STILL_ANGLE)))


@pytest.mark.parametrize("rate", [10.0, 30.0, 50.0, 100.0, -100.0])
def test_errors_that_depend_on_the_angle_cancel_and_a_change_of_bias_remains(rate):
    assert np.abs(compare(rate).value).max() < 2e-5
    changed = compare(rate, np.array([0.0, 0.01, 0.0]))
    np.testing.assert_allclose(changed.value, [0.0, 0.01, 0.0], atol=2e-5)
    assert changed.p_value < 1e-9


@pytest.mark.parametrize(("rate", "seen"), [(360.0, 0.0), (1.0, 0.5), (50.0, 1.0)])
def test_what_the_window_does_not_show_enters_with_its_tolerance(rate, seen):
    sigma = compare(rate).sigma[0]
    if seen == 1.0:  # noise alone: flicker of two means 40 s apart, five columns of white noise
        assert 5e-4 < sigma < 8e-4
    elif seen:
        assert sigma > 1e-3
    else:
        assert sigma == pytest.approx(np.hypot(3e-3, 1e-3) * 9.81, rel=0.01)


def test_the_mean_of_a_level_turn_is_the_mean_of_its_blocks():
    weights = comparison(residuals(50.0), turning=0.0).weights()
    np.testing.assert_allclose(weights, 1.0 / SECONDS, rtol=1e-9)


@pytest.mark.parametrize("rate", [10.0, 100.0])
def test_the_level_is_nominal_under_flicker_of_another_method(rate):
    rng = np.random.default_rng(5)
    p = []
    run = SimpleNamespace(rate=rate * DEG, constant_rate=True, axis=X)
    end = round(START) + SECONDS
    flicker = long_flicker(rng, 5 * end, 0.2, (300, 3)).reshape(300, 3, end, 5).mean(axis=-1)
    for slow in flicker:
        noise = WHITE * rng.standard_normal((end, 3)) + FLICKER * slow.T
        bias = noise[: round(STILL)].mean(axis=0) + force(np.array(STILL_ANGLE))
        accel = AccelSource(source().axes, bias)
        rest = StillAccelerometers(0.0, STILL, bias, STILL_ANGLE)
        window = residuals(rate, noise[round(START) :])
        mean, _, _ = accel_companions(run, window, accel, BASE, rest)
        if mean is not None:
            p.append(mean.p_value)
    low, high = binom.interval(0.99, len(p), 0.05)
    assert len(p) > 250
    assert low <= np.count_nonzero(np.array(p) < 0.05) <= high
