"""Thermometer lag and heat/cool offset: what differs between heating and cooling.

With a lag L the sensor's temperature is `T + L dT/dt`: a column `d'(T) dT/dt` of coefficient L.
A constant offset between heating and cooling: a column `sign(dT/dt)/2`. A lag grows with the ramp
rate, the offset does not: only two ramp rates, or ramps and soaks, separate them.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.thermal.fit import ThermalFit, fit_basis
from rotcli.units import FloatArray

with lazily():
    from scipy import special


# Below 0.1 degC/min a block is a soak: no direction.
SOAK_HEATING = 0.1 / 60.0  # degC/s
SIGNIFICANT = 0.01  # probability of finding either by chance
_CONVERGED = 1e-3  # s
_MAX_STEPS = 20


def direction_column(heating: FloatArray) -> FloatArray:
    """Return sign(dT/dt)/2 (k,), 0 in soaks."""
    result: FloatArray = 0.5 * np.sign(heating) * (np.abs(heating) >= SOAK_HEATING)
    return result


def lag_column(fit: ThermalFit) -> FloatArray:
    """Return `(d'(T) + K'(T) w) dT/dt` (k,) at the lagged temperatures of a fit."""
    problem = fit.problem
    temperature = problem.temperature + fit.shift * problem.heating
    x = fit.gls.estimate
    slope = fit.bias_basis.derivatives(temperature) @ x[: fit.bias_size]
    if fit.scale_basis is not None:
        scale = x[fit.bias_size : fit.bias_size + fit.scale_size]
        slope = slope + (problem.rate / problem.rate_unit) * (
            fit.scale_basis.derivatives(temperature) @ scale
        )
    result: FloatArray = slope * problem.heating
    return result


@dataclass(frozen=True, eq=False)
class Lag:
    """Lag in s with sigma, chi2 with it, and the fit at the lagged temperatures."""

    lag: float
    sigma: float
    chi2: float
    fit: ThermalFit


def fit_lag(fit: ThermalFit) -> Lag | None:
    """Return the lag by Gauss-Newton from 0; None if temperature or bias do not change."""
    problem, current, lag = fit.problem, fit, 0.0
    if not np.any(np.abs(problem.heating) >= SOAK_HEATING):
        return None
    for _ in range(_MAX_STEPS):
        column = lag_column(current)
        if not np.any(column):
            return None
        position = fit.bias_size + fit.scale_size
        try:
            step = fit_basis(problem, fit.bias_basis, fit.scale_basis, column[:, None], lag)
            increment = float(step.gls.estimate[position])
            sigma = float(step.gls.sigma[position])
            lag += increment
            current = fit_basis(problem, fit.bias_basis, fit.scale_basis, None, lag)
        except ValueError:  # the lag leaves the range of the data
            return None
        if abs(increment) < _CONVERGED:
            return Lag(lag, sigma, current.gls.chi2, current)
    return None


@dataclass(frozen=True)
class DirectionTest:
    """Test of heating against cooling: p-value of both columns together, each coefficient alone.

    rate_term: per (degC/s), of a column dT/dt; offset: heating minus cooling; sigmas None where
    the data contain no ramp. largest: largest |heating - cooling| of both columns over the data.
    """

    p_value: float
    rate_term: float
    rate_sigma: float
    offset: float
    offset_sigma: float
    largest: float
    largest_sigma: float

    @property
    def significant(self) -> bool:
        """Whether heating and cooling differ at the 1 % level."""
        return self.p_value < SIGNIFICANT


def compare_directions(fit: ThermalFit) -> DirectionTest | None:
    """Return the test of columns dT/dt and sign(dT/dt)/2; None without heating and cooling."""
    heating = fit.problem.heating
    sign = direction_column(heating)
    if not (np.any(sign > 0) and np.any(sign < 0)):
        return None
    position = fit.bias_size + fit.scale_size

    def alone(column: FloatArray) -> tuple[float, float, float]:
        found = fit_basis(fit.problem, fit.bias_basis, fit.scale_basis, column[:, None])
        return (
            float(found.gls.estimate[position]),
            float(found.gls.sigma[position]),
            found.gls.chi2,
        )

    rate_term, rate_sigma, rate_chi2 = alone(heating)
    offset, offset_sigma, offset_chi2 = alone(sign)
    columns = np.column_stack([heating, sign])
    fastest = float(np.max(np.abs(heating)))
    try:
        both = fit_basis(fit.problem, fit.bias_basis, fit.scale_basis, columns)
        gain, dof = fit.gls.chi2 - both.gls.chi2, 2
        P = np.zeros(len(both.gls.estimate))
        P[position : position + 2] = 2.0 * fastest, 1.0
        largest = float(P @ both.gls.estimate)
        largest_sigma = float(np.sqrt(P @ both.gls.covariance @ P))
    except ValueError:  # one ramp rate: the two columns are one
        gain, dof = fit.gls.chi2 - min(rate_chi2, offset_chi2), 1
        largest, largest_sigma = offset, offset_sigma
    p_value = float(special.chdtrc(dof, max(gain, 0.0)))
    return DirectionTest(
        p_value, rate_term, rate_sigma, offset, offset_sigma, abs(largest), largest_sigma
    )
