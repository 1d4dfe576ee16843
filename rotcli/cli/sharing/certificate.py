"""`rotcli certificate`: one page per device."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import messages, options
from rotcli.cli import output as outputs
from rotcli.files.text import visible
from rotcli.lazy import lazily

with lazily():
    from rotcli.certificate import collect, curves, pdf, render
    from rotcli.files import atomic
    from rotcli.files import spec as specifications
    from rotcli.files.results import documents, find

if TYPE_CHECKING:
    from rotcli.certificate.contents import Certificate

SUFFIXES = (".html", ".md", ".pdf")


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
        "rotcli certificate run/calibration.json -o run/certificate.html",
    )
)
@click.argument("results", nargs=-1, required=True, metavar="RESULT|DIR|GLOB…")
@click.option("--spec", "spec_path", metavar="FILE", help="Limits of the parameters (TOML).")
@click.option(
    "--fleet",
    "fleet_path",
    metavar="FILE.json",
    help="Result of rotcli fleet: adds repeatability, position in the fleet and trend.",
)
@click.option("--title", default="Calibration certificate", show_default=True, help="Heading.")
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    help="Write the certificate here: .html, .md or .pdf (needs Chromium) [default: Markdown on "
    "standard output].",
)
@options.messages
def command(
    results: tuple[str, ...],
    spec_path: str | None,
    fleet_path: str | None,
    title: str,
    output: str | None,
    quiet: bool,
) -> None:
    """Write a certificate of one device: one A4 page from all its results.

    Results of calibrate, triad, scale, thermal and allan combine, also of several turn-ons. With a
    spec file each limit has a verdict: pass, fail, or undecided within the guard band.
    """
    suffix = ".md" if output in (None, "-") else Path(str(output)).suffix.lower()
    if suffix not in SUFFIXES:
        raise click.UsageError(f"-o {output}: name it {', '.join(SUFFIXES)}")
    outputs.check_outputs([*results, spec_path, fleet_path], {"-o": output})
    made = _collect(results, spec_path, fleet_path, quiet)
    _write(made, title, output, suffix)
    if output not in (None, "-"):
        verdict = f", {made.verdict}" if made.verdict else ""
        device = made.identity.device or "an unnamed device"
        messages.info(f"{output}: certificate of {device}{verdict}", quiet)


def _collect(
    results: Sequence[str], spec_path: str | None, fleet_path: str | None, quiet: bool
) -> "Certificate":
    found = find.read_results(results, lambda doc: doc["kind"] in collect.KINDS)
    messages.warn(found.remarks(), quiet)
    inputs = [curves.Input(path, documents.sha256(path), doc) for path, doc in found.documents]
    spec = None if spec_path is None else specifications.read_spec(spec_path)
    fleet = None if fleet_path is None else documents.read_result(fleet_path, "fleet")
    made = collect.certificate(inputs, spec, fleet)
    if made.without_sigma:
        text = f"{', '.join(made.without_sigma)}: no sigma in the results, no uncertainty is stated"
        messages.warn([text], quiet)
    return made


def _write(made: "Certificate", title: str, output: str | None, suffix: str) -> None:
    if suffix == ".md":
        documents.write_text(output or "-", visible(render.to_markdown(made, title)))
    elif suffix == ".html":
        documents.write_text(str(output), visible(render.to_html(made, title)))
    else:
        _write_pdf(visible(render.to_html(made, title)), str(output))


def _write_pdf(html: str, path: str) -> None:
    data = pdf.to_pdf(html, path)
    try:
        with atomic.atomic_write(path) as stream:
            stream.write(data)
    except OSError as fault:
        raise documents.write_error(path, fault) from fault
