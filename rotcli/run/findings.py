"""Findings: typed results of checks, which the command line puts into words.

A finding states what was found, where and how much, without options of the command line: the
table of `rotcli.cli.findings` adds the option that belongs to its code.
"""

from collections.abc import Iterable
from typing import Any, Literal

from rotcli.dataclass import dataclass
from rotcli.errors import CodedText, LogError

Severity = Literal["note", "warning", "error"]


@dataclass(frozen=True)
class Finding:
    """Result of one check.

    code: kebab-case noun phrase, as in `rotcli.run.checks.CHECKS`; text: sentence with numbers
    and units that names the file first; where: file, channel or segment; value and limit: of the
    tested figure, in `unit`.
    """

    code: str
    text: str
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
            "text": self.text,
        }


class CheckError(LogError):
    """A check of severity error: the log cannot be used. code: as that of a `Finding`."""

    def __init__(self, path: str, code: str, message: str) -> None:
        super().__init__(path, message, code=code)


def texts(findings: Iterable[Finding]) -> list[str]:
    """Return the texts of warnings and errors, each once; notes are left to the document."""
    coded = (CodedText(f.code, f.text) for f in findings if f.severity != "note")
    return list(dict.fromkeys(coded))
