"""The fleet's document as readable tables: components, yield, flagged units."""

from collections.abc import Iterator, Mapping
from typing import Any

from rotcli.files.tables import Cell, Column, Table, known_columns

Parameters = Mapping[str, Mapping[str, Any]]


def component_table(doc: Mapping[str, Any]) -> Table:
    """Return the mean and the components of each parameter with their 95 % limits."""
    rows: list[tuple[Cell, ...]] = []
    for name, p in doc["parameters"].items():
        parts = [_spread(p["components"][key]) for key in ("unit", "day", "turn_on")]
        mean = p["mean"]
        rows.append(
            (name, p["unit"], mean["value"], mean["sigma"], *parts, p["units"], p["values"])
        )
    return Table(
        title=f"{doc['results']} results of {doc['units']} units",
        columns=(
            Column("parameter"),
            Column("unit"),
            Column("mean", ".4g"),
            Column("sigma", ".2g"),
            Column("unit (95 %)"),
            Column("day (95 %)"),
            Column("turn-on (95 %)"),
            Column("units", "d"),
            Column("values", "d"),
        ),
        rows=rows,
        note=" ".join(_notes(doc["parameters"])),
    )


def _spread(component: Mapping[str, Any] | None) -> str | None:
    if component is None:
        return None
    text = f"{component['value']:.3g}"
    if component["lower"] is None:
        return text
    return f"{text} ({component['lower']:.3g} to {component['upper']:.3g})"


def _notes(parameters: Parameters) -> list[str]:
    """Return each note once, with the parameters it belongs to."""
    names: dict[str, list[str]] = {}
    for name, p in parameters.items():
        for note in p["notes"]:
            names.setdefault(note, []).append(name)
    return [f"{', '.join(of)}: {note}." for note, of in names.items()]


def flag_table(doc: Mapping[str, Any]) -> Table:
    """Return outliers, alarms and trends of each parameter, with the number expected by chance."""
    rows: list[tuple[Cell, ...]] = []
    for name, p in doc["parameters"].items():
        charts, outliers, trend = p["charts"], p["outliers"], p["trend"]
        chance = charts["expected_by_chance"]
        has = charts["units"] > 0
        rows.append(
            (
                name,
                ", ".join(outliers["units"][:5]) or "none",
                len(outliers["values"]),
                outliers["expected_by_chance"]["values"],
                charts["shewhart_alarms"] if has else None,
                chance["shewhart_alarms"] if has else None,
                charts["ewma_units"] if has else None,
                chance["ewma_alarms"] if has else None,
                None if trend is None else _with_sigma(trend["mean"]),
            )
        )
    return known_columns(
        "Outliers, control charts and trend",
        (
            Column("parameter"),
            Column("outlying units"),
            Column("outlying values", "d"),
            Column("by chance", ".1g"),
            Column("Shewhart alarms", "d"),
            Column("by chance", ".2g"),
            Column("units with EWMA alarm", "d"),
            Column("by chance", ".2g"),
            Column("trend of the fleet"),
        ),
        rows,
        "",
    )


def _with_sigma(q: Mapping[str, Any]) -> str:
    return f"{q['value']:.3g} +- {q['sigma']:.2g} {q['unit']}"


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
                limits["min"],
                limits["max"],
                limits["unit"],
                y["pass"],
                y["fail"],
                y["undecided"],
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
            Column("min", "g"),
            Column("max", "g"),
            Column("unit"),
            Column("pass", "d"),
            Column("fail", "d"),
            Column("undecided", "d"),
            Column("yield (95 %)"),
            Column("counted (95 %)"),
        ),
        rows=rows,
        note="Yield: share of units inside the limits, free of measurement noise. Counted: share "
        "of measured means inside, which noise makes smaller. Undecided: within the guard band.",
    )


def _percent(share: Mapping[str, Any]) -> str:
    low, high = 100.0 * share["lower"], 100.0 * share["upper"]
    return f"{100.0 * share['value']:.1f} % ({low:.1f} to {high:.1f})"


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


def one_line_summary(doc: Mapping[str, Any]) -> str:
    """Return the result in one line."""
    outlying = {unit for p in doc["parameters"].values() for unit in p["outliers"]["units"]}
    return (
        f"{doc['results']} results of {doc['units']} units, {len(doc['parameters'])} parameters, "
        f"{len(outlying)} outlying units"
    )
