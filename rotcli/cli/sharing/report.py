"""`rotcli report`: result files as tables or a page."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import messages, options, output
from rotcli.files.text import visible
from rotcli.lazy import lazily

with lazily():
    from rotcli.files.results import documents
    from rotcli.navigate import solution
    from rotcli.report import page, report

if TYPE_CHECKING:
    from rotcli.report.report import Report

# Suffix of the output: format of the report.
REPORT_FORMATS = {
    ".md": "markdown",
    ".html": "html",
    ".tex": "latex",
    ".csv": "csv",
    ".txt": "text",
}


@dataclass(frozen=True)
class ReportCommand(options.OutputOptions):
    """Options of `rotcli report`."""

    results: tuple[str, ...]
    title: str
    solutions: tuple[str, ...]


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
        "rotcli report run/calibration.json -o run/report.html",
    )
)
@click.argument("results", nargs=-1, required=True, metavar="RESULT.json…")
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    help="Write the report here: .md, .html, .tex (needs booktabs), .csv or .txt; - is standard "
    "output [default: tables on standard output].",
)
@click.option("--title", default="rotcli report", show_default=True, help="Heading of the report.")
@click.option(
    "--solution",
    "solutions",
    metavar="FILE",
    multiple=True,
    help="Draw the errors of this solution (.parquet, .csv of rotcli navigate) in the page.",
)
@options.messages
@options.collect(ReportCommand)
def command(given: ReportCommand) -> None:
    """Combine result files into tables or an HTML page.

    Any results in any order: the report contains the tables that they support, with published
    values next to those of the papers' IMUs.
    """
    form = _format(given.output)
    output.check_outputs([*given.results, *given.solutions], {"-o": given.output})
    if given.solutions and form != "html":
        raise click.UsageError("--solution draws in a page: use -o FILE.html")

    gathered = report.gather(given.results, " ".join(given.title.split()) or "rotcli report")
    messages.warn(gathered.remarks, given.quiet)
    for section in gathered.sections:
        messages.verbose(f"read {len(section.sources)} results: {section.kind.heading}")
    text = visible(_render(gathered, form, given.solutions))
    documents.write_text(given.output or "-", text)
    if given.output not in (None, "-"):  # else the text itself contains them
        messages.warn([f"{path}: {text}" for path, text in gathered.warnings], given.quiet)
        count = len(gathered.sources)
        text = f"{given.output}: report on {count} result{'s' * (count != 1)}"
        messages.info(text, given.quiet)


def _format(name: str | None) -> str:
    if name in (None, "-"):
        return "text"
    suffix = Path(str(name)).suffix.lower()
    if suffix not in REPORT_FORMATS:
        known = ", ".join(REPORT_FORMATS)
        raise click.UsageError(f"-o {name}: unknown format '{suffix}'; known: {known}")
    return REPORT_FORMATS[suffix]


def _render(gathered: "Report", form: str, solutions: tuple[str, ...]) -> str:
    """Return the report as text; only HTML loads matplotlib and jinja2."""
    if form == "html":
        return page.as_html(gathered, solution.solution_figures(solutions))
    writers = {
        "text": report.as_text,
        "markdown": report.as_markdown,
        "latex": report.as_latex,
        "csv": report.as_csv,
    }
    return writers[form](gathered)
