"""Results: a result document with its tables, as every capability returns it.

A capability derives its own class and adds its tables and its figure.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.results.documents import write_result
from rotcli.lazy import lazily

with lazily():
    from rotcli.files import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from rotcli.files.tables import Table


@dataclass(frozen=True, eq=False)
class Result:
    """A result of rotcli: `document` is the JSON object that a file would contain."""

    document: dict[str, Any]

    kind: ClassVar[str] = ""

    @property
    def warnings(self) -> list[str]:
        """Texts of the warnings, in the order of the checks."""
        return list(self.document.get("warnings", []))

    @property
    def findings(self) -> list[dict[str, Any]]:
        """Typed findings (code, severity, where, value, limit)."""
        return list(self.document.get("findings", []))

    def tables(self) -> "list[Table]":
        """Return the tables that the command prints."""
        raise ResultError(f"a result of kind {self.kind or 'unknown'} has no table")

    def tables_of(self, results: "Sequence[Result]") -> "list[Table]":
        """Return the tables that a command prints for several results of this kind."""
        return [table for result in results for table in result.tables()]

    def one_line_summary(self) -> str:
        """Return the result in one line: by default the title of its first table."""
        return self.tables()[0].title

    def to_dict(self) -> dict[str, Any]:
        """Return the document."""
        return self.document

    def to_frame(self) -> "DataFrame":
        """Return the first table as a pandas frame, numbers at full precision."""
        return self.tables()[0].to_frame()

    def write(self, path: str) -> None:
        """Write the document as JSON; raises ResultError."""
        write_result(path, self.document)

    def figure(self) -> "Figure":
        """Return the figure of the result; raises ResultError if it has none."""
        raise ResultError(f"a result of kind {self.kind or 'unknown'} has no figure")

    def plot(self, path: str | None = None) -> "Figure":
        """Return the figure of the result; with `path` write it (.png, .svg, .pdf) as well."""
        figure = figures.arranged(self.figure())
        if path is not None:
            figures.save_figure(figure, path)
        return figure


def by_mode(path: str, document: Mapping[str, Any]) -> str:
    """Return a file name with `{mode}` replaced by the mode of a document, if it has one."""
    return path.replace("{mode}", str(document["mode"])) if "mode" in document else path
