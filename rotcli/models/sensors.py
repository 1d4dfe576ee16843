"""Errors of a sensor triad: bias, scale factor, installation, and the noises of IEEE Std 952.

The model is `measured = (I + N) true + bias + noise` for gyros and accelerometers alike
(R16 (3) to (8), (30)); `correct` inverts its constant part.
R16 is "MEMS IMU Error Mitigation Using Rotation Modulation Technique", Sensors 2016, 16, 2017.
"""

from dataclasses import field

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from rotcli.models import slow_noise

BIAS_NAMES = ("bias_x", "bias_y", "bias_z")
# Axis column in the paper's names: the column of N that a rotation about this axis excites.
AXIS_COLUMN_NAMES = {
    "x": ("Kgx", "Kgyx", "Kgzx"),
    "y": ("Kgxy", "Kgy", "Kgzy"),
    "z": ("Kgxz", "Kgyz", "Kgz"),
    "u": ("Kgxu", "Kgyu", "Kgzu"),
}
# The flat part of the Allan deviation over B: sqrt(2 ln 2 / pi) (IEEE Std 952, C.1.3).
FLICKER_FLOOR = float(np.sqrt(2.0 * np.log(2.0) / np.pi))


@dataclass(frozen=True, eq=False)
class TriadErrors:
    """Constant errors of one triad.

    matrix: (3, 3), scale factors on the diagonal, installation errors off it (N or M).
    bias: (3,) in the unit of the triad (rad/s or m/s^2).
    """

    matrix: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    bias: FloatArray = field(default_factory=lambda: np.zeros(3))


def distort(errors: TriadErrors, true: FloatArray) -> FloatArray:
    """Return noise-free readings (n, 3) of the triad from true values (n, 3) (R16 (30))."""
    return true + true @ errors.matrix.T + errors.bias


def correct(errors: TriadErrors, measured: FloatArray) -> FloatArray:
    """Return the corrected readings (n, 3): `(I + N)^-1 (measured - bias)`; undoes `distort`."""
    inverse = np.linalg.inv(np.eye(3) + errors.matrix)
    return (measured - errors.bias) @ inverse.T


@dataclass(frozen=True)
class NoiseFigures:
    """The noise of one sensor axis, in the coefficients of IEEE Std 952, SI units.

    For a gyro (rad, s): quantization Q rad, white noise N rad/sqrt(s), bias instability B rad/s
    (its Allan floor is 0.664 B), rate random walk K rad/s/sqrt(s), rate ramp R rad/s^2, and a
    first-order Gauss-Markov process of standard deviation rad/s and correlation time s.
    For an accelerometer the same with m/s instead of rad.
    """

    quantization: float = 0.0
    white: float = 0.0
    bias_instability: float = 0.0
    rate_random_walk: float = 0.0
    rate_ramp: float = 0.0
    markov_sigma: float = 0.0
    markov_time: float = 100.0

    def allan_variance(self, tau: FloatArray) -> FloatArray:
        """Return the theoretical Allan variance at cluster times tau (s), Gauss-Markov included.

        IEEE Std 952-1997, C.1.1 to C.1.7; the Gauss-Markov term is its equation (C.20).
        """
        r = tau / self.markov_time
        markov = (
            2.0
            * (self.markov_sigma / r) ** 2
            * (r - 0.5 * (3.0 - 4.0 * np.exp(-r) + np.exp(-2.0 * r)))
        )
        result: FloatArray = (
            3.0 * (self.quantization / tau) ** 2
            + self.white**2 / tau
            + (FLICKER_FLOOR * self.bias_instability) ** 2
            + self.rate_random_walk**2 * tau / 3.0
            + (self.rate_ramp * tau) ** 2 / 2.0
            + markov
        )
        return result


# Quoted, so that commands without noise do not import numpy.random.
def noise(rng: "np.random.Generator", n: int, interval: float, figures: NoiseFigures) -> FloatArray:
    """Return n samples (n,) of one axis's noise at the given interval (s).

    Flicker noise has been running for n samples before the first, the Gauss-Markov process is
    stationary; random walk and rate ramp start from zero. Each process has a random stream, so
    the white noise of a log does not change when another figure is set.
    """
    white, angle, flicker, walk, markov = rng.spawn(5)
    time = interval * np.arange(n, dtype=float)
    total: FloatArray = figures.rate_ramp * time
    if figures.white:
        total += figures.white / np.sqrt(interval) * white.standard_normal(n)
    if figures.quantization:
        total += figures.quantization / interval * np.diff(angle.standard_normal(n + 1))
    if figures.bias_instability:
        total += figures.bias_instability * slow_noise.flicker_noise(flicker, n)
    if figures.rate_random_walk:
        steps = figures.rate_random_walk * np.sqrt(interval) * walk.standard_normal(n)
        total += np.cumsum(steps)
    if figures.markov_sigma:
        decay = float(np.exp(-interval / figures.markov_time))
        total += figures.markov_sigma * slow_noise.markov_noise(markov, n, decay)
    return total
