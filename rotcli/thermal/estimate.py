"""Estimate bias and scale factor over temperature of a triad, and its warm-up.

Gyros and accelerometers alike: a channel has its own orders, its own lag and its own residuals.
"""

from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.mean_covariance import Goodness, Prediction, goodness, predict
from rotcli.models.sensors import NoiseFigures
from rotcli.run.findings import Finding
from rotcli.thermal.basis import Hats
from rotcli.thermal.fit import (
    OrderSelection,
    ThermalFit,
    ThermalProblem,
    fit_basis,
    fit_orders,
    group_temperatures,
    largest_orders,
    select_orders,
)
from rotcli.thermal.lag import SOAK_HEATING, DirectionTest, Lag, compare_directions, fit_lag
from rotcli.thermal.validation import LeaveOneOut, leave_one_out
from rotcli.units import FloatArray

CHANNELS = ("x", "y", "z")
HORIZON = 300.0  # s after the last block for which the bias is predicted, by default
# A gap between neighbouring temperatures wider than this share of the range is a hole in it.
MAX_GAP_SHARE = 0.4
_PROFILE_POINTS = 81  # temperatures of the plotted and stored curves


@dataclass(frozen=True, eq=False)
class ChannelResult:
    """Bias and scale factor over temperature of one sensor.

    soaks: (s,) degC, bias and bias_own: d at them for the horizon and for the log's span; scale: K
    at them, None without turning blocks; difference: d(highest) - d(lowest); residual_before and
    residual_after: rms of the means about their mean and about the fit; left_out: on soaks that
    the fit has not seen; directions: heating against cooling; lag: of the thermometer.
    """

    name: str
    selection: OrderSelection | None
    fit: ThermalFit
    goodness: Goodness
    soaks: FloatArray
    bias: Prediction
    bias_own: Prediction
    scale: Prediction | None
    difference: tuple[float, float]
    sensitivity: tuple[float, float]
    residual_before: tuple[float, float]
    residual_after: tuple[float, float]
    left_out: LeaveOneOut | None
    directions: DirectionTest | None
    lag: Lag | None


@dataclass(frozen=True, eq=False)
class ThermalResult:
    """Result of a thermal test, SI and degC.

    gyro and accel: channels by x, y, z; accel empty without an attitude. low, high: range of the
    temperatures; gap: largest between neighbouring ones; reference: of the powers, degC.
    """

    axis_name: str
    axis: FloatArray
    reference: float
    low: float
    high: float
    gap: float
    horizon: tuple[float, float]
    logs: tuple[Blocks, ...]
    gyro: dict[str, ChannelResult]
    accel: dict[str, ChannelResult]
    findings: tuple[Finding, ...]


def estimate_channel(
    name: str,
    problem: ThermalProblem,
    horizon: tuple[float, float],
    orders: tuple[int, int] | None = None,
    knots: tuple[float, ...] | None = None,
) -> ChannelResult:
    """Return the result of one sensor; orders (bias, scale) instead of those of smallest BIC.

    knots: degC of hat functions instead of polynomials.

    Raises ValueError for a swing that is too small or orders that the data cannot separate.
    """
    largest = largest_orders(problem)
    selection = None
    if knots is not None:
        hats = Hats(knots)
        fit = fit_basis(problem, hats, hats if largest[1] >= 0 else None)
    elif orders is None:
        selection = select_orders(problem, largest)
        fit = selection.selected
    else:
        fit = fit_orders(problem, orders[0], orders[1] if largest[1] >= 0 else None)
    found = goodness(fit.gls.chi2, fit.gls.dof)
    if found.sigma_factor > 1.0:
        problem = replace(problem, figures=scaled_figures(problem.figures, found.sigma_factor))
        fit = fit_basis(problem, fit.bias_basis, fit.scale_basis)
    soaks, _ = group_temperatures(problem.temperature)
    ends = np.array([problem.high, problem.low])
    rows = fit.bias_rows(ends)
    difference = predict(fit.gls, (rows[0] - rows[1])[None, :], np.zeros(1))
    slopes = fit.sensitivity(np.linspace(problem.low, problem.high, _PROFILE_POINTS)).value
    raw = problem.z - np.mean(problem.z)
    return ChannelResult(
        name=name,
        selection=selection,
        fit=fit,
        goodness=found,
        soaks=soaks,
        bias=fit.bias(soaks, problem.horizon(*horizon)),
        bias_own=fit.bias(soaks, problem.own_span()),
        scale=fit.scale(soaks) if fit.scale_basis is not None else None,
        difference=(float(difference.value[0]), float(difference.sigma[0])),
        sensitivity=(
            float(difference.value[0]) / (problem.high - problem.low),
            float(slopes[int(np.argmax(np.abs(slopes)))]),
        ),
        residual_before=_size(raw),
        residual_after=_size(fit.gls.residual - np.mean(fit.gls.residual)),
        left_out=leave_one_out(fit),
        directions=compare_directions(fit),
        lag=fit_lag(fit),
    )


def scaled_figures(figures: NoiseFigures, factor: float) -> NoiseFigures:
    """Return noise figures times a factor."""
    return replace(
        figures,
        white=figures.white * factor,
        bias_instability=figures.bias_instability * factor,
        rate_random_walk=figures.rate_random_walk * factor,
        markov_sigma=figures.markov_sigma * factor,
    )


