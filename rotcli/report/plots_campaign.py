"""Figures of many results: RMS and calibration against rate, Allan deviation."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.calibrate.campaign import calibration_runs, parameter_sets
from rotcli.files.figures import (
    BLUE,
    INK,
    SERIES,
    VERMILLION,
    legend_above,
    log_axes,
    panels,
    plain,
    styled,
)
from rotcli.files.results.groups import MODES, Group, Run, Source, device_label, grouped
from rotcli.navigate.campaign.errors import ERRORS
from rotcli.navigate.campaign.ratios import RunRatio, run_ratios
from rotcli.navigate.campaign.tables import conventional_runs, groups_of_device, navigation_runs
from rotcli.units import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rotcli.files.figures import Drawing


_BAR = 0.38  # of the distance between two rates
UNITS_OF_A_FIGURE = 4  # panels of one figure
_BAND_POINTS = 4.0  # width of a band, pt
_RMS_PANELS = (
    ("horizontal_m", "horizontal\nposition, m"),
    ("horizontal_mps", "horizontal\nvelocity, m/s"),
    ("azimuth_deg", "azimuth, deg"),
)
# Pale hatched against dark plain: distinct in grey too.
MODE_LOOK = {
    "partial": {"facecolor": "#f3c1a0", "edgecolor": VERMILLION["color"], "hatch": "////"},
    "full": {"facecolor": BLUE["color"], "edgecolor": BLUE["color"]},
}


@styled()
def rms_against_rate(
    groups: Sequence[Group],
    still: Sequence[Run],
    title: str,
    shown: Sequence[tuple[str, str]] = _RMS_PANELS,
) -> "Figure":
    """Draw the RMS errors of partial and full navigation against the table rate.

    A bar for each mode at each rate. groups: of one unit, both modes. still: its conventional
    runs, shown as a level with the range from minimum to maximum shaded. Error bars span the
    runs of one rate. shown: the error of each panel, and its label.
    """
    fig, axes = panels(len(shown), 1.75, title)
    rates = rates_of(groups)
    for panel, (name, label) in zip(axes, shown, strict=True):
        draw_rms(panel, groups, rates, still, name)
        panel.set_ylabel(label)
    legend_above(axes[0], 2)
    rate_axis(axes, rates)
    axes[-1].set_xlabel("table rate, deg/s")
    return fig


def rates_of(groups: Sequence[Group]) -> list[str]:
    """Return the rates of groups, deg/s, as the axis shows them, in order."""
    return list(dict.fromkeys(_shown(group.rate) for group in sorted(groups, key=_rate)))


def draw_rms(
    panel: "Axes", groups: Sequence[Group], rates: Sequence[str], still: Sequence[Run], name: str
) -> None:
    """Draw one error of groups at their rates as bars, and the level of conventional runs."""
    modes = [mode for mode in MODE_LOOK if any(group.mode == mode for group in groups)]
    levels = [value for run in still if (value := run.values[name]) is not None]
    if levels:
        level = float(np.mean(levels))
        panel.axhline(level, color=INK, linestyle=":", label="conventional: mean")
    if len(levels) > 1:
        label = "range of the runs"
        look: dict[str, Any] = {"facecolor": "#eeeeee", "edgecolor": "none", "zorder": 0}
        panel.axhspan(min(levels), max(levels), label=label, **look)
    for k, mode in enumerate(modes):
        members = [group for group in groups if group.mode == mode]
        place = np.array([rates.index(_shown(group.rate)) for group in members])
        _bars(panel, place + (k - (len(modes) - 1) / 2.0) * _BAR, members, name, mode)
    panel.set_ylim(bottom=0.0)


def rate_axis(axes: Any, rates: Sequence[str]) -> None:
    """Name the places of the rates below the last panel; the others need no marks of them."""
    for panel in axes[:-1]:
        panel.xaxis.set_visible(False)
    axes[-1].grid(visible=False, axis="x")
    axes[-1].set_xticks(range(len(rates)), rates)


def _rate(group: Group) -> float:
    return float(group.rate)


def _shown(rate: float) -> str:
    return f"{rate:.3g}"


def _bars(panel: Any, place: FloatArray, groups: Sequence[Group], name: str, mode: str) -> None:
    """Draw the means of groups as bars, with error bars from minimum to maximum."""
    values = [np.array([run.values[name] for run in group.runs]) for group in groups]
    mean = np.array([v.mean() for v in values])
    ends = [[m - v.min(), v.max() - m] for m, v in zip(mean, values, strict=True)]
    span = np.maximum(ends, 0.0).T  # of equal runs the mean may differ by rounding
    several = any(len(v) > 1 for v in values)
    panel.bar(
        place,
        mean,
        _BAR,
        yerr=span if several else None,
        error_kw={"ecolor": INK, "elinewidth": 0.8},
        linewidth=0.7,
        label=plain(mode),
        **MODE_LOOK[mode],
    )


@styled()
def calibration_against_rate(runs: Sequence[Run], parameters: Sequence[str], title: str) -> Any:
    """Draw calibrated parameters less their mean against the table rate, with 1-sigma bars.

    parameters: biases (`bias_…`) in one panel, the elements of the matrix in another.
    """
    kinds = (
        ("bias, deg/h", [name for name in parameters if name.startswith("bias_")]),
        ("scale factor and\ninstallation, ppm", [n for n in parameters if n.startswith("K")]),
    )
    members = [(label, names) for label, names in kinds if names]
    fig, axes = panels(len(members), 2.1, title)
    rates = np.array([run.rate for run in runs])
    step = 0.012 * (np.ptp(rates) or 1.0)
    for panel, (label, names) in zip(axes, members, strict=True):
        unit = label.rsplit(" ", 1)[1]
        for k, name in enumerate(names):
            values = np.array([run.values[name] for run in runs], dtype=float)
            sigma = np.array([run.values[f"sigma {name}"] for run in runs], dtype=float)
            panel.errorbar(
                rates + (k - (len(names) - 1) / 2.0) * step,
                values - values.mean(),
                yerr=None if np.isnan(sigma).any() else sigma,
                **{**SERIES[k % len(SERIES)], "linestyle": "none"},
                label=plain(f"{name}, mean {values.mean():.1f} {unit}"),
            )
        panel.axhline(0.0, color=INK, linewidth=0.6)
        panel.set_ylabel(f"{label}\nless the mean")
        legend_above(panel, 1)
    axes[-1].set_xlabel("table rate, deg/s")
    return fig


@styled()
def allan_deviation(source: Source, title: str) -> "Figure":
    """Draw the Allan deviation of every axis of an `allan` result with its confidence limits."""
    sections = source.section("axes")
    by_unit: dict[tuple[str, str], list[str]] = {}
    for name in sections:
        unit = str(source.section("axes", name).get("unit", ""))
        by_unit.setdefault((name.rpartition("_")[0], unit), []).append(name)
    fig, axes = panels(max(1, len(by_unit)), 2.4, title)
    for panel, ((sensor, unit), names) in zip(axes, by_unit.items(), strict=False):
        for k, name in enumerate(names):
            members = source.section("axes", name)
            tau, deviation, lower, upper = (
                np.array(members.get(key) or [], dtype=float)
                for key in ("tau_s", "deviation", "lower", "upper")
            )
            look = SERIES[k % len(SERIES)]
            spaced = max(1, len(tau) // 8)
            panel.plot(tau, deviation, label=plain(name), markevery=spaced, **look)
            if len(lower) == len(upper) == len(tau):
                panel.fill_between(
                    tau, lower, upper, color=look["color"], alpha=0.18, linewidth=0.0
                )
        log_axes(panel, x=True)
        panel.set_ylabel(plain(f"{sensor or 'Allan'} deviation, {unit}"))
        legend_above(panel, 3)
    axes[-1].set_xlabel("cluster time, s")
    return fig


def navigation_figures(sources: Sequence[Source], *, published: bool = False) -> "list[Drawing]":
    """Return RMS against rate for each unit that was navigated at more than one rate.

    published: also each of the nine errors, as R16 figures 8, 9, 11 and 12 show them.
    """
    runs = navigation_runs(sources)
    groups = grouped(runs)
    figures: list[Drawing] = []
    for imu, axis in dict.fromkeys((g.imu, g.axis) for g in groups if g.mode != "conventional"):
        members = [g for mode in MODE_LOOK for g in groups_of_device(groups, imu, axis, mode)]
        if len({g.rate for g in members}) > 1:
            unit, still = device_label(imu, axis), conventional_runs(runs, imu)
            title = f"{unit}: RMS errors against the table rate"
            figures.append((title, partial(rms_against_rate, members, still, unit)))
            for kind, columns in ERRORS.items() if published else ():
                shown = [(name, label) for name, label, _ in columns]
                title = f"{unit}: RMS errors of {kind} against the table rate"
                figures.append((title, partial(rms_against_rate, members, still, unit, shown)))
    ratios = run_ratios(sources)
    if len(ratios) > 1:
        title = "Observed over expected horizontal position RMS"
        devices = list(dict.fromkeys(device_label(r.imu, r.axis) for r in ratios))
        for first in range(0, len(devices), UNITS_OF_A_FIGURE):
            chosen = devices[first : first + UNITS_OF_A_FIGURE]
            judged = [r for r in ratios if device_label(r.imu, r.axis) in chosen]
            names = f": {', '.join(chosen)}" if len(devices) > UNITS_OF_A_FIGURE else ""
            draw = partial(observed_over_expected, judged, title)
            figures.append((title + names, draw))
    return figures


@styled()
def observed_over_expected(ratios: Sequence[RunRatio], title: str) -> "Figure":
    """Draw the ratio of each run with the range of 999 of 1000 clean runs, a panel a device.

    Grey: from zero to the 99.9 % limit of each run; a short line is the median of clean runs.
    """
    devices = sorted({device_label(r.imu, r.axis) for r in ratios})
    rates = sorted({round(r.rate, 2) for r in ratios})
    fig, axes = panels(len(devices), 2.0, title)
    for panel, device in zip(axes, devices, strict=True):
        members = [r for r in ratios if device_label(r.imu, r.axis) == device]
        modes = [mode for mode in MODES if any(r.mode == mode for r in members)]
        for k, mode in enumerate(modes):
            runs = [r for r in members if r.mode == mode]
            place = np.array([rates.index(round(r.rate, 2)) for r in runs])
            place = place + (k - (len(modes) - 1) / 2.0) * 0.25
            bands = [r.band for r in runs]
            panel.vlines(place, 0.0, bands, colors="#e6e6e6", linewidth=_BAND_POINTS, zorder=0)
            medians = [run.median for run in runs]
            panel.hlines(medians, place - 0.1, place + 0.1, colors="#999999", linewidth=1.0)
            look = {**SERIES[k % len(SERIES)], "linestyle": "none"}
            panel.plot(place, [r.ratio for r in runs], label=plain(mode), **look)
        panel.axhline(1.0, color=INK, linewidth=0.6)
        panel.set_ylabel(f"{plain(device)}\nobserved / expected")
        panel.set_ylim(bottom=0.0)
        legend_above(panel, 3)
    rate_axis(axes, [_shown(rate) for rate in rates])
    axes[-1].set_xlabel("table rate, deg/s (grey: 999 of 1000 clean runs, line: median)")
    return fig


def calibration_figures(sources: Sequence[Source], *, published: bool = False) -> "list[Drawing]":
    """Return parameters against rate for each unit that was calibrated at more than one rate."""
    figures: list[Drawing] = []
    for names, runs in parameter_sets(calibration_runs(sources)).items():
        for imu, axis in dict.fromkeys((run.imu, run.axis) for run in runs):
            members = [run for run in runs if (run.imu, run.axis) == (imu, axis)]
            if len({run.rate for run in members}) > 1:
                title = f"{device_label(imu, axis)}: calibrated parameters against the table rate"
                draw = partial(calibration_against_rate, members, names, device_label(imu, axis))
                figures.append((title, draw))
    return figures


def allan_figures(sources: Sequence[Source]) -> "list[Drawing]":
    """Return the Allan deviation of each result."""
    ordered = sorted(sources, key=lambda s: (s.imu.casefold(), s.imu, s.path))
    return [
        (f"{source.imu}: Allan deviation", partial(allan_deviation, source, source.imu))
        for source in ordered
        if source.section("axes")
    ]
