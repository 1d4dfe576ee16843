"""Which device a result document belongs to, and when it was measured.

The keys of the rig's [unit] table are copied into every result: serial, date, operator, place,
customer and free keys. Older documents have them below `rig`.
"""

from collections.abc import Mapping
from dataclasses import field
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any

from rotcli.dataclass import dataclass

KNOWN_KEYS = ("serial", "date", "operator", "place", "customer")
# s since 1970; a log clock within these is that of 1970 (years 2001 to 2286).
_EPOCH_RANGE = (1e9, 1e10)


@dataclass(frozen=True)
class Identity:
    """Device and circumstances of one document; None where it does not state them.

    name: of the IMU model; date: ISO text; extra: free keys in their order.
    """

    name: str | None = None
    serial: str | None = None
    date: str | None = None
    operator: str | None = None
    place: str | None = None
    customer: str | None = None
    extra: Mapping[str, str] = field(default_factory=dict)

    @property
    def device(self) -> str | None:
        """The serial, or the name of the model where there is no serial."""
        return self.serial or self.name


def identity(doc: Mapping[str, Any]) -> Identity:
    """Return the identity of a document; the first sample's time is the date of last resort."""
    rig = _table(doc, "rig")
    imu, unit = _table(rig, "imu"), _table(doc, "unit") or _table(rig, "unit")

    return Identity(
        name=_text(imu.get("name")),
        serial=_text(unit.get("serial") or imu.get("serial")),
        date=_text(unit.get("date")) or _start_date(doc),
        operator=_text(unit.get("operator")),
        place=_text(unit.get("place")),
        customer=_text(unit.get("customer")),
        extra={k: str(_text(v)) for k, v in unit.items() if k not in KNOWN_KEYS and v is not None},
    )


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Return an object of a document, an empty one for anything else."""
    value = data.get(key)
    return value if isinstance(value, dict) else {}  # a check for Mapping takes five times as long


def _text(value: Any) -> str | None:
    return None if value is None else _spaced(str(value))


@lru_cache(maxsize=4096)
def _spaced(text: str) -> str:
    """Return a text with single spaces; cached, because a fleet repeats its names."""
    return " ".join(text.split())


def _start_date(doc: Mapping[str, Any]) -> str | None:
    """Return the time of the first sample where the log's clock is that of 1970."""
    inputs = doc.get("inputs")
    first = inputs[0] if isinstance(inputs, list) and inputs else None
    start = first.get("start_s") if isinstance(first, Mapping) else None
    if not isinstance(start, int | float) or not _EPOCH_RANGE[0] < start < _EPOCH_RANGE[1]:
        return None
    return datetime.fromtimestamp(start, UTC).isoformat()
