"""Figures of a scale factor test: scale factor, asymmetry, nonlinearity, residuals per rate.

Every figure is a linear function of the means, with the covariance that follows, or says which
bias of a maximum it has. ppm of full scale refer to the w_FS of the problem.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import predict
from rotcli.scale.curves import TABLE, group_rates
from rotcli.scale.fit import CurveFit, Selection
from rotcli.units import FloatArray

# Draws of the maximum under a straight line: its 95 % quantile then repeats to 0.5 %.
_DRAWS = 20_000
_SEED = 528
QUANTILE = 0.95
CHAR_SIGNIFICANT = 3.0


@dataclass(frozen=True)
class Figure:
    """A value and its sigma."""

    value: float
    sigma: float


def scale_factor(fit: CurveFit) -> Figure:
    """Return K, the slope of the straight line that best fits the curve at the test's rates."""
    row = fit.straight_line()[1:]
    result = predict(fit.gls, row, np.zeros(1))
    return Figure(float(result.value[0]), float(result.sigma[0]))


def asymmetry(selection: Selection) -> Figure | None:
    """Return (S+ - S-)/S = 2 a/(1 + K) of model asym; None if only one sign was tested.

    Positive: more gain at positive rates. The share of K's sigma is below 1e-3 of it.
    """
    fit = selection.fits.get("asym")
    if fit is None:
        return None
    factor = 2.0 / (fit.problem.full_scale * (1.0 + scale_factor(fit).value))
    return Figure(factor * float(fit.gls.estimate[-1]), abs(factor) * float(fit.gls.sigma[-1]))


def _residual_maker(rates: FloatArray) -> FloatArray:
    """Return I - H (R, R) of the straight line through the distinct rates."""
    A = np.column_stack([np.ones(len(rates)), rates])
    result: FloatArray = np.eye(len(rates)) - A @ np.linalg.pinv(A)
    return result


@dataclass(frozen=True)
class Nonlinearity:
    """Largest deviation of the selected curve from its straight line, fractions of full scale.

    rate: where it is, rad/s; raw: maximum of the table of rates; limit: 95 % quantile of the raw
    maximum if the truth is a straight line. Report "below limit" if it is not significant.
    """

    value: float
    sigma: float
    rate: float
    raw: float
    limit: float


def nonlinearity(selection: Selection) -> Nonlinearity:
    """Return the nonlinearity of the selected curve with the raw maximum and its limit."""
    fit, table = selection.selected, selection.fits[TABLE]
    rates, full_scale = fit.problem.rates, fit.problem.full_scale
    maker = _residual_maker(rates)
    D = maker @ fit.rows(rates)
    deviation = D @ fit.gls.estimate
    worst = int(np.argmax(np.abs(deviation)))
    sigma = float(np.sqrt(D[worst] @ fit.gls.covariance @ D[worst]))
    table_rows = maker @ table.rows(rates)
    raw = float(np.max(np.abs(table_rows @ table.gls.estimate)))
    limit = maximum_quantile(table_rows @ table.gls.covariance @ table_rows.T)
    return Nonlinearity(
        value=float(abs(deviation[worst])) / full_scale,
        sigma=sigma / full_scale,
        rate=float(rates[worst]),
        raw=raw / full_scale,
        limit=limit / full_scale,
    )


