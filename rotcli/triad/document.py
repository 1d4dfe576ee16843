"""A full calibration as a result document and as tables."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli.files.results.documents import quantity
from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Table
from rotcli.models.triad.correction import EQUATION
from rotcli.run.findings import texts
from rotcli.triad.result import NULL, PRIOR, WHITE_NOISE, TriadResult
from rotcli.units import digits

MODEL = "triad"
MAX_POINTS = 400  # of a figure
_METHODS = {
    "table": "on a table",
    "hand-held": "by hand, without a table",
    "merged": "merged from single-axis calibrations",
}
USE = (
    "To correct a reading: subtract the accelerometer bias, undo the second-order term and the "
    "asymmetry of each axis, multiply by (I + M)^-1: this is f. Then subtract the gyro bias and "
    "G f from the gyro reading, undo the asymmetry, multiply by (I + N)^-1: this is w. Rows of a "
    "matrix belong to sensor axes: Kgxy is the part of the rate about y that gyro x reads"
)


def fields(result: TriadResult) -> dict[str, Any]:
    """Return the document's fields."""
    known = result.known
    return {
        "model": MODEL,
        "method": result.method,
        "convention": result.convention,
        "equation": EQUATION,
        "parameters": {e.name: quantity_of(e) for e in result.estimates},
        "covariance": {
            "order": [e.name for e in known],
            "units": [e.unit for e in known],
            "matrix": result.covariance,
        },
        **_horizon(result),
        "null_directions": result.null_directions,
        "rank": result.rank,
        "goodness": {
            "chi2": result.chi2,
            "dof": result.dof,
            "sigma_factor": result.scale,
            "noise_model": result.noise_model,
            "kinds": [
                {"kind": k.kind, "blocks": k.blocks, "gyro": k.gyro, "accel": k.accel}
                for k in result.kinds
            ],
        },
        "details": result.details,
        "residuals": residual_fields(result),
        "findings": [f.to_dict() for f in result.findings],
        "warnings": texts(result.findings),
    }


def _horizon(result: TriadResult) -> dict[str, Any]:
    """Return the time whose mean bias the biases are: that of the log's blocks or poses."""
    span = result.span
    return {} if span is None else {"horizon": {"start_s": span[0], "end_s": span[1]}}


def residual_fields(result: TriadResult) -> dict[str, Any]:
    """Return sizes of residuals before and after, thinned for figures; empty without series."""
    series = result.series
    if not series:
        return {}
    count = len(series["time [s]"])
    at = np.unique(np.linspace(0, count - 1, min(count, MAX_POINTS)).astype(np.int64))
    if result.method == "hand-held":
        sizes = {
            "gravity_before": series["force_before [m/s^2]"],
            "gravity_after": series["force_after [m/s^2]"],
            "carried_before": series["carried_before [deg]"],
            "carried_after": series["carried_after [deg]"],
        }
    else:
        sizes = {
            f"{name}_{when}": np.sqrt(
                sum(series[f"{triad}_{a}_{when} [{unit}]"] ** 2 for a in "xyz")
            )
            for name, triad, unit in (("force", "accel", "m/s^2"), ("rate", "gyro", "deg/s"))
            for when in ("before", "after")
        }
    thinned = {"time_s": series["time [s]"][at], **{k: values[at] for k, values in sizes.items()}}
    still = np.flatnonzero(np.isfinite(series.get("gravity_after [m/s^2]", np.zeros(0))))
    if len(still):
        part = still[np.unique(np.linspace(0, len(still) - 1, MAX_POINTS).astype(np.int64))]
        thinned["still_time_s"] = series["time [s]"][part]
        for when in ("before", "after"):
            thinned[f"gravity_{when}"] = series[f"gravity_{when} [m/s^2]"][part]
    # Nine digits of times and six of residuals suffice for a figure.
    return {
        name: [float(f"{v:.{9 if 'time' in name else 6}g}") for v in values]
        for name, values in thinned.items()
    }


def quantity_of(estimate: Any) -> dict[str, Any]:
    """Return a parameter as the document has it; status and reason where it is not estimated."""
    entry = quantity(estimate.value, estimate.sigma, estimate.unit)
    if estimate.reason:
        entry |= {"status": estimate.status, "reason": estimate.reason}
    return entry


def headline(doc: Mapping[str, Any]) -> str:
    """Return the result in one line."""
    sigma = {
        unit: max(
            (
                p["sigma"]
                for name, p in doc["parameters"].items()
                if p["value"] is not None and p["unit"] == unit and name.startswith(start)
                and p.get("status") != PRIOR
            ),
            default=None,
        )
        for unit, start in (("ppm", "Kg"), ("deg/h", "bias_"))
    }  # fmt: skip
    parts = [f"{digits(v, 2)} {u}" for u, v in sigma.items() if v is not None]
    null = sum(p["value"] is None for p in doc["parameters"].values())
    lacks = f", {null} parameters not observable" if null else ""
    return (
        f"calibration {_METHODS[doc['method']]}, {doc['convention']} convention: gyro matrix and "
        f"biases to {', '.join(parts) or 'nothing'}{lacks}"
    )


