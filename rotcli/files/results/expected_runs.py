"""Expected RMS of planned runs, before any test: fields of a document, a table, two panels."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli import units
from rotcli.files.tables import Cell, Column, Table
from rotcli.lazy import lazily
from rotcli.models.expected.planned_runs import STILL, ExpectedRun, PlannedExpectation

with lazily():
    from rotcli.files import figures

_SAME_RATE = 1e-6  # deg/s
_EXPECTED_KEYS = {
    **dict.fromkeys(("latitude_m", "longitude_m", "height_m"), 1.0),
    **dict.fromkeys(("v_north_mps", "v_east_mps", "v_up_mps"), 1.0),
    **dict.fromkeys(("pitch_deg", "roll_deg", "azimuth_deg"), units.DEG),
    **dict.fromkeys(("horizontal_m", "horizontal_mps"), 1.0),
}


def expected_fields(result: PlannedExpectation) -> dict[str, Any]:
    """Return the expected RMS of the planned runs: m, m/s, deg; null where they do not hold."""
    return {
        "model": "still 60 s, turning 60 s at the same rate, then navigation (R16 section 4); "
        "conventional: still 60 s, then navigation",
        "duration_s": result.duration,
        "reason": result.reason or None,
        "runs": [_expected_run(run) for run in result.runs],
    }


def _expected_run(run: ExpectedRun) -> dict[str, Any]:
    """Return a planned run: its RMS, and the horizontal error against time."""
    unit = np.array(list(_EXPECTED_KEYS.values()))
    rms = [None] * len(unit) if run.rms is None else (run.rms / unit).tolist()
    fields: dict[str, Any] = {
        "axis": run.axis,
        "mode": run.mode,
        "rate_dps": run.rate / units.DEG,
        "rms": dict(zip(_EXPECTED_KEYS, rms, strict=True)),
        "largest_source": run.largest or None,
        "reason": run.reason or None,
    }
    if run.errors is not None and run.rms is not None and not np.isnan(run.rms[9]):
        size = np.hypot(run.errors.envelope[:, 0], run.errors.envelope[:, 1])
        fields |= {"time_s": run.errors.time, "horizontal_m": size}
    return fields


def expected_table(expected: Mapping[str, Any]) -> Table:
    """Return the expected RMS before any test; expected: what `expected_fields` returned."""
    rows: list[tuple[Cell, ...]] = []
    for run in expected["runs"]:
        rms, still = run["rms"], run["axis"] == STILL
        rows.append(
            (
                run["mode"],
                "-" if still else run["axis"],
                run["rate_dps"],
                rms["horizontal_m"],
                rms["horizontal_mps"],
                rms["height_m"],
                rms["pitch_deg"],
                rms["azimuth_deg"],
                run["largest_source"] or "-",
            )
        )
    reasons = [f"{_described(run)}: {run['reason']}." for run in expected["runs"] if run["reason"]]
    note = f"Run: {expected['model']}. RMS over the navigation that noise, calibration and "
    note += "the sensor errors left in imply; the median of horizontal position is 0.84 of it. "
    note += "Source: the largest part of the horizontal position."
    return Table(
        title=f"Expected RMS over {expected['duration_s']:g} s, before any test",
        columns=(
            Column("mode"),
            Column("axis"),
            Column("rate, deg/s", ".4g"),
            Column("position, m", ".1f"),
            Column("velocity, m/s", ".2f"),
            Column("height, m", ".1f"),
            Column("pitch, deg", ".3f"),
            Column("azimuth, deg", ".3f"),
            Column("source"),
        ),
        rows=rows,
        note=" ".join([note, *reasons]),
    )


def _described(run: Mapping[str, Any]) -> str:
    """Return mode, axis and rate of a run."""
    return f"{run['mode']} about {run['axis']} at {run['rate_dps']:.4g} deg/s"


def drawn_runs(expected: Mapping[str, Any] | None) -> list[Any]:
    """Return the runs of a document's expected RMS that have a horizontal error against time."""
    return [run for run in (expected or {}).get("runs", []) if "time_s" in run]


def draw_over_time(panel: Any, rate: float, runs: Sequence[Any]) -> None:
    """Draw the expected horizontal error (1 sigma and mean together) against time, one a mode.

    rate: deg/s, of the turning runs that are drawn; runs: of `drawn_runs`, the last axis is shown.
    """
    axis = runs[-1]["axis"]
    chosen = [run for run in runs if run["axis"] == STILL]
    chosen += [
        run for run in runs if run["axis"] == axis and abs(run["rate_dps"] - abs(rate)) < 1e-6
    ]
    for run, look in zip(chosen, (figures.VERMILLION, figures.BLUE, figures.GREEN), strict=False):
        name = run["mode"] if run["axis"] == STILL else f"{run['mode']}, about {axis}"
        style = {**look, "marker": None}
        panel.plot([0.0, *run["time_s"]], [0.0, *run["horizontal_m"]], label=name, **style)
    panel.set_xlabel("time, s")
    panel.set_ylabel("expected\nhorizontal error, m")
    panel.margins(x=0.0)
    panel.set_ylim(bottom=0.0)
    figures.legend_above(panel, 2)


def draw_over_rate(panel: Any, duration: float, runs: Sequence[Any]) -> None:
    """Draw the expected horizontal RMS over `duration` s against the rate, per axis and mode."""
    lines: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for run in runs:
        if run["axis"] != STILL:
            point = (run["rate_dps"], run["rms"]["horizontal_m"])
            lines.setdefault((run["mode"], run["axis"]), []).append(point)
    looks = [
        {**look, "linestyle": s}
        for s in ("--", "-")
        for look in (figures.VERMILLION, figures.BLUE, figures.GREEN)
    ]
    for ((mode, axis), points), look in zip(lines.items(), _by_axis(lines, looks), strict=True):
        panel.plot(*zip(*sorted(points), strict=True), label=f"{mode}, {axis}", **look)
    panel.set_xlabel("table rate, deg/s")
    panel.set_ylabel(f"expected horizontal\nRMS over {duration:g} s, m")
    figures.log_axes(panel)
    figures.legend_above(panel, 3)


def _by_axis(lines: Mapping[tuple[str, str], Any], looks: Sequence[Any]) -> list[Any]:
    """Return a look for each line: one colour an axis, dashed for partial."""
    axes = list(dict.fromkeys(axis for _, axis in lines))
    return [looks[3 * (mode == "full") + axes.index(axis) % 3] for mode, axis in lines]
