"""Expected RMS of planned runs as fields of the budget's document and as a table."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rotcli import units
from rotcli.budget.estimate import STILL
from rotcli.budget.expected import BudgetExpectation, ExpectedRun
from rotcli.files.tables import Cell, Column, Table

_EXPECTED_KEYS = {
    **dict.fromkeys(("latitude_m", "longitude_m", "height_m"), 1.0),
    **dict.fromkeys(("v_north_mps", "v_east_mps", "v_up_mps"), 1.0),
    **dict.fromkeys(("pitch_deg", "roll_deg", "azimuth_deg"), units.DEG),
    **dict.fromkeys(("horizontal_m", "horizontal_mps"), 1.0),
}


def expected_fields(result: BudgetExpectation) -> dict[str, Any]:
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
    rms = np.full(len(unit), np.nan) if run.rms is None else run.rms / unit
    fields: dict[str, Any] = {
        "axis": run.axis,
        "mode": run.mode,
        "rate_dps": run.rate / units.DEG,
        "rms": dict(zip(_EXPECTED_KEYS, rms.tolist(), strict=True)),
        "largest_source": run.largest or None,
        "reason": run.reason or None,
    }
    if run.errors is not None and run.rms is not None and not np.isnan(run.rms[9]):
        size = np.hypot(run.errors.envelope[:, 0], run.errors.envelope[:, 1])
        fields |= {"time_s": run.errors.time, "horizontal_m": size}
    return fields


def expected_table(doc: Mapping[str, Any]) -> Table:
    """Return the expected RMS before any test."""
    expected = doc["expected"]
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
    reasons = list(dict.fromkeys(run["reason"] for run in expected["runs"] if run["reason"]))
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
        note=" ".join([note, *(f"{reason[:1].upper()}{reason[1:]}." for reason in reasons)]),
    )
