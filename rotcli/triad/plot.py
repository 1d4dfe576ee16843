"""Figure of a full calibration: residuals of forces and rates before and after."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files import captions
from rotcli.files.figures import BLUE, VERMILLION, legend_above, panels, styled
from rotcli.triad.result import TriadResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled()
def residual_figure(result: TriadResult, doc: Mapping[str, Any]) -> "Figure":
    """Draw force and rate residuals before and after the calibration against time."""
    title = captions.unless_nameless(doc, "residuals of the calibration")
    fig, axes = panels(2, 2.2, title, share=True, source=captions.log(doc))
    series = result.series
    time = series["time [s]"]
    if result.method == "hand-held":
        pairs = [
            (series["force_before [m/s^2]"], series["force_after [m/s^2]"], "|f| - g (m/s$^2$)"),
            (None, series["carried_after [deg]"], "carried gravity (deg)"),
        ]
    else:
        pairs = [
            (_size(series, "accel", "before", "m/s^2"), _size(series, "accel", "after", "m/s^2"),
             "force residual\n(m/s$^2$)"),
            (_size(series, "gyro", "before", "deg/s"), _size(series, "gyro", "after", "deg/s"),
             "rate residual\n(deg/s)"),
        ]  # fmt: skip
    for panel, (before, after, label) in zip(axes, pairs, strict=True):
        for values, look, name in ((before, VERMILLION, "before"), (after, BLUE, "after")):
            if values is not None:
                style = {**look, "linestyle": "none", "markersize": 1.8}
                panel.plot(time, np.abs(values) + 1e-12, label=name, **style)
        panel.set_yscale("log")
        panel.set_ylabel(label)
    axes[-1].set_xlabel("time (s)")
    legend_above(axes[0], 2)
    fig.align_ylabels()
    return fig


def _size(series: Mapping[str, Any], triad: str, when: str, unit: str) -> Any:
    """Return the length of a triad's residual vector."""
    return np.sqrt(sum(series[f"{triad}_{axis}_{when} [{unit}]"] ** 2 for axis in "xyz"))
