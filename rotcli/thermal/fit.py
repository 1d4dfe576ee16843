"""Fit bias and scale factor over temperature of one sensor; choose the order by BIC.

`z_k = d(T_k) + K(T_k) w_k + noise`; each log after the first has an offset (its turn-on).
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.laboratory.blocks import Blocks, joint_covariance, joint_horizon
from rotcli.models.least_squares import (
    GlsFit,
    Horizon,
    Prediction,
    cholesky,
    fit_gls,
    predict,
)
from rotcli.models.sensors import NoiseFigures
from rotcli.thermal.basis import Basis, Chebyshev
from rotcli.units import FloatArray

MAX_BIAS_ORDER = 5
MAX_SCALE_ORDER = 3
# Temperatures within 2 degC are one soak: chambers repeat to some tenths of a degree.
SOAK_WIDTH = 2.0
# A swing below 3 degC shows no temperature effect apart from noise; orders above 1 need 10 degC
# (ArduPilot's and PX4's lower limit as well).
MIN_SWING = 3.0
MIN_SWING_CURVED = 10.0


@dataclass(frozen=True, eq=False)
class ThermalProblem:
    """Means of one sensor over temperature, of one log or several.

    logs: blocks with temperatures; channel: column of their means; figures: noise (SI); rate_unit:
    rad/s that normalises the table rates (conditioning only).
    """

    logs: tuple[Blocks, ...]
    channel: int
    figures: NoiseFigures
    rate_unit: float = 1.0

    @cached_property
    def temperature(self) -> FloatArray:
        """Temperatures (k,), degC."""
        parts = [log.temperature for log in self.logs]
        return np.concatenate([part for part in parts if part is not None])

    @cached_property
    def heating(self) -> FloatArray:
        """Time derivatives of the temperature (k,), degC/s; 0 where unknown."""
        parts = [np.zeros(len(b)) if b.heating is None else b.heating for b in self.logs]
        return np.concatenate(parts)

    @cached_property
    def rate(self) -> FloatArray:
        """Table rates (k,), rad/s."""
        return np.concatenate([log.rate for log in self.logs])

    @cached_property
    def z(self) -> FloatArray:
        """Mean reading minus true value (k,)."""
        return np.concatenate([log.mean[:, self.channel] for log in self.logs])

    @cached_property
    def covariance(self) -> FloatArray:
        """S (k, k) of the means."""
        return joint_covariance(self.logs, self.figures)

    @cached_property
    def factor(self) -> FloatArray:
        """Lower Cholesky factor of S, for all fits."""
        return cholesky(self.covariance)

    @property
    def low(self) -> float:
        """Lowest temperature, degC."""
        return float(np.min(self.temperature))

    @property
    def high(self) -> float:
        """Highest temperature, degC."""
        return float(np.max(self.temperature))

    @cached_property
    def turning(self) -> NDArray[np.bool_]:
        """Which blocks have a rate."""
        result: NDArray[np.bool_] = self.rate != 0.0
        return result

    def offsets(self) -> FloatArray:
        """Return one column (k, L - 1) per log after the first."""
        number = np.repeat(np.arange(len(self.logs)), [len(log) for log in self.logs])
        return np.asarray(number[:, None] == np.arange(1, len(self.logs)), dtype=float)

    def horizon(self, start: float, end: float) -> Horizon:
        """Return the slow noise of the window [start, end], s, of the last log."""
        return joint_horizon(self.logs, self.figures, start, end)

    def own_span(self) -> Horizon:
        """Return the horizon from the first start to the last end of the last log."""
        log = self.logs[-1]
        return self.horizon(float(log.start[0]), float(log.end[-1]))


def group_temperatures(
    temperature: FloatArray, width: float = SOAK_WIDTH
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the soak temperatures (s,), degC, ascending, and the soak of each block (k,)."""
    group = np.zeros(len(temperature), dtype=np.intp)
    number, first = -1, -np.inf
    for k in np.argsort(temperature, kind="stable"):
        if temperature[k] - first > width:
            number, first = number + 1, temperature[k]
        group[k] = number
    means = np.bincount(group, weights=temperature) / np.bincount(group)
    return means, group


