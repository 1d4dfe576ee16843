"""Tables: one model, written as text, Markdown, HTML, LaTeX, CSV, Excel or Parquet."""

from rotcli.files.tables.model import (
    Cell,
    Column,
    Estimate,
    Table,
    drop_empty_columns,
    has_value,
    with_values,
)

__all__ = ["Cell", "Column", "Estimate", "Table", "drop_empty_columns", "has_value", "with_values"]
