"""Figures of a single-axis rotation INS, after the level-damping paper's ("S") figures 3 to 9.

Singular values by state; INS errors with and without damping; convergence of drifts and biases
with 3-sigma bands; the same and the attitude errors through a maneuver.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files import captions
from rotcli.files.figures import (
    BLUE,
    INK,
    SERIES,
    VERMILLION,
    legend_above,
    log_axes,
    panels,
    styled,
)
from rotcli.files.results.groups import Source
from rotcli.srins.observability_document import PUBLISHED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.figures import Drawing

Panels = Sequence[tuple[str, str]]  # key of the INS error, label

_DRIFTS = {f"gyro_bias_{axis}": f"{axis} drift, 1e-3 deg/h" for axis in "xyz"}
_BIASES = {f"accel_bias_{axis}": f"{axis} bias, ug" for axis in "xy"}
_ATTITUDE = {"phi_E": "phi E, arcsec", "phi_N": "phi N, arcsec", "phi_U": "phi U, arcsec"}
_SCALE = {"deg/h": 1e3, "m/s^2": 1.0 / 9.80665e-6, "arcsec": 1.0}
# S, figure 4: what the damping does to velocity, attitude and position.
_INS_ERRORS: dict[str, Panels] = {
    "velocity": (
        ("v_east_mps", "east velocity\nerror, m/s"),
        ("v_north_mps", "north velocity\nerror, m/s"),
    ),
    "attitude": tuple((f"phi_{c}_arcsec", f"phi {c},\narcsec") for c in "ENU"),
    "position": (("east_m", "east position\nerror, m"), ("north_m", "north position\nerror, m")),
}
_BAR = 0.38  # of the distance between two states


def srins_figures(sources: Sequence[Source], *, published: bool = False) -> "list[Drawing]":
    """Return the report's figures as (title, figure)."""
    drawn: list[Drawing] = []
    docs = [source.doc for source in sources]
    both = "damped and undamped" if len({doc["mode"] for doc in docs}) > 1 else ""
    for kind in _INS_ERRORS:
        if any(_has(doc, kind) for doc in docs):
            title = ", ".join(text for text in (f"INS {kind} error", both) if text)
            drawn.append((f"SRINS: {title}", partial(damping_figure, docs, kind)))
    for source in sources:
        kind = "through a maneuver" if source.doc["maneuvers_h"] else "convergence"
        drawn.append((f"SRINS: {kind}, drifts, {source.path}", partial(drifts_figure, source.doc)))
        if not source.doc["maneuvers_h"]:
            title = f"SRINS: convergence, biases, {source.path}"
            drawn.append((title, partial(biases_figure, source.doc)))
        else:
            title = f"SRINS: attitude errors through a maneuver, {source.path}"
            drawn.append((title, partial(attitude_figure, source.doc)))
    return drawn


def observability_figures(sources: Sequence[Source], *, published: bool = False) -> "list[Drawing]":
    """Return the histogram of the singular values of each result as (title, figure)."""
    return [
        (
            f"SRINS: singular values, {source.path}",
            partial(singular_figure, source.doc, published=published),
        )
        for source in sources
    ]


@styled()
def singular_figure(doc: Mapping[str, Any], *, published: bool = True) -> "Figure":
    """Draw the singular values by state, the paper's next to ours (S, figure 3 and table 1).

    Values below the threshold have no bar: they are zero in exact arithmetic or a matter of units.
    """
    fig, (panel,) = panels(1, 2.8, "")
    states, values = doc["singular_states"], np.array(doc["singular_values"])
    place = np.arange(len(states))
    threshold = doc["rank_threshold"]
    shown = np.where(values > threshold, values, np.nan)
    paper = np.array([PUBLISHED.get(state, np.nan) for state in states])
    candidate = 0.5 * _BAR if published else 0.0
    panel.bar(place - candidate, shown, _BAR, color=BLUE["color"], label="this model")
    if published:
        panel.bar(
            place + candidate, paper, _BAR, facecolor="#f3c1a0", edgecolor=VERMILLION["color"],
            hatch="////", linewidth=0.7, label="paper, table 1",
        )  # fmt: skip
    panel.axhline(threshold, color=INK, linewidth=0.9, linestyle=":", label="threshold")
    log_axes(panel)
    panel.set_ylim(0.1 * threshold, 300.0)
    panel.set_xticks(place, states, rotation=90)
    panel.grid(visible=False, axis="x")
    panel.set_ylabel("singular value, SI units")
    legend_above(panel, 3)
    return fig


