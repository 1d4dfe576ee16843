"""From a still log to its Allan deviations, noise coefficients and Gauss-Markov figures.

The record is the longest clean still stretch of the log. Each axis is worked on by itself, two
at a time, from its phase, computed once; the whole of it stays near the memory of the log.
The coefficients come from the overlapping Allan variance whichever estimator draws the curve.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rotcli.allan import gauss_markov
from rotcli.allan.deviation import (
    Factors,
    averaging_factors,
    deviation,
    integrate,
    limits,
    overlapping_variance,
)
from rotcli.allan.findings import misfit_findings, spectrum_findings
from rotcli.allan.gauss_markov import GaussMarkov
from rotcli.allan.noise_fit import NoiseFit, Summary, fit_noise, summarize
from rotcli.allan.spectrum import Spectrum, survey
from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.logs.plausible import check_gravity_magnitude, check_rest_readings
from rotcli.logs.record import ImuSource
from rotcli.run.findings import Finding, texts
from rotcli.run.still import longest_still

Array = NDArray[np.float64]
_Step = TypeVar("_Step")

_FALLING = -0.5  # d ln variance / d ln tau; steeper than this, averaging still helps
_KNOWN = 10.0  # degrees of freedom; a minimum of fewer may be chance


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

    tau (k,) s; deviation, lower, upper (k,), the limits holding the truth with 68.3 %;
    freedom (k,) the degrees of freedom behind the limits. mean: of the record.
    """

    name: str
    tau: Array
    deviation: Array
    lower: Array
    upper: Array
    freedom: Array
    mean: float
    fit: NoiseFit
    minimum: Minimum
    gauss_markov: GaussMarkov
    spectrum: Spectrum | None = None


@dataclass(frozen=True, eq=False)
class AllanResult:
    """The axes that were asked for, by name, and the stretch they were taken from (s)."""

    estimator: str
    start: float
    end: float
    samples: int
    interval: float
    axes: dict[str, AxisNoise]
    warnings: tuple[str, ...]
    findings: tuple[Finding, ...] = ()


def allan(
    log: ImuSource,
    *,
    window: tuple[float, float] | None = None,
    axes: Sequence[str] = AXES,
    taus: str | list[float] | None = None,
    estimator: str = "oadev",
    gyro_range: float | None = None,
    accel_range: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> AllanResult:
    """Analyse the longest clean still stretch of a log, or of a window (s) of it.

    taus: None, `octave`, `decade`, `all` or times (s); estimator: oadev, adev, mdev, totdev.
    gyro_range rad/s and accel_range m/s^2 tell clipped samples. progress: told how much (0 to 1)
    is done.

    Raises LogError when no clean stretch is long enough, an axis is constant, or a time of
    `taus` does not suit the record.
    """
    still = longest_still(log, window, gyro_range, accel_range)
    chosen = slice(still.first, still.last)
    count = still.last - still.first
    try:
        factors = averaging_factors(count, taus, log.interval)
    except ValueError as fault:
        raise LogError(log.path, f"{fault}; choose other --taus or another --window") from fault
    coarse = averaging_factors(count, None, log.interval)

    def measure(name: str) -> _Measured:
        phase = np.empty(
            count + 1
        )  # the readings first, integrated in place: days of one axis fill memory
        log.fill(phase[1:], name, chosen)
        if phase[1:].max() == phase[1:].min():
            raise LogError(
                log.path, "the sensor never changes: no noise to analyse; leave it out", column=name
            )
        try:
            return _measure(phase, factors, coarse, log.interval, estimator)
        except ValueError as fault:
            raise LogError(log.path, f"{fault}; choose other --taus") from fault

    done = 0

    def tell(held: _Step) -> _Step:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / (2.0 * len(axes)))
        return held

    # The long passes share the two cores; the fits, all small steps, would only hold them up.
    with ThreadPoolExecutor(max_workers=2) as pool:
        measured = [tell(found) for found in pool.map(measure, axes)]
    found = {
        name: tell(_analyse(name, found, factors, log.interval, log.sampling, estimator))
        for name, found in zip(axes, measured, strict=True)
    }
    warnings = [*log.warnings, *still.warnings, *_trends(log.path, found)]
    findings = [*spectrum_findings(log.path, found), *misfit_findings(log.path, found)]
    warnings += texts(findings)
    some = next(log.pieces(chosen))  # of hours, the first minutes tell
    warnings += check_rest_readings(log.path, some.gyro, log.interval)
    warnings += check_gravity_magnitude(log.path, some.accel)
    return AllanResult(
        estimator=estimator,
        start=float(log.times(slice(still.first, still.first + 1))[0]),
        end=float(log.times(slice(still.last - 1, still.last))[0]),
        samples=count,
        interval=log.interval,
        axes=found,
        warnings=tuple(warnings),
        findings=tuple(findings),
    )