@dataclass(frozen=True, eq=False)
class ThermalFit:
    """One fit: bases of bias and scale factor (None: no turning blocks), its GLS.

    extra: columns (k, m) after the bases, for lag and hysteresis. shift: s, the lag already in
    the temperatures of the bases.
    """

    problem: ThermalProblem
    bias_basis: Basis
    scale_basis: Basis | None
    gls: GlsFit
    extra: int = 0
    shift: float = 0.0

    @property
    def bic(self) -> float:
        """Bayesian information criterion: chi2 + p ln k."""
        k, p = self.gls.whitened.shape
        return float(self.gls.chi2 + p * np.log(k))

    @property
    def bias_size(self) -> int:
        """Number of bias coefficients, the first in the estimate."""
        return self.bias_basis.size

    @property
    def scale_size(self) -> int:
        """Number of scale coefficients, next in the estimate."""
        return self.scale_basis.size if self.scale_basis is not None else 0

    def bias_rows(self, temperature: FloatArray) -> FloatArray:
        """Return P (n, p) of d(T) of the last log at temperatures (n,), degC."""
        P = np.zeros((len(temperature), len(self.gls.estimate)))
        P[:, : self.bias_size] = self.bias_basis.values(temperature)
        if len(self.problem.logs) > 1:
            P[:, -1] = 1.0
        return P

    def sensitivity_rows(self, temperature: FloatArray) -> FloatArray:
        """Return P (n, p) of d'(T), per degC."""
        P = np.zeros((len(temperature), len(self.gls.estimate)))
        P[:, : self.bias_size] = self.bias_basis.derivatives(temperature)
        return P

    def scale_rows(self, temperature: FloatArray) -> FloatArray:
        """Return P (n, p) of K(T), 1."""
        P = np.zeros((len(temperature), len(self.gls.estimate)))
        if self.scale_basis is not None:
            values = self.scale_basis.values(temperature) / self.problem.rate_unit
            P[:, self.bias_size : self.bias_size + self.scale_size] = values
        return P

    def bias(self, temperature: FloatArray, horizon: Horizon) -> Prediction:
        """Return d(T) with the slow noise of the horizon."""
        return predict(self.gls, self.bias_rows(temperature), np.ones(len(temperature)), horizon)

    def scale(self, temperature: FloatArray) -> Prediction:
        """Return K(T), 1."""
        return predict(self.gls, self.scale_rows(temperature), np.zeros(len(temperature)))

    def sensitivity(self, temperature: FloatArray) -> Prediction:
        """Return d'(T), per degC."""
        return predict(self.gls, self.sensitivity_rows(temperature), np.zeros(len(temperature)))

    def bias_powers(self, reference: float, horizon: Horizon) -> Prediction:
        """Return the coefficients of d about the reference temperature (degC)."""
        if not isinstance(self.bias_basis, Chebyshev):
            raise ValueError("hat functions have no powers")
        P = np.zeros((self.bias_size, len(self.gls.estimate)))
        P[:, : self.bias_size] = self.bias_basis.powers(reference)
        if len(self.problem.logs) > 1:
            P[0, -1] = 1.0
        return predict(self.gls, P, np.eye(self.bias_size)[0], horizon)

    def scale_powers(self, reference: float) -> Prediction:
        """Return the coefficients of K about the reference temperature (degC)."""
        if not isinstance(self.scale_basis, Chebyshev):
            raise ValueError("hat functions have no powers")
        P = np.zeros((self.scale_size, len(self.gls.estimate)))
        powers = self.scale_basis.powers(reference) / self.problem.rate_unit
        P[:, self.bias_size : self.bias_size + self.scale_size] = powers
        return predict(self.gls, P, np.zeros(self.scale_size))


def design(
    problem: ThermalProblem,
    bias_basis: Basis,
    scale_basis: Basis | None,
    extra: FloatArray | None = None,
    shift: float = 0.0,
) -> FloatArray:
    """Return A (k, p): bias, scale, extra columns, offsets of the logs after the first."""
    temperature = problem.temperature + shift * problem.heating
    columns = [bias_basis.values(temperature)]
    if scale_basis is not None:
        x = (problem.rate / problem.rate_unit)[:, None]
        columns.append(x * scale_basis.values(temperature))
    if extra is not None:
        columns.append(extra)
    return np.column_stack([*columns, problem.offsets()])


def fit_basis(
    problem: ThermalProblem,
    bias_basis: Basis,
    scale_basis: Basis | None,
    extra: FloatArray | None = None,
    shift: float = 0.0,
) -> ThermalFit:
    """Return the fit on these bases; ValueError if the data cannot separate the columns."""
    A = design(problem, bias_basis, scale_basis, extra, shift)
    gls = fit_gls(A, problem.z, problem.covariance, problem.factor)
    count = 0 if extra is None else extra.shape[1]
    return ThermalFit(problem, bias_basis, scale_basis, gls, count, shift)


def fit_orders(
    problem: ThermalProblem,
    bias_order: int,
    scale_order: int | None,
    extra: FloatArray | None = None,
) -> ThermalFit:
    """Return the fit of polynomials of these orders over the range of the data."""
    low, high = problem.low, problem.high
    scale = None if scale_order is None else Chebyshev(scale_order, low, high)
    return fit_basis(problem, Chebyshev(bias_order, low, high), scale, extra)


@dataclass(frozen=True, eq=False)
class OrderSelection:
    """All fits by (bias order, scale order or -1) and the one of the smallest BIC."""

    fits: dict[tuple[int, int], ThermalFit]
    orders: tuple[int, int]

    @property
    def selected(self) -> ThermalFit:
        """The fit of the selected orders."""
        return self.fits[self.orders]


def largest_orders(problem: ThermalProblem) -> tuple[int, int]:
    """Return the largest bias and scale orders that the soaks allow; scale -1 without turning.

    Raises ValueError if the temperature swing is below 3 degC.
    """
    swing = problem.high - problem.low
    if swing < MIN_SWING:
        raise ValueError(f"the temperature changes by {swing:.1f} degC; {MIN_SWING:g} are needed")
    soaks, group = group_temperatures(problem.temperature)
    bias = min(MAX_BIAS_ORDER, max(len(soaks) - 2, 1))
    turning = len(np.unique(group[problem.turning]))
    scale = min(MAX_SCALE_ORDER, max(turning - 2, 0)) if turning else -1
    if swing < MIN_SWING_CURVED:
        bias, scale = min(bias, 1), min(scale, 1)
    return bias, scale


def select_orders(
    problem: ThermalProblem, largest: tuple[int, int] | None = None
) -> OrderSelection:
    """Return the fits of all orders up to the largest and the one of the smallest BIC."""
    bias_order, scale_order = largest if largest is not None else largest_orders(problem)
    scales = range(scale_order + 1) if scale_order >= 0 else [-1]
    fits = {
        (p, q): fit_orders(problem, p, q if q >= 0 else None)
        for p in range(bias_order + 1)
        for q in scales
    }
    return OrderSelection(fits, min(fits, key=lambda orders: fits[orders].bic))