def parameter_table(doc: Mapping[str, Any]) -> Table:
    """Return the parameters with their sigmas."""
    rows: list[tuple[Cell, ...]] = [
        (
            name,
            _rounded(p["value"], p["sigma"]),
            _rounded(p["sigma"], p["sigma"]),
            p["unit"],
            _status(p),
        )
        for name, p in doc["parameters"].items()
    ]
    columns = (
        Column("parameter"), Column("value", ".9g"), Column("sigma", ".3g"), Column("unit"),
        Column("remark"),
    )  # fmt: skip
    title = f"Calibration {_METHODS[doc['method']]}, {doc['convention']} convention"
    return Table(title, columns, rows, f"{doc['equation']}. {USE}.{_bias_note(doc)}")


def _bias_note(doc: Mapping[str, Any]) -> str:
    """Return which time the biases belong to, empty where it is unknown."""
    if "horizon" not in doc:
        return ""
    start, end = doc["horizon"]["start_s"], doc["horizon"]["end_s"]
    return (
        f" Biases are means over {start:.6g} to {end:.6g} s of the log; the bias of a later run "
        "differs by the bias instability."
    )


def _rounded(value: float | None, sigma: float | None) -> float | None:
    """Return a value with the digits that its sigma supports: two digits of the sigma."""
    if value is None or not sigma:
        return value
    places = 1 - math.floor(math.log10(abs(sigma)))
    return round(value, places) + 0.0  # no minus before zero


def _status(entry: Mapping[str, Any]) -> str:
    if entry.get("status") == NULL:
        return "not observable" if "exceeds" in entry["reason"] else str(entry["reason"])
    return str(entry.get("reason", ""))


def residual_table(doc: Mapping[str, Any]) -> Table | None:
    """Return the goodness by kind of block, None where there are no blocks."""
    kinds = doc["goodness"]["kinds"]
    if not kinds:
        return None
    rows = [(k["kind"], k["blocks"], k["gyro"], k["accel"]) for k in kinds]
    columns = (
        Column("blocks"), Column("count", "d"), Column("gyro chi2", ".3f"),
        Column("accel chi2", ".3f"),
    )  # fmt: skip
    note = (
        "Chi-squared per reading; it is 1 on average for residuals of the noise model "
        f"({doc['goodness']['noise_model']}). Large in turns: clock, levers or axes "
        "that do not meet. Large in still blocks: drift or temperature. Large in ramps alone: "
        f"encoder lag.{_enlarged(doc)}{_white_alone(doc)}"
    )
    return Table("Residuals by kind of block", columns, rows, note)


def _white_alone(doc: Mapping[str, Any]) -> str:
    """Return that the sigmas lack the slow noise, empty where the rig describes it."""
    if doc["goodness"]["noise_model"] != WHITE_NOISE:
        return ""
    return (
        " The sigmas contain white noise alone; those of a MEMS IMU are too small by 1.2 to 3.9. "
        "Set bias_instability and rate_random_walk in [imu]; allan measures them."
    )


def _enlarged(doc: Mapping[str, Any]) -> str:
    """Return by how much the noise of each triad was enlarged, empty where it was not."""
    factors = [doc["details"].get(f"noise_factor_{triad}", 1.0) for triad in ("gyro", "accel")]
    if max(factors) <= 1.0:
        return ""
    return (
        f" The noise of the gyros is multiplied by {factors[0]:.3g}, of the accelerometers by "
        f"{factors[1]:.3g}, so that chi-squared is 1 on average."
    )


def direction_table(doc: Mapping[str, Any]) -> Table | None:
    """Return the directions that the data do not show, None where there are none."""
    rows = [(str(k + 1), d["text"]) for k, d in enumerate(doc["null_directions"])]
    if not rows:
        return None
    return Table("Directions that the data do not show", (Column("no."), Column("direction")), rows)


def handheld_table(doc: Mapping[str, Any]) -> Table | None:
    """Return the figures of a hand-held calibration, None for others."""
    d = doc["details"]
    if doc["method"] != "hand-held":
        return None
    rows: list[tuple[Cell, ...]] = [
        ("|f| - g, RMS of the poses (m/s^2)", d["force_rms_before"], d["force_rms_after"]),
        (
            "gravity through a move, RMS (deg)",
            d["carried_rms_before_deg"],
            d["carried_rms_fitted_deg"],
        ),
        ("the same, moves left out of the fit (deg)", None, d["carried_rms_held_out_deg"]),
    ]
    columns = (Column("residual"), Column("before", ".4g"), Column("after", ".4g"))
    note = f"{d['poses']} still poses, longest move {d['longest_move_s']:.3g} s."
    return Table("Residuals of poses and moves", columns, rows, note)


def tables(doc: Mapping[str, Any]) -> list[Table]:
    """Return all tables of a document."""
    found = (parameter_table(doc), residual_table(doc), handheld_table(doc), direction_table(doc))
    return [table for table in found if table is not None]


def triad_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the tables of several documents for a report."""
    found = []
    for source in sources:
        for table in tables(source.doc):
            title = f"{source.imu}: {table.title}" if len(sources) > 1 else table.title
            found.append(Table(title, table.columns, table.rows, table.note))
    return found