@dataclass(frozen=True, eq=False)
class _Measured:
    """What is kept of an axis once its phase is gone."""

    curve: Array
    summary: Summary
    averages: Array
    block: float
    mean: float
    spectrum: Spectrum | None


def _measure(
    phase: Array, factors: Factors, coarse: Factors, interval: float, estimator: str
) -> _Measured:
    """Measure the noise of readings that stand in phase[1:]; they are integrated there."""
    spectrum = survey(phase[1:], interval)
    mean = integrate(phase, interval)
    if estimator == "oadev":  # one pass for the curve's cluster times and the fit's
        every = np.union1d(factors, coarse)
        variances = overlapping_variance(phase, every, interval)
        known = variances[np.searchsorted(every, coarse)]
        curve = np.sqrt(variances[np.searchsorted(every, factors)])
    else:
        known, curve = None, deviation(phase, factors, interval, estimator)
    averages, block = gauss_markov.block_averages(phase, interval)
    return _Measured(
        curve=curve,
        summary=summarize(phase, coarse, interval, known, spectrum),
        spectrum=spectrum,
        averages=averages,
        block=block,
        mean=mean,
    )


def _analyse(
    name: str,
    measured: _Measured,
    factors: Factors,
    interval: float,
    sampling: str,
    estimator: str,
) -> AxisNoise:
    curve, fit = measured.curve, fit_noise(measured.summary, sampling)
    drifting = fit.coefficients["rate_ramp"].value is not None
    markov = gauss_markov.fit(measured.averages, measured.block, drifting)
    if markov.time is not None:
        fit = fit_noise(measured.summary, sampling, markov.time)
    freedom = fit.freedom(factors, interval, measured.summary.n, estimator)
    lower, upper = limits(curve, freedom)
    tau = np.asarray(factors * interval, dtype=float)
    return AxisNoise(
        name=name,
        tau=tau,
        deviation=curve,
        lower=lower,
        upper=upper,
        freedom=freedom,
        mean=measured.mean,
        fit=fit,
        minimum=_minimum(tau, curve, lower, upper, freedom, fit),
        gauss_markov=markov,
        spectrum=measured.spectrum,
    )


def _minimum(
    tau: Array, curve: Array, lower: Array, upper: Array, freedom: Array, fit: NoiseFit
) -> Minimum:
    """Return the lowest well-known point, unless the fitted curve still falls after it."""
    known = freedom >= _KNOWN
    if known.sum() < 3:
        return Minimum(reason=f"no cluster time has {_KNOWN:g} degrees of freedom")
    k = int(np.argmin(np.where(known, curve, np.inf)))
    last = tau[known][-1:]
    if fit.slope(last)[0] < _FALLING:
        return Minimum(reason=f"the curve still falls at {last[0]:.4g} s, the longest sure time")
    return Minimum(float(tau[k]), float(curve[k]), float(lower[k]), float(upper[k]))


def _trends(path: str, axes: dict[str, AxisNoise]) -> list[str]:
    """Say which axes drift along a line: temperature, most often."""
    drifting = [name for name, axis in axes.items() if axis.fit.coefficients["rate_ramp"].value]
    if not drifting:
        return []
    return [
        f"{path}: a linear trend (temperature?) in {', '.join(drifting)} is part of the curve and "
        "is given as rate ramp"
    ]
