"""Figures of observability: estimates against time with 3-sigma bands, degrees along a sweep.

The estimates are drawn as in O17 ("Observability of a rotating MEMS INS", Sensors 2017, 17, 698),
figures 4 to 6 and 8 to 10: attitude errors, accelerometer biases and gyro biases, still and
turning runs together. matplotlib is loaded only here, without its windows.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli.results.plots import styled

ATTITUDE = ("pitch", "roll", "azimuth")
GROUPS = {
    "Attitude errors": tuple(f"{name}_error_deg" for name in ATTITUDE),
    "Accelerometer biases": tuple(f"accel_bias_{a}" for a in "xyz"),
    "Gyro biases": tuple(f"gyro_bias_{a}" for a in "xyz"),
}
# Sigma of an attitude error: that of the tilt it is made of, level and looking north.
_SIGMA_OF = {
    "pitch_error_deg": "tilt_east",
    "roll_error_deg": "tilt_north",
    "azimuth_error_deg": "azimuth",
}


def run_name(doc: Mapping[str, Any]) -> str:
    """Return a run's name for legends and tables: still, or axis and attitude."""
    if doc["axis"] == "none" or not doc["rate"]["value"]:
        return "still"
    axis = doc["axis"] if isinstance(doc["axis"], str) else "oblique axis"
    tilts = [
        f"{name} {doc['attitude'][f'{name}_deg']:.3g}"
        for name in ("pitch", "roll")
        if abs(doc["attitude"][f"{name}_deg"]) > 1e-6
    ]
    return f"about {axis}, {', '.join(tilts) or 'level'}"


def estimates_figure(docs: Sequence[Mapping[str, Any]]) -> Any:
    """Return a figure of all nine estimates of one run, or of several runs together."""
    return _figure(docs, list(GROUPS))


def group_figure(docs: Sequence[Mapping[str, Any]], group: str) -> Any:
    """Return one of the paper's figures: `group` is a key of GROUPS."""
    return _figure(docs, [group])


@styled()
def _figure(docs: Sequence[Mapping[str, Any]], groups: list[str]) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(groups), 7.0), layout="constrained")
    axes = figure.subplots(3, len(groups), sharex=True, squeeze=False)
    for column, group in enumerate(groups):
        axes[0, column].set_title(group)
        for row, name in enumerate(GROUPS[group]):
            spans = [_draw(axes[row, column], doc, name, f"C{k}") for k, doc in enumerate(docs)]
            axes[row, column].set_ylim(min(s[0] for s in spans), max(s[1] for s in spans))
            label, unit = _label(docs[0], name)
            axes[row, column].set_ylabel(f"{label}, {unit}")
            axes[row, column].grid(alpha=0.3)
        axes[2, column].set_xlabel("time, s")
    axes[0, 0].legend(loc="best", fontsize="small")
    return figure


def _label(doc: Mapping[str, Any], name: str) -> tuple[str, str]:
    if name in _SIGMA_OF:
        return name.removesuffix("_error_deg"), "deg"
    return name.replace("_", " "), str(doc["filter"]["history"][name]["unit"])


def _draw(ax: Any, doc: Mapping[str, Any], name: str, colour: str) -> tuple[float, float]:
    """Draw one run's estimate with its 3-sigma band, around zero for an error.

    Returns the limits within which it should be seen: the wide bands of the first seconds, and of
    what stays hidden, would flatten the rest.
    """
    history = doc["filter"]["history"]
    time = np.array(history["time_s"]) - history["time_s"][0]
    is_error = name in _SIGMA_OF
    value = np.array(history[name] if is_error else history[name]["value"])
    sigma = np.array(history[_SIGMA_OF.get(name, name)]["sigma"])
    centre = np.zeros_like(value) if is_error else value
    ax.plot(time, value, color=colour, lw=1.2, label=f"{run_name(doc)}, 3 sigma shaded")
    ax.fill_between(
        time, centre - 3.0 * sigma, centre + 3.0 * sigma, color=colour, alpha=0.15, lw=0.0
    )
    settled = value[len(value) // 10 :]
    spread = max(float(np.ptp(settled)), 6.0 * float(sigma.min()))
    return float(settled.min()) - spread, float(settled.max()) + spread


@styled()
def sweep_figure(doc: Mapping[str, Any]) -> Any:
    """Return a figure of rank and degrees along a sweep, weak cases shaded."""
    from matplotlib.figure import Figure

    s = doc["sweep"]
    x = np.array(s["values"])
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=[1, 3])
    top.step(x, s["rank"], where="mid", color="k")
    top.plot(
        x[np.array(s["weak"])],
        np.array(s["rank"])[np.array(s["weak"])],
        "o",
        color="C3",
        label="weak",
    )
    top.set_ylabel("rank")
    top.set_ylim(6.5, 12.5)
    top.set_title(f"Observability along {s['parameter']}, {doc['model']} model")
    if any(s["weak"]):
        top.legend(fontsize="small")
    styles = {"eps": "-", "gamma": "--", "d": ":"}
    for name, degrees in s["degrees"].items():
        kind, _, direction = name.partition("_")
        if kind in styles:
            colour = f"C{'ENU'.index(direction)}"
            below.plot(x, degrees, styles[kind], color=colour, label=name)
    below.set_ylabel("degree, 0 hidden to 1 clear")
    below.set_xlabel(f"{s['parameter']}, {s['unit']}")
    below.set_ylim(-0.03, 1.03)
    below.grid(alpha=0.3)
    below.legend(ncols=3, fontsize="small")
    return figure
