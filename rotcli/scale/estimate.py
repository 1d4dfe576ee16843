"""Estimate the error curves of a gyro triad over rates from the blocks of one or several logs.

Each gyro has a curve; about the table axis u the mean reading along u is the main channel, the
components perpendicular to u give the misalignment of the input axis.
"""

from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.mean_covariance import Goodness, Prediction, goodness, predict
from rotcli.models.sensors import NoiseFigures
from rotcli.run.findings import Finding
from rotcli.scale import figures as fig
from rotcli.scale.curves import SAME_RATE, TABLE, polynomial_columns
from rotcli.scale.fit import CurveProblem, Selection, select_model
from rotcli.scale.hysteresis import Hysteresis, hysteresis
from rotcli.scale.prediction import HORIZON, Verdict, linear_verdict
from rotcli.scale.repeatability import Repeatability, repeatability
from rotcli.units import DEG, DEG_PER_HOUR, PPM, FloatArray

CHANNELS = ("x", "y", "z")
ALONG = "u"  # name of the channel along an axis that is none of the sensor axes
# Largest share of the full scale below which the response ratio is worth printing: at 1 deg/s a
# dead band of fibre rings (some deg/h) is far below; MEMS gyros have none.
_SMALL_RATE = 1.0 * DEG


@dataclass(frozen=True, eq=False)
class ChannelResult:
    """Everything about one channel; None where the test's rates do not show it.

    selection: fits with sigmas enlarged by `goodness.sigma_factor`; bias and bias_own: offset of
    the straight line for the horizon and for the test's span, rad/s.
    """

    name: str
    selection: Selection
    goodness: Goodness
    goodness_table: Goodness
    scale: fig.Figure
    bias: Prediction
    bias_own: Prediction
    asymmetry: fig.Figure | None
    nonlinearity: fig.Nonlinearity
    residuals: fig.RateResiduals
    parts: fig.Parts | None
    composite: float
    hysteresis: Hysteresis | None
    response: fig.ResponseRatio | None


@dataclass(frozen=True, eq=False)
class ScaleResult:
    """Result of a scale factor test, SI.

    axis_name and axis: of the table; full_scale: rad/s, from the rig (`rated`) or the largest rate;
    horizon: window, s, of the predicted bias; channels: of the three gyros (and the axis, if it
    is none of them); main: name of the channel along the axis.
    """

    axis_name: str
    axis: FloatArray
    full_scale: float
    rated: bool
    horizon: tuple[float, float]
    logs: tuple[Blocks, ...]
    channels: dict[str, ChannelResult]
    main: str
    misalignment: tuple[fig.Figure, float, float | None]
    verdict: Verdict
    repeatability: Repeatability | None
    per_log: tuple[fig.Figure, ...]
    findings: tuple[Finding, ...]

    @property
    def along(self) -> ChannelResult:
        """The channel along the table axis."""
        return self.channels[self.main]


def _scaled(figures: NoiseFigures, factor: float) -> NoiseFigures:
    """Return noise figures times a factor."""
    return replace(
        figures,
        white=figures.white * factor,
        bias_instability=figures.bias_instability * factor,
        rate_random_walk=figures.rate_random_walk * factor,
        markov_sigma=figures.markov_sigma * factor,
    )


def _channel(
    name: str, problem: CurveProblem, horizon: tuple[float, float], model: str | None
) -> ChannelResult:
    """Return the result of one channel; sigmas enlarged where chi2 contradicts the noise."""
    selection = select_model(problem, model)
    found = goodness(selection.selected.gls.chi2, selection.selected.gls.dof)
    table = selection.fits[TABLE].gls
    if found.sigma_factor > 1.0:
        problem = replace(problem, figures=_scaled(problem.figures, found.sigma_factor))
        enlarged = select_model(problem, selection.model)
        selection = Selection(enlarged.fits, selection.tests, selection.p_line, selection.model)
    fit = selection.selected
    row, one = fit.straight_line()[:1], np.ones(1)
    curve_parts = fig.parts(selection)
    small = curve_parts is not None and float(curve_parts.rates[0]) <= _SMALL_RATE
    return ChannelResult(
        name=name,
        selection=selection,
        goodness=found,
        goodness_table=goodness(table.chi2, table.dof),
        scale=fig.scale_factor(fit),
        bias=predict(fit.gls, row, one, problem.horizon(*horizon)),
        bias_own=predict(fit.gls, row, one, problem.own_span()),
        asymmetry=fig.asymmetry(selection),
        nonlinearity=fig.nonlinearity(selection),
        residuals=fig.rate_residuals(selection),
        parts=curve_parts,
        composite=fig.composite_error(selection),
        hysteresis=hysteresis(problem),
        response=fig.response_ratio(curve_parts) if curve_parts is not None and small else None,
    )


