"""Analyse the table of a fleet: every parameter with components, outliers, charts, trend, yield."""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import field
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.spec import Spec, scale
from rotcli.fleet.aging import Trends, trends
from rotcli.fleet.charts import (
    BASELINE_POINTS,
    RUN_LENGTH,
    Chart,
    chart,
    points,
    shewhart_alarm_probability,
)
from rotcli.fleet.outliers import FALSE_ALARM_RATE, Outliers, find_outliers
from rotcli.fleet.variance.components import Components, UnitMeans, fit, unit_means
from rotcli.fleet.variance.nested import NestedRows, nest
from rotcli.fleet.yields import Percentile, Yield, estimate_yield, percentiles
from rotcli.run.findings import Finding
from rotcli.units import FloatArray

if TYPE_CHECKING:
    import pandas as pd


MIN_VALUES = 3  # below it a parameter has no components
# Columns of an analysis; texts that it does not need would be copied for each parameter.
_USED = ("parameter", "unit", "day", "time", "value", "sigma", "measure", "rate", "path")
_RATE_SHARE = 0.01  # rates within 1 % are one rate


@dataclass(frozen=True)
class FleetOptions:
    """default_sigma: pattern of parameters to the sigma of values without one, in their unit."""

    default_sigma: Mapping[str, float] = field(default_factory=dict)
    baseline: int = BASELINE_POINTS
    parameters: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ParameterResult:
    """One parameter of the fleet; arrays follow the order of `rows`.

    day_labels: (d,) of the days; paths: (n,) of the values; used: rows without flagged units.
    alarms_by_chance: expected false alarms of both charts over all units.
    """

    name: str
    measure: str
    rows: NestedRows
    day_labels: NDArray[np.object_]
    paths: NDArray[np.object_]
    time: FloatArray
    components: Components
    means: UnitMeans
    outliers: Outliers
    charts: dict[int, Chart]
    by_day: bool
    alarms_by_chance: tuple[float, float]
    trends: Trends | None
    percentiles: list[Percentile]
    yields: Yield | None


@dataclass(frozen=True, eq=False)
class FleetResult:
    """All parameters in alphabetical order, and findings."""

    parameters: list[ParameterResult]
    results: int
    units: int
    days: int
    findings: list[Finding]
    spec: Spec | None


def estimate(frame: "pd.DataFrame", options: FleetOptions, spec: Spec | None = None) -> FleetResult:
    """Analyse a table with the columns of `records.COLUMNS`.

    Raises ResultError for units of measure that do not convert, and when nothing can be analysed.
    """
    findings: list[Finding] = []
    measures = _measures(frame)
    if spec is not None:
        spec.check_known(measures)
    frame = _chosen(frame, options.parameters)
    prepared = []
    for name, rows in frame[list(_USED)].groupby("parameter", sort=True, observed=True):
        table = _prepared(str(name), rows, measures[str(name)], options, findings)
        if len(table) < MIN_VALUES:
            text = f"{name}: {len(table)} values with sigma; at least {MIN_VALUES} are needed"
            findings.append(Finding("too-few-values", text, where=name, limit=MIN_VALUES))
            continue
        prepared.append((str(name), table))
    if not prepared:
        reason = findings[-1].text if findings else "no rows"
        raise ResultError(f"no parameter can be analysed ({reason}); add results")
    # The sums release the interpreter's lock, so threads use the cores; the order stays.
    with ThreadPoolExecutor(min(len(prepared), os.cpu_count() or 1)) as pool:
        made = list(
            pool.map(lambda p: _analyse(p[0], measures[p[0]], p[1], options, spec), prepared)
        )
    return FleetResult(
        parameters=made,
        results=int(frame["sha256"].nunique()),
        units=int(frame["unit"].nunique()),
        days=int(frame["day"].nunique()),
        findings=[*findings, *_flags(made)],
        spec=spec,
    )


def _chosen(frame: "pd.DataFrame", patterns: Sequence[str]) -> "pd.DataFrame":
    if not patterns:
        return frame
    names = [
        name
        for name in frame["parameter"].unique()
        if any(fnmatchcase(name, pattern) for pattern in patterns)
    ]
    if not names:
        raise ResultError(f"{', '.join(patterns)}: no parameter of this name in the results")
    return frame[frame["parameter"].isin(names)]


def _measures(frame: "pd.DataFrame") -> dict[str, str]:
    """Return the unit of measure of each parameter: that of most of its values."""
    counts = frame.groupby(["parameter", "measure"], observed=True).size().reset_index(name="n")
    ordered = counts.sort_values(["parameter", "n", "measure"], ascending=[True, False, True])
    first = ordered.drop_duplicates("parameter")
    return dict(zip(first["parameter"].astype(str), first["measure"], strict=True))


def _prepared(
    name: str, rows: "pd.DataFrame", measure: str, options: FleetOptions, findings: list[Finding]
) -> "pd.DataFrame":
    """Return the rows in one unit, each with a sigma, sorted; warn about the others."""
    rows = rows.copy()
    for other in rows["measure"].unique():
        factor = scale(other, measure)
        where = rows["measure"] == other
        if factor is None:
            path = rows.loc[where, "path"].iloc[0]
            raise ResultError(
                f"{path}: {name}: unit {other}, but most results are in {measure}; "
                "remove or convert these results"
            )
        if factor != 1.0:
            rows.loc[where, ["value", "sigma"]] *= factor
    without = ~(rows["sigma"] > 0.0)
    for pattern, sigma in options.default_sigma.items():
        if fnmatchcase(name, pattern):
            rows.loc[without, "sigma"] = sigma
            without = ~(rows["sigma"] > 0.0)
    if without.any():
        path = rows.loc[without, "path"].iloc[0]
        count = int(without.sum())
        excluded = "This value is" if count == 1 else f"{count} such values are"
        text = f"{path}: {name}: no sigma. {excluded} excluded; set a default sigma"
        findings.append(Finding("sigma-missing", text, where=name, value=float(without.sum())))
        rows = rows[~without]
    _warn_mixed_rates(name, rows, findings)
    _warn_repeated(rows, findings)
    return rows.sort_values(["unit", "day", "time", "path"], ignore_index=True)


