"""Sets of rates, error curves and noise figures for the tests of the scale factor."""

import numpy as np

from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.sensors import NoiseFigures
from rotcli.models.slow_noise import simulate_slow_noise

DEG = np.pi / 180
DPH = DEG / 3600
PPM = 1e-6
FULL_SCALE = 100 * DEG
NAV440 = NoiseFigures(
    white=0.4 * DEG / 60, bias_instability=15.66 * DPH, rate_random_walk=0.35 * DPH
)
MTIG = NoiseFigures(white=3.0 * DEG / 60, bias_instability=8.28 * DPH, rate_random_walk=2.6 * DPH)
IMUS = {"NAV440": NAV440, "MTi-G": MTIG}
A1 = [0, 10, 20, 50, 100, 100, 50, 20, 10, 0, -10, -20, -50, -100, -100, -50, -20, -10, 0]
ALTERNATING = [0, 10, -10, 20, -20, 50, -50, 100, -100, -100, 100, -50, 50, -20, 20, -10, 10, 0]
# The error curves beyond 60 deg/h and 900 ppm, deg/h over x = rate / 100 deg/s.
TRUTHS = {
    "line": lambda x: 0.0 * x,
    "cubic": lambda x: 30 * x**2 - 60 * x**3,
    "asym": lambda x: 200e-6 * 360_000 * np.abs(x),
    "knee": lambda x: 60 * np.tanh(x / 0.15),
}


def truth(rates, name="line"):
    """The true error, rad/s, at rates in deg/s."""
    x = np.asarray(rates, float) / 100
    return DPH * (60 + 900e-6 * 360_000 * x + TRUTHS[name](x))


def blocks(rates, z=None, duration=60.0, change=4.0):
    """Blocks at rates (deg/s) whose three gyros have the means z (rad/s)."""
    start = (duration + change) * np.arange(len(rates))
    mean = np.zeros(len(rates)) if z is None else np.asarray(z)
    return Blocks(start, start + duration, np.array(rates) * DEG, np.column_stack([mean] * 3))


def noisy_blocks(rng, rates, name, figures, *, extra=300.0, step=2.0):
    """Simulated blocks of the truth and the mean slow noise next (300 s) and over the test.

    The slow noise is drawn with a history of one record; sampling it at 2 s changes the variance
    of a minute's mean by less than 0.5 %.
    """
    log = blocks(rates)
    end = float(log.end[-1])
    n = round((end + extra) / step)
    series = simulate_slow_noise(rng, n, step, SlowNoise.from_figures(figures))

    def mean(a, b):
        return series[round(a / step) : round(b / step)].mean()

    z = truth(rates, name)
    z += np.array([mean(a, b) for a, b in zip(log.start, log.end, strict=True)])
    z += figures.white / np.sqrt(log.end - log.start) * rng.standard_normal(len(z))
    return blocks(rates, z), mean(end, end + extra), mean(0.0, end)
