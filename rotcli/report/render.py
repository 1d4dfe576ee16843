"""A report as text, Markdown or LaTeX, and its values as one long table."""

import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING

from rotcli.files.results.groups import Source, device_label
from rotcli.files.results.identity import identity
from rotcli.files.tables import Column, Table
from rotcli.files.tables.latex import PACKAGES, to_latex
from rotcli.files.tables.markup import markdown_text, to_markdown
from rotcli.files.tables.text import WIDTH, to_text
from rotcli.lazy import lazily
from rotcli.report.provenance import devices, provenance
from rotcli.report.report import Report, Section
from rotcli.version import __version__

with lazily():
    from rotcli.files.tables import tidy

if TYPE_CHECKING:
    from pandas import DataFrame

_SAME_RATE = (0.005, 0.05)  # fraction; deg/s: rates that differ by less are one


def warning_table(report: Report) -> list[Table]:
    """Return the warnings as a table, each text once with the files that contain it."""
    by_text: dict[str, list[str]] = {}
    for path, text in report.warnings:
        by_text.setdefault(text, []).append(path)
    rows = [(text, ", ".join(dict.fromkeys(files))) for text, files in by_text.items()]
    return [Table("Warnings", (Column("warning"), Column("in")), rows)] if rows else []


def as_summary(report: Report, width: int = WIDTH) -> str:
    """Return the sentences of the summary for a terminal, and how many warnings there are."""
    lines = [
        *(textwrap.fill(text, width, subsequent_indent="  ") for text in report.summary),
    ]
    if count := len({text for _, text in report.warnings}):
        lines.append(f"{count} warning{'s' * (count > 1)}: see the tables or the page.")
    return "\n".join(lines) + "\n"


def as_text(report: Report, width: int = WIDTH) -> str:
    """Return the report for a terminal of some width."""
    shown = [*devices(report.sources), *report.tables, *warning_table(report)]
    parts = [as_summary(report, width)] if report.summary else []
    return "\n".join([*parts, *(to_text(table, width) for table in shown)])


def as_markdown(report: Report) -> str:
    """Return the report in Markdown: one top heading, a heading for each kind of result."""
    parts = [f"# {markdown_text(report.title)}\n"]
    if report.summary:
        parts += ["## Summary\n"]
        parts += ["\n".join(f"- {markdown_text(s)}" for s in report.summary) + "\n"]
    parts += [to_markdown(table) for table in devices(report.sources)]
    parts += [to_markdown(table) for table in warning_table(report)]
    for section in report.sections:
        parts += [f"## {section.kind.heading}\n", *map(to_markdown, section.tables)]
    parts += ["## Provenance\n", *map(to_markdown, provenance(report.sources))]
    return "\n".join(parts)


def as_latex(report: Report) -> str:
    """Return the tables in LaTeX, for one and two columns."""
    head = f"% Made by rotcli {__version__}. Needs {PACKAGES} in the preamble.\n"
    lines = [f"% Warning: {path}: {text}" for path, text in report.warnings]
    warnings = "".join(" ".join(line.split()) + "\n" for line in lines)
    summary = "".join(f"% {' '.join(text.split())}\n" for text in report.summary)
    used: set[str] = set()
    shown = [*devices(report.sources), *report.tables]
    return "\n".join([head + summary + warnings, *(to_latex(table, used) for table in shown)])


def as_frame(report: Report) -> "DataFrame":
    """Return every value of the report's tables as one long table (pandas)."""
    sections = {id(table): section for section in report.sections for table in section.tables}
    paths = {source.path: source for source in report.sources}

    def origin(table: Table, row: int) -> Mapping[str, str]:
        section = sections.get(id(table))
        if table.origins:
            sources = [paths[path] for path in table.origins[row]]
        else:
            sources = [] if section is None else _sources_of(section, table, row)
        return _names(sources)

    return tidy.to_tidy([*report.tables, *warning_table(report)], origin)


def _sources_of(section: Section, table: Table, row: int) -> list[Source]:
    """Return the section's sources that a row is about, by its IMU, mode and rate."""
    cells = dict(zip(table.headings, table.rows[row], strict=True))
    imu, mode, rate = cells.get("IMU"), cells.get("mode"), cells.get("rate, deg/s")
    found = []
    for source in section.sources:
        if imu is not None and imu not in (source.imu, device_label(source.imu, source.axis)):
            continue
        if mode is not None and source.doc.get("mode") not in (None, str(mode).split(",")[0]):
            continue
        if isinstance(rate, int | float) and not _is_rate(source, float(rate)):
            continue
        found.append(source)
    return found


def _is_rate(source: Source, rate: float) -> bool:
    own = source.number_or_none("rate", "value")
    near = max(_SAME_RATE[1], _SAME_RATE[0] * abs(rate))
    return own is None or abs(own - rate) <= near


def _table_axis(source: Source) -> str:
    """Return the table axis of a result, nothing where its values belong to several axes."""
    several = source.doc.get("kind") in ("calibration", "warm-up") and not source.doc.get("axis")
    return "" if several else source.axis


def _names(sources: list[Source]) -> dict[str, str]:
    """Return device, serial, date and files of sources; several of one are joined."""
    known = [(source, identity(source.doc)) for source in sources]
    columns = {
        "unit": [source.imu for source, _ in known],
        "serial": [one.serial or "" for _, one in known],
        "date": [one.date or "" for _, one in known],
        "axis": [_table_axis(source) for source, _ in known],
        "source file": [source.path for source, _ in known],
    }
    return {
        name: "; ".join(dict.fromkeys(value for value in values if value))
        for name, values in columns.items()
    }
