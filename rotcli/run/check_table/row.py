"""One row of the table of checks: code, comparison, limit, severity for each command."""

from typing import Literal

from rotcli.dataclass import dataclass
from rotcli.run.findings import Severity

Command = Literal["calibrate", "navigate", "observe", "srins", "laboratory"]
COMMANDS: tuple[Command, ...] = ("calibrate", "navigate", "observe", "srins", "laboratory")


@dataclass(frozen=True)
class Check:
    """One row: code, comparison, limit with its reason, and the severity for each command.

    None: the command does not make the check, and a finding of it is dropped.
    """

    code: str
    compares: str
    limit: str
    calibrate: Severity | None = None
    navigate: Severity | None = None
    observe: Severity | None = None
    srins: Severity | None = None
    laboratory: Severity | None = None

    def severity(self, command: Command) -> Severity | None:
        """Return the severity of the check's finding for a command."""
        result: Severity | None = getattr(self, command)
        return result
