"""From a still log to its Allan deviations, noise coefficients and Gauss-Markov figures.

The record is the clean still segments of the log. Each axis is worked on by itself, from its
phase, computed once; an axis with a drift is measured again without it. Two axes at a time in
threads would save 7 % of the time and cost 30 % more CPU time and a buffer: they wait for each
other between their many short array operations.

The coefficients come from the overlapping Allan variance whichever estimator draws the curve.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

import numpy as np

from rotcli.allan.deviation import averaging_factors, limits
from rotcli.allan.findings import axis_findings
from rotcli.allan.fit import gauss_markov
from rotcli.allan.fit.coefficients import NoiseFit, without_coefficients
from rotcli.allan.fit.gauss_markov import GaussMarkov
from rotcli.allan.fit.trimmed import MIN_P_VALUE, Misfit, fit_trimmed
from rotcli.allan.measure import Measured, Plan, drift_blocks, measure_axis
from rotcli.allan.survey.clipping import MAX_SHARE, Clipping
from rotcli.allan.survey.drift import Drift, find_drifts, refine_step
from rotcli.allan.survey.spectrum import Spectrum
from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.logs.plausible import check_gravity_magnitude, check_rest_readings
from rotcli.logs.record import ImuSource
from rotcli.run.findings import Finding, texts
from rotcli.run.still.record import StillRecord, still_record
from rotcli.units import FloatArray

_Step = TypeVar("_Step")

_FALLING = -0.5  # d ln variance / d ln tau; steeper than this, averaging still helps
_MIN_FREEDOM = 10.0  # degrees of freedom; a minimum of fewer may be chance
_SLOW = ("bias_instability", "rate_random_walk", "rate_ramp")


@dataclass(frozen=True)
class Minimum:
    """The lowest point of the curve, tau (s) and deviation, with its limits; or why none."""

    tau: float | None = None
    deviation: float | None = None
    lower: float | None = None
    upper: float | None = None
    reason: str | None = None


@dataclass(frozen=True, eq=False)
class AxisNoise:
    """The noise of one axis, SI: rad/s for a gyro, m/s^2 for an accelerometer.

    tau (k,) s; deviation, lower, upper (k,), the limits containing the truth with 68.3 %;
    freedom (k,) the degrees of freedom behind the limits. mean: of the record, without its
    drifts. rest (k,): the deviation without the drifts, None where there are none; averages
    (b,): of blocks of `block` s, without the drifts.
    """

    name: str
    tau: FloatArray
    deviation: FloatArray
    lower: FloatArray
    upper: FloatArray
    freedom: FloatArray
    mean: float
    fit: NoiseFit
    minimum: Minimum
    gauss_markov: GaussMarkov
    spectrum: Spectrum | None = None
    misfit: Misfit | None = None
    clipping: Clipping | None = None
    drifts: tuple[Drift, ...] = ()
    rest: FloatArray | None = None
    averages: FloatArray | None = None
    block: float = 1.0


@dataclass(frozen=True, eq=False)
class AllanResult:
    """The requested axes by name, and the record they were measured in (s).

    segments: start and end (s) of each; share: of the log's samples that is used.
    """

    estimator: str
    start: float
    end: float
    samples: int
    interval: float
    axes: dict[str, AxisNoise]
    warnings: tuple[str, ...]
    findings: tuple[Finding, ...] = ()
    segments: tuple[tuple[float, float], ...] = ()
    share: float = 1.0


def allan(
    log: ImuSource,
    *,
    window: tuple[float, float] | None = None,
    axes: Sequence[str] = AXES,
    taus: str | list[float] | None = None,
    estimator: str = "oadev",
    gyro_range: float | None = None,
    accel_range: float | None = None,
    despike: bool = False,
    progress: Callable[[float], None] | None = None,
) -> AllanResult:
    """Analyse the clean still segments of a log, or of a window (s) of it.

    taus: None, `octave`, `decade`, `all` or times (s); estimator: oadev, adev, mdev, totdev.
    gyro_range rad/s and accel_range m/s^2: clipped samples. despike: interpolate spikes.
    progress: is called with the share (0 to 1) that is done.

    Raises LogError when no clean segment is long enough, an axis is constant, or a time of
    `taus` does not suit the record.
    """
    record = still_record(log, window, gyro_range, accel_range, despike=despike)
    longest = max(record.lengths)
    try:
        factors = averaging_factors(longest, taus, log.interval)
    except ValueError as fault:
        raise LogError(
            log.path,
            f"{fault}; choose other averaging times or another window",
            code="averaging-times",
        ) from fault
    plan = Plan(factors, averaging_factors(longest, None, log.interval), estimator)
    report = _Steps(2 * len(axes), progress)
    results = {}
    for name in axes:
        measured = report.done(measure_axis(log, record, name, plan))
        results[name] = report.done(_analyse(log, record, name, plan, measured))
    findings = (*record.findings, *axis_findings(log.path, results))
    return _result(log, record, estimator, results, findings)


class _Steps:
    """Counts the steps of the work that are done."""

    def __init__(self, count: int, progress: Callable[[float], None] | None) -> None:
        self._count, self._done, self._progress = count, 0, progress

    def done(self, result: _Step) -> _Step:
        """Report one more step, and return its result."""
        self._done += 1
        if self._progress is not None:
            self._progress(self._done / self._count)
        return result


def _result(
    log: ImuSource,
    record: StillRecord,
    estimator: str,
    axes: dict[str, AxisNoise],
    findings: tuple[Finding, ...],
) -> AllanResult:
    """Return the result with all warnings."""
    first = next(log.chunks(record.segments[0]))  # of hours, the first minutes are enough
    warnings = [*log.warnings, *texts(findings)]
    warnings += check_rest_readings(log.path, first.gyro, log.interval)
    warnings += check_gravity_magnitude(log.path, first.accel)
    spans = tuple(
        (_time(log, segment.start), _time(log, segment.stop - 1)) for segment in record.segments
    )
    return AllanResult(
        estimator=estimator,
        start=spans[0][0],
        end=spans[-1][1],
        samples=sum(record.lengths),
        interval=log.interval,
        axes=axes,
        warnings=tuple(warnings),
        findings=findings,
        segments=spans,
        share=record.share,
    )


def _time(log: ImuSource, sample: int) -> float:
    return float(log.times(slice(sample, sample + 1))[0])


def _analyse(
    log: ImuSource, record: StillRecord, name: str, plan: Plan, measured: Measured
) -> AxisNoise:
    """Return the noise of one axis, its drifts removed before the fit."""
    fit, misfit = fit_trimmed(measured.summary, log.sampling)
    first = measured
    drifts = _drifts(log, record, measured, fit)
    if drifts:
        measured = measure_axis(log, record, name, plan, drifts)
        fit, misfit = fit_trimmed(measured.summary, log.sampling)
    has_ramp = fit.coefficients["rate_ramp"].value is not None
    markov = gauss_markov.fit(measured.averages, measured.block, has_ramp)
    if markov.time is not None:
        fit, misfit = fit_trimmed(measured.summary, log.sampling, markov.time)
    clipping = measured.clipping
    if clipping is not None and clipping.share > MAX_SHARE:
        reason = f"{100.0 * clipping.share:.2g} % of the readings are clipped"
        fit = without_coefficients(fit, reason)
    freedom = fit.freedom(plan.factors, log.interval, measured.summary.lengths, plan.estimator)
    lower, upper = limits(first.curve, freedom)
    rest = measured.curve
    tau = np.asarray(plan.factors * log.interval, dtype=float)
    return AxisNoise(
        name=name,
        tau=tau,
        deviation=first.curve,
        lower=lower,
        upper=upper,
        freedom=freedom,
        mean=measured.mean,
        fit=fit,
        minimum=_minimum(tau, rest, *limits(rest, freedom), freedom, fit),
        gauss_markov=markov,
        spectrum=measured.spectrum,
        misfit=misfit,
        clipping=clipping,
        drifts=drifts,
        rest=rest if drifts else None,
        averages=measured.averages,
        block=measured.block,
    )


def _drifts(
    log: ImuSource, record: StillRecord, measured: Measured, fit: NoiseFit
) -> tuple[Drift, ...]:
    """Return the drifts of an axis; white noise alone, without a temperature, has none."""
    has_temperature = next(log.chunks(slice(0, 1))).temperature is not None
    slow = any(fit.coefficients[name].value is not None for name in _SLOW)
    misfit = fit.goodness is not None and fit.goodness.p_value < MIN_P_VALUE
    if not (slow or misfit or has_temperature):
        return ()
    blocks = drift_blocks(log, record, measured, has_temperature=has_temperature)
    if blocks is None:
        return ()
    means, start, length, temperature = blocks
    refine = partial(refine_step, measured.averages, start, measured.block)
    return tuple(find_drifts(means, start, length, temperature, refine=refine))


def _minimum(
    tau: FloatArray,
    curve: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    freedom: FloatArray,
    fit: NoiseFit,
) -> Minimum:
    """Return the lowest well-known point, unless the fitted curve still falls at the last."""
    known = freedom >= _MIN_FREEDOM
    if known.sum() < 3:
        return Minimum(reason=f"no cluster time has {_MIN_FREEDOM:g} degrees of freedom")
    k = int(np.argmin(np.where(known, curve, np.inf)))
    last = tau[known][-1:]
    if not np.any(fit.squares):
        return Minimum(reason="no noise term is significant")
    if fit.slope(last)[0] < _FALLING:
        return Minimum(reason=f"the curve still falls at {last[0]:.4g} s")
    return Minimum(float(tau[k]), float(curve[k]), float(lower[k]), float(upper[k]))
