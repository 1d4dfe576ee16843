"""Figures of a long-run SRINS calibration, after the level-damping paper's ("S") figures 4 to 9.

INS errors with and without damping; convergence of drifts and biases with 3-sigma bands; the
same through a maneuver.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files import captions
from rotcli.files.figures import BLUE, INK, SERIES, VERMILLION, legend_above, panels, styled
from rotcli.files.results.groups import Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DRIFTS = {f"gyro_bias_{axis}": f"{axis} drift, 1e-3 deg/h" for axis in "xyz"}
_BIASES = {f"accel_bias_{axis}": f"{axis} bias, ug" for axis in "xy"}
_SCALE = {"deg/h": 1e3, "m/s^2": 1.0 / 9.80665e-6}


def srins_figures(sources: Sequence[Source]) -> "list[tuple[str, Figure]]":
    """Return the report's figures as (title, figure)."""
    drawn = []
    modes = {source.doc["mode"] for source in sources}
    if modes:
        title = (
            "INS velocity error, damped and undamped" if len(modes) > 1 else "INS velocity error"
        )
        drawn.append((f"SRINS: {title}", damping_figure([source.doc for source in sources])))
    for source in sources:
        kind = "through a maneuver" if source.doc["maneuvers_h"] else "convergence"
        drawn.append((f"SRINS: {kind}, drifts, {source.path}", drifts_figure(source.doc)))
        if not source.doc["maneuvers_h"]:
            drawn.append((f"SRINS: convergence, biases, {source.path}", biases_figure(source.doc)))
    return drawn


@styled()
def damping_figure(docs: Sequence[Mapping[str, Any]]) -> "Figure":
    """Draw INS - GNSS velocity over the whole run, one line for each mode (S, figure 4)."""
    fig, axes = panels(2, 1.75, "")
    first = {doc["mode"]: doc for doc in reversed(docs)}
    for mode, look in (("undamped", VERMILLION), ("damped", BLUE)):
        if mode not in first:
            continue
        error = first[mode]["ins_error"]
        for panel, name in zip(axes, ("v_east_mps", "v_north_mps"), strict=True):
            panel.plot(error["time_h"], error[name], label=mode, **{**look, "marker": None})
    for panel, name in zip(axes, ("east", "north"), strict=True):
        panel.axhline(0.0, color=INK, linewidth=0.6)
        panel.set_ylabel(f"{name} velocity error, m/s")
        panel.margins(x=0.0)
    legend_above(axes[0], 2)
    axes[-1].set_xlabel("time, h")
    fig.align_ylabels()
    return fig


def drifts_figure(doc: Mapping[str, Any], *, alone: bool = False) -> "Figure":
    """Draw the gyro drifts with 3-sigma bands (S, figures 5; 7 to 9 through a maneuver).

    alone: not in a page that names it, so that the figure itself says whose it is.
    """
    if not alone:
        return _history(doc, _DRIFTS)
    title = captions.subject(doc, f"long-run calibration, {doc['mode']}", captions.motion(doc))
    return _history(doc, _DRIFTS, title, captions.log(doc))


def biases_figure(doc: Mapping[str, Any]) -> "Figure":
    """Draw the accelerometer biases with 3-sigma bands (S, figure 6)."""
    return _history(doc, _BIASES)


@styled()
def _history(
    doc: Mapping[str, Any], names: Mapping[str, str], title: str = "", source: str = ""
) -> "Figure":
    fig, axes = panels(len(names), 1.6, title, source=source)
    history, truth = doc["history"], doc.get("truth") or {}
    time = np.array(history["time_h"])
    for panel, (name, label) in zip(axes, names.items(), strict=True):
        held = history[name]
        scale = _SCALE[held["unit"]]
        value, sigma = scale * np.array(held["estimate"]), scale * np.array(held["sigma"])
        panel.plot(time, value, label="estimate", **{**SERIES[0], "marker": None})
        panel.fill_between(
            time, value - 3 * sigma, value + 3 * sigma, color=BLUE["color"], alpha=0.18, lw=0.0,
            label="3 sigma",
        )  # fmt: skip
        if truth.get(name) is not None:
            panel.axhline(
                scale * truth[name], color=INK, linewidth=0.9, linestyle=":", label="true"
            )
        for moment in doc["maneuvers_h"]:
            panel.axvline(moment, color=VERMILLION["color"], linewidth=0.9, label="maneuver")
        # The bands of the first half hour would flatten the rest.
        settled = time > 0.1 * time[-1]
        low = float((value - 3 * sigma)[settled].min())
        high = float((value + 3 * sigma)[settled].max())
        panel.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
        panel.set_ylabel(label)
        panel.margins(x=0.0)
    legend_above(axes[0], 4)
    axes[-1].set_xlabel("time since the start of the filter, h")
    fig.align_ylabels()
    return fig
