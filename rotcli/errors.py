"""The errors a user can cause: one base class, a few kinds, all shown as one line.

Raised where the fault is known, caught once, in `rotcli.cli.main`, which prints
`rotcli: error: ` and the text and exits with status 1.
"""


class RotcliError(Exception):
    """The data or the files are at fault; the text says where, what and what to do."""


class LogError(RotcliError):
    """A log cannot be used.

    The text reads `FILE: row N: column: what is wrong; what to do`. A row is the line of a CSV
    file (the header is row 1), as an editor or a spreadsheet counts, and the record of a
    Parquet file counted from 1. problems: findings with the rig keys that solve them, where the
    layout of the log is the cause (`rotcli.logs.describe.layout.Problem`).
    """

    problems: tuple[object, ...] = ()

    def __init__(
        self, path: str, what: str, *, row: int | None = None, column: str | None = None
    ) -> None:
        place = [path] + ([f"row {row}"] if row is not None else []) + ([column] if column else [])
        super().__init__(": ".join([*place, what]))


class RigError(RotcliError):
    """The rig, a scenario or an IMU profile cannot be used: `FILE: key: what; what to do`."""


class ResultError(RotcliError):
    """A result file cannot be read or written."""
