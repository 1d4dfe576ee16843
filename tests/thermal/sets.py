"""Set of soaks, truth and simulated blocks for the tests of bias over temperature."""

import numpy as np

from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.slow_noise import simulate_slow_noise
from rotcli.thermal.fit import ThermalProblem
from tests.scale.sets import DEG, DPH, FULL_SCALE, NAV440, PPM

SOAKS = np.array([-20, 0, 20, 40, 60.0])
UP_AND_DOWN = np.array([-20, 0, 20, 40, 60, 60, 40, 20, 0, -20.0])
END = 18716.0
STEP = 4.0


def true_bias(T):
    """The true bias, rad/s, at temperatures in degC."""
    x = (np.asarray(T) - 20) / 40
    return (60 + 400 * x - 150 * x**2 + 80 * x**3) * DPH


def true_scale(T):
    x = (np.asarray(T) - 20) / 40
    return (900 + 1500 * x + 400 * x**2) * PPM


def blocks(z=None, soaks=UP_AND_DOWN, extra=None):
    """120 s still, 60 s at +50 and at -50 deg/s per soak, every 2052 s; means z (rad/s)."""
    start = (2052.0 * np.arange(len(soaks))[:, None] + np.array([0.0, 124, 188])).ravel()
    length = np.tile([120.0, 60, 60], len(soaks))
    rate = np.tile([0, 50, -50], len(soaks)) * DEG
    T = np.repeat(soaks, 3)
    mean = np.zeros(len(start)) if z is None else z
    return Blocks(start, start + length, rate, np.column_stack([mean] * 3), T, np.zeros(len(start)))


def truth(log):
    return true_bias(log.temperature) + true_scale(log.temperature) * log.rate


def problem(z=None, figures=NAV440, soaks=UP_AND_DOWN):
    return ThermalProblem((blocks(z, soaks),), 2, figures, FULL_SCALE)


def noisy_problem(rng, figures=NAV440):
    """A simulated set with the mean slow noise of the next 300 s and of the set's span."""
    log = blocks()
    n = round((END + 300) / STEP)
    series = simulate_slow_noise(rng, n, STEP, SlowNoise.from_figures(figures))

    def mean(a, b):
        return series[round(a / STEP) : round(b / STEP)].mean()

    z = truth(log)
    z += np.array([mean(a, b) for a, b in zip(log.start, log.end, strict=True)])
    z += figures.white / np.sqrt(log.end - log.start) * rng.standard_normal(len(z))
    return problem(z, figures), mean(END, END + 300), mean(0, END)
