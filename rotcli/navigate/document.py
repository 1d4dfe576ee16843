"""A navigated window as a result document, as a table and as a time series."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files.results.documents import quantity
from rotcli.files.tables import Column, Table
from rotcli.lazy import lazily
from rotcli.units import DEG, FloatArray

with lazily():
    from rotcli.navigate import expected as expectations


if TYPE_CHECKING:  # a report reads results only: the stage need not be imported
    from rotcli.models.expected.companions import BlockResiduals
    from rotcli.navigate.assess import Assessment
    from rotcli.navigate.estimate import Navigation, Summary
    from rotcli.rig.rig import Rig


KIND = "navigation"
# JSON key of each error, in the order of rotcli.navigate.estimate.ERROR_NAMES, and its unit.
KEYS = {
    "latitude_m": 1.0,
    "longitude_m": 1.0,
    "height_m": 1.0,
    "v_north_mps": 1.0,
    "v_east_mps": 1.0,
    "v_up_mps": 1.0,
    "pitch_deg": DEG,
    "roll_deg": DEG,
    "azimuth_deg": DEG,
}
# Columns of a solution that hold the errors, in the order of KEYS.
_ERROR_COLUMNS = (
    "err_north [m]",
    "err_east [m]",
    "err_up [m]",
    "err_v_north [m/s]",
    "err_v_east [m/s]",
    "err_v_up [m/s]",
    "err_pitch [deg]",
    "err_roll [deg]",
    "err_azimuth [deg]",
)
RMS_KEYS = {**KEYS, "horizontal_m": 1.0, "horizontal_mps": 1.0}


_HEADS: dict[str, tuple[str, str]] = {
    "rms": ("RMS", ".3f"),
    "expected": ("expected", ".3f"),
    "q999": ("99.9 %", ".3f"),
    "ratio": ("ratio", ".2f"),
    "p": ("p", ".2g"),
    "final": ("final", ".3f"),
    "max": ("max", ".3f"),
}
_MEANING = (
    "expected: RMS that noise figures, calibration and motion imply; 99.9 %: 999 of 1000 clean "
    "runs lie below it; p: chance of a larger RMS."
)


def fields(result: "Summary") -> dict[str, Any]:
    """Return the document's own fields: errors in m, m/s and deg."""
    start, end = (float(t) for t in result.time)
    return {
        "mode": result.mode,
        "rate": quantity(result.rate / DEG, None, "deg/s"),
        "duration_s": end - start,
        "window": {"start_s": start, "end_s": end},
        "rms": _figures(result.rms),
        "final": _figures(result.final),
        "max": _figures(result.max),
    }


def assessment_fields(result: "Assessment", rig: "Rig") -> dict[str, Any]:
    """Return the fields of an assessment: expected errors, their tests, and what they rest on."""
    found, mean = result.expectation, result.expectation.tests.gyro_mean
    level = found.tests.level
    sigma = [None] * 3 if mean is None else (mean.sigma / DEG).tolist()
    values = result.residuals.mean_gyro / DEG
    return {
        "mean_after": {
            axis: quantity(float(value), s, "deg/s")
            for axis, value, s in zip("xyz", values, sigma, strict=True)
        },
        "expected": _expected(result),
        "expected_reason": found.reason or None,
        "p_run": result.verdict.p_run,
        "mean_p_value": None if mean is None else mean.p_value,
        "residual_1s": {
            kind: None if blocks is None else _blocks(blocks)
            for kind, blocks in (
                ("gyro", found.tests.gyro_blocks),
                ("accel", found.tests.accel_blocks),
            )
        },
        "level": None
        if level is None
        else {
            "pitch": quantity(level.pitch / DEG, level.sigma / DEG, "deg"),
            "roll": quantity(level.roll / DEG, level.sigma / DEG, "deg"),
        },
        "basis": None if found.errors is None else _basis(result, rig),
    }


