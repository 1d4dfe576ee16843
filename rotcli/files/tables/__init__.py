"""Tables: one model, written as text, Markdown, HTML, LaTeX, CSV, Excel or Parquet."""

from rotcli.files.tables.model import (
    Cell,
    Column,
    Estimate,
    Table,
    known_columns,
    rows_have,
    with_values,
)

__all__ = ["Cell", "Column", "Estimate", "Table", "known_columns", "rows_have", "with_values"]
