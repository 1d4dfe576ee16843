"""`rotcli report`: result files into tables or a page."""

from pathlib import Path
from typing import Any

import click

from rotcli.cli import messages, options
from rotcli.cli import output as delivery

# Suffix of the output: what it becomes.
FORMATS = {".md": "markdown", ".html": "html", ".tex": "latex", ".csv": "csv", ".txt": "text"}


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
def command(
    results: tuple[str, ...],
    output: str | None,
    title: str,
    solutions: tuple[str, ...],
    quiet: bool,
) -> None:
    """Put result files into the tables of a paper or a page.

    Any set of results works, in any order: the tables that they support appear, published values
    beside those of the papers' IMUs.
    """
    form = _format(output)
    delivery.check_outputs([*results, *solutions], {"-o": output})
    if solutions and form != "html":
        raise click.UsageError("--solution draws in a page: give -o FILE.html")

    from rotcli.files.documents import write_text
    from rotcli.report import report

    found = report.gather(results, " ".join(title.split()) or "rotcli report")
    messages.warn(found.remarks, quiet)
    for section in found.sections:
        messages.tell(f"read {len(section.sources)} results: {section.kind.heading}")
    write_text(output or "-", _written(found, form, solutions))
    if output not in (None, "-"):  # else they stand in the text itself
        messages.warn([f"{path}: {text}" for path, text in found.warnings], quiet)
        count = len(found.sources)
        messages.say(f"{output}: report on {count} result{'s' * (count != 1)}", quiet)


def _format(output: str | None) -> str:
    if output in (None, "-"):
        return "text"
    suffix = Path(str(output)).suffix.lower()
    if suffix not in FORMATS:
        known = ", ".join(FORMATS)
        raise click.UsageError(f"-o {output}: unknown kind of report '{suffix}'; known are {known}")
    return FORMATS[suffix]


def _written(found: Any, form: str, solutions: tuple[str, ...]) -> str:
    """Return the report as text; only HTML loads matplotlib and jinja2."""
    from rotcli.report import report

    if form == "html":
        from rotcli.navigate.solution import solution_figures
        from rotcli.report.page import as_html

        return as_html(found, solution_figures(solutions))
    writers = {
        "text": report.as_text,
        "markdown": report.as_markdown,
        "latex": report.as_latex,
        "csv": report.as_csv,
    }
    return writers[form](found)
