"""Figures of scale and thermal tests for a certificate, read by name from their documents."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli.certificate.contents import FigureRow
from rotcli.certificate.numbers import quantity_text, short_unit


def laboratory_rows(calibrations: Sequence[Mapping[str, Any]]) -> tuple[FigureRow, ...]:
    """Return the rows of the last scale and the last thermal test."""
    last = {doc.get("model"): doc for doc in calibrations}
    rows: list[FigureRow] = []
    if "scale" in last:
        rows += _scale(last["scale"])
    if "thermal" in last:
        rows += _thermal(last["thermal"])
    return tuple(rows)


_SCALE_FIGURES = (
    ("scale", "scale factor"),
    ("asymmetry", "asymmetry"),
    ("nonlinearity", "nonlinearity"),
    ("hysteresis", "hysteresis"),
)


def _scale(doc: Mapping[str, Any]) -> list[FigureRow]:
    channels = doc.get("channels") or {}
    rows = []
    for key, label in _SCALE_FIGURES:
        cells = tuple(_channel_text(channels.get(axis), key) for axis in "xyz")
        if any(cells):
            rows.append(FigureRow("scale", label, cells))
    misalignment = doc.get("misalignment")
    if isinstance(misalignment, Mapping):
        limit = misalignment.get("limit")
        text = quantity_text(misalignment) if limit is None else f"below {limit:.3g} urad"
        rows.append(FigureRow("scale", "misalignment of the input axis", (text,)))
    return rows


def _channel_text(channel: Any, key: str) -> str:
    """Return one figure of one gyro as text, empty where it was not determined."""
    entry = channel.get(key) if isinstance(channel, Mapping) else None
    if not isinstance(entry, Mapping):
        return ""
    if key == "nonlinearity" and channel.get("linear"):
        return f"below {entry['raw_limit_95']:.3g} {short_unit(entry['unit'])}"
    if entry.get("limit") is not None and entry.get("value") is None:
        return f"below {entry['limit']:.3g}"
    return quantity_text(entry) if "unit" in entry else ""


def scale_curves(
    doc: Mapping[str, Any],
) -> tuple[tuple[str, Sequence[float], Sequence[float]], ...]:
    """Return the residuals over the rates of each gyro: (label, deg/s, deg/h)."""
    curves = []
    for axis, channel in (doc.get("channels") or {}).items():
        residuals = channel.get("residuals") or []
        if residuals:
            rates = [float(r["rate_dps"]) for r in residuals]
            curves.append((f"gyro {axis}", rates, [float(r["residual_dph"]) for r in residuals]))
    return tuple(curves)


def _thermal(doc: Mapping[str, Any]) -> list[FigureRow]:
    rows = []
    model = doc.get("thermal") or doc
    span = model.get("range_degC")
    if span:
        text = f"{span[0]:.4g} to {span[1]:.4g} degC, powers about {model['reference_degC']:.4g}"
        rows.append(FigureRow("thermal", "range", (text,)))
    for name, entry in (model.get("powers") or {}).items():
        values = ", ".join(f"{value:.5g}" for value in entry["values"])
        rows.append(FigureRow("thermal", name, (f"{values} {entry['unit']}/degC^n",)))
    for axis, channel in (doc.get("channels") or {}).items():
        left_out = channel.get("left_out")
        if isinstance(left_out, Mapping) and "rms" in left_out:
            text = quantity_text(left_out["rms"])
            rows.append(FigureRow("thermal", f"left-out soaks {axis}", (text,)))
    return rows