def _repeatability(
    problem: CurveProblem,
) -> tuple[Repeatability | None, tuple[fig.Figure, ...]]:
    """Return the repeatability of K over the logs and each log's K of a line."""
    values = []
    for log in problem.logs:
        single = replace(problem, logs=(log,), scale_sigma=0.0)
        try:
            values.append(fig.scale_factor(select_model(single, "line").selected))
        except ValueError:  # a log at one rate contributes to the common curve only
            continue
    if len(values) < 2:
        return None, tuple(values)
    y = np.array([value.value for value in values])
    s = np.array([value.sigma for value in values])
    return repeatability(y, s), tuple(values)


def estimate_scale(
    logs: tuple[Blocks, ...],
    noise: tuple[NoiseFigures, NoiseFigures, NoiseFigures],
    *,
    axis_name: str,
    axis: FloatArray,
    full_scale: float | None = None,
    horizon: tuple[float, float] | None = None,
    model: str | None = None,
) -> ScaleResult:
    """Return the error curves of the triad over the rates of the logs.

    noise: figures of the three gyros (SI). full_scale: rad/s; default the largest rate. horizon:
    s, on the last log's clock; default the 300 s after its last block. model: instead of the
    selected one. Raises ValueError if there is one rate only or a model is not available.
    """
    largest = float(max(np.max(np.abs(log.rate)) for log in logs))
    scale = full_scale if full_scale is not None else largest
    end = float(logs[-1].end[-1])
    window = horizon if horizon is not None else (end, end + HORIZON)
    main = axis_name if axis_name in CHANNELS else ALONG
    problems = {name: CurveProblem(logs, i, noise[i], scale) for i, name in enumerate(CHANNELS)}
    if main == ALONG:
        projected = tuple(replace(log, mean=(log.mean @ axis)[:, None]) for log in logs)
        problems[ALONG] = CurveProblem(projected, 0, _mean_figures(noise, axis), scale)
    repeated, per_log = _repeatability(problems[main])
    if repeated is not None and repeated.sigma > 0.0:
        problems = {n: replace(p, scale_sigma=repeated.sigma) for n, p in problems.items()}
    channels = {name: _channel(name, p, window, model) for name, p in problems.items()}
    verdict = linear_verdict(channels[main].selection.selected)
    result = ScaleResult(
        axis_name=axis_name,
        axis=axis,
        full_scale=scale,
        rated=full_scale is not None,
        horizon=window,
        logs=logs,
        channels=channels,
        main=main,
        misalignment=_misalignment(channels, axis),
        verdict=verdict,
        repeatability=repeated,
        per_log=per_log,
        findings=(),
    )
    return replace(result, findings=_findings(result))


def _mean_figures(noise: tuple[NoiseFigures, ...], axis: FloatArray) -> NoiseFigures:
    """Return the figures of the reading along an axis: squares weighted by its components."""

    def combined(name: str) -> float:
        return float(
            np.sqrt(sum((u * getattr(n, name)) ** 2 for u, n in zip(axis, noise, strict=True)))
        )

    names = ("white", "bias_instability", "rate_random_walk", "markov_sigma")
    return NoiseFigures(
        **{name: combined(name) for name in names}, markov_time=noise[0].markov_time
    )