def _expected(result: "Assessment") -> dict[str, Any] | None:
    """Return the expected figures of each error; null where the propagation does not hold."""
    statistics, verdict = result.expectation.statistics, result.verdict
    if statistics is None:
        return None
    fields: dict[str, Any] = {}
    for k, (key, unit) in enumerate(RMS_KEYS.items()):
        valid = bool(statistics.valid[k])
        fields[key] = {
            "rms": float(statistics.rms[k]) / unit if valid else None,
            "median": float(statistics.median[k]) / unit if valid else None,
            "ratio": float(verdict.ratio[k]) if valid else None,
            "p_value": float(verdict.p_values[k]),
            "q999": float(statistics.q999[k]) / unit if valid else None,
            "reason": statistics.reasons[k] or None,
        }
    return fields


def _blocks(blocks: "BlockResiduals") -> dict[str, Any]:
    """Return the whitened block residuals of a triad."""
    return {
        "length_s": blocks.length,
        "max": blocks.maximum,
        "at_s": blocks.at,
        "axis": "xyz"[blocks.axis],
        "p_value": blocks.p_value,
        "chi2_per_dof": dict(zip("xyz", blocks.chi2_per_dof.tolist(), strict=True)),
        "disturbed_s": list(blocks.disturbed),
    }


def _basis(result: "Assessment", rig: "Rig") -> dict[str, Any]:
    """Return what an expectation rests on, and the source that dominates each error."""
    basis, errors = result.expectation.basis, result.expectation.errors
    if errors is None:
        return {}
    names = list(errors.parts)
    sizes = np.stack([errors.parts[name] for name in names])
    return {
        "noise": expectations.describe_noise(rig),
        "segments": [{"start_s": a, "end_s": b} for a, b in basis.segments],
        "accel_bias": basis.accel_bias,
        "attitude_sigma_deg": expectations.in_degrees(basis.attitude_sigma),
        "nominal_tilt_deg": errors.tilt / DEG,
        "incomplete": basis.incomplete or None,
        "dominating": {key: names[int(np.argmax(sizes[:, k]))] for k, key in enumerate(KEYS)},
    }


def _figures(errors: FloatArray) -> dict[str, float]:
    return {key: float(e) / unit for (key, unit), e in zip(RMS_KEYS.items(), errors, strict=True)}


def tables(docs: Sequence[Mapping[str, Any]]) -> list[Table]:
    """Return the errors of navigation documents, a table each: RMS next to what it should be.

    The meaning of the columns is explained once, below the last table.
    """
    notes = [_notes(doc) for doc in docs]
    if any(doc.get("expected") for doc in docs):
        notes[-1] = [*notes[-1], _MEANING]
    return [_table(doc, " ".join(note)) for doc, note in zip(docs, notes, strict=True)]


def _table(doc: Mapping[str, Any], note: str) -> Table:
    """Return the errors of one document: RMS, expected RMS and its limit, ratio, p, final, max."""
    parts = tuple(_HEADS) if doc.get("expected") else ("rms", "final", "max")
    return Table(
        title=f"Navigation errors, {doc['mode']}, {summary(doc)}",
        columns=(Column("error"), *(Column(*_HEADS[part]) for part in parts)),
        rows=_rows([doc], parts),
        note=note,
    )


def side_by_side(docs: Sequence[Mapping[str, Any]]) -> Table:
    """Return RMS and expected RMS of several modes of one log, two columns a mode."""
    expected = any(doc.get("expected") for doc in docs)
    parts = ("rms", "expected") if expected else ("rms", "final", "max")
    columns = [Column("error")]
    for doc in docs:
        columns += [Column(f"{doc['mode']} {_HEADS[part][0]}", _HEADS[part][1]) for part in parts]
    return Table(
        title=f"Navigation errors over {summary(docs[0])}",
        columns=tuple(columns),
        rows=_rows(docs, parts),
        note=_MEANING if expected else "",
    )


def _rows(docs: Sequence[Mapping[str, Any]], parts: Sequence[str]) -> list[tuple[Any, ...]]:
    """Return a row for each error."""
    rows: list[tuple[Any, ...]] = []
    for name in RMS_KEYS:
        error, unit = name.rsplit("_", 1)
        shown = f"{error.replace('_', ' ')}, {'m/s' if unit == 'mps' else unit}"
        rows.append((shown, *(_cell(doc, part, name) for doc in docs for part in parts)))
    return rows