def _warn_mixed_rates(name: str, rows: "pd.DataFrame", findings: list[Finding]) -> None:
    rates = np.unique(np.round(np.abs(rows["rate"].dropna().to_numpy(dtype=float)), 6))
    if name.startswith("K") and len(rates) > 1 and rates[-1] > rates[0] * (1.0 + _RATE_SHARE):
        text = (
            f"{name}: table rates from {rates[0]:g} to {rates[-1]:g} deg/s are analysed together; "
            "a nonlinear scale factor then adds to the components"
        )
        findings.append(Finding("mixed-rates", text, where=name, unit="deg/s"))


def _warn_repeated(rows: "pd.DataFrame", findings: list[Finding]) -> None:
    """Warn once of results of one device and day that are equal to the last digit."""
    again = rows["value"].duplicated() & (rows["value"] != 0.0)
    if not again.any() or any(f.code == "repeated-result" for f in findings):
        return
    same = ["unit", "day", "value", "sigma"]
    shared = rows[rows["value"].isin(rows.loc[again, "value"])].sort_values("path")
    second = shared[shared.duplicated(same)]
    if second.empty:
        return
    path = second["path"].iloc[0]
    key = tuple(second.iloc[0][same])
    first = next(r.path for r in shared.itertuples() if tuple(getattr(r, c) for c in same) == key)
    count = "" if len(second) == 1 else f" ({len(second)} files repeat another one)"
    text = f"{path}: the values are those of {first}{count}; each counts as a turn-on. Remove one"
    findings.append(Finding("repeated-result", text, where=path, value=float(len(second))))


def _analyse(
    name: str, measure: str, table: "pd.DataFrame", options: FleetOptions, spec: Spec | None
) -> ParameterResult:
    values, sigma, time = (table[c].to_numpy(dtype=float) for c in ("value", "sigma", "time"))
    order = np.where(np.isfinite(time), time, 0.0)
    rows = nest(values, sigma, table["unit"].to_numpy(str), table["day"].to_numpy(str), order)
    outliers = find_outliers(rows, fit(rows, intervals=False))
    flagged = outliers.unit_flagged
    used = rows.without(flagged) if flagged.any() else rows
    components = fit(used, near=outliers.components.variances)
    means = unit_means(rows, components)
    charts, by_day, chance = _charts(rows, components, options.baseline)
    sorted_time = time[rows.order]
    limits = None if spec is None else spec.limits_in(name, measure)
    return ParameterResult(
        name=name,
        measure=measure,
        rows=rows,
        day_labels=table["day"].to_numpy(object)[rows.order][rows.day_start],
        paths=table["path"].to_numpy(object)[rows.order],
        time=sorted_time,
        components=components,
        means=means,
        outliers=outliers,
        charts=charts,
        by_day=by_day,
        alarms_by_chance=chance,
        trends=trends(rows, sorted_time, components) if np.isfinite(time).all() else None,
        percentiles=percentiles(components, means.shrunk[~flagged]),
        yields=None if limits is None else estimate_yield(used, components, means, flagged, limits),
    )


def _charts(
    rows: NestedRows, components: Components, baseline: int
) -> tuple[dict[int, Chart], bool, tuple[float, float]]:
    """Return the charts by unit index, whether points are days, and alarms expected by chance."""
    made = points(rows, components)
    ends = np.append(made.start[1:], len(made.value))
    charts: dict[int, Chart] = {}
    later = 0
    for unit, (start, end) in enumerate(zip(made.start, ends, strict=True)):
        one = chart(
            made.value[start:end], made.variance[start:end], made.day[start:end], baseline=baseline
        )
        if one is not None:
            charts[unit] = one
            later += len(one.value) - one.baseline
    return charts, made.by_day, (later * shewhart_alarm_probability(), later / RUN_LENGTH)


def _flags(parameters: Sequence[ParameterResult]) -> list[Finding]:
    """Return a note per outlying unit and per unit whose EWMA chart has an alarm."""
    notes = []
    for p in parameters:
        for k in np.flatnonzero(p.outliers.unit_flagged):
            z, limit = float(p.outliers.unit_z[k]), p.outliers.unit_limit
            text = f"{p.name}: unit {p.rows.units[k]} deviates by {z:.1f} sigma (limit {limit:.1f})"
            notes.append(Finding("outlying-unit", text, "note", str(p.rows.units[k]), z, limit))
        for unit, one in p.charts.items():
            if one.ewma_flagged.any():
                first = p.day_labels[one.day[one.ewma_flagged][0]]
                text = f"{p.name}: EWMA chart of unit {p.rows.units[unit]} has an alarm on {first}"
                notes.append(Finding("ewma-alarm", text, "note", str(p.rows.units[unit])))
    return notes


def chance_of_outliers(units: int) -> tuple[float, float]:
    """Return the expected false flags: of units in the fleet, and of single values."""
    return FALSE_ALARM_RATE, FALSE_ALARM_RATE * units
