"""Several devices or runs in one figure and one table: Allan deviations side by side."""

from collections.abc import Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.allan.document import deviation_unit
from rotcli.allan.estimate import AllanResult, AxisNoise
from rotcli.allan.plot import ESTIMATORS, draw_curve
from rotcli.dataclass import dataclass
from rotcli.files.channels import AXES
from rotcli.files.figures import INK, MANY, legend_above, log_axes, panels, plain, styled
from rotcli.files.published import published
from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FIGURES = {
    "random_walk": "N random walk",
    "bias_instability": "B bias instability",
    "rate_random_walk": "K rate random walk",
}
PUBLISHED_AXIS = "gyro_x"  # of R16 figure 6


@dataclass(frozen=True, eq=False)
class Compared:
    """One log of a comparison: its label, its estimate, its document."""

    label: str
    estimate: AllanResult
    document: dict[str, Any]


def labelled(results: Sequence[tuple[AllanResult, dict[str, Any]]]) -> list[Compared]:
    """Return the logs with labels: names of the IMUs, with the path where a name repeats."""
    names = [Source("", doc).imu for _, doc in results]
    paths = [PurePath(str(doc["inputs"][0]["path"])) for _, doc in results]
    labels = []
    for k, (name, path) in enumerate(zip(names, paths, strict=True)):
        short = "/".join(path.parts[-2:])
        labels.append(name if names.count(name) == 1 else f"{k + 1}: {name}, {short}")
    return [Compared(label, *result) for label, result in zip(labels, results, strict=True)]


@styled()
def comparison_figure(logs: Sequence[Compared], *, marks: bool = False) -> "Figure":
    """Draw the curves of several logs, a panel for each axis.

    marks: also the lowest deviations that R16 figure 6 has for its IMUs, of gyro x.
    """
    axes = [name for name in AXES if any(name in log.estimate.axes for log in logs)]
    columns = 2 if len(axes) > 3 else 1
    rows = -(-len(axes) // columns)
    title = ESTIMATORS[logs[0].estimate.estimator]
    title = title[0].upper() + title[1:]
    fig, places = panels(rows, 3.0, title, columns=columns, share=False)
    every = np.reshape(places, (rows, columns)).T.ravel()
    for place, name in zip(every, axes, strict=False):
        _draw(place, name, logs, marks=marks and name == PUBLISHED_AXIS)
    for place in every[len(axes) :]:
        place.set_visible(False)
    return fig


def _draw(place: "Axes", name: str, logs: Sequence[Compared], *, marks: bool) -> None:
    unit, size = deviation_unit(name)
    log_axes(place, x=True)
    for k, log in enumerate(logs):
        axis = log.estimate.axes.get(name)
        if axis is None:
            continue
        look = MANY[k % len(MANY)]
        draw_curve(place, axis, size, look, label=plain(log.label + _minimum(axis, size, unit)))
        found = published(Source("", log.document).imu) if marks else None
        if found is not None and found.lowest is not None:
            tau, value = found.lowest
            place.plot(
                tau, value, marker="x", markersize=9.0, markeredgewidth=2.0, linestyle="none",
                color=INK, zorder=6,
                label=plain(f"R16 figure 6, {log.label}: {value:g} deg/h at {tau:g} s"),
            )  # fmt: skip
    place.set_ylabel(f"{name} deviation, {unit}")
    place.set_xlabel("cluster time, s; bars: 68 % limits; open: not fitted")
    legend_above(place, 1)


def _minimum(axis: AxisNoise, size: float, unit: str) -> str:
    lowest = axis.minimum
    if lowest.tau is None or lowest.deviation is None:
        return ""
    return f", lowest {lowest.deviation / size:.3g} {unit} at {lowest.tau:.3g} s"


def comparison_table(logs: Sequence[Compared]) -> Table:
    """Return N, B, K and the minimum of each axis, a column for each log."""
    rows: list[tuple[Cell, ...]] = []
    for name in AXES:
        present = [log.document["axes"].get(name) for log in logs]
        if not any(present):
            continue
        first = next(axis for axis in present if axis)
        for key, label in _FIGURES.items():
            unit = first["coefficients"][key]["unit"]
            cells = [_cell(axis and axis["coefficients"][key]) for axis in present]
            rows.append((name, label, unit, *cells))
        lowest = [_lowest(axis) for axis in present]
        rows.append((name, "minimum", first["unit"], *lowest))
    columns = (Column("axis"), Column("figure"), Column("unit"))
    return Table(
        "Noise of several logs",
        (*columns, *(Column(log.label) for log in logs)),
        rows,
        "value +- sigma; <: not significant, 95 % upper limit.",
    )


def _cell(found: dict[str, Any] | None) -> str | None:
    if not found or (found["value"] is None and found["upper"] is None):
        return None
    if found["value"] is None:
        return f"<{found['upper']:.3g}"
    return f"{found['value']:.4g} +- {found['sigma']:.2g}"


def _lowest(axis: dict[str, Any] | None) -> str | None:
    if not axis or axis["minimum"]["tau_s"] is None:
        return None
    return f"{axis['minimum']['deviation']:.4g} at {axis['minimum']['tau_s']:.4g} s"
