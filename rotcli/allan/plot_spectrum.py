"""Panels next to the Allan deviation: power spectral density and autocorrelation."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.allan.document import deviation_unit
from rotcli.allan.estimate import AxisNoise
from rotcli.allan.findings import reading_unit
from rotcli.allan.survey.autocorrelation import autocorrelation
from rotcli.files.figures import INK, legend_above, log_axes
from rotcli.units import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_PER_DECADE = 60  # points of a density that are drawn


def draw_density(
    place: "Axes", sensor: str, axes: list[AxisNoise], looks: Mapping[str, Mapping[str, Any]]
) -> None:
    """Draw the one-sided densities of a sensor's axes, with N, lines and cut-off frequencies."""
    unit, size = reading_unit(sensor)
    for axis in axes:
        look = looks[axis.name[-1]]
        spectrum = axis.spectrum
        if spectrum is None:
            continue
        shown = [axis.name]
        frequency, density = binned(spectrum.frequency, spectrum.measured / size**2)
        white = axis.fit.coefficients["random_walk"].value
        if white is not None:
            place.axhline(
                2.0 * (white / size) ** 2, color=look["color"], linestyle=":", linewidth=0.8
            )
        for line in spectrum.lines:
            level = np.interp(line.frequency, spectrum.frequency, spectrum.measured / size**2)
            place.plot(
                line.frequency, level, marker="v", markersize=6.0, color=look["color"],
                linestyle="none",
            )  # fmt: skip
            shown.append(f"{line.frequency:.4g} Hz")
        if spectrum.cutoff is not None:
            place.axvline(spectrum.cutoff, color=look["color"], linestyle="--", linewidth=0.6)
            shown.append(f"low-pass {spectrum.cutoff:.3g} Hz")
        label = ", ".join(shown[:4]) + (" …" if len(shown) > 4 else "")
        place.plot(frequency, density, label=label, linewidth=0.8, color=look["color"])
    log_axes(place, x=True)
    place.set_ylabel(f"{sensor} density, ({unit})^2/Hz")
    place.set_xlabel("frequency, Hz\ndotted: 2 N^2; triangle: line; dashed: cut-off frequency")
    if place.lines:
        legend_above(place, 1)


def binned(frequency: FloatArray, density: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return means (j,) of a density (k,) over bins that are equal in the logarithm."""
    edges = np.floor(_PER_DECADE * np.log10(frequency / frequency[0]))
    starts = np.flatnonzero(np.diff(edges, prepend=-1.0) > 0.0)
    counts = np.diff(np.append(starts, len(frequency)))
    means = [np.add.reduceat(values, starts) / counts for values in (frequency, density)]
    return means[0], means[1]


def draw_autocorrelation(
    place: "Axes", sensor: str, axes: list[AxisNoise], looks: Mapping[str, Mapping[str, Any]]
) -> None:
    """Draw the autocorrelation of block averages with the fitted exponential, O17 section 4."""
    unit, size = deviation_unit(sensor)
    block = 0.0
    for axis in axes:
        if axis.averages is None:
            continue
        markov, look, block = axis.gauss_markov, looks[axis.name[-1]], axis.block
        found = autocorrelation(axis.averages, axis.block, markov.sigma, markov.time)
        label = f"{axis.name}: no exponential"
        if markov.sigma is not None and markov.time is not None:
            label = f"{axis.name}: {markov.sigma / size:.3g} {unit}, {markov.time:.3g} s"
        place.plot(
            found.lag, found.covariance / size**2, label=label, color=look["color"],
            marker=look["marker"], markersize=2.0, linestyle="none",
        )  # fmt: skip
        if found.expected is not None:
            place.plot(found.lag, found.expected / size**2, color=look["color"], linewidth=1.2)
    place.axhline(0.0, color=INK, linewidth=0.6)
    place.set_ylabel(f"{sensor} autocorrelation, ({unit})^2")
    place.set_xlabel(f"lag, s; averages over {block:.3g} s, mean removed\nline: fitted exponential")
    if place.lines:
        legend_above(place, 1)
