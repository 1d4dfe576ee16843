"""The fleet's document as readable tables: components, yield, flagged units."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Table, drop_empty_columns
from rotcli.units import digits

MAX_NAMED = 5  # outlying units in a cell; the document names all
Parameters = Mapping[str, Mapping[str, Any]]


_SPREADS = (
    "Unit, day, turn-on: sigma between units, between the days of a unit and between the turn-ons "
    "of a day, without the noise of the measurement; in brackets the 95 % limits."
)


def component_table(doc: Mapping[str, Any]) -> Table:
    """Return the mean and the components of each parameter with their 95 % limits."""
    parameters: Parameters = doc["parameters"]
    counts = {p["values"] for p in parameters.values()}
    rows: list[tuple[Cell, ...]] = []
    for name, p in parameters.items():
        parts = [_spread(p["components"][key]) for key in ("unit", "day", "turn_on")]
        count = p["values"] if len(counts) > 1 else None
        rows.append((f"{name}, {p['unit']}", _with_sigma(p["mean"]), *parts, count))
    return drop_empty_columns(
        f"{doc['results']} results of {doc['units']} units",
        (
            Column("parameter"),
            Column("mean"),
            Column("unit (95 %)"),
            Column("day (95 %)"),
            Column("turn-on (95 %)"),
            Column("values", "d"),
        ),
        rows,
        " ".join([_SPREADS, *_notes(parameters)]),
    )


def _spread(component: Mapping[str, Any] | None) -> str | None:
    if component is None:
        return None
    text = digits(component["value"])
    if component["lower"] is None:
        return text
    return f"{text} ({digits(component['lower'])}–{digits(component['upper'])})"


def _with_sigma(q: Mapping[str, Any]) -> str:
    """Return a value and its sigma, both with the digits that the sigma supports."""
    value, sigma = q["value"], q["sigma"]
    if not sigma:
        return f"{value:.4g}"
    places = max(1 - math.floor(math.log10(sigma)), 0)
    return f"{value:.{places}f} ± {sigma:.{places}f}"


def _notes(parameters: Parameters) -> list[str]:
    """Return each note once, with the parameters it belongs to."""
    names: dict[str, list[str]] = {}
    for name, p in parameters.items():
        for note in p["notes"]:
            names.setdefault(note, []).append(name)
    return [f"{', '.join(of)}: {note}." for note, of in names.items()]


def flag_table(doc: Mapping[str, Any]) -> Table:
    """Return outliers, alarms and trend; in brackets the number that chance alone gives."""
    rows: list[tuple[Cell, ...]] = []
    for name, p in doc["parameters"].items():
        charts, outliers, trend = p["charts"], p["outliers"], p["trend"]
        chance = charts["expected_by_chance"]
        has = charts["units"] > 0
        units = outliers["units"]
        rows.append(
            (
                name,
                ", ".join(units[:MAX_NAMED]) + (", …" if len(units) > MAX_NAMED else "") or "none",
                _counted(len(outliers["values"]), outliers["expected_by_chance"]["values"]),
                _counted(charts["shewhart_alarms"], chance["shewhart_alarms"]) if has else None,
                _counted(charts["ewma_units"], chance["ewma_alarms"]) if has else None,
                None if trend is None else _with_sigma(trend["mean"]),
            )
        )
    return drop_empty_columns(
        "Outliers, control charts and trend",
        (
            Column("parameter"),
            Column("outlying units"),
            Column("values"),
            Column("Shewhart"),
            Column("EWMA units"),
            Column("trend per year"),
        ),
        rows,
        "Values, Shewhart and EWMA: outlying values, alarms, units with an alarm; in brackets the "
        "number that chance alone gives.",
    )


def _counted(count: int, chance: float) -> str:
    return f"{count} ({digits(chance, 2)})"


def yield_table(doc: Mapping[str, Any]) -> Table | None:
    """Return limits, verdicts and yields of the parameters of the spec, None without a spec."""
    rows: list[tuple[Cell, ...]] = []
    for name, p in doc["parameters"].items():
        y, limits = p["yield"], p["limits"]
        if y is None or limits is None:
            continue
        rows.append(
            (
                name,
                f"{_edge(limits['min'])} to {_edge(limits['max'])} {limits['unit']}",
                f"{y['pass']} / {y['fail']} / {y['undecided']}",
                _percent(y["true"]),
                _percent(y["raw"]),
            )
        )
    if not rows:
        return None
    return Table(
        title="Limits and yield",
        columns=(
            Column("parameter"),
            Column("limits"),
            Column("pass / fail / undecided"),
            Column("yield (95 %)"),
            Column("counted (95 %)"),
        ),
        rows=rows,
        note="Yield: share of units inside the limits, free of measurement noise. Counted: share "
        "of measured means inside, which noise makes smaller. Undecided: within the guard band.",
    )


def _edge(value: float | None) -> str:
    return "…" if value is None else f"{value:.6g}"


def _percent(share: Mapping[str, Any]) -> str:
    low, high = 100.0 * share["lower"], 100.0 * share["upper"]
    return f"{100.0 * share['value']:.1f} % ({low:.0f}–{high:.0f})"


def unit_rows(parameter: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the units of a parameter that have a flag, the largest |z| first."""
    flagged = [
        (name, unit)
        for name, unit in parameter["by_unit"].items()
        if unit["outlier"]
        or unit["shewhart_alarms"]
        or unit["ewma_alarms"]
        or (unit["trend"] or {}).get("significant")
        or unit["verdict"] in ("fail", "undecided")
    ]
    yield from sorted(flagged, key=lambda item: (-abs(item[1]["z"]), item[0]))


def tables(doc: Mapping[str, Any]) -> list[Table]:
    """Return all tables of a fleet document."""
    made = [component_table(doc), flag_table(doc), yield_table(doc)]
    return [table for table in made if table is not None]


def fleet_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the tables of fleet documents for a report."""
    return [table for source in sources for table in tables(source.doc)]


def one_line_summary(doc: Mapping[str, Any]) -> str:
    """Return the result in one line."""
    outlying = {unit for p in doc["parameters"].values() for unit in p["outliers"]["units"]}
    return (
        f"{doc['results']} results of {doc['units']} units, {len(doc['parameters'])} parameters, "
        f"{len(outlying)} outlying units"
    )
