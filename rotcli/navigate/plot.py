"""Errors of one run against time, in one mode or in several, after R16 figures 7 and 10."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rotcli.errors import ResultError
from rotcli.files import captions
from rotcli.files.figures import (
    BLUE,
    GREEN,
    INK,
    SERIES,
    VERMILLION,
    legend_above,
    panels,
    styled,
)
from rotcli.units import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.navigate.api import NavigationResult


_LOOKS = {"conventional": GREEN, "partial": VERMILLION, "full": BLUE}
_ORDER = {"full": 2.0, "conventional": 2.1, "partial": 2.2}  # a dashed line shows on a solid one
_COLUMNS = 3
_WIDTH, _HEIGHT = 3.2, 1.7  # inch, of a panel
# Rows of panels: column of the time series, label. In the order of R16: a row a kind of error.
_PANELS = (
    ("err_north [m]", "latitude, m"),
    ("err_east [m]", "longitude, m"),
    ("err_up [m]", "height, m"),
    ("err_v_north [m/s]", "v north, m/s"),
    ("err_v_east [m/s]", "v east, m/s"),
    ("err_v_up [m/s]", "v up, m/s"),
    ("err_pitch [deg]", "pitch, deg"),
    ("err_roll [deg]", "roll, deg"),
    ("err_azimuth [deg]", "azimuth, deg"),
)


_RUN_PANELS: tuple[tuple[str, Sequence[tuple[str, str]]], ...] = (
    (
        "attitude error, deg",
        (
            ("pitch", "err_pitch [deg]"),
            ("roll", "err_roll [deg]"),
            ("azimuth", "err_azimuth [deg]"),
        ),
    ),
    (
        "velocity error, m/s",
        (
            ("north", "err_v_north [m/s]"),
            ("east", "err_v_east [m/s]"),
            ("up", "err_v_up [m/s]"),
        ),
    ),
    (
        "horizontal position\nerror, m",
        (("north", "err_north [m]"), ("east", "err_east [m]")),
    ),
    # The unaided height error grows exponentially and would flatten the others.
    ("height error, m", (("up", "err_up [m]"),)),
)


ERROR_COLUMNS = ("time [s]", *(column for _, group in _RUN_PANELS for _, column in group))


@styled()
def navigation_errors(
    columns: Mapping[str, FloatArray],
    title: str,
    source: str = "",
    expected: Mapping[str, FloatArray] | None = None,
) -> "Figure":
    """Draw the errors against time: attitude, velocity, horizontal position, height.

    columns: as `rotcli.navigate.document.solution` returns them, each (n,); expected: the same
    errors' expected band (2, m) against the time since the start, mean -+ 1 sigma.
    """
    fig, axes = panels(len(_RUN_PANELS), 1.6, title, source=source)
    time = columns["time [s]"] - columns["time [s]"][0]
    for panel, (label, series) in zip(axes, _RUN_PANELS, strict=True):
        for (name, column), look in zip(series, SERIES, strict=False):
            panel.plot(time, columns[column], label=name, **{**look, "marker": None})
            if expected:
                band = {"color": look["color"], "linewidth": 0.8, "linestyle": ":"}
                panel.plot(expected["time [s]"], expected[column].T, **band)
        panel.axhline(0.0, color=INK, linewidth=0.6)
        panel.set_ylabel(label)
        panel.margins(x=0.0)
        legend_above(panel, 3)
    dotted = " (dotted: expected, 1 sigma)" if expected else ""
    axes[-1].set_xlabel(f"time since the start of navigation, s{dotted}")
    return fig


def modes_figure(results: "Sequence[NavigationResult]") -> "Figure":
    """Draw the nine errors of one run in all its modes, a line for each mode.

    Raises ResultError for a result without its time series.
    """
    series = {}
    for result in results:
        if result.series is None:
            raise ResultError("a navigation without its time series has no figure")
        series[str(result.document["mode"])] = result.series
    first = results[0]
    motion = captions.motion(first.document, constant_rate=first.constant_rate)
    title = captions.subject(first.document, ", ".join(series), motion)
    return _draw(series, title, captions.log(first.document))


@styled()
def _draw(series: Mapping[str, Mapping[str, FloatArray]], title: str, source: str) -> "Figure":
    rows = len(_PANELS) // _COLUMNS
    width = _COLUMNS * _WIDTH
    fig, axes = panels(rows, _HEIGHT, title, columns=_COLUMNS, source=source, width=width)
    for panel, (name, label) in zip(axes.ravel(), _PANELS, strict=True):
        for mode, columns in series.items():
            time = columns["time [s]"] - columns["time [s]"][0]
            look: dict[str, Any] = {**_LOOKS[mode], "marker": None, "zorder": _ORDER[mode]}
            panel.plot(time, columns[name], label=mode, **look)
        panel.axhline(0.0, color=INK, linewidth=0.6)
        panel.set_ylabel(label)
        panel.margins(x=0.0)
    legend_above(axes[0, 0], len(series))
    for panel in axes[-1]:
        panel.set_xlabel("time, s")
    return fig
