"""What writes tables into a file with a suffix."""

from collections.abc import Callable, Sequence

from rotcli.files.tables.latex import PACKAGES, to_latex
from rotcli.files.tables.markup import to_markdown
from rotcli.files.tables.model import Table
from rotcli.files.tables.text import to_text
from rotcli.lazy import lazily

with lazily():
    from rotcli.files.tables import save, tidy


def latex_document(tables: Sequence[Table]) -> str:
    """Return the floats of several tables, labels unique, under a line that names the packages."""
    used: set[str] = set()
    head = f"% Needs {PACKAGES} in the preamble.\n"
    return "\n".join([head, *(to_latex(table, used) for table in tables)])


def csv_document(tables: Sequence[Table]) -> str:
    """Return several tables as one long table in CSV."""
    return save.csv_text(tidy.to_tidy(tables))


WRITERS: dict[str, Callable[[Sequence[Table]], str]] = {
    ".txt": lambda tables: "\n".join(to_text(table) for table in tables),
    ".md": lambda tables: "\n".join(map(to_markdown, tables)),
    ".tex": latex_document,
    ".csv": csv_document,
}