def _cell(doc: Mapping[str, Any], part: str, name: str) -> float | None:
    """Return a cell of the table of errors."""
    if part in ("rms", "final", "max"):
        return float(doc[part][name])
    expected = (doc.get("expected") or {}).get(name) or {}
    value = expected.get({"expected": "rms", "p": "p_value"}.get(part, part))
    return None if value is None else float(value)


def _notes(doc: Mapping[str, Any]) -> list[str]:
    """Return what a reader must know of the expected figures of a document."""
    if doc.get("expected_reason"):
        return [
            f"No expected errors: {doc['expected_reason']}. `rotcli allan` measures the noise "
            "figures."
            if str(doc["expected_reason"]).startswith("[imu] lacks")
            else f"No expected errors: {doc['expected_reason']}."
        ]
    if not doc.get("expected"):
        return []
    basis = doc.get("basis") or {}
    if basis.get("incomplete"):
        return [f"Expected: a lower bound, not judged: {basis['incomplete']}."]
    p_run = doc.get("p_run")
    return [] if p_run is None else [f"p of the run: {p_run:.2g}."]


def summary(doc: Mapping[str, Any]) -> str:
    """Return time and motion of a navigation document in words."""
    rate = doc["rate"]["value"]
    motion = "still" if rate == 0.0 else f"mean table rate {rate:.5g} deg/s"
    return f"{doc['duration_s']:.5g} s, {motion}"


def headline(doc: Mapping[str, Any]) -> str:
    """Return the result of a navigation document in one line."""
    rms = doc["rms"]
    return (
        f"{doc['mode']}, {summary(doc)}: horizontal {rms['horizontal_m']:.4g} m, "
        f"{rms['horizontal_mps']:.3g} m/s RMS"
    )


def envelope(result: "Assessment") -> dict[str, FloatArray]:
    """Return the expected band of each error, mean -+ 1 sigma, (2, m), named as in `solution`.

    `time [s]` (m,) counts from the window's start. Empty without expected errors.
    """
    errors = result.expectation.errors
    if errors is None or result.expectation.statistics is None:
        return {}
    sigma = np.sqrt(np.maximum(errors.variance, 0.0))
    band = np.stack([errors.mean - sigma, errors.mean + sigma]) / np.array([*KEYS.values()])
    band[:, :, ~result.expectation.statistics.valid[:9]] = np.nan
    band = np.concatenate([np.zeros((2, 1, 9)), band], axis=1)
    columns = {name: band[:, :, k] for k, name in enumerate(_ERROR_COLUMNS)}
    return {"time [s]": np.append(0.0, errors.time), **columns}


def solution(result: "Navigation") -> dict[str, FloatArray]:
    """Return the time series of a navigated window, columns with their units."""
    return {
        "time [s]": result.time,
        "latitude [deg]": result.latitude / DEG,
        "longitude [deg]": result.longitude / DEG,
        "height [m]": result.height,
        "v_east [m/s]": result.v_n[:, 0],
        "v_north [m/s]": result.v_n[:, 1],
        "v_up [m/s]": result.v_n[:, 2],
        "pitch [deg]": result.pitch / DEG,
        "roll [deg]": result.roll / DEG,
        "azimuth [deg]": result.azimuth / DEG,
        **{
            column: result.errors[:, k] / unit
            for k, (column, unit) in enumerate(zip(_ERROR_COLUMNS, KEYS.values(), strict=True))
        },
    }


class DownsampledSeries:
    """A time series that comes part by part, thinned to what a plot can show.

    rows: of the complete series; up to twice SHOWN rows are not thinned.
    """

    SHOWN = 50_000

    def __init__(self, rows: int) -> None:
        self._every = max(1, rows // self.SHOWN)
        self._skip = 0
        self._parts: list[dict[str, FloatArray]] = []

    def add(self, columns: Mapping[str, FloatArray]) -> None:
        """Take the part that follows."""
        count = len(next(iter(columns.values())))
        self._parts.append(
            {name: values[self._skip :: self._every].copy() for name, values in columns.items()}
        )
        self._skip = (self._skip - count) % self._every

    def columns(self) -> dict[str, FloatArray]:
        """Return the series, columns with their units."""
        return {
            name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]
        }
