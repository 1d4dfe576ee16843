"""Plot of a scale factor test: error over rate with its line, residuals with full-scale axis."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files import captions
from rotcli.files.figures import BLUE, INK, VERMILLION, legend_above, panels, save_figure, styled
from rotcli.files.results.groups import Source
from rotcli.run.laboratory.corrections import read_curve
from rotcli.units import DEG, DEG_PER_HOUR

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.figures import Drawing

_POINTS = 401


def plot(doc: Mapping[str, Any], path: str) -> None:
    """Draw the test into a png, svg or pdf file; ResultError if it cannot be written."""
    save_figure(scale_figure(doc, path), path)


def scale_figures(sources: Sequence[Source]) -> "list[Drawing]":
    """Return the figures of several documents, for a report."""
    return [
        (f"Scale factor over rates, {source.imu}", partial(scale_figure, source.doc, source.path))
        for source in sources
    ]


@styled()
def scale_figure(doc: Mapping[str, Any], path: str) -> "Figure":
    """Draw error over rate and residuals of the gyro along the axis; path: for messages."""
    main = doc["channels"][doc["main"]]
    rows = main["residuals"]
    rate = np.array([row["rate_dps"] for row in rows])
    residual = np.array([row["residual_dph"] for row in rows])
    sigma = np.array([row["sigma_dph"] for row in rows])
    line = main["offset"]["value"] + main["scale"]["value"] * 1e-6 * rate * 3600.0
    title = captions.subject(doc, f"scale factor over rates, gyro {doc['main']}")
    fig, (upper, lower) = panels(2, 2.3, title, source=captions.log(doc))
    upper.errorbar(rate, line + residual, sigma, label="mean at the rate", **_points())
    upper.plot(rate, line, label="straight line", **{**VERMILLION, "marker": None})
    upper.set_ylabel("error (deg/h)")
    legend_above(upper, 2)
    fine, deviation = _curve(doc, path, rate)
    lower.axhline(0.0, color=VERMILLION["color"], linestyle=VERMILLION["linestyle"])
    lower.plot(fine, deviation, color=INK, linewidth=1.0, label=f"model {main['model']}")
    lower.errorbar(rate, residual, sigma, label="minus the straight line", **_points())
    lower.set_ylabel("residual (deg/h)")
    lower.set_xlabel("table rate (deg/s)")
    to_ppm = 1e6 / (doc["full_scale"]["value"] * 3600.0)
    right = lower.secondary_yaxis(
        "right", functions=(lambda y: y * to_ppm, lambda y: np.asarray(y) / to_ppm)
    )
    right.set_ylabel("ppm of full scale")
    legend_above(lower, 2)
    return fig


def _points() -> dict[str, Any]:
    return {"fmt": BLUE["marker"], "color": BLUE["color"], "markersize": 3.5, "linewidth": 1.0}


def _curve(doc: Mapping[str, Any], path: str, rate: Any) -> tuple[Any, Any]:
    """Return rates (deg/s) and the selected curve minus its straight line (deg/h)."""
    fine = np.linspace(float(np.min(rate)), float(np.max(rate)), _POINTS)
    curve = read_curve(path, doc)

    def error(at: Any) -> Any:
        values = curve.error(DEG * at)
        along = values @ curve.axis if doc["main"] == "u" else values[:, "xyz".index(doc["main"])]
        return along / DEG_PER_HOUR

    slope, offset = np.polyfit(rate, error(rate), 1)
    return fine, error(fine) - slope * fine - offset
