"""Figures of scale and thermal tests for a certificate, read by name from their documents."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli.certificate.contents import FigureRow
from rotcli.certificate.numbers import digits_of, quantity_text, short_unit


def laboratory_rows(documents: Sequence[Mapping[str, Any]]) -> tuple[FigureRow, ...]:
    """Return the rows of the last scale, thermal and warm-up test."""
    last = {doc.get("model") or doc["kind"]: doc for doc in documents}
    rows: list[FigureRow] = []
    if "scale" in last:
        rows += _scale(last["scale"])
    if "thermal" in last:
        rows += _thermal(last["thermal"])
    if "warm-up" in last:
        rows += warm_up_rows(last["warm-up"])
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
    """Return range, coefficients about the reference, and residuals on soaks left out."""
    span = doc.get("temperature") or {}
    rows = []
    if "low" in span:
        low, high, reference = (
            f"{round(float(span[name]), 2) + 0.0:g}" for name in ("low", "high", "reference")
        )
        text = f"{low} to {high} degC, reference {reference}"
        rows.append(FigureRow("thermal", "range", (text,)))
    for name, channel in (doc.get("channels") or {}).items():
        for kind, entry in (channel.get("powers") or {}).items():
            text = ", ".join(_coefficients(entry))
            rows.append(FigureRow("thermal", f"{name} {kind}", (f"{text} {entry['unit']}",)))
    left_out = [
        f"{name[-1]} {channel['left_out_soaks']['rms']:.3g} {channel['left_out_soaks']['unit']}"
        for name, channel in (doc.get("channels") or {}).items()
        if channel.get("left_out_soaks") and name.startswith("gyro")
    ]
    if left_out:
        rows.append(FigureRow("thermal", "gyro residual, left-out soaks", (", ".join(left_out),)))
    return rows


def _coefficients(entry: Mapping[str, Any]) -> list[str]:
    """Return each power with its sigma where the document has one."""
    values = [float(v) for v in entry["value"]]
    sigmas = entry.get("sigma") or [None] * len(values)
    return [
        f"{v:.4g}" if s is None else f"{digits_of(v, s)} ± {digits_of(s, s)}"
        for v, s in zip(values, sigmas, strict=True)
    ]


def warm_up_rows(doc: Mapping[str, Any]) -> list[FigureRow]:
    """Return amplitude and time constant of the accepted channels, and the time to wait."""
    rows = [FigureRow("warm-up", "wait after power-on", (f"{doc['warm_up_time_s']:.4g} s",))]
    for name, channel in (doc.get("channels") or {}).items():
        if channel is not None and channel.get("accepted"):
            text = (
                f"{quantity_text(channel['amplitude'])}, {quantity_text(channel['time_constant'])}"
            )
            rows.append(FigureRow("warm-up", name, (text,)))
    return rows
