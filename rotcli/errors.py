"""The errors a user can cause: one base class, a few kinds, all shown as one line.

Raised where the fault is known, caught once, in `rotcli.cli.main`, which prints
`rotcli: error: ` and the text and exits with status 1.
"""


class CodedText(str):
    """A warning with the code of its finding, to which the command line adds the option."""

    __slots__ = ("code",)
    code: str

    def __new__(cls, code: str, text: str) -> "CodedText":
        """Create the text of a finding with a code."""
        made = super().__new__(cls, text)
        made.code = code
        return made

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        """Return the arguments of a copy, as a worker process needs it."""
        return self.code, str(self)


class RotcliError(Exception):
    """The data or the files are at fault; the text says where, what and what to do.

    code: of the finding, to which the command line adds the option that helps.
    """

    def __init__(self, *text: str, code: str = "") -> None:
        super().__init__(*text)
        self.code = code


class LogError(RotcliError):
    """A log cannot be used.

    The text reads `FILE: row N: column: what is wrong; what to do`. A row is the line of a CSV
    file (the header is row 1), as an editor or a spreadsheet counts, and the record of a
    Parquet file counted from 1. problems: findings with the rig keys that solve them, where the
    layout of the log is the cause (`rotcli.logs.describe.layout.Problem`).
    """

    problems: tuple[object, ...] = ()

    def __init__(
        self,
        path: str,
        what: str,
        *,
        row: int | None = None,
        column: str | None = None,
        code: str = "",
    ) -> None:
        place = [path] + ([f"row {row}"] if row is not None else []) + ([column] if column else [])
        super().__init__(": ".join([*place, what]), code=code)


class RigError(RotcliError):
    """The rig, a scenario or an IMU profile cannot be used: `FILE: key: what; what to do`."""


class ResultError(RotcliError):
    """A result file cannot be read or written."""
