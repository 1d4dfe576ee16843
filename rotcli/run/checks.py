"""The table of checks: which check a command makes, and how severe its finding is.

Functions in `rotcli.run` and in the capabilities compare and return findings; every command passes
them through `judge`, which takes the severity from this table. The rows are in
`rotcli.run.check_table`; the table is generated into the reference documentation by
`python -m rotcli.run.checks`.
"""

import sys
from collections.abc import Iterable
from dataclasses import replace

from rotcli.run.check_table import clocks, fit, laboratory, navigation, readings, segments
from rotcli.run.check_table.row import COMMANDS, Check, Command
from rotcli.run.findings import CheckError, Finding

__all__ = ["CHECKS", "CHECK_BY_CODE", "COMMANDS", "Check", "Command", "judge", "to_markdown"]

CHECKS: tuple[Check, ...] = (
    *segments.CHECKS,
    *clocks.CHECKS,
    *readings.CHECKS,
    *fit.CHECKS,
    *navigation.CHECKS,
    *laboratory.CHECKS,
)

CHECK_BY_CODE = {check.code: check for check in CHECKS}


def judge(
    command: Command, findings: Iterable[Finding], *, lenient: bool = False
) -> tuple[Finding, ...]:
    """Return the findings with the severity that the table has for the command.

    Findings of checks that the command does not make are dropped. lenient: errors become
    warnings. Raises CheckError for the first error, KeyError for a code that the table lacks.
    """
    judged = []
    for finding in findings:
        severity = CHECK_BY_CODE[finding.code].severity(command)
        if severity is None:
            continue
        if severity == "error" and not lenient:
            path, _, message = finding.text.partition(": ")
            raise CheckError(path, finding.code, message)
        judged.append(replace(finding, severity="warning" if severity == "error" else severity))
    return tuple(judged)


def to_markdown() -> str:
    """Return the table of checks as a Markdown page for docs/reference."""
    lines = [
        "# Checks",
        "",
        "Which check a command makes, and the severity of its finding. An *error* ends the command",
        "without a result, a *warning* is printed and stored in it, a *note* is stored only.",
        "`laboratory` means `scale` and `thermal`.",
        "",
        "| check | compares | limit | " + " | ".join(COMMANDS) + " |",
        "| --- | --- | --- |" + " --- |" * len(COMMANDS),
    ]
    for check in CHECKS:
        severities = " | ".join(check.severity(command) or "-" for command in COMMANDS)
        lines.append(f"| `{check.code}` | {check.compares} | {check.limit} | {severities} |")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.stdout.write(to_markdown())
