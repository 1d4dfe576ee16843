"""Tables of a long-run SRINS calibration: estimates, convergence, time series, claims."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli import units
from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Estimate, Table, drop_empty_columns
from rotcli.files.tables.model import BY_SIGMA
from rotcli.srins.claims import claims_table
from rotcli.srins.model import GYRO_BIAS, STATES


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


def srins_tables(sources: Sequence[Source], *, published: bool = False) -> list[Table]:
    """Return the report's tables: the drifts at the end, every estimate against time.

    published: also the claims of the paper, judged by these results.
    """
    made = [_final(sources), *(_against_time(source) for source in sources)]
    return [*made, *([claims_table(sources)] if published else [])]


def _final(sources: Sequence[Source]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    origins = []
    for source in sources:
        for name in STATES[GYRO_BIAS]:
            q = source.doc["estimates"][name]
            true = (source.doc.get("truth") or {}).get(name)
            estimate = Estimate(q["value"], q["sigma"])
            rows.append((_label(source), name, estimate, true))
            origins.append((source.path,))
    return drop_empty_columns(
        "SRINS: gyro drifts at the end",
        (
            Column("result"),
            Column("drift"),
            Column("estimate, deg/h", ".6f"),
            Column("true, deg/h", ".6f"),
        ),
        rows,
        " ".join(sentences(sources[0].doc)[:2]),
        origins,
    )


def _against_time(source: Source) -> Table:
    history = source.doc["history"]
    time = np.array(history["time_h"])
    in_ug = 1.0 / units.UNITS["acceleration"]["ug"]
    shown = [(f"gyro_bias_{a}", f"drift {a}, 1e-3 deg/h", 1e3) for a in "xyz"]
    shown += [(f"accel_bias_{a}", f"accel bias {a}, ug", in_ug) for a in "xy"]
    rows: list[tuple[Cell, ...]] = []
    for hour in range(1, int(time[-1] + 0.01) + 1):
        k = int(np.argmin(np.abs(time - hour)))
        cells = [
            Estimate(scale * history[name]["estimate"][k], scale * history[name]["sigma"][k])
            for name, _, scale in shown
        ]
        rows.append((float(time[k]), *cells))
    columns = [Column("time, h", ".3g"), *(Column(head, BY_SIGMA) for _, head, _ in shown)]
    title = f"SRINS: estimates against time, {_label(source)}"
    return Table(title, tuple(columns), rows, "", [(source.path,)] * len(rows))
