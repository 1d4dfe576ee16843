"""Findings of a noise analysis: what the record contains besides the noise of the five terms."""

from collections.abc import Mapping
from typing import Protocol

from rotcli.allan.fit.coefficients import NoiseFit
from rotcli.allan.fit.trimmed import Misfit
from rotcli.allan.survey.clipping import Clipping
from rotcli.allan.survey.drift import Drift
from rotcli.allan.survey.spectrum import Spectrum
from rotcli.run.findings import Finding
from rotcli.units import DEG, DEG_PER_HOUR, show_time

# Shortest cluster time times cut-off frequency. The fit begins at five samples anyway: a filter at
# the Nyquist frequency (2.5 then) has no effect on it.
_MIN_EXCLUDED = 2.6


class Axis(Protocol):
    """Fit, spectrum, clipping and drifts of one axis."""

    @property
    def fit(self) -> NoiseFit: ...  # noqa: D102
    @property
    def spectrum(self) -> Spectrum | None: ...  # noqa: D102
    @property
    def misfit(self) -> Misfit | None: ...  # noqa: D102
    @property
    def clipping(self) -> Clipping | None: ...  # noqa: D102
    @property
    def drifts(self) -> tuple[Drift, ...]: ...  # noqa: D102


def axis_findings(path: str, axes: Mapping[str, Axis]) -> tuple[Finding, ...]:
    """Return the findings about the axes of a log."""
    spectra = {name: axis.spectrum for name, axis in axes.items() if axis.spectrum is not None}
    repeated = {name: s.repeats for name, s in spectra.items() if s.repeats > 1}
    return (
        *_repeated_samples(path, repeated),
        *_interpolated(path, axes, spectra),
        *_low_pass(
            path,
            axes,
            {n: s for n, s in spectra.items() if n not in repeated and s.source_rate is None},
        ),
        *_lines(path, spectra),
        *_clipping(path, axes),
        *_drifts(path, axes),
        *_trends(path, axes),
        *_misfits(path, axes),
    )


def reading_unit(name: str) -> tuple[str, float]:
    """Return the unit of the readings of an axis, and its size in SI."""
    return ("deg/s", DEG) if name.startswith("gyro") else ("m/s^2", 1.0)


def _repeated_samples(path: str, repeated: Mapping[str, int]) -> list[Finding]:
    findings = []
    for count in sorted(set(repeated.values())):
        where = ", ".join(name for name, repeats in repeated.items() if repeats == count)
        text = (
            f"{path}: each reading of {where} occurs {count} times in a row. The real "
            f"rate is 1/{count} of the log's; the shortest cluster times are excluded"
        )
        findings.append(Finding("repeated-samples", text, "warning", where, float(count), 1.0))
    return findings


def _interpolated(
    path: str, axes: Mapping[str, Axis], spectra: Mapping[str, Spectrum]
) -> list[Finding]:
    """Return the findings of axes that were interpolated, those of one rate together."""
    rates: dict[str, list[str]] = {}
    for name, spectrum in spectra.items():
        if spectrum.source_rate is not None:
            rates.setdefault(f"{spectrum.source_rate:.3g}", []).append(name)
    findings = []
    for rate, names in rates.items():
        shortest = [good.tau[0] for n in names if (good := axes[n].fit.goodness) is not None]
        excluded = f". Cluster times below {max(shortest):.3g} s are excluded" if shortest else ""
        where, verb = ", ".join(names), "is" if len(names) == 1 else "are"
        text = (
            f"{path}: {where} {verb} interpolated: the sensor measures at about {rate} Hz, and the "
            f"readings of the log between lie on straight lines{excluded}"
        )
        found = spectra[names[0]].source_rate
        findings.append(Finding("interpolated-samples", text, "warning", where, found, None, "Hz"))
    return findings


def _low_pass(
    path: str, axes: Mapping[str, Axis], spectra: Mapping[str, Spectrum]
) -> list[Finding]:
    filtered = {name: s for name, s in spectra.items() if s.cutoff is not None}
    if not filtered:
        return []
    cutoffs = sorted(s.cutoff or 0.0 for s in filtered.values())
    shortest = [axes[name].fit.goodness for name in filtered]
    start = max((g.tau[0] for g in shortest if g is not None), default=None)
    if start is not None and start * cutoffs[0] <= _MIN_EXCLUDED:
        return []
    excluded = "" if start is None else f". Cluster times below {start:.3g} s are excluded"
    low, high = f"{cutoffs[0]:.3g}", f"{cutoffs[-1]:.3g}"
    span = low if cutoffs[-1] < 1.3 * cutoffs[0] else f"{low} to {high}"
    where = ", ".join(filtered)
    verb = "is" if len(filtered) == 1 else "are"
    text = f"{path}: {where} {verb} low-pass filtered at about {span} Hz{excluded}"
    return [Finding("low-pass", text, "warning", where, cutoffs[0], None, "Hz")]


