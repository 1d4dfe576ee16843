"""The HTML page of a fleet: one self-contained file, figures inside as SVG, no script."""

from collections.abc import Mapping
from typing import Any

from rotcli.files.figures import inline_svg
from rotcli.files.results.page import render_page
from rotcli.files.tables.markup import to_html
from rotcli.fleet.estimate import FleetResult, ParameterResult
from rotcli.fleet.plot import chart_figure, units_figure
from rotcli.fleet.tables import tables, unit_rows
from rotcli.lazy import lazily
from rotcli.version import __version__

with lazily():
    import markupsafe


MAX_PARAMETERS = 12  # with figures; the tables contain all
MAX_CHARTS = 4  # per parameter: those with alarms, or one as an example
MAX_FLAGGED = 15  # units named per parameter


def to_html_page(result: FleetResult, doc: Mapping[str, Any], title: str) -> str:
    """Return the page of a fleet and its document."""
    sections = [
        _section(k, p, doc["parameters"][p.name], result)
        for k, p in enumerate(result.parameters[:MAX_PARAMETERS])
    ]
    return render_page(
        "fleet.html",
        title=title,
        version=__version__,
        doc=doc,
        tables=[markupsafe.Markup(to_html(table)) for table in tables(doc)],
        sections=sections,
        omitted=[p.name for p in result.parameters[MAX_PARAMETERS:]],
    )


def _section(
    k: int, p: ParameterResult, entry: Mapping[str, Any], result: FleetResult
) -> dict[str, Any]:
    limits = None if result.spec is None else result.spec.limits_in(p.name, p.measure)
    units = units_figure(p, limits)
    figures = [_figure(f"p{k}u", f"{p.name}: units in order of their mean", units)]
    for unit in _charted(p)[:MAX_CHARTS]:
        name = f"{p.name}: control charts of {p.rows.units[unit]}"
        figures.append(_figure(f"p{k}c{unit}", name, chart_figure(p, unit)))
    flagged = list(unit_rows(entry))
    return {
        "name": p.name,
        "figures": [{"title": title, "svg": markupsafe.Markup(svg)} for title, svg in figures],
        "flagged": [_flags(name, unit) for name, unit in flagged[:MAX_FLAGGED]],
        "more": max(0, len(flagged) - MAX_FLAGGED),
    }


def _figure(prefix: str, title: str, figure: Any) -> tuple[str, str]:
    return title, inline_svg(prefix, title, figure)


def _charted(p: ParameterResult) -> list[int]:
    """Return the units whose charts have alarms, or the first unit with a chart."""
    alarmed = [
        unit
        for unit, chart in p.charts.items()
        if chart.ewma_flagged.any() or chart.shewhart_flagged.any()
    ]
    return alarmed or list(p.charts)[:1]


def _flags(name: str, unit: Mapping[str, Any]) -> str:
    """Return the reasons why a unit is listed, in one line."""
    parts = []
    if unit["outlier"]:
        parts.append(f"outlying, z = {unit['z']:.1f}")
    for key, label in (("shewhart_alarms", "Shewhart"), ("ewma_alarms", "EWMA")):
        if unit[key]:
            first = unit[key][0]
            parts.append(f"{label} alarm: {len(unit[key])}, first {first}")
    trend = unit["trend"]
    if trend and trend["significant"]:
        parts.append(f"trend {trend['value']:.3g} ± {trend['sigma']:.2g} {trend['unit']}")
    if unit["verdict"] in ("fail", "undecided"):
        parts.append(str(unit["verdict"]))
    mean = unit["mean"]
    return f"{name}: {mean['value']:.4g} ± {mean['sigma']:.2g} {mean['unit']}; {'; '.join(parts)}"
