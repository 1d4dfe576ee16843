"""Figures of a fleet: units in order of their mean, and control charts of units in time."""

import math
from typing import TYPE_CHECKING

import numpy as np

from rotcli.files.figures import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    SOFT,
    VERMILLION,
    legend_above,
    panels,
    plain,
    styled,
)
from rotcli.fleet.charts import SHEWHART_LIMIT, Chart
from rotcli.fleet.estimate import ParameterResult
from rotcli.units import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rotcli.models.conformity import Limits


MAX_NAMED_UNITS = 25  # names under the axis stay readable
MAX_BARS = 200  # beyond it error bars cover each other
MAX_DAY_NAMES = 6


@styled()
def units_figure(p: ParameterResult, limits: "Limits | None") -> "Figure":
    """Draw the units in ascending order of their mean with sigma, fleet mean, spread and limits."""
    fig, (axes,) = panels(1, 2.4, "")
    order = np.argsort(p.means.raw, kind="stable")
    x = np.arange(len(order)) + 1.0
    value, sigma = p.means.raw[order], p.means.raw_sigma[order]
    spread = math.sqrt(p.components.variances[0])
    mean = p.components.mean
    axes.axhspan(mean - spread, mean + spread, color=SOFT, alpha=0.6, label="fleet, 1 sigma")
    axes.axhline(mean, color=FAINT, linewidth=0.8)
    flagged = p.outliers.unit_flagged[order]
    size = 4.0 if len(x) <= MAX_BARS else 1.5
    for mask, look, label in (
        (~flagged, BLUE, "unit mean, 1 sigma"),
        (flagged, VERMILLION, "outlying unit"),
    ):
        if not mask.any():
            continue
        style = {"color": look["color"], "marker": look["marker"], "linestyle": "none"}
        bars = sigma[mask] if len(x) <= MAX_BARS else None
        axes.errorbar(x[mask], value[mask], yerr=bars, label=label, markersize=size, **style)
    if limits is not None:
        for edge in (limits.low, limits.high):
            if edge is not None:
                axes.axhline(edge, color=VERMILLION["color"], linestyle=":", linewidth=1.0)
    if len(x) <= MAX_NAMED_UNITS:
        axes.set_xticks(x, [plain(str(p.rows.units[k])) for k in order], rotation=90, fontsize=7)
    else:
        axes.set_xlabel("unit, in order of its mean")
    axes.set_ylabel(plain(f"{p.name} ({p.measure})"))
    axes.margins(x=0.02)
    legend_above(axes, 2)
    return fig


@styled()
def chart_figure(p: ParameterResult, unit: int) -> "Figure":
    """Draw the control charts of one unit: values with the baseline, and the EWMA."""
    chart = p.charts[unit]
    fig, (top, bottom) = panels(2, 1.7, "")
    k: FloatArray = np.arange(1.0, len(chart.value) + 1.0)
    _draw_values(top, chart, k)
    top.set_ylabel(plain(f"{p.name} ({p.measure})"))
    later = k > chart.baseline
    bottom.plot(k[later], chart.ewma[later], label="EWMA", **GREEN)
    for sign, label in ((-1.0, "limits"), (1.0, None)):
        limit = sign * chart.ewma_limit[later]
        bottom.plot(k[later], limit, color=FAINT, linestyle=":", label=label)
    alarm = chart.ewma_flagged
    bottom.plot(
        k[alarm], chart.ewma[alarm], linestyle="none", marker="o", color="#D55E00", zorder=5
    )
    bottom.axhline(0.0, color=INK, linewidth=0.6)
    bottom.set_ylabel("EWMA (sigma)")
    legend_above(bottom, 2)
    step = max(1, math.ceil(len(k) / MAX_DAY_NAMES))
    days = [plain(str(p.day_labels[day])) for day in chart.day]
    bottom.set_xticks(k[::step], days[::step], rotation=30, ha="right", fontsize=7)
    return fig


def _draw_values(axes: "Axes", chart: Chart, k: FloatArray) -> None:
    first = k <= chart.baseline
    axes.axvspan(0.5, chart.baseline + 0.5, color=SOFT, alpha=0.6, label="baseline")
    axes.axhline(chart.mean, color=FAINT, linewidth=0.8)
    half = SHEWHART_LIMIT * np.sqrt(chart.sigma**2 + chart.mean_sigma**2)
    for sign, label in ((-1.0, "limits"), (1.0, None)):
        edge = chart.mean + sign * half[~first]
        axes.plot(k[~first], edge, color=FAINT, linestyle=":", label=label)
    axes.errorbar(k, chart.value, yerr=chart.sigma, label="value, 1 sigma", **BLUE)
    alarm = chart.shewhart_flagged
    if alarm.any():
        axes.plot(
            k[alarm],
            chart.value[alarm],
            linestyle="none",
            marker="o",
            color="#D55E00",
            zorder=5,
            label="alarm",
        )
    legend_above(axes, 4)
