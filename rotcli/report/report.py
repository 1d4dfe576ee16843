"""Any set of result files into one report: summary, tables, warnings, provenance.

`KINDS` says what shows the results of each kind; a new kind is a line there.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from rotcli.errors import ResultError
from rotcli.files import tables
from rotcli.files.results.documents import read_result, sound
from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Table
from rotcli.report.summary import Verdict, calibration_sentences, verdicts
from rotcli.version import __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Kind:
    """What shows the results of one kind, functions named as `module:function`.

    tables: takes the kind's sources and returns a list of tables. figures: takes them and returns
    (title, figure) pairs.
    """

    heading: str
    tables: str
    figures: str | None = None


# In the order of the report.
KINDS = {
    "navigation": Kind(
        "Navigation",
        "rotcli.navigate.campaign.tables:navigation_tables",
        "rotcli.report.plots_campaign:navigation_figures",
    ),
    "calibration": Kind(
        "Calibration",
        "rotcli.calibrate.campaign:calibration_tables",
        "rotcli.report.plots_campaign:calibration_figures",
    ),
    "calibration:triad": Kind(
        "Full calibration",
        "rotcli.triad.document:triad_tables",
        "rotcli.triad.plot:triad_figures",
    ),
    "calibration:scale": Kind(
        "Scale factor over rates",
        "rotcli.scale.tables:scale_tables",
        "rotcli.scale.plot:scale_figures",
    ),
    "calibration:thermal": Kind(
        "Bias and scale factor over temperature",
        "rotcli.thermal.tables:thermal_tables",
        "rotcli.thermal.plot:thermal_figures",
    ),
    "warm-up": Kind("Warm-up", "rotcli.thermal.tables:warm_up_tables"),
    "scale-design": Kind("Design of a scale factor test", "rotcli.scale.design:design_tables"),
    "plan": Kind("Calibration plan", "rotcli.plan.document:plan_tables"),
    "allan": Kind(
        "Noise",
        "rotcli.allan.campaign:allan_tables",
        "rotcli.report.plots_campaign:allan_figures",
    ),
    "budget": Kind(
        "Error budget",
        "rotcli.budget.document:budget_tables",
        "rotcli.budget.plot:budget_figures",
    ),
    "observability": Kind(
        "Observability",
        "rotcli.observe.published_o17:observability_tables",
        "rotcli.observe.published_o17:observability_figures",
    ),
    "srins": Kind(
        "Single-axis rotation INS with level damping",
        "rotcli.srins.tables:srins_tables",
        "rotcli.srins.plot:srins_figures",
    ),
    "srins-observability": Kind(
        "Observability of a single-axis rotation INS",
        "rotcli.srins.observability_document:observability_tables",
        "rotcli.srins.plot:observability_figures",
    ),
    "fleet": Kind("Fleet", "rotcli.fleet.tables:fleet_tables"),
}
# Files that lie beside results and are none: the truth of a simulation.
PASSED_OVER = ("simulation",)


@dataclass(frozen=True)
class Section:
    """The results of one kind."""

    kind: Kind
    sources: tuple[Source, ...]
    tables: tuple[Table, ...]

    def figures(self) -> "list[tuple[str, Figure]]":
        """Draw the section's figures; only then is matplotlib loaded."""
        if self.kind.figures is None:
            return []
        with sound(", ".join(source.path for source in self.sources[:3]), self.kind.heading):
            drawn: list[tuple[str, Figure]] = _load(self.kind.figures)(self.sources)
        return drawn


@dataclass(frozen=True)
class Report:
    """A report on results.

    warnings: (file, text), part of the report. remarks: on the choice of files, for the user who
    makes the report.
    """

    title: str
    verdicts: tuple[Verdict, ...]
    sentences: tuple[str, ...]
    sections: tuple[Section, ...]
    warnings: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]
    sources: tuple[Source, ...]

    @property
    def summary(self) -> list[str]:
        """The summary as sentences."""
        return [*(verdict.sentence for verdict in self.verdicts), *self.sentences]

    @property
    def tables(self) -> list[Table]:
        """The tables of all sections."""
        return [table for section in self.sections for table in section.tables]


def _load(name: str) -> Callable[..., Any]:
    module, _, function = name.partition(":")
    found: Callable[..., Any] = getattr(import_module(module), function)
    return found


def gather(paths: Sequence[str], title: str) -> Report:
    """Read result files and put the report together.

    A result given twice counts once, whatever the file's name. The order of the files is of no
    consequence. Raises ResultError for a file that is no result or of a kind without a table.
    """
    sources, remarks = _read(paths)
    sections = []
    for name, kind in KINDS.items():
        members = tuple(source for source in sources if section_of(source.doc) == name)
        if members:
            sections.append(Section(kind, members, tuple(_tables(name, kind, members))))
    navigated = [source for source in sources if source.doc["kind"] == "navigation"]
    calibrated = [source for source in sources if section_of(source.doc) == "calibration"]
    return Report(
        title=title,
        verdicts=tuple(verdicts(navigated)),
        sentences=tuple(calibration_sentences(calibrated)),
        sections=tuple(sections),
        warnings=tuple((source.path, text) for source in sources for text in source.warnings),
        remarks=tuple(remarks),
        sources=tuple(sources),
    )


def section_of(doc: Mapping[str, Any]) -> str:
    """Return the key of KINDS for a document: its kind, and its model where that has a section."""
    key = f"{doc['kind']}:{doc.get('model')}"
    return key if key in KINDS else str(doc["kind"])


