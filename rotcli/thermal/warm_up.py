"""Warm-up: bias after power-on, `c + A exp(-t/tau)`, and the time until it may be neglected."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.least_squares import (
    GlsFit,
    Horizon,
    Prediction,
    cholesky,
    fit_gls,
    predict,
)
from rotcli.models.mean_covariance import IntervalNoise
from rotcli.models.numerics.triangular import solve_triangular
from rotcli.models.sensors import NoiseFigures
from rotcli.units import FloatArray

GRID = 60  # time constants of the search
# Gain of chi2 that is accepted: 2 parameters, one of them searched for. By chance in 2 of 300
# records; with the limits of the sigma and the record's length in 0 of 300.
MIN_GAIN = 10.0
MAX_SIGMA_LN = float(np.log(2.0))  # of ln tau
MIN_TIME_CONSTANTS = 2.0  # the record in units of tau
_STEPS = 30
_CONVERGED = 1e-6


def decay_means(start: FloatArray, end: FloatArray, tau: float) -> FloatArray:
    """Return the block means (k,) of exp(-t/tau), t from power-on."""
    result: FloatArray = tau * (np.exp(-start / tau) - np.exp(-end / tau)) / (end - start)
    return result


def decay_slopes(start: FloatArray, end: FloatArray, tau: float) -> FloatArray:
    """Return the derivative of `decay_means` with respect to ln tau."""
    result: FloatArray = decay_means(start, end, tau) + (
        start * np.exp(-start / tau) - end * np.exp(-end / tau)
    ) / (end - start)
    return result


@dataclass(frozen=True, eq=False)
class WarmUp:
    """Fitted warm-up: amplitude A, tau in s, sigma of ln tau, gain of chi2 over no warm-up.

    fit: GLS linearised at the solution, columns (other columns, exp, d/d ln tau); reasons: why it
    is not accepted, empty if it is.
    """

    amplitude: float
    amplitude_sigma: float
    tau: float
    sigma_ln_tau: float
    gain: float
    chi2: float
    dof: int
    fit: GlsFit
    reasons: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        """Whether the record shows this warm-up."""
        return not self.reasons

    @property
    def tau_sigma(self) -> float:
        """Sigma of tau, s."""
        return self.tau * self.sigma_ln_tau

    def constant(self, horizon: Horizon) -> Prediction:
        """Return the bias after the warm-up, with the slow noise of the horizon."""
        P = np.zeros((1, len(self.fit.estimate)))
        P[0, 0] = 1.0
        return predict(self.fit, P, np.ones(1), horizon)

    def time_within(self, limit: float) -> float:
        """Return the time after power-on (s) until the bias stays within `limit` of its end."""
        return max(0.0, self.tau * float(np.log(abs(self.amplitude) / limit)))


def allan_minimum(figures: NoiseFigures) -> float:
    """Return the smallest Allan deviation of the noise figures between 1 s and 1 day."""
    tau = np.geomspace(1.0, 86400.0, 400)
    return float(np.sqrt(np.min(figures.allan_variance(tau))))


def fit_warm_up(
    start: FloatArray,
    end: FloatArray,
    z: FloatArray,
    noise: IntervalNoise,
    columns: FloatArray | None = None,
) -> WarmUp | None:
    """Return the warm-up in means z (k,) over [start, end], s after power-on.

    columns: (k, m) further columns next to the constant (bias over temperature). Variable
    projection over ln tau on a grid from 2 blocks to the record, then Gauss-Newton. None if
    the record has fewer than 5 blocks.
    """
    if len(z) < 5:
        return None
    base = np.ones((len(z), 1)) if columns is None else np.column_stack([np.ones(len(z)), columns])
    S = noise.covariance()
    factor = cholesky(S)
    plain = fit_gls(base, z, S, factor)
    record = float(end[-1])
    taus = np.geomspace(2.0 * float(np.median(end - start)), record, GRID)
    chi2 = [_chi2(plain, decay_means(start, end, float(tau))) for tau in taus]
    tau = float(taus[int(np.argmin(chi2))])
    fit = fit_gls(np.column_stack([base, decay_means(start, end, tau)]), z, S, factor)
    amplitude = float(fit.estimate[-1])
    linear = fit
    for _ in range(_STEPS):
        E, slope = decay_means(start, end, tau), decay_slopes(start, end, tau)
        try:
            linear = fit_gls(np.column_stack([base, E, amplitude * slope]), z, S, factor)
        except ValueError:
            return None
        step = float(np.clip(linear.estimate[-1], -0.5, 0.5))
        tau = float(np.clip(tau * np.exp(step), 0.5 * taus[0], 2.0 * record))
        amplitude = float(
            fit_gls(np.column_stack([base, decay_means(start, end, tau)]), z, S, factor).estimate[
                -1
            ]
        )
        if abs(step) < _CONVERGED:
            break
    gain = plain.chi2 - linear.chi2
    sigma = float(linear.sigma[-1])
    return WarmUp(
        amplitude=amplitude,
        amplitude_sigma=float(linear.sigma[-2]),
        tau=tau,
        sigma_ln_tau=sigma,
        gain=gain,
        chi2=linear.chi2,
        dof=linear.dof,
        fit=linear,
        reasons=_reasons(gain, sigma, abs(amplitude) > float(linear.sigma[-2]), tau, record),
    )


def _chi2(plain: GlsFit, column: FloatArray) -> float:
    """Return chi2 of the fit with one more column, from the whitened residual of the plain one."""
    white = solve_triangular(plain.factor, np.column_stack([column, plain.residual]), lower=True)
    q, _ = np.linalg.qr(plain.whitened)
    new = white[:, 0] - q @ (q.T @ white[:, 0])
    return plain.chi2 - float(new @ white[:, 1]) ** 2 / float(new @ new)


def _reasons(
    gain: float, sigma: float, amplitude_known: bool, tau: float, record: float
) -> tuple[str, ...]:
    """Return why a warm-up is not accepted."""
    found = []
    if gain <= MIN_GAIN:
        found.append("gain")
    if sigma > MAX_SIGMA_LN or not amplitude_known:
        found.append("sigma")
    if tau > record / MIN_TIME_CONSTANTS:
        found.append("record")
    return tuple(found)
