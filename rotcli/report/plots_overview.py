"""Figures that show all units of a large report at once, in place of one figure for each unit."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rotcli.calibrate.campaign import calibration_runs, parameter_sets
from rotcli.files.figures import INK, MANY, legend_above, log_axes, panels, plain, styled
from rotcli.files.results.groups import Group, Run, Source, device_label, grouped
from rotcli.navigate.campaign.ratios import run_ratios
from rotcli.navigate.campaign.tables import conventional_runs, groups_of_device, navigation_runs
from rotcli.report.plots_campaign import (
    MODE_LOOK,
    UNITS_OF_A_FIGURE,
    draw_rms,
    observed_over_expected,
    rate_axis,
    rates_of,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.figures import Drawing

    Unit = tuple[str, str]  # name, axis

_LOOKS = (*MANY, {"color": INK, "marker": "x"})  # of the six parameters of a calibration


def navigation_overview(sources: Sequence[Source]) -> "list[Drawing]":
    """Return the position RMS against rate and observed over expected, a panel for each unit."""
    runs = navigation_runs(sources)
    groups = [group for group in grouped(runs) if group.mode in MODE_LOOK]
    ratios = run_ratios(sources)
    return [
        *_drawings(
            "Horizontal position RMS against the table rate",
            _with_several_rates(groups),
            lambda units: position_of_units(groups, runs, units),
        ),
        *_drawings(
            "Observed over expected horizontal position RMS",
            list(dict.fromkeys((ratio.imu, ratio.axis) for ratio in ratios)),
            lambda units: observed_over_expected(
                [ratio for ratio in ratios if (ratio.imu, ratio.axis) in units], ""
            ),
        ),
    ]


def calibration_overview(sources: Sequence[Source]) -> "list[Drawing]":
    """Return the calibrated parameters against rate in sigma, a panel for each unit."""
    drawings: list[Drawing] = []
    for names, runs in parameter_sets(calibration_runs(sources)).items():
        drawings += _drawings(
            "Calibrated parameters less their mean, in sigma, against the table rate",
            _with_several_rates(runs),
            partial(parameters_of_units, runs, names),
        )
    return drawings


def allan_overview(sources: Sequence[Source]) -> "list[Drawing]":
    """Return the Allan deviations of several units in one figure, a colour for each unit."""
    members = [source for source in sources if source.section("axes")]
    units = sorted({source.imu for source in members}, key=lambda name: (name.casefold(), name))
    return _drawings(
        "Allan deviation", [(unit, "z") for unit in units], partial(allan_of_units, members)
    )


def _with_several_rates(members: Sequence[Group] | Sequence[Run]) -> "list[Unit]":
    """Return the units that were measured at more than one rate."""
    rates: dict[Unit, set[float | None]] = {}
    for member in members:
        rates.setdefault((member.imu, member.axis), set()).add(member.rate)
    return [unit for unit, found in rates.items() if len(found) > 1]


def _drawings(
    title: str, units: "Sequence[Unit]", draw: "Callable[[Sequence[Unit]], Figure]"
) -> "list[Drawing]":
    """Return the figures of units, a few units in each."""
    size = UNITS_OF_A_FIGURE
    parts = [units[k : k + size] for k in range(0, len(units), size)]
    return [
        (f"{title}: {', '.join(device_label(*unit) for unit in part)}", partial(draw, part))
        for part in parts
    ]


@styled()
def position_of_units(
    groups: Sequence[Group], runs: Sequence[Run], units: "Sequence[Unit]"
) -> "Figure":
    """Draw the horizontal position RMS of each unit (name, axis) against rate, m.

    groups: partial and full navigation. runs: all navigation runs, for the conventional level.
    """
    fig, axes = panels(len(units), 1.75, "", share=False)
    for panel, (imu, axis) in zip(axes, units, strict=True):
        members = [g for mode in MODE_LOOK for g in groups_of_device(groups, imu, axis, mode)]
        rates = rates_of(members)
        draw_rms(panel, members, rates, conventional_runs(runs, imu), "horizontal_m")
        panel.set_ylabel(f"{plain(device_label(imu, axis))}\nposition, m")
        rate_axis([panel], rates)
    legend_above(axes[0], 2)
    axes[-1].set_xlabel("table rate, deg/s")
    return fig


@styled()
def parameters_of_units(
    runs: Sequence[Run], names: Sequence[str], units: "Sequence[Unit]"
) -> "Figure":
    """Draw each parameter less its mean over the runs of a unit, divided by its own sigma."""
    fig, axes = panels(len(units), 1.75, "")
    for panel, unit in zip(axes, units, strict=True):
        members = [run for run in runs if (run.imu, run.axis) == unit]
        rates = np.array([run.rate for run in members])
        step = 0.012 * float(np.ptp(rates))
        for k, name in enumerate(names):
            values = np.array([run.values[name] for run in members], dtype=float)
            sigma = np.array([run.values[f"sigma {name}"] for run in members], dtype=float)
            sigma[sigma <= 0.0] = np.nan
            place = rates + (k - (len(names) - 1) / 2.0) * step
            look = {**_LOOKS[k % len(_LOOKS)], "linestyle": "none"}
            panel.plot(place, (values - values.mean()) / sigma, label=plain(name), **look)
        panel.axhline(0.0, color=INK, linewidth=0.6)
        panel.set_ylabel(f"{plain(device_label(*unit))}\nsigma")
    legend_above(axes[0], 3)
    axes[-1].set_xlabel("table rate, deg/s")
    return fig


@styled()
def allan_of_units(sources: Sequence[Source], units: "Sequence[Unit]") -> "Figure":
    """Draw the Allan deviation of all axes of units, a panel for each kind of sensor."""
    names = [name for name, _ in units]
    curves: dict[tuple[str, str], list[tuple[str, list[float], list[float]]]] = {}
    for source in sources:
        for name in source.section("axes") if source.imu in names else ():
            axis = source.section("axes", name)
            key = name.rpartition("_")[0], str(axis.get("unit", ""))
            curve = source.imu, list(axis.get("tau_s") or []), list(axis.get("deviation") or [])
            curves.setdefault(key, []).append(curve)
    fig, axes = panels(len(curves), 2.4, "")
    for panel, ((sensor, unit), members) in zip(axes, curves.items(), strict=True):
        for imu, look in zip(names, MANY, strict=False):
            for k, (_, tau, deviation) in enumerate(c for c in members if c[0] == imu):
                style = {"color": look["color"], "linestyle": look["linestyle"], "linewidth": 1.0}
                panel.plot(tau, deviation, label=plain(imu) if k == 0 else None, **style)
        log_axes(panel, x=True)
        panel.set_ylabel(plain(f"{sensor or 'Allan'} deviation, {unit}"))
    legend_above(axes[0], 3)
    axes[-1].set_xlabel("cluster time, s (a line for each axis and log)")
    return fig
