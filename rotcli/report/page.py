"""The HTML report: one self-contained page, figures inside as SVG, nothing fetched, no script."""

from collections.abc import Mapping, Sequence
from importlib import resources
from typing import TYPE_CHECKING, Any

from rotcli.files.figures import inline_svg
from rotcli.files.tables import to_html
from rotcli.report.report import Report, provenance
from rotcli.report.summary import Verdict
from rotcli.units import digits
from rotcli.version import __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def as_html(report: Report, extra: "Sequence[tuple[str, Figure]]" = ()) -> str:
    """Return the page of a report; `extra` are (title, figure) pairs shown after the sections."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    template = resources.files("rotcli").joinpath("data/report.html").read_text("utf-8")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    drawn = 0
    sections = []
    for section in report.sections:
        figures = section.figures()
        sections.append(
            {
                "heading": section.kind.heading,
                "tables": [Markup(to_html(table)) for table in section.tables],
                "figures": [_inline(f"f{drawn + k}", *pair) for k, pair in enumerate(figures)],
            }
        )
        drawn += len(figures)
    return environment.from_string(template).render(
        title=report.title,
        version=__version__,
        results=len(report.sources),
        verdicts=[_bars(verdict) for verdict in report.verdicts],
        sentences=report.sentences,
        warnings=_warnings(report),
        sections=sections,
        runs=[_inline(f"f{drawn + k}", *pair) for k, pair in enumerate(extra)],
        provenance=[Markup(to_html(table)) for table in provenance(report.sources)],
    )


def _bars(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict with the length of each mode's bar, % of the longest."""
    longest = max(line.position for line in verdict.modes) or 1.0
    return {
        "label": verdict.label,
        "sentence": verdict.sentence.removeprefix(f"{verdict.label}: "),
        "modes": [
            {
                "name": line.mode,
                "best": line.mode == verdict.best,
                "position": f"{digits(line.position)} m",
                "velocity": f"{digits(line.velocity)} m/s",
                "gain": "" if line.gain is None else f"{digits(line.gain, 2)}",
                "width": f"{100.0 * line.position / longest:.1f}",
            }
            for line in verdict.modes
        ],
    }


def _warnings(report: Report) -> list[dict[str, Any]]:
    """Return the warnings, each text once with its files."""
    by_text: dict[str, list[str]] = {}
    for path, text in report.warnings:
        by_text.setdefault(text, []).append(path)
    return [{"text": text, "files": list(dict.fromkeys(files))} for text, files in by_text.items()]


def _inline(prefix: str, title: str, figure: "Figure") -> Mapping[str, Any]:
    """Return a figure as an `svg` element whose ids are its own within the page."""
    from markupsafe import Markup

    return {"title": title, "svg": Markup(inline_svg(prefix, title, figure))}