def _misalignment(
    channels: dict[str, ChannelResult], axis: FloatArray
) -> tuple[fig.Figure, float, float | None]:
    """Return the misalignment from the two components of K perpendicular to the axis."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    K = np.array([channels[name].scale.value for name in CHANNELS])
    s = np.array([channels[name].scale.sigma for name in CHANNELS])
    perpendicular = [
        fig.Figure(float(p @ K), float(np.sqrt((p * s) @ (p * s))))
        for p in (first, np.cross(axis, first))
    ]
    return fig.misalignment(*perpendicular)


def _findings(result: ScaleResult) -> tuple[Finding, ...]:
    """Return what the test shows that a user must know."""
    found: list[Finding] = []
    along = result.along
    selection = along.selection
    if selection.nonlinear and selection.model != "line":
        NL = along.nonlinearity
        found.append(
            Finding(
                "scale-nonlinear",
                f"the error of gyro {along.name} is not a straight line over the rates "
                f"(p = {selection.p_line:.2g}): nonlinearity {NL.value / PPM:.0f} ppm of full "
                f"scale at {NL.rate / DEG:.4g} deg/s",
                where=f"gyro_{along.name}",
                value=selection.p_line,
                limit=0.01,
            )
        )
    found += [f for name, c in result.channels.items() for f in _goodness_findings(name, c)]
    rates = along.selection.selected.problem.rates
    if not (np.any(rates > 0) and np.any(rates < 0)):
        found.append(
            Finding(
                "scale-one-sign",
                "the table turns in one direction only; asymmetry and even terms are not tested",
                where="table",
            )
        )
    if along.hysteresis is not None and along.hysteresis.limit is None:
        h = along.hysteresis.difference
        found.append(
            Finding(
                "scale-hysteresis",
                f"readings after a lower rate differ from those after a higher one by "
                f"{h.value / DEG_PER_HOUR:.1f} deg/h (sigma {h.sigma / DEG_PER_HOUR:.1f} deg/h)",
                where=f"gyro_{along.name}",
                value=h.value / DEG_PER_HOUR,
                limit=3.0 * h.sigma / DEG_PER_HOUR,
                unit="deg/h",
            )
        )
    return tuple(found)


def _goodness_findings(name: str, channel: ChannelResult) -> list[Finding]:
    """Return the finding of the chi-squared test of one gyro, if any."""
    test = channel.goodness
    if test.noise_too_small:
        return [
            Finding(
                "noise-figures-small",
                f"gyro {name} scatters more than its noise figures allow (chi-squared "
                f"{test.chi2:.1f}, limit {test.high:.1f}); its sigmas are multiplied by "
                f"{test.sigma_factor:.2f}",
                where=f"gyro_{name}",
                value=test.chi2,
                limit=test.high,
            )
        ]
    if test.noise_too_large:
        return [
            Finding(
                "noise-figures-large",
                f"gyro {name} scatters less than its noise figures imply (chi-squared "
                f"{test.chi2:.2f}, limit {test.low:.2f}); its sigmas are too large",
                where=f"gyro_{name}",
                value=test.chi2,
                limit=test.low,
            )
        ]
    return []


def curve_values(channel: ChannelResult, rates: FloatArray) -> FloatArray:
    """Return e (r,), rad/s, of the selected curve without its bias; rates: those of the test.

    The bias is the curve's value at rate 0; a table without rate 0 takes it from the straight
    line.
    """
    fit = channel.selection.selected
    if fit.model != TABLE:
        coefficients = fit.gls.estimate[len(fit.problem.logs) :]
        result: FloatArray = (
            polynomial_columns(fit.model, rates / fit.problem.full_scale) @ coefficients
        )
        return result
    return np.asarray((fit.rows(rates) - bias_row(channel)) @ fit.gls.estimate)


def bias_row(channel: ChannelResult) -> FloatArray:
    """Return P (1, p) of the bias d of `w + d + e(w)`: the curve's value at rate 0.

    A table without rate 0 takes the offset of the straight line.
    """
    fit = channel.selection.selected
    if fit.model != TABLE:
        return fit.rows(np.zeros(1))
    rates = fit.problem.rates
    zero = np.flatnonzero(np.abs(rates) < SAME_RATE)
    return fit.rows(rates[zero[:1]]) if len(zero) else fit.straight_line()[:1]


def curve_bias(channel: ChannelResult, horizon: tuple[float, float]) -> Prediction:
    """Return the bias d of `w + d + e(w)` with the slow noise of the horizon, rad/s."""
    fit = channel.selection.selected
    return predict(fit.gls, bias_row(channel), np.ones(1), fit.problem.horizon(*horizon))
