"""What the survey of a clean record must not find, with noise of other programs than our own.

White noise of numpy, and flicker and random-walk noise of allantools (the generator of Kasdin
and Walter), or shaped by a Fourier transform. The shares are those of single axes.
"""

import allantools
import numpy as np
import pytest

from rotcli.allan.deviation import averaging_factors, phase_from_rate
from rotcli.allan.fit.summary import summarize
from rotcli.allan.fit.trimmed import MIN_P_VALUE, fit_trimmed
from rotcli.allan.survey.clipping import find_clipping
from rotcli.allan.survey.spectrum import survey

SAMPLES, INTERVAL = 120_000, 0.01  # twenty minutes at 100 Hz


def white(rng):
    return rng.standard_normal(SAMPLES)


def kasdin(rng, exponent, variance):
    """Return a rate whose phase has the density f^exponent, by allantools; `variance` scales it."""
    np.random.seed(rng.integers(2**31))  # noqa: NPY002  allantools draws from the global state
    source = allantools.Noise(nr=1 << 18, qd=variance, b=exponent)
    source.generateNoise()
    return np.diff(source.time_series)[-SAMPLES:]  # a process that has been running


def white_and_flicker(rng):
    """A corner near 0.2 Hz, where a MEMS gyro has it."""
    return white(rng) + kasdin(rng, -3, 2e-3)


def white_and_walk(rng):
    return white(rng) + kasdin(rng, -4, 1e-7)


def shaped(rng):
    """White noise, flicker noise and random walk as one spectrum, by a Fourier transform."""
    size = 2 * SAMPLES
    frequency = np.fft.rfftfreq(size)
    frequency[0] = frequency[1]
    shape = np.sqrt(1.0 + 2e-3 / frequency + 1e-7 / frequency**2)
    return np.fft.irfft(np.fft.rfft(rng.standard_normal(size)) * shape, size)[:SAMPLES]


def quantised(rng):
    """White noise of 0.7 digits: the worst that a recording has."""
    return np.round(0.7 * white(rng))


def findings(readings):
    """Return the names of what is found in readings, and the p-value of the fit."""
    spectrum = survey([readings], INTERVAL)
    phase = phase_from_rate(readings, INTERVAL)
    factors = averaging_factors(SAMPLES, None, INTERVAL)
    fit, misfit = fit_trimmed(summarize([phase], factors, INTERVAL, None, spectrum), "average")
    found = {
        "line": bool(spectrum.lines),
        "low-pass": spectrum.cutoff is not None,
        "repeated": spectrum.repeats > 1,
        "clipped": find_clipping(readings) is not None,
        "misfit": misfit is not None,
    }
    return {name for name, there in found.items() if there}, fit.goodness.p_value


@pytest.mark.parametrize("noise", [white, white_and_flicker, white_and_walk, shaped, quantised])
def test_clean_noise_has_no_finding(noise):
    rng = np.random.default_rng(11)
    assert [findings(noise(rng))[0] for _ in range(5)] == [set()] * 5


@pytest.mark.campaign
@pytest.mark.parametrize("noise", [white, white_and_flicker, white_and_walk, shaped, quantised])
def test_the_false_alarm_rate_is_below_one_in_two_hundred(noise):
    rng = np.random.default_rng(12)
    every = [findings(noise(rng)) for _ in range(400)]
    counts = {name: sum(name in found for found, _ in every) for name in
              ("line", "low-pass", "repeated", "clipped", "misfit")}  # fmt: skip
    # MIN_P_VALUE for the misfit and 1e-4 for lines: 0.04 expected.
    assert max(counts.values()) <= 2, counts
    # p-values are uniform: as many below 0.05 and 0.5 as there should be (5 sigma).
    p = np.array([value for _, value in every])
    assert abs(np.mean(p < 0.05) - 0.05) < 0.055
    assert abs(np.mean(p < 0.5) - 0.5) < 0.125
    assert MIN_P_VALUE == 1e-4
