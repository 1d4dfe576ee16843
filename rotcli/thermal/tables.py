"""Tables of thermal tests and warm-ups, from their documents."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli.files.results.groups import Source, device_label
from rotcli.files.tables import Cell, Column, Table
from rotcli.units import digits


def tables(doc: Mapping[str, Any], label: str = "") -> list[Table]:
    """Return summary, soaks, coefficients and heating against cooling; label: of the IMU."""
    T = doc["temperature"]
    title = f"Bias and scale factor over {T['low']:.1f} to {T['high']:.1f} degC"
    title += f", {label}" if label else ""
    found = [_summary(doc, title), _soaks(doc, title), _powers(doc, title)]
    found.append(_directions(doc, title))
    return [table for table in found if table is not None]


def thermal_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the tables of several documents, for a report."""
    return [t for s in sources for t in tables(s.doc, device_label(s.imu, "z"))]


def warm_up_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the tables of several warm-up documents, for a report."""
    return [warm_up_table(s.doc, device_label(s.imu, "z")) for s in sources]


def _summary(doc: Mapping[str, Any], title: str) -> Table:
    columns = (
        Column("sensor"),
        Column("order"),
        Column("RMS before", ".3g"),
        Column("RMS after", ".3g"),
        Column("left-out soaks", ".3g"),
        Column("chi2/n", ".2f"),
        Column("largest slope", ".3g"),
        Column("unit"),
        Column("chi2", ".1f"),
        Column("dof", "d"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, c in doc["channels"].items():
        order = "hats" if c["bias_order"] is None else f"{c['bias_order']}"
        order += "" if c["scale_order"] is None else f", {c['scale_order']}"
        left, test = c["left_out_soaks"], doc["goodness"][name]
        rows.append(
            (
                name,
                order,
                c["residual_before"]["rms"],
                c["residual_after"]["rms"],
                None if left is None else left["rms"],
                None if left is None else left["chi2_per_value"],
                c["sensitivity"]["largest"],
                c["residual_after"]["unit"],
                test["chi2"],
                test["dof"],
            )
        )
    note = (
        "Order: of the bias, of the scale factor. Left-out soaks: RMS of the errors on soaks that "
        "the fit does not contain; chi2/n is near 1 if the order is right. Largest slope: per degC."
    )
    return Table(title, columns, rows, note)


def _soaks(doc: Mapping[str, Any], title: str) -> Table:
    columns = (
        Column("sensor"),
        Column("T (degC)", ".1f"),
        Column("bias", ".6g"),
        Column("sigma", ".3g"),
        Column("sigma, own span", ".3g"),
        Column("unit"),
        Column("K (ppm)", ".1f"),
        Column("sigma", ".1f"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, c in doc["channels"].items():
        for soak in _thinned(c["soaks"]):
            bias, scale = soak["bias"], soak["scale"]
            rows.append(
                (
                    name,
                    soak["temperature_degC"],
                    bias["value"],
                    bias["sigma"],
                    soak["bias_own_span"]["sigma"],
                    bias["unit"],
                    None if scale is None else scale["value"],
                    None if scale is None else scale["sigma"],
                )
            )
    window = doc["horizon"]
    note = f"Biases and sigmas for the mean over {window['start_s']:g} to {window['end_s']:g} s."
    if any(row[-1] is not None for row in rows):
        note += (
            " K: k, reading over rate about the axis: scale factor error of the gyro along the "
            f"axis, installation error of the others. {doc.get('equation', '')}."
        )
    return Table(f"{title}: soaks", columns, rows, note)


_MAX_SOAKS = 6  # of a ramp there are more: the document contains all


def _thinned(soaks: Sequence[Any]) -> list[Any]:
    """Return at most 6 soaks, evenly chosen, the first and the last among them."""
    if len(soaks) <= _MAX_SOAKS:
        return list(soaks)
    return [soaks[round(k * (len(soaks) - 1) / (_MAX_SOAKS - 1))] for k in range(_MAX_SOAKS)]


def _powers(doc: Mapping[str, Any], title: str) -> Table | None:
    reference = doc["temperature"]["reference"]
    columns = (
        Column("sensor"),
        Column("of"),
        Column("n", "d"),
        Column("value", ".6g"),
        Column("sigma", ".3g"),
        Column("unit"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, c in doc["channels"].items():
        for of, entry in (c["powers"] or {}).items():
            for n, (value, sigma) in enumerate(zip(entry["value"], entry["sigma"], strict=True)):
                rows.append((name, of, n, value, sigma, entry["unit"]))
    if not rows:
        return None
    heading = f"{title}: coefficients of (T - {digits(reference)} degC)^n"
    return Table(heading, columns, rows)


def _directions(doc: Mapping[str, Any], title: str) -> Table | None:
    columns = (
        Column("sensor"),
        Column("p", ".2g"),
        Column("heating - cooling", ".3g"),
        Column("sigma", ".3g"),
        Column("unit"),
        Column("lag (s)", ".1f"),
        Column("sigma", ".1f"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, c in doc["channels"].items():
        d, lag = c["directions"], c["lag"]
        if d is None:
            continue
        rows.append(
            (
                name,
                d["p_value"],
                d["offset"]["value"],
                d["offset"]["sigma"],
                d["offset"]["unit"],
                None if lag is None else lag["value"],
                None if lag is None else lag["sigma"],
            )
        )
    if not rows:
        return None
    note = "Heating and cooling differ if p is below 0.01; else see the sigmas for the limits."
    return Table(f"{title}: heating against cooling", columns, rows, note)


def warm_up_table(doc: Mapping[str, Any], label: str = "") -> Table:
    """Return the table of a warm-up document."""
    columns = (
        Column("gyro"),
        Column("A (deg/h)", ".1f"),
        Column("sigma", ".1f"),
        Column("tau (s)", ".0f"),
        Column("sigma", ".0f"),
        Column("bias after (deg/h)", ".2f"),
        Column("sigma", ".2f"),
        Column("gain of chi2", ".1f"),
        Column("warm-up time (s)", ".0f"),
        Column("verdict"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, c in doc["channels"].items():
        if c is None:
            rows.append((name, *[None] * 8, "cannot be fitted"))
            continue
        rows.append(
            (
                name,
                c["amplitude"]["value"],
                c["amplitude"]["sigma"],
                c["time_constant"]["value"],
                c["time_constant"]["sigma"],
                c["bias_after"]["value"],
                c["bias_after"]["sigma"],
                c["gain_chi2"],
                c["warm_up_time_s"],
                "warm-up" if c["accepted"] else _REASONS[c["reasons"][0]],
            )
        )
    note = (
        f"Bias = c + A exp(-t/tau) after power-on. The bias stays within its limit after "
        f"{doc['warm_up_time_s']:.0f} s."
    )
    return Table("Warm-up" + (f", {label}" if label else ""), columns, rows, note)


_REASONS = {
    "gain": "not significant",
    "sigma": "time constant unknown",
    "record": "record too short",
}