def maximum_draws(covariance: FloatArray) -> FloatArray:
    """Return draws (20000,) of the largest absolute value of normal numbers (R, R) covariance."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(values))) @ root.T
    result: FloatArray = np.max(np.abs(draws), axis=1)
    return result


def maximum_quantile(covariance: FloatArray, probability: float = QUANTILE) -> float:
    """Return the quantile of the largest absolute value of normal numbers of this covariance."""
    return float(np.quantile(maximum_draws(covariance), probability))


@dataclass(frozen=True, eq=False)
class RateResiduals:
    """Per distinct rate (R,): rad/s; table value minus the straight line, and its sigma."""

    rates: FloatArray
    residual: FloatArray
    sigma: FloatArray
    curve: FloatArray  # selected curve minus the same line


def rate_residuals(selection: Selection) -> RateResiduals:
    """Return the table of rates minus the straight line of the selected curve."""
    fit, table = selection.selected, selection.fits[TABLE]
    rates = fit.problem.rates
    line = np.column_stack([np.ones(len(rates)), rates]) @ fit.straight_line()
    map_to_z = table.rows(rates) @ table.gls.gain - line @ fit.gls.gain
    variance = np.einsum("rk,kl,rl->r", map_to_z, fit.problem.covariance, map_to_z)
    curve = (fit.rows(rates) - line) @ fit.gls.estimate
    residual = map_to_z @ fit.problem.z
    return RateResiduals(rates, residual, np.sqrt(np.maximum(variance, 0.0)), curve)


def composite_error(selection: Selection) -> float:
    """Return max |z - line| / w_FS over all blocks: noise, hysteresis, repeatability included.

    Each log is compared with its bias; the line is that of the selected curve.
    """
    fit = selection.selected
    problem = fit.problem
    slope = scale_factor(fit).value
    remaining = problem.z - slope * problem.rate
    offsets = problem.offsets()
    if fit.model == TABLE:
        means = np.linalg.lstsq(offsets, remaining, rcond=None)[0]
        return float(np.max(np.abs(remaining - offsets @ means))) / problem.full_scale
    biases = fit.gls.estimate[: offsets.shape[1]]
    shift = float(fit.straight_line()[0] @ fit.gls.estimate) - float(biases[-1])
    return float(np.max(np.abs(remaining - offsets @ biases - shift))) / problem.full_scale


@dataclass(frozen=True, eq=False)
class Parts:
    """Odd and even parts of the curve per magnitude (M,), rad/s, with sigmas.

    Even parts are differences from the smallest magnitude (its bias is no part of the curve).
    """

    rates: FloatArray
    odd: FloatArray
    odd_sigma: FloatArray
    even: FloatArray
    even_sigma: FloatArray


def parts(selection: Selection) -> Parts | None:
    """Return odd and even parts of the table of rates; None without rates of both signs."""
    table = selection.fits[TABLE]
    rates = table.problem.rates
    magnitudes, group = group_rates(np.abs(rates))
    used, odd_rows, even_rows = [], [], []
    zero_row = None
    P = table.rows(rates)
    for m, magnitude in enumerate(magnitudes):
        members = np.flatnonzero(group == m)
        positive = [i for i in members if rates[i] > 0]
        negative = [i for i in members if rates[i] < 0]
        if positive and negative:
            plus, minus = P[positive[0]], P[negative[0]]
            used.append(magnitude)
            odd_rows.append(0.5 * (plus - minus))
            even_rows.append(0.5 * (plus + minus))
        elif not positive and not negative:
            zero_row = P[members[0]]
    if not used:
        return None
    base = even_rows[0] if zero_row is None else zero_row
    odd = predict(table.gls, np.array(odd_rows), np.zeros(len(used)))
    even = predict(table.gls, np.array(even_rows) - base, np.zeros(len(used)))
    return Parts(np.array(used), odd.value, odd.sigma, even.value, even.sigma)


def misalignment(first: Figure, second: Figure) -> tuple[Figure, float, float | None]:
    """Return the angle between input axis and table axis from the cross gyros' K, rad.

    Returns the corrected value sqrt(max(0, a^2 - s_j^2 - s_l^2)) with its sigma, the plain norm
    a (biased upward by noise), and an upper limit where a is below 3 sigma, else None.
    """
    norm = float(np.hypot(first.value, second.value))
    corrected = float(np.sqrt(max(0.0, norm**2 - first.sigma**2 - second.sigma**2)))
    if norm > 0.0:
        sigma = float(np.hypot(first.value * first.sigma, second.value * second.sigma)) / norm
    else:
        sigma = max(first.sigma, second.sigma)
    limit = norm + 2.0 * sigma if norm <= CHAR_SIGNIFICANT * sigma else None
    return Figure(corrected, sigma), norm, limit


@dataclass(frozen=True, eq=False)
class ResponseRatio:
    """Response ratio at the tested magnitudes (M,), rad/s, its sigma, dead band and threshold.

    dead_band: largest magnitude without response (None: below the smallest tested); threshold:
    smallest magnitude with response (None: not reached).
    """

    rates: FloatArray
    ratio: FloatArray
    sigma: FloatArray
    dead_band: float | None
    threshold: float | None


NO_RESPONSE, RESPONSE = 0.1, 0.5  # limits of the ratio (IEEE Std 528: 50 % of the input)


def response_ratio(curve_parts: Parts) -> ResponseRatio:
    """Return rho(w) = 1 + [z(w) - z(-w)]/(2 w) per magnitude from the odd parts."""
    ratio = 1.0 + curve_parts.odd / curve_parts.rates
    sigma = curve_parts.odd_sigma / curve_parts.rates
    silent = curve_parts.rates[ratio + 2.0 * sigma < NO_RESPONSE]
    responding = curve_parts.rates[ratio - 2.0 * sigma > RESPONSE]
    return ResponseRatio(
        curve_parts.rates,
        ratio,
        sigma,
        float(np.max(silent)) if len(silent) else None,
        float(np.min(responding)) if len(responding) else None,
    )
