"""Errors of sensors that depend on rate, temperature and time since power-on, for simulations.

Gyro i reads, on top of its constant errors, `e(w_i) + d(T) + K(T) w_i + A exp(-t/tau)`: e the
nonlinearity of its input rate, d and K polynomials about a reference temperature without a
constant. The thermometer of the log follows the sensors' temperature with a lag and in steps.
"""

from dataclasses import field

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.laboratory.thermometer import lagged, profile_temperature, stepped
from rotcli.units import FloatArray


def _none() -> FloatArray:
    return np.zeros((3, 0))


@dataclass(frozen=True)
class RateNonlinearity:
    """Error of a gyro over its normalised input rate x = w / full_scale, rad/s.

    quadratic, cubic, asymmetry: rad/s of x^2, x^3, |x|; knee_height tanh(w / knee_rate): rad/s.
    """

    full_scale: float
    quadratic: float = 0.0
    cubic: float = 0.0
    asymmetry: float = 0.0
    knee_height: float = 0.0
    knee_rate: float = 1.0

    def error(self, rate: FloatArray) -> FloatArray:
        """Return the error (n, ...), rad/s, at input rates of the same shape."""
        x = rate / self.full_scale
        result: FloatArray = (
            self.quadratic * x**2
            + self.cubic * x**3
            + self.asymmetry * np.abs(x)
            + self.knee_height * np.tanh(rate / self.knee_rate)
        )
        return result


@dataclass(frozen=True, eq=False)
class Environment:
    """Temperature profile, its effect on the sensors, nonlinearity and warm-up.

    temperature: (p, 2) points (s, degC), None: none is logged. thermometer_lag: s;
    thermometer_step: degC. reference: degC; gyro_bias (3, q) rad/s, gyro_scale (3, q),
    accel_bias (3, q) m/s^2: coefficients of (T - reference)^1, ^2, ... warm_up: rad/s at
    power-on, all gyros; warm_up_time: s.
    """

    temperature: FloatArray | None = None
    thermometer_lag: float = 0.0
    thermometer_step: float = 0.0
    reference: float = 20.0
    gyro_bias: FloatArray = field(default_factory=_none)
    gyro_scale: FloatArray = field(default_factory=_none)
    accel_bias: FloatArray = field(default_factory=_none)
    nonlinearity: RateNonlinearity | None = None
    warm_up: float = 0.0
    warm_up_time: float = 300.0

    def thermometer(self, time: FloatArray, interval: float) -> FloatArray | None:
        """Return the logged temperature (n,), degC, at even times (n,); None without profile."""
        if self.temperature is None:
            return None
        true = profile_temperature(self.temperature, time)
        return stepped(lagged(true, interval, self.thermometer_lag), self.thermometer_step)

    def gyro_errors(self, time: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the errors (n, 3), rad/s, at times (n,), s, and true rates (n, 3), rad/s."""
        total = np.zeros(rate.shape)
        if self.nonlinearity is not None:
            total += self.nonlinearity.error(rate)
        if self.temperature is not None:
            T = profile_temperature(self.temperature, time) - self.reference
            total += _polynomial(self.gyro_bias, T) + _polynomial(self.gyro_scale, T) * rate
        if self.warm_up:
            total += self.warm_up * np.exp(-time / self.warm_up_time)[:, None]
        return total

    def accel_errors(self, time: FloatArray) -> FloatArray:
        """Return the errors (n, 3), m/s^2, at times (n,), s."""
        if self.temperature is None:
            return np.zeros((len(time), 3))
        T = profile_temperature(self.temperature, time) - self.reference
        return _polynomial(self.accel_bias, T)


def _polynomial(coefficients: FloatArray, T: FloatArray) -> FloatArray:
    """Return (n, 3) of coefficients (3, q) of T, T^2, ..."""
    powers = T[:, None] ** np.arange(1, coefficients.shape[1] + 1)
    result: FloatArray = powers @ coefficients.T
    return result
