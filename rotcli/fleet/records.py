"""Rows of a fleet: one per result and parameter, from the JSON documents of any command.

A calibration gives its `parameters`; a bias enters with the value and sigma for the span of its
log where the document has them, because the turn-on component covers the time between logs. An
allan result gives its coefficients as `gyro_x.random_walk` and so on.
"""

import math
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, date, datetime
from functools import lru_cache
from pathlib import PurePath
from typing import Any

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.results.documents import SCHEMA
from rotcli.files.results.identity import identity
from rotcli.files.results.validate import validate

# Columns of the table, in this order.
COLUMNS = (
    "unit",
    "day",
    "time",
    "parameter",
    "value",
    "sigma",
    "measure",
    "kind",
    "rate",
    "temperature",
    "path",
    "sha256",
)
# Of one result: unit, day, time, kind, rate, temperature, path, sha256.
FILE_COLUMNS = ("unit", "day", "time", "kind", "rate", "temperature", "path", "sha256")
FileRow = tuple[str, str, float, str, float, float, str, str]
# Of one value: parameter, value, sigma, unit of measure.
VALUE_COLUMNS = ("parameter", "value", "sigma", "measure")
ValueRow = tuple[str, float, float, str]
NUMBER_COLUMNS = ("time", "value", "sigma", "rate", "temperature")
# Parameters of the table and the site, not of the device.
SET_UP = ("base_", "outer_middle", "middle_", "gravity", "clock_", "lever_")
SAME_SOAK = 0.5  # degC: chambers control a soak better
SCALE_FIGURES = ("asymmetry", "nonlinearity", "hysteresis")  # of each gyro, of model `scale`
UNKNOWN_DAY = "unknown"
_NAN = math.nan
_EPOCH = date(1970, 1, 1).toordinal()
_DAY_SECONDS = 86400.0
_DATE = re.compile(r"(?<!\d)(\d{4})-?(\d{2})-?(\d{2})(?!\d)")
_FIELD = re.compile(r"\{(\w*)\}")


@dataclass(frozen=True)
class Folders:
    """The pattern of the folders above a result, such as `{unit}/{day}`; None for none."""

    pattern: str | None = None

    def fields(self, path: str) -> dict[str, str]:
        """Return unit, day and turn-on by the folders of a path; raises ResultError."""
        if self.pattern is None:
            return {}
        parts = self.pattern.split("/")
        folders = PurePath(path).parts[:-1][-len(parts) :]
        if len(folders) < len(parts):
            raise ResultError(f"{path}: fewer folders than [fleet] path = {self.pattern}")
        found: dict[str, str] = {}
        for part, folder in zip(parts, folders, strict=True):
            match = _FIELD.fullmatch(part)
            if match and match[1]:
                found[match[1]] = folder
        return found


def rows_of(
    doc: Mapping[str, Any], path: str, sha256: str, folders: Folders
) -> tuple[FileRow, list[ValueRow]] | None:
    """Return the rows of one document, or None for a kind without parameters.

    Raises ResultError for a document that is not a valid result.
    """
    if doc.get("schema") != SCHEMA:
        raise ResultError(
            f"{path}: schema {doc.get('schema')!r} is not known; use the rotcli that wrote it"
        )
    kind = doc.get("kind")
    if kind not in ("allan", "calibration"):
        return None
    validate(doc, path)
    try:
        calibrated = kind == "calibration"
        entries = _parameters(doc) if calibrated else _coefficients(doc["axes"])
        unit, day, time = _place(doc, path, folders)
        rate, temperature = _number(doc.get("rate")), _number(doc.get("temperature"))
        file = (unit, day, time, str(doc.get("model") or kind), rate, temperature, path, sha256)
        return file, [
            (
                name,
                float(entry["value"]),
                _NAN if entry.get("sigma") is None else float(entry["sigma"]),
                str(entry["unit"]),
            )
            for name, entry in entries
            if entry.get("value") is not None
        ]
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as fault:
        raise ResultError(
            f"{path}: not a valid {kind} result ({type(fault).__name__}: {str(fault)[:80]}); "
            "create it again"
        ) from fault


def _parameters(doc: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the estimated parameters of the device; those of the table and priors are omitted."""
    channels = doc.get("channels") or {}
    for name, entry in doc["parameters"].items():
        if entry.get("status") == "prior" or name.startswith(SET_UP):
            continue
        span = entry.get("own_span") or (channels and _own_span(doc, channels, name))
        yield name, {"unit": entry["unit"], **span} if span else entry
    for axis, channel in channels.items():
        for figure in SCALE_FIGURES:
            entry = channel.get(figure)
            if isinstance(entry, Mapping) and "unit" in entry:
                yield f"scale_{axis}.{figure}", entry


def _own_span(doc: Mapping[str, Any], channels: Mapping[str, Any], name: str) -> Any:
    """Return the bias for the span of the log of a scale or thermal document, or None."""
    axis = name.removeprefix("bias_")
    scale = (channels.get(axis) or {}).get("offset_own_span")
    return scale or _soak_value(doc, channels.get(f"gyro_{axis}"))


def _soak_value(doc: Mapping[str, Any], channel: Mapping[str, Any] | None) -> Any:
    """Return the bias for the span of the log at the soak of the reference temperature, or None."""
    if not channel or "soaks" not in channel:
        return None
    reference = float(doc["temperature"]["reference"])
    for soak in channel["soaks"]:
        if abs(float(soak["temperature_degC"]) - reference) < SAME_SOAK:
            return soak["bias_own_span"]
    return None


def _coefficients(axes: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for axis, entry in axes.items():
        for name, coefficient in entry["coefficients"].items():
            yield f"{axis}.{name}", coefficient


def _place(doc: Mapping[str, Any], path: str, folders: Folders) -> tuple[str, str, float]:
    """Return unit, day and time (days since 1970, NaN where unknown) of a document."""
    found = identity(doc)
    by_folder = folders.fields(path)
    unit = by_folder.get("unit") or found.device
    day = by_folder.get("day") or found.date or _folder_date(path)
    if unit is None:
        raise ResultError(
            f"{path}: neither a serial nor an IMU name; set [unit] serial in the rig, or [fleet] "
            "path in the spec file"
        )
    text = UNKNOWN_DAY if day is None else str(day)
    time = days_since_epoch(text)
    return str(unit), text[:10] if math.isfinite(time) else text, time


def _folder_date(path: str) -> str | None:
    """Return the last date, 2026-03-01 or 20260301, among the folders of a path."""
    for folder in reversed(PurePath(path).parts[:-1]):
        found = _DATE.search(folder)
        if found and math.isfinite(days_since_epoch("-".join(found.groups()))):
            return "-".join(found.groups())
    return None


@lru_cache(maxsize=65536)
def days_since_epoch(text: str) -> float:
    """Return days since 1970-01-01 of an ISO date or time; NaN for other text.

    >>> days_since_epoch("1970-01-02"), days_since_epoch("1970-01-02T12:00:00")
    (1.0, 1.5)
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return _NAN
    if moment.tzinfo is not None:
        moment = moment.astimezone(UTC)
    seconds = moment.hour * 3600.0 + moment.minute * 60.0 + moment.second
    return moment.toordinal() - _EPOCH + seconds / _DAY_SECONDS


def _number(entry: Any) -> float:
    value = entry.get("value") if isinstance(entry, dict) else entry
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else _NAN
