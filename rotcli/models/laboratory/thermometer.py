"""Thermometers: temperature profiles, first-order lag, steps, and the filter of a temperature log.

Times in s, temperatures in degC.
"""

import numpy as np

from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from scipy import signal


def profile_temperature(points: FloatArray, time: FloatArray) -> FloatArray:
    """Return the temperature (n,) at times (n,): straight lines between points (p, 2) of (s, degC).

    Constant before the first and after the last point.
    """
    return np.asarray(np.interp(time, points[:, 0], points[:, 1]))


def lagged(temperature: FloatArray, interval: float, lag: float) -> FloatArray:
    """Return what is behind a first-order lag (s), from rest at the first temperature (n,).

    `T' = (input - T)/lag`, exact for an input that is linear between samples.
    """
    if lag <= 0.0:
        return temperature
    a = float(np.exp(-interval / lag))
    b = lag / interval * (1.0 - a)
    start = np.array([temperature[0] * b])
    result: FloatArray = signal.lfilter([1.0 - b, b - a], [1.0, -a], temperature, zi=start)[0]
    return result


def stepped(temperature: FloatArray, step: float) -> FloatArray:
    """Return the temperatures in multiples of the thermometer's step (0: none)."""
    if step <= 0.0:
        return temperature
    result: FloatArray = step * np.round(temperature / step)
    return result


def smooth(time: FloatArray, temperature: FloatArray, tau: float) -> FloatArray:
    """Return temperatures (n,) filtered forward and backward: no delay, noise of tau averaged.

    Each pass is a first-order lag of tau/4, adapted to the spacing of the times; both together
    have the noise bandwidth of a mean over tau. A constant and a straight ramp (away from the
    ends) pass unchanged.
    """
    if tau <= 0.0 or len(time) < 3:
        return temperature
    even = float(np.median(np.diff(time)))
    grid = np.linspace(time[0], time[-1], max(3, round((time[-1] - time[0]) / even) + 1))
    values = np.interp(grid, time, temperature)
    # Mirrored ends: the first-order passes begin and end at rest.
    count = min(len(grid) - 1, int(np.ceil(4.0 * tau / even)))
    before = 2.0 * values[0] - values[count:0:-1]
    after = 2.0 * values[-1] - values[-2 : -count - 2 : -1]
    padded = np.concatenate([before, values, after])
    step = float(grid[1] - grid[0])
    forward = lagged(padded, step, tau / 4.0)
    both = lagged(forward[::-1], step, tau / 4.0)[::-1]
    return np.asarray(np.interp(time, grid, both[count : count + len(grid)]))