def _has(doc: Mapping[str, Any], kind: str) -> bool:
    return all(name in doc["ins_error"] for name, _ in _INS_ERRORS[kind])


@styled()
def damping_figure(docs: Sequence[Mapping[str, Any]], kind: str = "velocity") -> "Figure":
    """Draw the INS error over the complete run, one line for each mode (S, figure 4).

    kind: velocity and position, INS - GNSS; attitude, INS - truth.
    """
    rows = _INS_ERRORS[kind]
    fig, axes = panels(len(rows), 1.75 if len(rows) == 2 else 1.4, "")
    first = {doc["mode"]: doc for doc in reversed(docs) if _has(doc, kind)}
    for mode, look in (("undamped", VERMILLION), ("damped", BLUE)):
        if mode not in first:
            continue
        error = first[mode]["ins_error"]
        for panel, (name, _) in zip(axes, rows, strict=True):
            panel.plot(error["time_h"], error[name], label=mode, **{**look, "marker": None})
    for panel, (_, label) in zip(axes, rows, strict=True):
        panel.axhline(0.0, color=INK, linewidth=0.6)
        panel.set_ylabel(label)
        panel.margins(x=0.0)
    legend_above(axes[0], 2)
    axes[-1].set_xlabel("time, h")
    return fig


def drifts_figure(doc: Mapping[str, Any], *, alone: bool = False) -> "Figure":
    """Draw the gyro drifts with 3-sigma bands (S, figures 5; 7 and 8 through a maneuver).

    alone: outside a page that names the result, so that the title of the figure does.
    """
    if not alone:
        return _history(doc, _DRIFTS)
    title = captions.subject(doc, f"long-run calibration, {doc['mode']}", captions.motion(doc))
    return _history(doc, _DRIFTS, title, captions.log(doc))


def biases_figure(doc: Mapping[str, Any]) -> "Figure":
    """Draw the accelerometer biases with 3-sigma bands (S, figure 6)."""
    return _history(doc, _BIASES)


def attitude_figure(doc: Mapping[str, Any]) -> "Figure":
    """Draw the attitude errors of the INS with 3-sigma bands (S, figure 9)."""
    return _history(doc, _ATTITUDE)


@styled()
def _history(
    doc: Mapping[str, Any], names: Mapping[str, str], title: str = "", source: str = ""
) -> "Figure":
    fig, axes = panels(len(names), 1.6, title, source=source)
    history, truth = doc["history"], doc.get("truth") or {}
    time = np.array(history["time_h"])
    for panel, (name, label) in zip(axes, names.items(), strict=True):
        entry = history[name]
        scale = _SCALE[entry["unit"]]
        value, sigma = scale * np.array(entry["estimate"]), scale * np.array(entry["sigma"])
        panel.plot(time, value, label="estimate", **{**SERIES[0], "marker": None})
        panel.fill_between(
            time, value - 3 * sigma, value + 3 * sigma, color=BLUE["color"], alpha=0.18, lw=0.0,
            label="3 sigma",
        )  # fmt: skip
        if "true" in entry:
            panel.plot(time, scale * np.array(entry["true"]), color=INK, linewidth=0.9,
                       linestyle=":", label="true")  # fmt: skip
        if truth.get(name) is not None:
            panel.axhline(
                scale * truth[name], color=INK, linewidth=0.9, linestyle=":", label="true"
            )
        for moment in doc["maneuvers_h"]:
            panel.axvline(moment, color=VERMILLION["color"], linewidth=0.9, label="maneuver")
        # The bands of the first half hour would flatten the rest.
        settled = time > 0.1 * time[-1]
        shown = [(value - 3 * sigma)[settled], (value + 3 * sigma)[settled]]
        if "true" in entry:
            shown.append(scale * np.array(entry["true"]))
        low, high = float(np.min(np.concatenate(shown))), float(np.max(np.concatenate(shown)))
        panel.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
        panel.set_ylabel(label)
        panel.margins(x=0.0)
    legend_above(axes[0], 4)
    axes[-1].set_xlabel("time since the start of the filter, h")
    return fig
