"""`rotcli report`: result files as tables, a page, data for other programs, or figures."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import messages, options, output
from rotcli.dataclass import dataclass
from rotcli.files.text import visible
from rotcli.lazy import lazily

with lazily():
    from rotcli.files import atomic
    from rotcli.files.results import documents
    from rotcli.files.tables import save
    from rotcli.navigate import solution
    from rotcli.report import figure_files, page, render, report

if TYPE_CHECKING:
    from rotcli.report.report import Report

# Suffix of the output: format of the report.
REPORT_FORMATS = {
    ".md": "markdown",
    ".html": "html",
    ".tex": "latex",
    ".csv": "csv",
    ".xlsx": "excel",
    ".parquet": "parquet",
    ".txt": "text",
}
FIGURE_FORMATS = ("pdf", "svg", "png")


@dataclass(frozen=True)
class ReportCommand(options.OutputOptions):
    """Options of `rotcli report`."""

    results: tuple[str, ...]
    title: str
    published: bool
    summary: bool
    solutions: tuple[str, ...]
    figures: str | None
    figure_format: str


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
        "rotcli report run -o run/report.html",
    )
)
@click.argument("results", nargs=-1, required=True, metavar="RESULT|DIR|GLOB…")
@click.option(
    "-o",
    "--output",
    metavar="FILE|DIR/",
    help="Write the report here: .html, .md, .tex (booktabs, siunitx) or .txt; .csv, .parquet or "
    ".xlsx is one long table of all values; a folder (with a / at the end) gets a CSV per table; "
    "- is standard output [default: tables on standard output].",
)
@click.option("--title", default="rotcli report", show_default=True, help="Heading of the report.")
@click.option("--summary", is_flag=True, help="Print the sentences of the summary only.")
@click.option(
    "--published",
    is_flag=True,
    help="Compare with the values of the three papers, for IMUs named as theirs.",
)
@click.option(
    "--solution",
    "solutions",
    metavar="FILE",
    multiple=True,
    help="Draw the errors of this solution (.parquet, .csv of rotcli navigate) too.",
)
@click.option("--figures", metavar="DIR", help="Write every figure as a file into this folder.")
@click.option(
    "--figure-format",
    type=click.Choice(FIGURE_FORMATS),
    default="pdf",
    show_default=True,
    help="Format of --figures.",
)
@options.figure_style
@options.messages
@options.collect(ReportCommand)
def command(given: ReportCommand) -> None:
    """Combine result files into tables, an HTML page, data for other programs, or figures.

    Any results in any order, folders and patterns too: the report contains the tables that they
    support.
    """
    form = _format(given.output)
    output.check_outputs([*given.results, *given.solutions], {"-o": given.output})
    if given.solutions and form != "html" and given.figures is None:
        raise click.UsageError(
            "--solution draws in a page or folder: use -o FILE.html or --figures"
        )
    if given.summary and given.output not in (None, "-"):
        raise click.UsageError("--summary prints on standard output: omit -o")

    with report.rare_collections():
        _report(given, form)


def _report(given: ReportCommand, form: str) -> None:
    title = " ".join(given.title.split()) or "rotcli report"
    gathered = report.gather(given.results, title, published=given.published)
    messages.warn(gathered.remarks, given.quiet)
    for section in gathered.sections:
        messages.verbose(f"read {len(section.sources)} results: {section.kind.heading}")
    if given.figures is not None:
        _write_figures(gathered, given)
    if given.figures is None or given.output is not None or given.summary:
        _deliver(gathered, form, given)


def _format(name: str | None) -> str:
    if name in (None, "-"):
        return "text"
    if str(name).endswith(("/", "\\")) or Path(str(name)).is_dir():
        return "folder"
    suffix = Path(str(name)).suffix.lower()
    if suffix not in REPORT_FORMATS:
        known = ", ".join(REPORT_FORMATS)
        raise click.UsageError(
            f"-o {name}: unknown format '{suffix}'; known: {known}, or a folder with / at the end"
        )
    return REPORT_FORMATS[suffix]


def _deliver(gathered: "Report", form: str, given: ReportCommand) -> None:
    """Print or write the report; only HTML loads matplotlib and jinja2."""
    to_file = given.output not in (None, "-")
    if form in ("excel", "parquet"):
        _write_binary(gathered, form, str(given.output))
    elif form == "folder":
        save.write_folder(str(given.output), gathered.tables)
    else:
        documents.write_text(given.output or "-", _text(gathered, form, given))
    if to_file:  # else the text itself contains them
        messages.warn([f"{path}: {text}" for path, text in gathered.warnings], given.quiet)
        count = len(gathered.sources)
        messages.info(f"{given.output}: report on {count} result{'s' * (count != 1)}", given.quiet)


def _text(gathered: "Report", form: str, given: ReportCommand) -> str:
    if form == "html":
        return visible(page.as_html(gathered, solution.solution_figures(given.solutions)))
    if form == "csv":
        return save.csv_text(render.as_frame(gathered))
    if form == "text":
        width = output.terminal_width() if given.output is None else output.PLAIN_WIDTH
        return visible((render.as_summary if given.summary else render.as_text)(gathered, width))
    writers = {"markdown": render.as_markdown, "latex": render.as_latex}
    return visible(writers[form](gathered))


def _write_binary(gathered: "Report", form: str, path: str) -> None:
    frame = render.as_frame(gathered)
    data = (
        save.excel_bytes(frame, gathered.tables) if form == "excel" else save.parquet_bytes(frame)
    )
    try:
        with atomic.atomic_write(path) as stream:
            stream.write(data)
    except OSError as fault:
        raise documents.write_error(path, fault) from fault


def _write_figures(gathered: "Report", given: ReportCommand) -> None:
    folder = str(given.figures)
    drawings = [pair for section in gathered.sections for pair in section.figures()]
    drawings += solution.solution_figures(given.solutions)
    count = len(figure_files.write_figures(folder, drawings, given.figure_format))
    messages.info(f"{folder}: {count} figure{'s' * (count != 1)}", given.quiet)
