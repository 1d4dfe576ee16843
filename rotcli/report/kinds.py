"""What shows the results of each kind; a new kind is an entry of KINDS."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from rotcli.dataclass import dataclass


@dataclass(frozen=True)
class Kind:
    """What shows the results of one kind, functions named as `module:function`.

    tables: takes the kind's sources and returns a list of tables. figures: takes the sources and
    returns (title, function that draws) pairs. overview: as figures, of all units at once, for
    large reports. compares: tables and figures take the flag `published`. summary:
    takes the sources and returns sentences; headline: takes a document and returns its result in
    one line, for kinds without a summary.
    """

    heading: str
    tables: str
    figures: str | None = None
    overview: str | None = None
    summary: str | None = None
    headline: str | None = None
    compares: bool = False


# In the order of the report.
KINDS = {
    "navigation": Kind(
        "Navigation",
        "rotcli.navigate.campaign.tables:navigation_tables",
        figures="rotcli.report.plots_campaign:navigation_figures",
        overview="rotcli.report.plots_overview:navigation_overview",
        compares=True,
    ),
    "calibration": Kind(
        "Calibration",
        "rotcli.calibrate.campaign:calibration_tables",
        figures="rotcli.report.plots_campaign:calibration_figures",
        overview="rotcli.report.plots_overview:calibration_overview",
        summary="rotcli.report.summary:calibration_sentences",
        compares=True,
    ),
    "calibration:triad": Kind(
        "Full calibration",
        "rotcli.triad.document:triad_tables",
        figures="rotcli.triad.plot:triad_figures",
        headline="rotcli.triad.document:headline",
    ),
    "calibration:scale": Kind(
        "Scale factor over rates",
        "rotcli.scale.tables:scale_tables",
        figures="rotcli.scale.plot:scale_figures",
        headline="rotcli.scale.document:one_line_summary",
    ),
    "calibration:thermal": Kind(
        "Bias and scale factor over temperature",
        "rotcli.thermal.tables:thermal_tables",
        figures="rotcli.thermal.plot:thermal_figures",
        headline="rotcli.thermal.document:one_line_summary",
    ),
    "warm-up": Kind("Warm-up", "rotcli.thermal.tables:warm_up_tables"),
    "scale-design": Kind("Design of a scale factor test", "rotcli.scale.design:design_tables"),
    "plan": Kind(
        "Calibration plan",
        "rotcli.plan.document:plan_tables",
        headline="rotcli.plan.document:headline",
    ),
    "allan": Kind(
        "Noise",
        "rotcli.allan.campaign:allan_tables",
        figures="rotcli.report.plots_campaign:allan_figures",
        overview="rotcli.report.plots_overview:allan_overview",
        summary="rotcli.report.sentences:allan_sentences",
    ),
    "budget": Kind(
        "Error budget",
        "rotcli.budget.document:budget_tables",
        figures="rotcli.budget.plot:budget_figures",
        headline="rotcli.report.sentences:budget_headline",
    ),
    "observability": Kind(
        "Observability",
        "rotcli.observe.published_o17:observability_tables",
        figures="rotcli.observe.published_o17:observability_figures",
        headline="rotcli.report.sentences:observability_headline",
        compares=True,
    ),
    "srins": Kind(
        "Single-axis rotation INS with level damping",
        "rotcli.srins.tables:srins_tables",
        figures="rotcli.srins.plot:srins_figures",
        summary="rotcli.report.sentences:srins_sentences",
        compares=True,
    ),
    "srins-observability": Kind(
        "Observability of a single-axis rotation INS",
        "rotcli.srins.observability_document:observability_tables",
        figures="rotcli.srins.plot:observability_figures",
        headline="rotcli.report.sentences:srins_observability_headline",
        compares=True,
    ),
    "fleet": Kind(
        "Fleet",
        "rotcli.fleet.tables:fleet_tables",
        headline="rotcli.fleet.tables:one_line_summary",
    ),
}
# Files that lie next to results and are none: the truth of a simulation.
SKIPPED_KINDS = ("simulation",)


def load(name: str) -> Callable[..., Any]:
    """Return the function `module:function`."""
    module, _, function = name.partition(":")
    found: Callable[..., Any] = getattr(import_module(module), function)
    return found


def section_of(doc: Mapping[str, Any]) -> str:
    """Return the key of KINDS for a document: its kind, and its model where that has a section."""
    key = f"{doc['kind']}:{doc.get('model')}"
    return key if key in KINDS else str(doc["kind"])


def is_reported(doc: Mapping[str, Any]) -> bool:
    """Return whether a report shows documents of this kind."""
    return section_of(doc) in KINDS
