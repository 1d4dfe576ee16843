"""The way results go out: where they may go, tables on standard output, documents and series.

Only results go to standard output; what is said of them goes to standard error.
"""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from rotcli.cli.messages import say, tell, warn


def check_outputs(
    inputs: Sequence[str | None], outputs: Mapping[str, str | None], log: str | None = None
) -> None:
    """Refuse, as a usage error, an output that would replace an input or another output.

    inputs: the files that are read; with a `log` also the rig.toml beside it. outputs: option to
    file, None and `-` for none.
    """
    read = [name for name in (log, *inputs) if name]
    read += [str(Path(log).with_name("rig.toml"))] if log and Path(log).name else []
    written: dict[str, str] = {}
    for option, name in outputs.items():
        if name is None or name == "-" or is_special(name):
            continue
        for other in read:
            if _same_file(name, other):
                raise click.UsageError(f"{option} {name}: would replace the input {other}")
        for before, other in written.items():
            if _same_file(name, other):
                raise click.UsageError(f"{option} {name}: would replace what {before} writes")
        written[option] = name


def check_result_name(name: str | None, tables: Sequence[str] = ()) -> None:
    """Refuse, as a usage error, the name of a result whose suffix promises what it is not.

    tables: the suffixes of tables that are written as well. A name without a suffix, `-` and what
    is no file (/dev/stdout, a pipe) are free.
    """
    if name is None or is_special(name):
        return
    path = Path(name)
    if path.suffix.lower() in ("", ".json", *tables):
        return
    also = f" (or {', '.join(tables)})" if tables else ""
    raise click.UsageError(
        f"-o {name}: a result is JSON: name it -o {path.with_suffix('.json')}{also}; "
        "for tables of results see rotcli report"
    )


def is_special(name: str) -> bool:
    """Tell whether a name is that of a pipe, a terminal or the like: no plain file, nor new."""
    path = Path(name)
    return path.exists() and not path.is_file()


def _same_file(one: str, other: str) -> bool:
    try:
        return Path(one).samefile(other)
    except OSError:  # one of them is not there yet, or a link to itself
        return os.path.realpath(one) == os.path.realpath(other)


def write_series(path: str, columns: Mapping[str, Any]) -> None:
    """Write a time series to .parquet or .csv."""
    from rotcli.files.columns import write_columns

    write_columns(path, columns)
    tell(f"wrote {path}: {len(next(iter(columns.values())))} rows")


def write_parts(path: str, parts: Iterable[Mapping[str, Any]]) -> None:
    """Write a time series that comes part by part to .parquet or .csv."""
    from rotcli.files.columns import write_parts as write

    write(path, parts)


def deliver(
    docs: Any,
    table: Any,
    output: str | None,
    quiet: bool,
    headline: Callable[[Mapping[str, Any]], str] | None = None,
) -> None:
    """Print a table, or write result documents; warnings go to standard error either way.

    Several documents differ in their mode, which stands in the place of `{mode}` in the name.
    headline: a document in one line, told of each file written [default: the table's title].
    """
    from rotcli.files.documents import write_result
    from rotcli.files.tables import to_text

    docs = docs if isinstance(docs, list) else [docs]
    warn([text for doc in docs for text in doc["warnings"]], quiet)
    if output is None:
        click.echo(to_text(table), nl=False)
        return
    for doc in docs:
        path = output.replace("{mode}", doc["mode"]) if "mode" in doc else output
        write_result(path, doc)
        tell(f"wrote {path}")
        if path != "-":
            warnings = len(doc["warnings"])
            told = f", {warnings} warning{'s' * (warnings > 1)}" if warnings else ""
            say(f"{path}: {headline(doc) if headline else table.title}{told}", quiet)
