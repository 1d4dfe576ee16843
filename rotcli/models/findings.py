"""Findings: typed results of checks, which the command line puts into words."""

from dataclasses import dataclass
from typing import Any, Literal

Severity = Literal["note", "warning"]


@dataclass(frozen=True)
class Finding:
    """Result of one check.

    code: noun-adjective in kebab case; message: sentence without flags, with numbers and units;
    where: channel or place; value and limit: of the tested figure, in `unit`.
    """

    code: str
    message: str
    severity: Severity = "warning"
    where: str = ""
    value: float | None = None
    limit: float | None = None
    unit: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the finding as a JSON object."""
        return {
            "code": self.code,
            "severity": self.severity,
            "where": self.where,
            "value": self.value,
            "limit": self.limit,
            "unit": self.unit,
            "message": self.message,
        }
