"""The figure of an error budget: error growth for each axis, and the calibration time."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.budget.plot_within import within_figure
from rotcli.files import captions
from rotcli.files.figures import (
    BLUE,
    INK,
    VERMILLION,
    legend_above,
    log_axes,
    panels,
    plain,
    styled,
)
from rotcli.files.results.expected_runs import draw_over_rate, draw_over_time, drawn_runs
from rotcli.files.results.groups import Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.figures import Drawing

_WIDTH = 0.19  # of a bar; the distance between two schemes is 1
# One plain, the others with a hatch each: distinct in grey.
_LOOKS: tuple[dict[str, Any], ...] = (
    {"facecolor": "#0072B2", "edgecolor": "#0072B2"},
    {"facecolor": "#f3c1a0", "edgecolor": "#D55E00", "hatch": "////"},
    {"facecolor": "#c9ebdf", "edgecolor": "#009E73", "hatch": "xxxx"},
    {"facecolor": "#f2f2f2", "edgecolor": INK, "hatch": "...."},
)


@styled()
def budget_figure(doc: Mapping[str, Any]) -> "Figure":
    """Draw a `budget` document: horizontal position error by axis and source; calibration time.

    The error is that of navigation after the budget's duration. The second panel, sigma
    of a calibrated gyro bias against the time still, is left out where no noise is known.
    """
    times = doc["calibration"]["times"]
    runs = drawn_runs(doc.get("expected"))
    title = captions.title_without_imu(doc, f"error budget at {doc['rate']['value']:.6g} deg/s")
    entry = doc.get("sources") or {}
    origin = [str(entry[key]) for key in ("imu", "calibration") if key in entry]
    source = f"sensor errors: {', '.join(origin)}" if origin else ""
    count = 1 + bool(times) + (2 if runs else 0)
    fig, axes = panels(count, 2.6, title, share=False, source=source)
    _growth(axes[0], doc)
    if runs:
        draw_over_time(axes[1], doc["rate"]["value"], runs)
        draw_over_rate(axes[2], doc["duration_s"], runs)
    if times:
        _calibration(axes[-1], doc["calibration"])
    return fig


def _growth(panel: Any, doc: Mapping[str, Any]) -> None:
    """Draw a bar for each source at each axis, on a scale of powers of ten."""
    growth = doc["growth"]
    sources = list(next(iter(growth.values())))
    for k, source in enumerate(sources):
        seen = [entry[source]["navigated"] for entry in growth.values()]
        size = np.array([np.hypot(s["east_m"], s["north_m"]) for s in seen])
        place = np.arange(len(seen)) + (k - (len(sources) - 1) / 2.0) * _WIDTH
        look = _LOOKS[k % len(_LOOKS)]
        panel.bar(place, size, _WIDTH, label=plain(source.replace("_", " ")), linewidth=0.7, **look)
    log_axes(panel)
    names = [name if name == "still" else f"about {name}" for name in growth]
    panel.set_xticks(range(len(names)), names)
    panel.grid(visible=False, axis="x")
    panel.set_ylabel(f"horizontal error\nafter {doc['duration_s']:g} s, m")
    greatest = panel.get_ylim()[1]
    panel.set_ylim(bottom=max(panel.get_ylim()[0], 1e-6 * greatest))
    legend_above(panel, 2)


def _calibration(panel: Any, calibration: Mapping[str, Any]) -> None:
    """Draw sigma of the bias against the time still, with white noise alone next to it."""
    time = [row["time_s"] for row in calibration["times"]]
    for key, label, look in (
        ("bias_dph", "all noise", BLUE),
        ("bias_white_dph", "white noise alone", VERMILLION),
    ):
        panel.plot(time, [row[key] for row in calibration["times"]], label=label, **look)
    best = calibration["best"]
    if best is not None:
        panel.plot(
            best["time_s"],
            best["bias_dph"],
            marker="*",
            markersize=11.0,
            markerfacecolor="white",
            markeredgecolor=INK,
            linestyle="none",
            zorder=5,
            label=f"best: {best['time_s']:.3g} s",
        )
    log_axes(panel, x=True)
    panel.set_xlabel("time still, s")
    panel.set_ylabel("sigma of a\ncalibrated bias, deg/h")
    legend_above(panel, 2)


def budget_figures(sources: Sequence[Source]) -> "list[Drawing]":
    """Return the figures of each budget."""
    drawn: list[Drawing] = []
    for source in sources:
        drawn.append((f"{source.path}: error budget", partial(budget_figure, source.doc)))
        if source.doc.get("within_turn"):
            title = f"{source.path}: errors within one turn"
            drawn.append((title, partial(within_figure, source.doc)))
    return drawn
