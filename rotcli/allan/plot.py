"""The log-log figure of Allan deviations with their limits, fitted terms and minima."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.allan.document import deviation_unit
from rotcli.allan.estimate import AllanResult, AxisNoise
from rotcli.allan.fit.model import FLICKER_VARIANCE
from rotcli.files import captions
from rotcli.files.figures import SERIES, legend_above, log_axes, panels, save_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LOOKS = dict(zip("xyz", SERIES, strict=True))
_SENSORS = ("gyro", "accel")
_ESTIMATORS = {
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


def plot(result: AllanResult, path: str, doc: Mapping[str, Any]) -> None:
    """Draw the curves into a png, svg or pdf file; `doc`: the result's document, for its names.

    Raises ResultError for another suffix or a file that cannot be written.
    """
    save_figure(allan_figure(result, doc), path)


@styled()
def allan_figure(result: AllanResult, doc: Mapping[str, Any]) -> "Figure":
    """Draw the curves with limits, fitted asymptotes and minima, a panel for each sensor."""
    held = {
        sensor: [axis for name, axis in result.axes.items() if name.startswith(sensor)]
        for sensor in _SENSORS
    }
    held = {sensor: axes for sensor, axes in held.items() if axes}
    title = captions.subject(doc, _ESTIMATORS[result.estimator])
    fig, places = panels(len(held), 3.2, title, source=captions.log(doc))
    for place, (sensor, axes) in zip(places, held.items(), strict=True):
        _draw(place, sensor, axes)
        place.set_ylabel(f"{sensor} deviation, {deviation_unit(sensor)[0]}")
        legend_above(place, 1)
    places[-1].set_xlabel(
        "cluster time, s\nbars: 68 % limits; dotted: fitted terms Q, N, B, K, R; star: minimum"
    )
    return fig


def _draw(place: Any, sensor: str, axes: list[AxisNoise]) -> None:
    """Draw one panel."""
    _, size = deviation_unit(sensor)
    for axis in axes:
        value = axis.deviation / size
        bars = np.abs(np.stack([value - axis.lower / size, axis.upper / size - value]))
        lowest = "" if axis.minimum.tau is None else f", minimum at {axis.minimum.tau:.3g} s"
        place.errorbar(
            axis.tau, value, yerr=bars, label=axis.name + lowest, capsize=1.5, elinewidth=0.6,
            markersize=3.0, markevery=(axes.index(axis), 3), **_LOOKS[axis.name[-1]],
        )  # fmt: skip
    log_axes(place, x=True)
    window = (
        0.6 * min(float(a.lower.min()) for a in axes) / size,
        1.7 * max(float(a.upper.max()) for a in axes) / size,
    )
    for axis in axes:
        _draw_fit(place, axis, size, window)
    place.set_ylim(*window)


def _draw_fit(place: Any, axis: AxisNoise, size: float, window: tuple[float, float]) -> None:
    """Draw the asymptote of each supported term, and the minimum."""
    color = _LOOKS[axis.name[-1]]["color"]
    for name, (letter, factor, power) in _ASYMPTOTES.items():
        found = axis.fit.coefficients[name].value
        if found is None:
            continue
        line = factor * found / size * axis.tau**power
        inside = (line > window[0]) & (line < window[1])
        if not inside.any():
            continue
        place.plot(axis.tau[inside], line[inside], linestyle=":", linewidth=0.8, color=color)
        at = np.flatnonzero(inside)[-1 if power >= 0.0 else 0]
        place.annotate(
            f"{letter}{axis.name[-1]}", (axis.tau[at], line[at]), fontsize=7.0, color=color,
            xytext=(3.0 + 9.0 * "xyz".index(axis.name[-1]), 2.0), textcoords="offset points",
        )  # fmt: skip
    lowest = axis.minimum
    if lowest.tau is not None and lowest.deviation is not None:
        place.plot(
            lowest.tau, lowest.deviation / size, marker="*", markersize=11.0,
            markerfacecolor="white", markeredgecolor=color, linestyle="none", zorder=5,
        )  # fmt: skip
