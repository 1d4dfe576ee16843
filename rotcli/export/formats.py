"""The table of formats, and one file with its header comment."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.export.figures import ACCELS, GYROS, SensorFigures
from rotcli.export.header import header_lines
from rotcli.export.numbers import Settings, prepare
from rotcli.export.target import Format
from rotcli.lazy import lazily
from rotcli.version import __version__

with lazily():
    from rotcli.export import autopilots, estimators, simulators, toolboxes


# Figure: how the list of lost figures names it.
FIGURES = {
    "white": "white noise N",
    "flicker": "bias instability B",
    "walk": "rate random walk K",
    "markov": "Gauss-Markov process",
    "axes": "differences between the axes",
    "gyro_bias": "gyro biases",
    "accel_bias": "accelerometer biases",
    "gyro_scale": "gyro scale factors",
    "gyro_installation": "gyro installation errors",
    "accel_scale": "accelerometer scale factors",
    "accel_installation": "accelerometer installation errors",
    "g_sensitivity": "g-sensitivity",
    "second_order": "second-order accelerometer terms",
    "thermal_bias": "bias over temperature",
    "thermal_scale": "scale factor over temperature",
}


@dataclass(frozen=True)
class Export:
    """The text of one exported file, its title, and the figures that it cannot contain.

    limits: notes on values that are limits or guesses, not measurements.
    """

    title: str
    text: str
    lost: tuple[str, ...]
    limits: tuple[str, ...]


def available(figures: SensorFigures) -> frozenset[str]:
    """Return the keys of FIGURES that the inputs contain."""
    noise = figures.noise.values()
    diagonal = np.eye(3, dtype=bool)
    present = {
        "white": any(n.white.value is not None for n in noise),
        "flicker": any(n.flicker.value is not None for n in noise),
        "walk": any(n.walk.value is not None for n in noise),
        "markov": any(n.markov_sigma is not None for n in noise),
        "axes": _axes_differ(figures),
        "gyro_bias": np.isfinite(figures.gyro_bias).any(),
        "accel_bias": np.isfinite(figures.accel_bias).any(),
        "gyro_scale": np.isfinite(figures.gyro_matrix[diagonal]).any(),
        "gyro_installation": np.isfinite(figures.gyro_matrix[~diagonal]).any(),
        "accel_scale": np.isfinite(figures.accel_matrix[diagonal]).any(),
        "accel_installation": np.isfinite(figures.accel_matrix[~diagonal]).any(),
        "g_sensitivity": np.isfinite(figures.g_sensitivity).any(),
        "second_order": np.isfinite(figures.second_order).any(),
        "thermal_bias": figures.thermal is not None,
        "thermal_scale": figures.thermal is not None and figures.thermal.scale is not None,
    }
    return frozenset(name for name, there in present.items() if there)


def _axes_differ(figures: SensorFigures) -> bool:
    for axes in (GYROS, ACCELS):
        values = {figures.noise[a].white.value for a in axes if a in figures.noise}
        if len(values) > 1:
            return True
    return False


def all_formats() -> dict[str, Format]:
    """Return every format by its name, in the order of the help text."""
    formats = (
        *estimators.FORMATS,
        *autopilots.FORMATS,
        *simulators.FORMATS,
        *toolboxes.FORMATS,
    )
    return {entry.name: entry for entry in formats}


def render(name: str, figures: SensorFigures, settings: Settings) -> Export:
    """Return the text of one format; raises ResultError when an input is missing."""
    formats = all_formats()
    if name not in formats:
        raise ResultError(f"{name}: unknown format; known: {', '.join(formats)}")
    target = formats[name]
    numbers = prepare(figures, settings)
    if target.noise:
        numbers.noise()  # raises for a missing triad, before anything else can
    body = target.body(numbers)
    lost = [FIGURES[key] for key in FIGURES if key in available(figures) - target.contains]
    limits = numbers.notes(target.contains)
    notes = [*limits, *body.notes]
    start, end = target.comment
    header = header_lines(target.title, numbers, notes, lost, __version__)
    lines = [*([target.first] if target.first else [])]
    if end:  # XML allows no double hyphen in a comment
        header = [line.replace("--", "- -") for line in header]
    lines += [f"{start}{line}{end}".rstrip() for line in header]
    lines += body.lines
    return Export(target.title, "\n".join(lines) + "\n", tuple(lost), tuple(limits))
