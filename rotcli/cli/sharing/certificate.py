"""`rotcli certificate`: one page per device."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rotcli.cli import messages, options
from rotcli.cli import output as outputs

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
@click.argument("results", nargs=-1, required=True, metavar="RESULT.json…")
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
    made = _collect(results, spec_path, fleet_path)
    _write(made, title, output, suffix)
    if output not in (None, "-"):
        verdict = f", {made.verdict}" if made.verdict else ""
        device = made.identity.device or "an unnamed device"
        messages.info(f"{output}: certificate of {device}{verdict}", quiet)


def _collect(
    results: Sequence[str], spec_path: str | None, fleet_path: str | None
) -> "Certificate":
    from rotcli.certificate.collect import certificate
    from rotcli.certificate.curves import Input
    from rotcli.files.results.documents import read_result, sha256
    from rotcli.files.spec import read_spec

    inputs = [Input(path, sha256(path), read_result(path)) for path in dict.fromkeys(results)]
    spec = None if spec_path is None else read_spec(spec_path)
    fleet: Mapping[str, Any] | None = None
    if fleet_path is not None:
        fleet = read_result(fleet_path, "fleet")
    return certificate(inputs, spec, fleet)


def _write(made: "Certificate", title: str, output: str | None, suffix: str) -> None:
    from rotcli.certificate.render import to_html, to_markdown
    from rotcli.files.results.documents import write_text

    if suffix == ".md":
        write_text(output or "-", to_markdown(made, title))
    elif suffix == ".html":
        write_text(str(output), to_html(made, title))
    else:
        _write_pdf(to_html(made, title), str(output))


def _write_pdf(html: str, path: str) -> None:
    from rotcli.certificate.pdf import to_pdf
    from rotcli.files.atomic import atomic_write
    from rotcli.files.results.documents import unwritable

    data = to_pdf(html, path)
    try:
        with atomic_write(path) as stream:
            stream.write(data)
    except OSError as fault:
        raise unwritable(path, fault) from fault