def _size(values: FloatArray) -> tuple[float, float]:
    """Return rms and peak."""
    return float(np.sqrt(np.mean(values**2))), float(np.max(np.abs(values)))


def estimate_thermal(
    logs: tuple[Blocks, ...],
    accel_logs: tuple[Blocks, ...],
    noise: dict[str, tuple[NoiseFigures, NoiseFigures, NoiseFigures]],
    *,
    axis_name: str,
    axis: FloatArray,
    reference: float | None = None,
    horizon: tuple[float, float] | None = None,
    orders: tuple[int, int] | None = None,
    knots: tuple[float, ...] | None = None,
) -> ThermalResult:
    """Return bias and scale factor over temperature of the gyros (and accelerometers).

    logs, accel_logs: blocks with temperatures (accel_logs may be empty); noise: figures of
    `gyro` and `accel`. reference: degC of the powers, default the middle of the range rounded to
    1 degC. horizon: s, on the last log's clock, default the 300 s after its last block.
    """
    end = float(logs[-1].end[-1])
    window = horizon if horizon is not None else (end, end + HORIZON)
    rate = max(float(np.max(np.abs(log.rate))) for log in logs) or 1.0
    gyro = {
        name: estimate_channel(
            name, ThermalProblem(logs, i, noise["gyro"][i], rate), window, orders, knots
        )
        for i, name in enumerate(CHANNELS)
    }
    accel = {}
    if accel_logs:
        still = tuple(replace(log, rate=np.zeros(len(log))) for log in accel_logs)
        accel = {
            name: estimate_channel(
                name, ThermalProblem(still, i, noise["accel"][i]), window, orders, knots
            )
            for i, name in enumerate(CHANNELS)
        }
    problem = gyro["x"].fit.problem
    temperatures = np.sort(problem.temperature)
    middle = float(np.round(0.5 * (problem.low + problem.high)))
    result = ThermalResult(
        axis_name=axis_name,
        axis=axis,
        reference=middle if reference is None else reference,
        low=problem.low,
        high=problem.high,
        gap=float(np.max(np.diff(temperatures))),
        horizon=window,
        logs=logs,
        gyro=gyro,
        accel=accel,
        findings=(),
    )
    return replace(result, findings=_findings(result))


def heating_and_cooling(problem: ThermalProblem) -> tuple[bool, bool]:
    """Return whether the temperature rises and falls, inside blocks or from one to the next."""
    rises = falls = False
    for log in problem.logs:
        if log.temperature is None:
            continue
        steps = np.diff(log.temperature)
        rises = rises or bool(np.any(steps > 1.0))
        falls = falls or bool(np.any(steps < -1.0))
        if log.heating is not None:
            rises = rises or bool(np.any(log.heating > SOAK_HEATING))
            falls = falls or bool(np.any(log.heating < -SOAK_HEATING))
    return rises, falls


def _findings(result: ThermalResult) -> tuple[Finding, ...]:
    """Return what the test shows that a user must know."""
    found: list[Finding] = []
    rises, falls = heating_and_cooling(result.gyro["x"].fit.problem)
    if rises != falls:
        missing = "cooling" if rises else "heating"
        found.append(
            Finding(
                "thermal-one-way",
                f"the logs contain no {missing}; drift and temperature are not separated well",
                where="temperature",
            )
        )
    if result.gap > MAX_GAP_SHARE * (result.high - result.low):
        found.append(
            Finding(
                "temperature-gap",
                f"neighbouring temperatures are up to {result.gap:.1f} degC apart; the curve "
                "between them is not tested",
                where="temperature",
                value=result.gap,
                limit=MAX_GAP_SHARE * (result.high - result.low),
                unit="degC",
            )
        )
    for kind, channels in (("gyro", result.gyro), ("accel", result.accel)):
        for name, channel in channels.items():
            found += _channel_findings(f"{kind}_{name}", channel)
    return tuple(found)


def _channel_findings(where: str, channel: ChannelResult) -> list[Finding]:
    """Return the findings of one sensor."""
    found = []
    test = channel.goodness
    if test.noise_too_small:
        found.append(
            Finding(
                "noise-figures-small",
                f"{where} scatters more than its noise figures and the curve allow (chi-squared "
                f"{test.chi2:.1f}, limit {test.high:.1f}); its sigmas are multiplied by "
                f"{test.sigma_factor:.2f}",
                where=where,
                value=test.chi2,
                limit=test.high,
            )
        )
    elif test.noise_too_large:
        found.append(
            Finding(
                "noise-figures-large",
                f"{where} scatters less than its noise figures imply (chi-squared "
                f"{test.chi2:.2f}, limit {test.low:.2f}); its sigmas are too large",
                where=where,
                value=test.chi2,
                limit=test.low,
            )
        )
    if channel.directions is not None and channel.directions.significant:
        found.append(
            Finding(
                "thermal-hysteresis",
                f"{where} differs between heating and cooling (p = "
                f"{channel.directions.p_value:.2g}); soaks with slower changes separate a lag of "
                "the thermometer from hysteresis",
                where=where,
                value=channel.directions.p_value,
                limit=0.01,
            )
        )
    return found
