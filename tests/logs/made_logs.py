"""Logs made for the tests of this folder: a table that turns or sweeps, an IMU that measures it."""

import numpy as np

from rotcli.logs.record import ImuLog, TableLog

DEG = np.pi / 180


def table(plan, *, acceleration=50.0, grain=0.0, jitter=0.0, interval=0.02):
    """A table log of (deg/s, s) legs with ramps at `acceleration` deg/s^2; the legs' limits too."""
    times, rates, limits, now = [0.0], [plan[0][0]], [], plan[0][0]
    for rate, seconds in plan:
        if rate != now:
            times.append(times[-1] + abs(rate - now) / acceleration)
            rates.append(rate)
            now = rate
        limits.append((times[-1], times[-1] + seconds))
        times.append(times[-1] + seconds)
        rates.append(rate)
    time = np.arange(0, times[-1], interval)
    knots = np.concatenate([[0], np.cumsum(0.5 * np.diff(times) * (np.add(rates[1:], rates[:-1])))])
    leg = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2)
    into = time - np.array(times)[leg]
    slope = np.diff(rates) / np.maximum(np.diff(times), 1e-12)
    angle = knots[leg] + np.array(rates)[leg] * into + 0.5 * slope[leg] * into**2
    if grain:
        angle = np.rint(angle / grain) * grain
    stamps = time + np.random.default_rng(5).uniform(-jitter, jitter, len(time))
    return TableLog("table.csv", stamps, angle * DEG, interval, len(time)), limits


def sweep(amplitude, period, seconds=120.0):
    time = np.arange(0, seconds, 0.02)
    angle = amplitude * period / (2 * np.pi) * np.sin(2 * np.pi * time / period)
    return TableLog("table.csv", time, angle * DEG, 0.02)


def imu(seconds, rate_dps=(0.0, 0.0, 0.0), noise=0.0, seed=0):
    n = round(seconds * 100)
    rng = np.random.default_rng(seed)
    gyro = np.array(rate_dps) * DEG + noise * rng.normal(size=(n, 3))
    accel = np.array([0.0, 0.0, 9.8]) + noise * rng.normal(size=(n, 3))
    return ImuLog("imu.csv", np.arange(n) * 0.01, gyro, accel, 0.01, rows=n)


def drifting(seed, seconds=60.0):
    """White noise, flicker-like drift and turn-on bias of the papers' coarser IMU (MTi-G)."""
    rng = np.random.default_rng(seed)
    n = round(seconds * 100)
    arw, rate_walk = 3.0 * DEG / 60, 2.6 * DEG / 3600  # rad/sqrt(s), rad/s/sqrt(s)
    gyro = arw * 10 * rng.normal(size=(n, 3)) + DEG * rng.normal(size=3)
    gyro += np.cumsum(rate_walk * 0.1 * rng.normal(size=(n, 3)), axis=0)
    accel = 0.002 * 10 * rng.normal(size=(n, 3)) + [0, 0, 9.8]
    accel += np.cumsum(8e-5 * 0.1 * rng.normal(size=(n, 3)), axis=0)
    return ImuLog("imu.csv", np.arange(n) * 0.01, gyro, accel, 0.01)
