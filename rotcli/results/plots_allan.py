"""The log-log figure of Allan deviations.

Colours are those of Okabe and Ito, told apart by the colour-blind; dash patterns and markers
tell the axes apart in grey print. The same result gives the same bytes.
"""

from pathlib import Path
from typing import Any

import numpy as np

from rotcli.atomic import replace_whole
from rotcli.errors import ResultError
from rotcli.models.noise_model import FLICKER_FLOOR
from rotcli.results.allan import deviation_unit
from rotcli.results.files import unwritable
from rotcli.stages.allan import AllanResult, AxisNoise

FORMATS = ("png", "svg", "pdf")
_STYLES = {
    "x": {"color": "#0072B2", "linestyle": "-", "marker": "o"},
    "y": {"color": "#D55E00", "linestyle": "--", "marker": "s"},
    "z": {"color": "#009E73", "linestyle": "-.", "marker": "^"},
}
_NAMES = {"gyro": "Gyroscopes", "accel": "Accelerometers"}
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
    "bias_instability": ("B", FLICKER_FLOOR**0.5, 0.0),
    "rate_random_walk": ("K", 3.0**-0.5, 0.5),
    "rate_ramp": ("R", 2.0**-0.5, 1.0),
}


def plot(result: AllanResult, path: str) -> None:
    """Draw the curves with limits, fitted asymptotes and minima; png, svg or pdf by suffix.

    Raises ResultError for another suffix or a file that cannot be written.
    """
    kind = Path(path).suffix.lstrip(".").lower()
    if kind not in FORMATS:
        raise ResultError(f"{path}: a plot is written as {', '.join(FORMATS)}; name such a file")
    import matplotlib as mpl
    from matplotlib.figure import Figure

    undated: dict[str, Any] = {
        "png": {"Software": None},
        "svg": {"Date": None},
        "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    }[kind]
    with mpl.rc_context({"svg.hashsalt": "rotcli", "font.size": 9.0}):
        panels = [k for k in _NAMES if any(name.startswith(k) for name in result.axes)]
        figure = Figure(figsize=(6.4, 4.2 * len(panels)), dpi=150, layout="constrained")
        for place, panel in zip(
            figure.subplots(len(panels), squeeze=False)[:, 0], panels, strict=True
        ):
            _draw(place, panel, [a for name, a in result.axes.items() if name.startswith(panel)])
            place.set_ylabel(f"{_ESTIMATORS[result.estimator]} [{deviation_unit(panel)[0]}]")
        try:
            with replace_whole(path) as stream:
                figure.savefig(stream, format=kind, metadata=undated)
        except OSError as fault:
            raise unwritable(path, fault) from fault


def _draw(place: Any, panel: str, axes: list[AxisNoise]) -> None:
    """Draw one panel."""
    _, size = deviation_unit(panel)
    for axis in axes:
        style = _STYLES[axis.name[-1]]
        value = axis.deviation / size
        bars = np.abs(np.stack([value - axis.lower / size, axis.upper / size - value]))
        lowest = "" if axis.minimum.tau is None else f", minimum at {axis.minimum.tau:.3g} s"
        place.errorbar(
            axis.tau, value, yerr=bars, label=axis.name + lowest, capsize=1.5, elinewidth=0.6,
            markersize=3.0, linewidth=1.2, markevery=(axes.index(axis), 3), **style,
        )  # fmt: skip
    place.set_xscale("log")
    place.set_yscale("log")
    window = (
        0.6 * min(float(a.lower.min()) for a in axes) / size,
        1.7 * max(float(a.upper.max()) for a in axes) / size,
    )
    for axis in axes:
        _draw_fit(place, axis, size, window)
    place.set_ylim(*window)
    place.set_title(_NAMES[panel])
    place.set_xlabel("cluster time [s]")
    place.grid(True, which="both", linewidth=0.3, color="0.85")
    place.legend(title="68 % limits; dotted: fitted terms; star: minimum", fontsize=8.0)


def _draw_fit(place: Any, axis: AxisNoise, size: float, window: tuple[float, float]) -> None:
    """Draw the asymptote of each supported term, and the minimum."""
    color = _STYLES[axis.name[-1]]["color"]
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
