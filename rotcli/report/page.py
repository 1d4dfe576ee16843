"""The HTML report: one self-contained page, figures inside as SVG, nothing fetched, no script."""

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from rotcli.dataclass import dataclass
from rotcli.files.figures import inline_svg, styled
from rotcli.files.results.page import render_page
from rotcli.files.tables.markup import to_html
from rotcli.lazy import lazily
from rotcli.report.provenance import devices, provenance, provenance_line
from rotcli.report.report import Report
from rotcli.report.summary import Verdict
from rotcli.units import digits
from rotcli.version import __version__

with lazily():
    import markupsafe

if TYPE_CHECKING:
    from rotcli.files.figures import Drawing

MAX_FIGURES = 12  # shown at once; a reader looks at no more
MAX_FOLDED = 24  # drawn behind a fold; each costs a tenth of a second
MANY_RESULTS = 100  # of so many all units share figures, and the further ones are left to files


@dataclass
class _Figures:
    """Figures of a section: shown, folded, and the number of those that are not on the page."""

    shown: "list[Drawing]"
    folded: "list[Drawing]"
    left: int


def as_html(report: Report, extra: "Sequence[Drawing]" = ()) -> str:
    """Return the page of a report; `extra` are (title, drawing) pairs shown after the sections."""
    many = len(report.sources) >= MANY_RESULTS
    overviews = [s.overview() if many else [] for s in report.sections]
    every = [s.figures() for s in report.sections]
    drawings = [some or others for some, others in zip(overviews, every, strict=True)]
    chosen = _chosen([*drawings, list(extra)], 0 if many else MAX_FOLDED)
    for part, some, others in zip(chosen, overviews, every, strict=False):
        part.left += len(others) if some else 0
    drawer = _Drawer()
    with styled():
        drawn = [drawer.draw(figures) for figures in chosen]
    sections = [
        {
            "heading": section.kind.heading,
            "tables": [markupsafe.Markup(to_html(table)) for table in section.tables],
            **figures,
        }
        for section, figures in zip(report.sections, drawn, strict=False)
    ]
    return render_page(
        "report.html",
        title=report.title,
        version=__version__,
        made=provenance_line(report.sources),
        devices=[markupsafe.Markup(to_html(table)) for table in devices(report.sources)],
        verdicts=[_bars(verdict) for verdict in report.verdicts],
        sentences=report.sentences,
        warnings=_warnings(report),
        sections=sections,
        runs=drawn[-1],
        provenance=[markupsafe.Markup(to_html(table)) for table in provenance(report.sources)],
    )


def _chosen(sections: "Sequence[Sequence[Drawing]]", folded: int) -> list[_Figures]:
    """Return which figures of each section are shown: in turn the first of each, then the next."""
    order = [
        (k, figure)
        for row in zip_longest(*sections)
        for k, figure in enumerate(row)
        if figure is not None
    ]
    chosen = [_Figures([], [], 0) for _ in sections]
    for count, (k, figure) in enumerate(order):
        if count < MAX_FIGURES:
            chosen[k].shown.append(figure)
        elif count < MAX_FIGURES + folded:
            chosen[k].folded.append(figure)
    return [
        _Figures(f.shown, f.folded, len(every) - len(f.shown) - len(f.folded))
        for f, every in zip(chosen, sections, strict=True)
    ]


class _Drawer:
    """Draws figures as `svg` elements whose ids are unique within the page."""

    def __init__(self) -> None:
        self._drawn = 0

    def draw(self, figures: _Figures) -> dict[str, Any]:
        """Return the figures for the template."""
        return {
            "figures": [self._inline(*figure) for figure in figures.shown],
            "folded": [self._inline(*figure) for figure in figures.folded],
            "left": figures.left,
        }

    def _inline(self, title: str, drawing: Any) -> Mapping[str, Any]:
        self._drawn += 1
        svg = inline_svg(f"f{self._drawn}", title, drawing())
        return {"title": title, "svg": markupsafe.Markup(svg)}


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
