"""The figure of one log: Allan deviations with their fit, and next to them spectra on request."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.allan.document import deviation_unit
from rotcli.allan.estimate import AllanResult, AxisNoise
from rotcli.allan.fit.model import FLICKER_VARIANCE
from rotcli.allan.plot_spectrum import draw_autocorrelation, draw_density
from rotcli.files import captions
from rotcli.files.figures import (
    INK,
    SERIES,
    is_titled,
    legend_above,
    log_axes,
    panels,
    save_figure,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKS = dict(zip("xyz", SERIES, strict=True))
_SENSORS = ("gyro", "accel")
ESTIMATORS = {
    "oadev": "overlapping Allan deviation",
    "adev": "Allan deviation",
    "mdev": "modified Allan deviation",
    "totdev": "total deviation",
}
# Deviation of a unit coefficient at tau = 1 s, and its power of tau.
_ASYMPTOTES = {
    "quantization": ("Q", 3.0**0.5, -1.0),
    "random_walk": ("N", 1.0, -0.5),
    "bias_instability": ("B", FLICKER_VARIANCE**0.5, 0.0),
    "rate_random_walk": ("K", 3.0**-0.5, 0.5),
    "rate_ramp": ("R", 2.0**-0.5, 1.0),
}
PANELS = {"psd": draw_density, "autocorrelation": draw_autocorrelation}


def plot(result: AllanResult, path: str, doc: Mapping[str, Any], extra: Sequence[str] = ()) -> None:
    """Draw the curves into a png, svg or pdf file; `doc`: the result's document, for its names.

    Raises ResultError for another suffix or a file that cannot be written.
    """
    save_figure(allan_figure(result, doc, extra), path)


@styled()
def allan_figure(
    result: AllanResult, doc: Mapping[str, Any], extra: Sequence[str] = ()
) -> "Figure":
    """Draw the curves with limits, fitted terms and minima, a row for each sensor.

    extra: of PANELS, drawn to the right.
    """
    rows = {
        sensor: [axis for name, axis in result.axes.items() if name.startswith(sensor)]
        for sensor in _SENSORS
    }
    rows = {sensor: axes for sensor, axes in rows.items() if axes}
    title = captions.subject(doc, ESTIMATORS[result.estimator])
    fig, places = panels(
        len(rows), 3.2, title, source=captions.log(doc), columns=1 + len(extra), share=not extra
    )
    places = np.reshape(places, (len(rows), -1))
    for place, (sensor, axes) in zip(places, rows.items(), strict=True):
        _draw(place[0], sensor, axes)
        place[0].set_ylabel(f"{sensor} deviation, {deviation_unit(sensor)[0]}")
        legend_above(place[0], 1)
        for panel, name in zip(place[1:], extra, strict=True):
            PANELS[name](panel, sensor, axes, LOOKS)
    explained = (
        "\nbars: 68 % limits; filled: fitted; star: minimum\n"
        "lines: terms Q, N, B, K, R, thick where the coefficient comes from"
    )
    places[-1, 0].set_xlabel(f"cluster time, s{explained if is_titled() else ''}")
    return fig


_MARGIN = 1.3  # of cluster time, free at both ends
# Share of the panel's width and height in which labels are written.
_LABEL_REGION = (np.array([0.05, 0.04]), np.array([0.93, 0.88]))  # lower left, upper right
_ON_CURVE = 0.03  # share of the panel: what a place on a curve is worth against one next to it


def _draw(place: "Axes", sensor: str, axes: list[AxisNoise]) -> None:
    """Draw one panel of curves."""
    _, size = deviation_unit(sensor)
    for k, axis in enumerate(axes):
        draw_curve(place, axis, size, LOOKS[axis.name[-1]], (k, 3))
    log_axes(place, x=True)
    window = (
        0.6 * min(float(a.lower.min()) for a in axes) / size,
        1.7 * max(float(a.upper.max()) for a in axes) / size,
    )
    for axis in axes:
        _draw_fit(place, axis, size, window)
    place.set_ylim(*window)
    span = (float(min(a.tau[0] for a in axes)), float(max(a.tau[-1] for a in axes)))
    place.set_xlim(span[0] / _MARGIN, span[1] * _MARGIN)
    _label_terms(place, axes, size)


def draw_curve(
    place: "Axes",
    axis: AxisNoise,
    size: float,
    look: Mapping[str, Any],
    every: tuple[int, int] = (0, 1),
    label: str | None = None,
) -> None:
    """Draw a curve with its limits in a unit of the given size; open markers are not fitted."""
    value = axis.deviation / size
    bars = np.abs(np.stack([value - axis.lower / size, axis.upper / size - value]))
    lowest = "" if axis.minimum.tau is None else f", minimum at {axis.minimum.tau:.3g} s"
    text = axis.name + lowest if label is None else label
    place.errorbar(
        axis.tau, value, yerr=bars, label=text, capsize=1.5, elinewidth=0.6, markersize=3.0,
        markevery=every, **look,
    )  # fmt: skip
    unused = ~_fitted(axis)
    shown = np.zeros(len(unused), dtype=bool)
    shown[every[0] :: every[1]] = True
    if (unused & shown).any():
        place.plot(
            axis.tau[unused & shown], value[unused & shown], marker=look["marker"], markersize=3.0,
            linestyle="none", markerfacecolor="white", markeredgecolor=look["color"], zorder=4,
        )  # fmt: skip
    if axis.rest is not None:
        place.plot(
            axis.tau, axis.rest / size, color=look["color"], linewidth=0.7, linestyle=(0, (1, 2))
        )


def _fitted(axis: AxisNoise) -> Any:
    """Return which points (k,) of the curve the fit uses."""
    goodness = axis.fit.goodness
    if goodness is None:
        return np.ones(len(axis.tau), dtype=bool)
    used = np.array(goodness.tau)
    nearest = np.abs(np.log(axis.tau[:, None] / used)).min(axis=1)
    return nearest < 0.01


def _draw_fit(place: "Axes", axis: AxisNoise, size: float, window: tuple[float, float]) -> None:
    """Draw each significant term, thick over the cluster times it comes from; and the minimum."""
    color = LOOKS[axis.name[-1]]["color"]
    for name, (_, factor, power) in _ASYMPTOTES.items():
        found = axis.fit.coefficients[name]
        if found.value is None:
            continue
        line = factor * found.value / size * axis.tau**power
        inside = (line > window[0]) & (line < window[1])
        if not inside.any():
            continue
        place.plot(axis.tau[inside], line[inside], linestyle=":", linewidth=0.8, color=color)
        if found.tau is not None:
            span = np.array(found.tau)
            strong = factor * found.value / size * span**power
            place.plot(span, strong, linewidth=3.0, alpha=0.35, color=color, solid_capstyle="butt")
    lowest = axis.minimum
    if lowest.tau is not None and lowest.deviation is not None:
        place.plot(
            lowest.tau, lowest.deviation / size, marker="*", markersize=11.0,
            markerfacecolor="white", markeredgecolor=color, linestyle="none", zorder=5,
        )  # fmt: skip


def _label_terms(place: "Axes", axes: list[AxisNoise], size: float) -> None:
    """Write the letter of each term once, next to its lines, inside the panel, free of the others.

    A term that not every axis has is written with the names of those that have it.
    """
    curves = np.concatenate(
        [_in_panel(place, np.column_stack([a.tau, a.deviation / size])) for a in axes]
    )
    labels = np.full((1, 2), 9.0)  # far outside
    for name, (letter, factor, power) in _ASYMPTOTES.items():
        lines = {}
        for axis in axes:
            value = axis.fit.coefficients[name].value
            if value is not None:
                lines[axis.name[-1]] = factor * value / size * axis.tau**power
        if not lines:
            continue
        middle = np.exp(np.mean([np.log(line) for line in lines.values()], axis=0))
        points = np.column_stack([axes[0].tau, middle])
        shown = _in_panel(place, points)
        inside = np.all((shown > _LABEL_REGION[0]) & (shown < _LABEL_REGION[1]), axis=1)
        if not inside.any():
            continue
        from_curves, from_labels = (
            np.linalg.norm(shown[inside][:, None] - others, axis=2).min(axis=1)
            for others in (curves, labels)
        )
        # On a curve a label is readable, on another label it is not.
        score = np.minimum(from_curves + _ON_CURVE, 0.3 * from_labels) + 1e-3 * from_labels
        best = np.flatnonzero(inside)[int(score.argmax())]
        labels = np.vstack([labels, shown[best]])
        text = letter + ("" if len(lines) == len(axes) else " " + ",".join(lines))
        label = place.annotate(
            text, tuple(points[best]), fontsize=8.0, color=INK, xytext=(0.0, 3.0),
            textcoords="offset points", ha="center", va="bottom", zorder=6,
        )  # fmt: skip
        label.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.6})


def _in_panel(place: "Axes", points: Any) -> Any:
    """Return points (n, 2) of logarithmic axes as fractions of the panel."""
    x, y = np.log(place.get_xlim()), np.log(place.get_ylim())
    low, high = np.array([x[0], y[0]]), np.array([x[1], y[1]])
    return (np.log(points) - low) / (high - low)
