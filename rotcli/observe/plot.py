"""Figures of observability: estimates against time with 3-sigma bands, degrees along a sweep.

The estimates are drawn as in O17 ("Improving Observability of an Inertial System by Rotary Motions
of an IMU", Sensors 2017, 17, 698), figures 4 to 6 and 8 to 10: attitude errors, accelerometer
biases and gyro biases, still and turning runs together. matplotlib is loaded only here, without its
windows.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli.files import captions
from rotcli.files.figures import INK, MANY, SERIES, VERMILLION, legend_above, panels, plain, styled

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
    title, source = "ZUPT filter estimates", ""
    if len(docs) == 1:
        title = captions.subject(docs[0], title.lower(), captions.motion(docs[0]))
        source = captions.log(docs[0])
    return _figure(docs, list(GROUPS), title, source)


def group_figure(docs: Sequence[Mapping[str, Any]], group: str) -> Any:
    """Return one of the paper's figures: `group` is a key of GROUPS."""
    return _figure(docs, [group])


@styled()
def _figure(
    docs: Sequence[Mapping[str, Any]], groups: list[str], title: str = "", source: str = ""
) -> Any:
    figure, axes = panels(3, 1.75, title, columns=len(groups), source=source)
    axes = axes.reshape(3, len(groups))
    for column, group in enumerate(groups):
        for row, name in enumerate(GROUPS[group]):
            place = axes[row, column]
            looks = [{**MANY[k % len(MANY)], "marker": None} for k in range(len(docs))]
            spans = [_draw(place, doc, name, look) for doc, look in zip(docs, looks, strict=True)]
            place.set_ylim(min(s[0] for s in spans), max(s[1] for s in spans))
            place.margins(x=0.0)
            label, unit = _label(docs[0], name)
            place.set_ylabel(plain(f"{label}, {unit}"))
        axes[2, column].set_xlabel("time, s")
    legend_above(axes[0, 0], 1)
    return figure


def _label(doc: Mapping[str, Any], name: str) -> tuple[str, str]:
    if name in _SIGMA_OF:
        return name.removesuffix("_deg").replace("_", " "), "deg"
    return name.replace("_", " "), str(doc["filter"]["history"][name]["unit"])


def _draw(ax: Any, doc: Mapping[str, Any], name: str, look: dict[str, Any]) -> tuple[float, float]:
    """Draw one run's estimate with its 3-sigma band, around zero for an error.

    Returns the limits of the panel: they exclude the wide bands of the first seconds and of
    unobservable states.
    """
    history = doc["filter"]["history"]
    time = np.array(history["time_s"]) - history["time_s"][0]
    is_error = name in _SIGMA_OF
    value = np.array(history[name] if is_error else history[name]["value"])
    sigma = np.array(history[_SIGMA_OF.get(name, name)]["sigma"])
    centre = np.zeros_like(value) if is_error else value
    ax.plot(time, value, label=plain(f"{run_name(doc)}, 3 sigma shaded"), **look)
    low, high = centre - 3.0 * sigma, centre + 3.0 * sigma
    ax.fill_between(time, low, high, color=look["color"], alpha=0.15, linewidth=0.0)
    for edge in (low, high):  # the shade alone is lost in grey print
        ax.plot(time, edge, **{**look, "linewidth": 0.5})
    settled = value[len(value) // 10 :]
    spread = max(float(np.ptp(settled)), 6.0 * float(sigma.min()))
    return float(settled.min()) - spread, float(settled.max()) + spread


@styled()
def sweep_figure(doc: Mapping[str, Any]) -> Any:
    """Return a figure of rank and degrees along a sweep, weak cases marked."""
    s = doc["sweep"]
    x, rank, weak = np.array(s["values"]), np.array(s["rank"]), np.array(s["weak"], dtype=bool)
    along = f"observability along {s['parameter']}, {doc['model']} model"
    still = s["parameter"] != "rate" or captions.motion(doc) == "still"
    moving = captions.motion(doc if still else {**doc, "rate": None})
    title = captions.title_without_imu(doc, along, moving)
    figure, (top, below) = panels(2, 2.4, title, ratios=(1, 3))
    top.step(x, rank, where="mid", color=INK, label="rank")
    if weak.any():
        top.plot(x[weak], rank[weak], **{**VERMILLION, "linestyle": "none"}, label="weak")
        legend_above(top, 2)
    top.set_ylabel("rank")
    top.set_ylim(6.5, 12.5)
    # The kind of state by dashes, its direction by colour and marker.
    dashes = {"eps": "-", "gamma": "--", "d": ":"}
    looks = dict(zip("ENU", SERIES, strict=True))
    for name, degrees in s["degrees"].items():
        kind, _, direction = name.partition("_")
        if kind in dashes:
            look = {**looks[direction], "linestyle": dashes[kind]}
            spaced = ("ENU".index(direction), max(1, len(x) // 8))
            below.plot(x, degrees, label=plain(name), markevery=spaced, **look)
    below.set_ylabel("degree of observability")
    below.set_xlabel(plain(f"{s['parameter']}, {s['unit']}"))
    below.set_ylim(-0.03, 1.03)
    below.margins(x=0.0)
    legend_above(below, 3)
    return figure
