"""Noise figures of a rig as the error sources of an expectation.

The expected errors need five figures of [imu]; `allan --to-rig` measures them. Zero is a figure:
a sensor without random walk has `rate_random_walk = 0`.
"""

import numpy as np

from rotcli.models.mean_covariance import SlowNoise
from rotcli.rig.rig import ImuSettings
from rotcli.units import FloatArray

GYRO_FIGURES = ("angle_random_walk", "bias_instability", "rate_random_walk")
ACCEL_FIGURES = ("velocity_random_walk", "accel_bias_instability")


def missing_figures(imu: ImuSettings) -> tuple[str, ...]:
    """Return the names of the noise figures that an expectation needs and the rig lacks.

    A Gauss-Markov process of the gyros or accelerometers takes the place of their slow figures.
    """
    needed = list(GYRO_FIGURES + ACCEL_FIGURES)
    if imu.gauss_markov_gyro_sigma is not None:
        needed = [name for name in needed if name not in GYRO_FIGURES[1:]]
    if imu.gauss_markov_accel_sigma is not None:
        needed.remove(ACCEL_FIGURES[1])
    return tuple(name for name in needed if imu.figure(name) is None)


def gyro_noise(imu: ImuSettings) -> list[tuple[float, SlowNoise]]:
    """Return N (rad/sqrt(s)) and the slow noise of the gyros: one entry for equal gyros, else 3.

    Bias instability and random walk where the rig has them, else its Gauss-Markov process: both
    describe the same slow noise.
    """
    slow = (
        "bias_instability",
        "rate_random_walk",
        "gauss_markov_gyro_sigma",
        "gauss_markov_gyro_time",
    )
    return _noise(imu, GYRO_FIGURES[0], slow)


def accel_noise(imu: ImuSettings) -> list[tuple[float, SlowNoise]]:
    """Return N (m/s/sqrt(s)) and the slow noise of the accelerometers, as `gyro_noise`."""
    slow = ("accel_bias_instability", None, "gauss_markov_accel_sigma", "gauss_markov_accel_time")
    return _noise(imu, ACCEL_FIGURES[0], slow)


def _noise(
    imu: ImuSettings, white: str, slow: tuple[str, str | None, str, str]
) -> list[tuple[float, SlowNoise]]:
    def values(name: str | None) -> FloatArray:
        found = None if name is None else imu.figure(name)
        return np.zeros(3) if found is None else found

    flicker, walk, sigma, time = (values(name) for name in slow)
    if np.any(flicker) or np.any(walk) or not np.all(time):
        sigma = np.zeros(3)
    found = [
        (float(N), SlowNoise(float(B), float(K), float(s), float(t) if s else 100.0))
        for N, B, K, s, t in zip(values(white), flicker, walk, sigma, time, strict=True)
    ]
    return found[:1] if found[0] == found[1] == found[2] else found
