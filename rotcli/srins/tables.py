"""Tables of a long-run SRINS calibration: estimates, convergence, time series, claims."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli import units
from rotcli.files.results.groups import Source
from rotcli.files.tables import Column, Table
from rotcli.srins.claims import claims_table
from rotcli.srins.model import STATES


def table(doc: Mapping[str, Any]) -> Table:
    """Return the estimates of a document as a readable table."""
    truth = doc.get("truth") or {}
    unreliable = doc.get("unreliable") or {}
    rows = [
        (
            name,
            q["value"],
            q["sigma"],
            truth.get(name),
            doc["degrees"][name],
            q["unit"],
            f"no: {unreliable[name]}" if name in unreliable else "yes",
        )
        for name, q in doc["estimates"].items()
    ]
    hours = (doc["filter"]["end_s"] - doc["filter"]["start_s"]) / units.HOUR
    return Table(
        title=f"SRINS calibration, {doc['mode']}, {hours:.4g} h",
        columns=(
            Column("error"),
            Column("estimate", ".6f"),
            Column("sigma", ".6f"),
            Column("true", ".6f"),
            Column("degree", ".4f"),
            Column("unit"),
            Column("use"),
        ),
        rows=rows,
        note=" ".join(sentences(doc)),
    )


def sentences(doc: Mapping[str, Any]) -> list[str]:
    """Return the convergence, the expected errors and the consistency as sentences."""
    convergence = doc["convergence"]
    drift = convergence["stated_drift_dph"]
    reached = ", ".join(
        f"{fraction:.0%} " + ("not reached" if hours is None else f"after {hours:.2f} h")
        for fraction, hours in zip(convergence["fractions"], convergence["hours"], strict=True)
    )
    bias = doc["expected_bias"]
    gnss = doc["consistency"]["gnss"]
    verdict = "consistent" if gnss["sound"] else "not consistent"
    level = (doc.get("expected_bias_y") or {}).get("value") or 0.0
    also = f" and up to {level:.2e} deg/h in gyro_bias_y" if level else ""
    return [
        f"Sigma of gyro_bias_z against a drift of {drift:g} deg/h: {reached}.",
        f"Uncalibrated {bias['scale_ppm']:g} ppm and {bias['installation_arcsec']:g} arcsec cause "
        f"an error of up to {bias['value']:.2e} deg/h in gyro_bias_z "
        f"({bias['value'] / drift:.0%} of that drift){also}, which sigma does not contain.",
        f"GNSS innovations: {gnss['nis_over_expected']:.3f} of the expected mean square (95 % band "
        f"{gnss['lower']:.3f} to {gnss['upper']:.3f}): {verdict}.",
    ]


def _label(source: Source) -> str:
    states = "measured" if source.doc.get("measured_damping_states") else "estimated"
    return f"{source.path} ({source.doc['mode']}, damping states {states})"


def srins_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the report's tables: the estimates at the end, and the axial drift against time."""
    made = [_final(sources), *(_against_time(source) for source in sources)]
    return [*made, claims_table(sources)]


def _final(sources: Sequence[Source]) -> Table:
    rows = []
    for source in sources:
        for name in STATES[7:10]:
            q = source.doc["estimates"][name]
            true = (source.doc.get("truth") or {}).get(name)
            rows.append((_label(source), name, q["value"], q["sigma"], true))
    return Table(
        "SRINS: gyro drifts at the end, deg/h",
        (
            Column("result"),
            Column("drift"),
            Column("estimate", ".6f"),
            Column("sigma", ".6f"),
            Column("true", ".6f"),
        ),
        rows,
        " ".join(sentences(sources[0].doc)[:2]),
    )


def _against_time(source: Source) -> Table:
    history = source.doc["history"]
    time = np.array(history["time_h"])
    names = STATES[7:12]
    rows = []
    for hour in range(1, int(time[-1] + 0.01) + 1):
        k = int(np.argmin(np.abs(time - hour)))
        cells = [history[name][key][k] for name in names for key in ("estimate", "sigma")]
        scale = [1e3, 1e3] * 3 + [1.0 / units.UNITS["acceleration"]["ug"]] * 4
        rows.append((float(time[k]), *(c * s for c, s in zip(cells, scale, strict=True))))
    columns = [Column("h", ".2f")]
    for name in names:
        columns += [Column(name, ".3f"), Column("sigma", ".3f")]
    return Table(
        f"SRINS: estimates against time, {_label(source)}",
        tuple(columns),
        rows,
        "Gyro drifts in 1e-3 deg/h, accelerometer biases in ug.",
    )