def _lines(path: str, spectra: Mapping[str, Spectrum]) -> list[Finding]:
    findings = []
    for name, spectrum in spectra.items():
        unit, size = reading_unit(name)
        for line in spectrum.lines:
            amplitude = line.amplitude / size
            text = (
                f"{path}: {name}: a sinusoid of {line.frequency:.4g} Hz, amplitude "
                f"{amplitude:.3g} {unit}. It is removed from the coefficients; find its source"
            )
            place = f"{name}, {line.frequency:.4g} Hz"
            findings.append(Finding("spectral-line", text, "warning", place, amplitude, None, unit))
    return findings


def _clipping(path: str, axes: Mapping[str, Axis]) -> list[Finding]:
    findings = []
    for name, axis in axes.items():
        if axis.clipping is None:
            continue
        unit, size = reading_unit(name)
        percent = 100.0 * axis.clipping.share
        text = (
            f"{path}: {name}: {percent:.2g} % of the readings are exactly "
            f"{axis.clipping.value / size:.6g} {unit}, an end of their range: they are clipped. "
            "Check range and offset of the logger"
        )
        findings.append(Finding("clipped-readings", text, "warning", name, percent, 0.0, "%"))
    return findings


_DRIFT_CODES = {
    "step": "bias-step",
    "exponential": "warm-up-drift",
    "temperature": "temperature-drift",
}


def _drifts(path: str, axes: Mapping[str, Axis]) -> list[Finding]:
    findings = []
    for name, axis in axes.items():
        unit, size = ("deg/h", DEG_PER_HOUR) if name.startswith("gyro") else ("m/s^2", 1.0)
        for drift in axis.drifts:
            value, sigma = drift.amplitude / size, drift.sigma / size
            amount = f"{abs(value):.3g} {unit}"
            if drift.kind == "step":
                what = f"the bias {'rises' if value > 0.0 else 'falls'} by {amount} (sigma "
                what += f"{sigma:.2g}) at {show_time(drift.start)} s, in a step"
            elif drift.kind == "exponential":
                what = f"the bias {'falls' if value > 0.0 else 'rises'} by {amount} (sigma "
                what += f"{sigma:.2g}) in an exponential of {drift.time:.3g} s, as in a warm-up"
            else:
                unit += "/degC"
                what = f"the bias follows the temperature by {value:.3g} {unit} (sigma "
                what += f"{sigma:.2g})"
            text = f"{path}: {name}: {what}. This part is removed from the coefficients"
            code = _DRIFT_CODES[drift.kind]
            findings.append(Finding(code, text, "warning", name, value, None, unit))
    return findings


def _trends(path: str, axes: Mapping[str, Axis]) -> list[Finding]:
    """Return a finding about the axes that drift along a line: temperature, most often."""
    trends = {
        name: axis.fit.trend
        for name, axis in axes.items()
        if axis.fit.coefficients["rate_ramp"].value is not None
    }
    if not trends:
        return []
    where = ", ".join(trends)
    verb = "has" if len(trends) == 1 else "have"
    text = (
        f"{path}: {where} {verb} a linear trend, probably temperature; it is reported as rate ramp"
    )
    return [Finding("linear-trend", text, "warning", where)]


def _misfits(path: str, axes: Mapping[str, Axis]) -> list[Finding]:
    """Return a finding for each axis whose curve does not follow the terms everywhere."""
    findings = []
    for name, axis in axes.items():
        misfit = axis.misfit
        if misfit is None:
            continue
        good = misfit.goodness
        if misfit.excluded:
            low, high = misfit.excluded[0], misfit.excluded[-1]
            reaction = (
                f"{len(misfit.excluded)} cluster times between {low:.3g} and {high:.3g} s are "
                "excluded"
            )
        elif axis.fit.coefficients["random_walk"].value is None:
            reaction = "It has no coefficients"
        else:
            reaction = "Its coefficients are unreliable; see the plot"
        ratio = good.chi2 / good.dof
        text = (
            f"{path}: {name}: the curve does not follow the noise terms (chi2/dof {ratio:.3g}), "
            f"most at {good.largest_tau:.3g} s by {100.0 * good.largest:+.2g} %. {reaction}"
        )
        place = f"{name}, {good.largest_tau:.3g} s"
        findings.append(Finding("allan-misfit", text, "warning", place, ratio, 1.0))
    return findings
