"""Findings of a noise analysis: filters, held samples, lines, and a curve that does not fit."""

from collections.abc import Mapping
from typing import Protocol

from rotcli.allan.noise_fit import NoiseFit
from rotcli.allan.spectrum import Spectrum
from rotcli.run.findings import Finding
from rotcli.units import DEG

# p-value of curve against model that one axis in ten thousand has by chance.
MIN_P_VALUE = 1e-4
# Shortest cluster time times cut-off frequency. The fit begins at five samples anyway: a filter at
# the Nyquist frequency (2.5 then) has no effect on it.
_MIN_EXCLUDED = 2.6


class Axis(Protocol):
    """Fit and spectrum of one axis."""

    @property
    def fit(self) -> NoiseFit: ...  # noqa: D102
    @property
    def spectrum(self) -> Spectrum | None: ...  # noqa: D102


def spectrum_findings(path: str, axes: Mapping[str, Axis]) -> list[Finding]:
    """Return findings about filters, held samples and lines; axes are named together."""
    findings: list[Finding] = []
    spectra = {name: axis.spectrum for name, axis in axes.items() if axis.spectrum is not None}
    held = {name: s.repeats for name, s in spectra.items() if s.repeats > 1}
    for count in sorted(set(held.values())):
        names = [name for name, repeats in held.items() if repeats == count]
        text = (
            f"{path}: each reading of {', '.join(names)} occurs {count} times in a row. The real "
            f"rate is 1/{count} of the log's; the shortest cluster times are excluded"
        )
        where = ", ".join(names)
        findings.append(Finding("held-samples", text, "warning", where, float(count), 1.0))
    filtered = {n: s for n, s in spectra.items() if s.cutoff is not None and n not in held}
    if filtered:
        cutoffs = sorted(s.cutoff or 0.0 for s in filtered.values())
        shortest = [axes[name].fit.goodness for name in filtered]
        start = max((g.tau[0] for g in shortest if g is not None), default=None)
        filtered = filtered if start is None or start * cutoffs[0] > _MIN_EXCLUDED else {}
    if filtered:
        excluded = "" if start is None else f" Cluster times below {start:.3g} s are excluded"
        span = (
            f"{cutoffs[0]:.3g}"
            if cutoffs[-1] < 1.3 * cutoffs[0]
            else f"{cutoffs[0]:.3g} to {cutoffs[-1]:.3g}"
        )
        text = f"{path}: {', '.join(filtered)} low-pass filtered at about {span} Hz.{excluded}"
        where = ", ".join(filtered)
        findings.append(Finding("low-pass", text, "warning", where, cutoffs[0], None, "Hz"))
    for name, spectrum in spectra.items():
        size, unit = (DEG, "deg/s") if name.startswith("gyro") else (1.0, "m/s^2")
        for line in spectrum.lines:
            amplitude = line.amplitude / size
            text = (
                f"{path}: {name}: a sinusoid of {line.frequency:.4g} Hz, amplitude "
                f"{amplitude:.3g} {unit}. It is removed from the coefficients; find its source"
            )
            place = f"{name}, {line.frequency:.4g} Hz"
            findings.append(Finding("spectral-line", text, "warning", place, amplitude, None, unit))
    return findings


def misfit_findings(path: str, axes: Mapping[str, Axis]) -> list[Finding]:
    """Return a finding for each axis whose curve does not follow the five terms."""
    findings: list[Finding] = []
    for name, axis in axes.items():
        goodness = axis.fit.goodness
        if goodness is None or goodness.p_value >= MIN_P_VALUE:
            continue
        text = (
            f"{path}: {name}: the curve does not follow the fitted terms (chi2/dof "
            f"{goodness.chi2 / goodness.dof:.3g}), most at {goodness.largest_tau:.3g} s by "
            f"{100.0 * goodness.largest:.2g} %. Its coefficients are unreliable; see the plot"
        )
        value, place = goodness.chi2 / goodness.dof, f"{name}, {goodness.largest_tau:.3g} s"
        findings.append(Finding("allan-misfit", text, "warning", place, value, 1.0))
    return findings
