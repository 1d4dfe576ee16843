"""Convert noise coefficients to the numbers that programs and data sheets use, each formula once.

Densities are two-sided: N is the Allan deviation of white noise at 1 s, and a sample at the rate
f scatters by N sqrt(f). The random walk of an estimator is K, the rate random walk (its Allan
deviation is K at 3 s); the bias changes by K / sqrt(f) from one sample to the next. Sources: IEEE
Std 952-1997, C.1; Kalibr wiki, "IMU Noise Model" (equations for discrete time).
"""

import math
from typing import NamedTuple, TypeVar

import numpy as np

from rotcli import units
from rotcli.units import FloatArray

Number = TypeVar("Number", float, FloatArray)


class NoiseUnit(NamedTuple):
    """Unit of a coefficient on data sheets, its size in SI, and the SI unit."""

    name: str
    size: float
    si: str


UG = units.UNITS["acceleration"]["ug"]  # m/s^2
# Coefficient: as data sheets and results have it; a rate random walk is rad/s/sqrt(s) in IEEE Std
# 952 and rad/s^2/sqrt(Hz) in estimators, which is the same.
GYRO_UNITS = {
    "quantization": NoiseUnit("arcsec", units.DEG / 3600.0, "rad"),
    "random_walk": NoiseUnit("deg/sqrt(h)", units.DEG_PER_ROOT_HOUR, "rad/s/sqrt(Hz)"),
    "bias_instability": NoiseUnit("deg/h", units.DEG_PER_HOUR, "rad/s"),
    "rate_random_walk": NoiseUnit("deg/h/sqrt(s)", units.DEG_PER_HOUR, "rad/s/sqrt(s)"),
    "rate_ramp": NoiseUnit("deg/h^2", units.DEG_PER_HOUR / units.HOUR, "rad/s^2"),
}
ACCEL_UNITS = {
    "quantization": NoiseUnit("m/s", 1.0, "m/s"),
    "random_walk": NoiseUnit("m/s/sqrt(h)", units.METRE_PER_SECOND_PER_ROOT_HOUR, "m/s^2/sqrt(Hz)"),
    "bias_instability": NoiseUnit("ug", UG, "m/s^2"),
    "rate_random_walk": NoiseUnit("ug/sqrt(s)", UG, "m/s^2/sqrt(s)"),
    "rate_ramp": NoiseUnit("ug/h", UG / units.HOUR, "m/s^3"),
}
# The same coefficients in the other units that data sheets use.
RATE_DENSITY = NoiseUnit("deg/s/sqrt(Hz)", units.DEG, "rad/s/sqrt(Hz)")
FORCE_DENSITY = NoiseUnit("ug/sqrt(Hz)", UG, "m/s^2/sqrt(Hz)")
GYRO_WALK_PER_ROOT_HOUR = NoiseUnit(
    "deg/h/sqrt(h)", units.DEG_PER_HOUR / math.sqrt(units.HOUR), "rad/s/sqrt(s)"
)
ACCEL_WALK_PER_ROOT_HOUR = NoiseUnit("ug/sqrt(h)", UG / math.sqrt(units.HOUR), "m/s^2/sqrt(s)")
# Units of N and K as Kalibr and its relatives write them, and the keys of its imu.yaml.
GYRO_WALK_DENSITY, ACCEL_WALK_DENSITY = "rad/s^2/sqrt(Hz)", "m/s^3/sqrt(Hz)"
KALIBR_KEYS = {
    ("gyro", "white"): "gyroscope_noise_density",
    ("gyro", "walk"): "gyroscope_random_walk",
    ("accel", "white"): "accelerometer_noise_density",
    ("accel", "walk"): "accelerometer_random_walk",
}


def per_sample(white: Number, rate: float) -> Number:
    """Return the standard deviation of one sample, N sqrt(f), f the rate (Hz).

    >>> f"{per_sample(1.163553e-4, 100.0):.6e}"
    '1.163553e-03'
    """
    return white * math.sqrt(rate)


def sample_variance(white: Number, rate: float) -> Number:
    """Return the variance of one sample, N^2 f."""
    return white * white * rate


def midpoint_sample(white: Number, rate: float) -> Number:
    """Return N sqrt(2 f): of steps that add two half intervals of newly drawn noise."""
    return white * math.sqrt(2.0 * rate)


def walk_per_sample(walk: Number, rate: float) -> Number:
    """Return the standard deviation of the bias change over one sample, K / sqrt(f)."""
    return walk / math.sqrt(rate)


def walk_rate_per_step(walk: Number, rate: float) -> Number:
    """Return K sqrt(f), per second: a bias that changes by this times the interval at each step."""
    return walk * math.sqrt(rate)


def root_mean_square(values: FloatArray) -> float:
    """Return the root mean square of values (n,), which are scaled so that no square overflows."""
    largest = float(np.max(np.abs(values)))
    return largest * float(np.sqrt(np.mean((values / (largest or 1.0)) ** 2)))
