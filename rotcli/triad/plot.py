"""Figure of a full calibration: residuals of forces and rates before and after."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files import captions
from rotcli.files.figures import BLUE, VERMILLION, legend_above, log_axes, panels, styled
from rotcli.files.results.groups import Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.figures import Drawing

# Key of the residuals without `_before`, `_after`, and label of the panel.
_PANELS = (
    ("force", "force residual\n(m/s$^2$)"),
    ("rate", "rate residual\n(deg/s)"),
    ("gravity", "size of |f| - g\n(m/s$^2$)"),
    ("carried", "carried gravity (deg)"),
)


@styled()
def residual_figure(doc: Mapping[str, Any]) -> "Figure":
    """Draw force and rate residuals before and after the calibration against time."""
    residuals = doc["residuals"]
    shown = [(key, label) for key, label in _PANELS if f"{key}_after" in residuals]
    title = captions.title_without_imu(doc, "residuals before and after the calibration")
    fig, axes = panels(len(shown), 2.2, title, share=True, source=captions.log(doc))
    axes = np.atleast_1d(axes)
    for panel, (key, label) in zip(axes, shown, strict=True):
        for look, when in ((VERMILLION, "before"), (BLUE, "after")):
            values = residuals.get(f"{key}_{when}")
            if values is not None:
                size = np.abs(np.array([np.nan if v is None else v for v in values], dtype=float))
                style = {**look, "linestyle": "none", "markersize": 2.2}
                time = residuals["time_s"]
                if key == "gravity":
                    time = residuals.get("still_time_s", time)
                panel.plot(time, np.where(size > 0.0, size, np.nan), label=when, **style)
        log_axes(panel)
        panel.set_ylabel(label)
    axes[-1].set_xlabel("time (s)")
    legend_above(axes[0], 2)
    return fig


def triad_figures(sources: Sequence[Source]) -> "list[Drawing]":
    """Return the figure of each document that has residuals."""
    return [
        (
            f"{source.imu}: residuals before and after the calibration",
            partial(residual_figure, source.doc),
        )
        for source in sources
        if source.doc.get("residuals")
    ]