def _tables(name: str, kind: Kind, members: tuple[Source, ...]) -> list[Table]:
    """Return the tables of a kind; a document of wrong shape is named."""
    show = _load(kind.tables)
    try:
        return list(show(members))
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        for source in members:
            with sound(source.path, name):
                show((source,))
        with sound(", ".join(source.path for source in members[:3]), name):
            raise


def _read(paths: Sequence[str]) -> tuple[list[Source], list[str]]:
    sources: list[Source] = []
    remarks = []
    for path in sorted(paths):
        doc = read_result(path)
        if doc["kind"] in PASSED_OVER:
            remarks.append(f"{path}: the truth of a simulation, no result; left out")
            continue
        if doc["kind"] not in KINDS:
            raise ResultError(
                f"{path}: a report has no table for results of kind '{doc['kind']}'; known are "
                f"{', '.join(KINDS)}; leave the file out"
            )
        twin = next((source.path for source in sources if source.doc == doc), None)
        if twin is not None:
            remarks.append(f"{path}: the same result as {twin}; counted once")
            continue
        sources.append(Source(path, doc))
    if not sources:
        raise ResultError(f"{', '.join(sorted(paths))}: no results to report on")
    return sources, remarks


def provenance(sources: Sequence[Source]) -> list[Table]:
    """Return where the results come from: result files, logs with their hashes, rigs."""
    files = [
        (source.path, str(source.doc["kind"]), source.imu, str(source.doc.get("rotcli", "-")))
        for source in sources
    ]
    columns = (Column("file"), Column("kind"), Column("IMU"), Column("made by rotcli"))
    made = [Table("Results", columns, files, f"Report made by rotcli {__version__}.")]
    logs = sorted({row for source in sources for row in _logs(source)}, key=str)
    if logs:
        log_columns = (
            Column("log"),
            Column("rows", "d"),
            Column("from, s", "g"),
            Column("to, s", "g"),
            Column("SHA-256"),
        )
        made.append(Table("Logs", log_columns, logs))
    return [*made, *_rigs(sources)]


def _logs(source: Source) -> list[tuple[Cell, ...]]:
    members = source.doc.get("inputs")
    rows: list[tuple[Cell, ...]] = []
    for log in members if isinstance(members, list) else []:
        if isinstance(log, dict):
            span = (log.get("rows"), log.get("start_s"), log.get("end_s"))
            numbers = [value if isinstance(value, int | float) else None for value in span]
            rows.append((str(log.get("path")), *numbers, str(log.get("sha256"))))
    return rows


def _rigs(sources: Sequence[Source]) -> list[Table]:
    """Return the distinct rigs side by side, a column each; where the stages lay is left out."""
    rigs: list[tuple[str, dict[str, str]]] = []
    for source in sources:
        flat = {
            f"[{section}] {key}": value if isinstance(value, str) else str(value)
            for section, keys in source.section("rig").items()
            if section != "stages" and isinstance(keys, dict)
            for key, value in keys.items()
        }
        if flat and flat not in [members for _, members in rigs]:
            rigs.append((source.imu, flat))
    rigs.sort(key=lambda rig: (rig[0], str(rig[1])))
    keys = list(dict.fromkeys(key for _, rig in rigs for key in rig))
    rows = [(key, *(rig.get(key) for _, rig in rigs)) for key in keys]
    columns = (Column("key"), *(Column(name) for name, _ in rigs))
    return [Table("Rigs", columns, rows)] if rigs else []


def warning_table(report: Report) -> list[Table]:
    """Return the warnings as a table, each text once with the files that contain it."""
    by_text: dict[str, list[str]] = {}
    for path, text in report.warnings:
        by_text.setdefault(text, []).append(path)
    rows = [(text, ", ".join(dict.fromkeys(files))) for text, files in by_text.items()]
    return [Table("Warnings", (Column("warning"), Column("in")), rows)] if rows else []


def as_text(report: Report) -> str:
    """Return the report for a terminal."""
    parts = [*(f"{sentence}\n" for sentence in report.summary)]
    shown = [*report.tables, *warning_table(report)]
    return "".join(parts) + "\n" * bool(parts) + "\n".join(tables.to_text(t) for t in shown)


def as_markdown(report: Report) -> str:
    """Return the report in Markdown: one top heading, a heading for each kind of result."""
    parts = [f"# {tables.markdown_text(report.title)}\n"]
    if report.summary:
        parts += ["## Summary\n"]
        parts += ["\n".join(f"- {tables.markdown_text(s)}" for s in report.summary) + "\n"]
    parts += [tables.to_markdown(table) for table in warning_table(report)]
    for section in report.sections:
        parts += [f"## {section.kind.heading}\n", *map(tables.to_markdown, section.tables)]
    parts += ["## Provenance\n", *map(tables.to_markdown, provenance(report.sources))]
    return "\n".join(parts)


def as_latex(report: Report) -> str:
    """Return the tables in LaTeX, for a document that loads booktabs."""
    head = f"% Made by rotcli {__version__}. Needs \\usepackage{{booktabs}} in the preamble.\n"
    lines = [f"% Warning: {path}: {text}" for path, text in report.warnings]
    warnings = "".join(" ".join(line.split()) + "\n" for line in lines)
    return "\n".join([head + warnings, *map(tables.to_latex, report.tables)])


def as_csv(report: Report) -> str:
    """Return the tables in CSV, numbers at full precision."""
    return tables.to_csv([*report.tables, *warning_table(report)])
