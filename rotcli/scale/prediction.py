"""Sigmas of a scale factor test before the test, and the runs that one line is good enough for.

The sigmas follow from the covariance of the means and the design; no data are needed.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.mean_covariance import predict
from rotcli.models.sensors import NoiseFigures
from rotcli.scale.curves import MODELS, TABLE, available_models
from rotcli.scale.figures import maximum_quantile, scale_factor
from rotcli.scale.fit import CurveFit, CurveProblem, fit_curve
from rotcli.scale.hysteresis import hysteresis
from rotcli.units import FloatArray

CHANGE = 4.0  # s between two blocks, default: the table changes its rate
DURATION = 60.0  # s per block, default
HORIZON = 300.0  # s after the test for which the bias is predicted
# Lengths of a run for the verdict: 1 s to 1 day, 20 per decade.
RUN_LENGTHS = np.geomspace(1.0, 86400.0, 100)


def planned_blocks(rates: FloatArray, duration: float, change: float) -> Blocks:
    """Return blocks of the duration (s), `change` s apart, at the rates (k,), rad/s."""
    start = np.asarray((duration + change) * np.arange(len(rates)), dtype=np.float64)
    return Blocks(start, start + duration, np.asarray(rates, float), np.zeros((len(rates), 3)))


@dataclass(frozen=True)
class DesignSigmas:
    """Predicted sigmas (SI; shares of full scale for coefficients) of one order of rates.

    bias: for the 300 s after the test; own: over the test; asymmetry, hysteresis: None where the
    rates do not show them; nonlinearity_limit: 95 % quantile of the raw maximum under a line;
    smallest rate's response ratio sigma; total: seconds of the test.
    """

    scale: float
    bias: float
    bias_own: float
    asymmetry: float | None
    hysteresis: float | None
    nonlinearity_limit: float | None
    response_ratio: float | None
    coefficients: dict[str, tuple[float, ...]]
    total: float


def design_sigmas(
    rates: FloatArray,
    figures: NoiseFigures,
    full_scale: float,
    duration: float = DURATION,
    change: float = CHANGE,
) -> DesignSigmas:
    """Return the sigmas of a test with blocks at rates (k,), rad/s, in this order."""
    blocks = planned_blocks(rates, duration, change)
    problem = CurveProblem((blocks,), 2, figures, full_scale)
    names = available_models(problem.rates)
    if "line" not in names:
        raise ValueError("a scale factor needs at least two different rates")
    fits = {name: fit_curve(problem, name) for name in names}
    line = fits["line"]
    end = float(blocks.end[-1])
    zero = np.zeros(1)
    asym = fits.get("asym")
    up_down = hysteresis(problem)
    limit = None
    if len(problem.rates) > 2:
        table = fit_curve(problem, TABLE)
        A = np.column_stack([np.ones(len(problem.rates)), problem.rates])
        maker = np.eye(len(A)) - A @ np.linalg.pinv(A)
        limit = maximum_quantile(maker @ table.gls.covariance @ maker.T) / full_scale
    return DesignSigmas(
        scale=scale_factor(line).sigma,
        bias=float(line.curve(zero, problem.horizon(end, end + HORIZON)).sigma[0]),
        bias_own=float(line.curve(zero, problem.own_span()).sigma[0]),
        asymmetry=None if asym is None else 2.0 * float(asym.gls.sigma[-1]) / full_scale,
        hysteresis=None if up_down is None else up_down.difference.sigma,
        nonlinearity_limit=limit,
        response_ratio=_ratio_sigma(problem),
        coefficients={
            name: tuple(float(s) / full_scale for s in fits[name].gls.sigma[1:])
            for name in MODELS
            if name in fits
        },
        total=end,
    )


def _ratio_sigma(problem: CurveProblem) -> float | None:
    """Return the sigma of the response ratio at the smallest rate tested with both signs."""
    rates = problem.rates
    positive = rates[rates > 0]
    pairs = [w for w in positive if np.any(np.isclose(rates, -w, rtol=1e-3))]
    if not pairs:
        return None
    table = fit_curve(problem, TABLE)
    P = table.rows(rates)
    plus = int(np.flatnonzero(rates == pairs[0])[0])
    minus = int(np.argmin(np.abs(rates + pairs[0])))
    difference = predict(table.gls, (P[plus] - P[minus])[None, :], np.zeros(1))
    return float(difference.sigma[0] / (2.0 * pairs[0]))


def alternating(rates: FloatArray) -> FloatArray:
    """Return the rates in the recommended order: 0, +, - by rising magnitude, then back.

    Neighbours of opposite sign cancel drift. Each distinct rate comes twice, but 0 at the ends.
    """
    magnitudes = np.unique(np.abs(rates))
    there = [0.0] if magnitudes[0] == 0.0 else []
    for w in magnitudes[magnitudes > 0]:
        there += [w, -w]
    return np.array(there + there[::-1])


@dataclass(frozen=True)
class Verdict:
    """Whether one linear calibration is good enough.

    deviation: largest |curve - line| over the rates, rad/s; up_to: run length in s below which
    the deviation is less than the sigma of the run's mean rate error (calibration, slow and white
    noise); None: not even for 1 s; infinite: for every run of a day and less.
    sigma: that sigma for the horizon of HORIZON s at the rate of the largest deviation.
    """

    deviation: float
    rate: float
    sigma: float
    up_to: float | None

    @property
    def good(self) -> bool:
        """Whether the line is good enough for a run of HORIZON s."""
        return self.deviation < self.sigma


def linear_verdict(fit: CurveFit, lengths: FloatArray = RUN_LENGTHS) -> Verdict:
    """Return the verdict on the straight line of the selected curve for runs after the test.

    The residual of the curve is a bias along the table axis: after t its angle error is residual
    times t. It does not matter while it is below the sigma of the mean error over the run, which
    calibration, slow noise and white noise make whatever curve is used.
    """
    problem = fit.problem
    rates = problem.rates
    line = np.column_stack([np.ones(len(rates)), rates]) @ fit.straight_line()
    deviation = np.abs((fit.rows(rates) - line) @ fit.gls.estimate)
    worst = int(np.argmax(deviation))

    def sigma(length: float) -> FloatArray:
        end = float(problem.logs[-1].end[-1])
        predicted = fit.curve(rates, problem.horizon(end, end + length))
        result: FloatArray = np.hypot(predicted.sigma, problem.figures.white / np.sqrt(length))
        return result

    if fit.model == "line":
        return Verdict(0.0, float(rates[worst]), float(sigma(HORIZON)[worst]), float("inf"))
    up_to: float | None = None
    for length in lengths:
        if np.any(deviation >= sigma(float(length))):
            break
        up_to = float(length)
    else:
        up_to = float("inf")
    return Verdict(
        float(deviation[worst]), float(rates[worst]), float(sigma(HORIZON)[worst]), up_to
    )
