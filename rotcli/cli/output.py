"""Output of results: checks of file names, tables on standard output, documents, time series.

Only results go to standard output; messages go to standard error.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli.messages import info, verbose, warn
from rotcli.lazy import lazily

with lazily():
    import shutil

    from rotcli.files import columns as file_columns
    from rotcli.files.results import result as result_files
    from rotcli.files.tables import text as text_tables

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rotcli.files.results.result import Result

    Columns = Mapping[str, NDArray[np.generic]]  # name with unit: values (n,)


PLAIN_WIDTH = 80  # letters of a line where there is no terminal


def check_outputs(
    inputs: Sequence[str | None], outputs: Mapping[str, str | None], log: str | None = None
) -> None:
    """Raise UsageError for an output that would replace an input or another output.

    inputs: files that are read; with a `log` also the rig.toml in its folder. outputs: option to
    file; None and `-` are no file.
    """
    read = [name for name in (log, *inputs) if name]
    read += [str(Path(log).with_name("rig.toml"))] if log and Path(log).name else []
    written: dict[str, str] = {}
    for option, name in outputs.items():
        if not name or name == "-" or is_not_regular_file(name):
            continue
        for other in read:
            if _same_file(name, other):
                raise click.UsageError(f"{option} {name}: would replace the input {other}")
        for before, other in written.items():
            if _same_file(name, other):
                raise click.UsageError(f"{option} {name}: would replace the output of {before}")
        written[option] = name


def check_result_name(name: str | None, tables: Sequence[str] = ()) -> None:
    """Raise UsageError for a result name whose suffix is that of another format.

    tables: suffixes of tables that the command also writes. A name without suffix, `-` and names
    of pipes or devices are accepted.
    """
    if name is None or is_not_regular_file(name):
        return
    path = Path(name)
    if path.suffix.lower() in ("", ".json", *tables):
        return
    also = f" (or {', '.join(tables)})" if tables else ""
    raise click.UsageError(
        f"-o {name}: this command writes JSON; use -o {path.with_suffix('.json')}{also}, or "
        "rotcli report for tables"
    )


def is_not_regular_file(name: str) -> bool:
    """Return whether a name is that of a pipe, a terminal or the like."""
    path = Path(name)
    return path.exists() and not path.is_file()


def _same_file(one: str, other: str) -> bool:
    try:
        return Path(one).samefile(other)
    except OSError:  # one of them does not exist, or is a link to itself
        return os.path.realpath(one) == os.path.realpath(other)


def write_time_series(path: str, columns: "Columns") -> None:
    """Write a time series to .parquet or .csv."""
    file_columns.write_columns(path, columns)
    verbose(f"{path}: written")


def write_time_series_chunks(path: str, chunks: "Iterable[Columns]") -> None:
    """Write a time series that comes chunk by chunk to .parquet or .csv."""
    file_columns.write_column_chunks(path, chunks)


def terminal_width() -> int:
    """Return the width of the terminal in letters: COLUMNS, else the window's, else 80."""
    return shutil.get_terminal_size((PLAIN_WIDTH, 24)).columns


def print_or_write(results: "Result | Sequence[Result]", output: str | None, quiet: bool) -> None:
    """Print the tables of results, or write their documents; warnings go to standard error.

    Several results differ in their mode, which replaces `{mode}` in the file name.
    """
    results = [results] if isinstance(results, result_files.Result) else results
    warn([text for result in results for text in result.warnings], quiet)
    if output is None:
        tables = results[0].tables_of(results)
        width = terminal_width()
        click.echo("\n".join(text_tables.to_text(table, width) for table in tables), nl=False)
        return
    for result in results:
        path = result_files.by_mode(output, result.document)
        result.write(path)
        verbose(f"{path}: written")
        if path != "-":
            count = len(result.warnings)
            with_warnings = f", {count} warning{'s' * (count > 1)}" if count else ""
            info(f"{path}: {result.one_line_summary()}{with_warnings}", quiet)
