"""The result of a fleet as a document (kind `fleet`) and as a tidy table."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.files.results.documents import document, quantity
from rotcli.fleet.aging import DAYS_PER_YEAR
from rotcli.fleet.charts import LAMBDA, SHEWHART_LIMIT
from rotcli.fleet.estimate import FleetResult, ParameterResult, chance_of_outliers
from rotcli.fleet.variance.nested import COMPONENTS, NestedRows
from rotcli.lazy import lazily
from rotcli.models.conformity import verdict
from rotcli.run.findings import texts
from rotcli.units import FloatArray

with lazily():
    import pandas as pd


KIND = "fleet"


def to_document(result: FleetResult, inputs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the document; inputs: one entry per folder, pattern, file or data set."""
    fields = {
        "results": result.results,
        "units": result.units,
        "days": result.days,
        "spec": None if result.spec is None else result.spec.path,
        "parameters": {p.name: _parameter(p, result) for p in result.parameters},
        "findings": [finding.to_dict() for finding in result.findings],
        "warnings": texts(result.findings),
    }
    return {**document(KIND, [], {}, fields), "inputs": [dict(entry) for entry in inputs]}


def _parameter(p: ParameterResult, result: FleetResult) -> dict[str, Any]:
    limits = None if result.spec is None else result.spec.limits_in(p.name, p.measure)
    return {
        "unit": p.measure,
        "values": len(p.rows.y),
        "units": len(p.rows.unit_start),
        "mean": quantity(p.components.mean, p.components.mean_sigma, p.measure),
        "components": {name: _component(p, k) for k, name in enumerate(COMPONENTS)},
        "repeatability": _repeatability(p),
        "minus_two_log_reml": p.components.minimum,
        "notes": list(p.components.notes),
        "outliers": _outliers(p),
        "charts": _charts(p),
        "trend": _trend(p),
        "percentiles": [
            {"percent": q.percent, "value": q.value, "lower": q.lower, "upper": q.upper}
            for q in p.percentiles
        ],
        "limits": None
        if limits is None
        else {"min": limits.low, "max": limits.high, "unit": limits.unit, "guard": limits.guard},
        "yield": _yield(p),
        "by_unit": _by_unit(p, result),
    }


def _component(p: ParameterResult, k: int) -> dict[str, Any] | None:
    """Return a component as a standard deviation with its 95 % limits, None if not separable."""
    if not p.components.estimable[k]:
        return None
    limits = p.components.intervals[k]
    low, high = (None, None) if limits is None else (math.sqrt(limits[0]), math.sqrt(limits[1]))
    return {
        "value": math.sqrt(p.components.variances[k]),
        "lower": low,
        "upper": high,
        "unit": p.measure,
        "zero_probability": p.components.zero_probability[k],
    }


def _repeatability(p: ParameterResult) -> dict[str, Any]:
    v_unit, v_day, v_turn = (float(v) for v in p.components.variances)
    unit, day, turn = p.components.estimable
    return {
        "turn_on": quantity(math.sqrt(v_turn), None, p.measure) if turn else None,
        "day_to_day": quantity(math.sqrt(v_turn + v_day), None, p.measure) if day else None,
        "unit_to_unit": quantity(math.sqrt(v_unit), None, p.measure) if unit else None,
    }


def _outliers(p: ParameterResult) -> dict[str, Any]:
    found = p.outliers
    units = [str(p.rows.units[k]) for k in np.flatnonzero(found.unit_flagged)]
    fleet, values = chance_of_outliers(len(p.rows.unit_start))
    return {
        "units": units,
        "unit_limit": found.unit_limit,
        "values": [
            {"path": str(p.paths[k]), "z": float(found.value_z[k])}
            for k in np.flatnonzero(found.value_flagged)
        ],
        "expected_by_chance": {"units": fleet, "values": values},
    }


def _charts(p: ParameterResult) -> dict[str, Any]:
    return {
        "units": len(p.charts),
        "points": "day means" if p.by_day else "turn-ons",
        "shewhart_limit": SHEWHART_LIMIT,
        "ewma_weight": LAMBDA,
        "shewhart_alarms": int(sum(c.shewhart_flagged.sum() for c in p.charts.values())),
        "ewma_units": int(sum(c.ewma_flagged.any() for c in p.charts.values())),
        "expected_by_chance": {
            "shewhart_alarms": p.alarms_by_chance[0],
            "ewma_alarms": p.alarms_by_chance[1],
        },
    }


def _trend(p: ParameterResult) -> dict[str, Any] | None:
    """Return the trend of the fleet per year, None where no time or too short."""
    if p.trends is None or p.trends.fleet is None:
        return None
    fleet = p.trends.fleet
    return {
        "mean": quantity(fleet.mean, fleet.mean_sigma, f"{p.measure}/year"),
        "spread": math.sqrt(fleet.variances[0]),
        "significant_units": int(p.trends.significant.sum()),
    }


def _yield(p: ParameterResult) -> dict[str, Any] | None:
    if p.yields is None:
        return None
    y = p.yields
    return {
        "pass": y.passed,
        "fail": y.failed,
        "undecided": y.undecided,
        "raw": {"value": y.raw.value, "lower": y.raw.lower, "upper": y.raw.upper},
        "true": {"value": y.true.value, "lower": y.true.lower, "upper": y.true.upper},
    }


def turn_on_sigmas(rows: NestedRows) -> FloatArray:
    """Return the turn-on standard deviation of each unit (u,): spread within days minus s^2.

    NaN where no day has two values; 0 where the spread is below the measurement noise.
    """
    day = rows.day_of_row()
    mean = np.add.reduceat(rows.y, rows.day_start) / rows.rows_per_day
    squares = np.add.reduceat((rows.y - mean[day]) ** 2, rows.day_start)
    # Over a day of n values: E sum (y_i - mean)^2 = (1 - 1/n) sum (s_i^2 + vR).
    noise = np.add.reduceat(rows.s2, rows.day_start) * (1.0 - 1.0 / rows.rows_per_day)
    dof = np.add.reduceat(rows.rows_per_day - 1.0, rows.unit_start)
    excess = np.add.reduceat(squares - noise, rows.unit_start)
    with np.errstate(divide="ignore", invalid="ignore"):
        variance: FloatArray = excess / dof
    return np.where(dof > 0, np.sqrt(np.maximum(variance, 0.0)), np.nan)


def _by_unit(p: ParameterResult, result: FleetResult) -> dict[str, Any]:
    rows, means = p.rows, p.means
    last = np.append(rows.day_start[rows.unit_start][1:], len(rows.y)) - 1
    turn_on = turn_on_sigmas(rows)
    limits = None if result.spec is None else result.spec.limits_in(p.name, p.measure)
    spread = math.sqrt(p.components.variances[0])
    units = {}
    for k, name in enumerate(rows.units):
        raw, sigma = float(means.raw[k]), float(means.raw_sigma[k])
        chart = p.charts.get(k)
        units[str(name)] = {
            "values": int(rows.rows_per_unit[k]),
            "last": quantity(
                float(rows.y[last[k]] + rows.centre), math.sqrt(rows.s2[last[k]]), p.measure
            ),
            "mean": quantity(raw, sigma, p.measure),
            "shrunk": quantity(float(means.shrunk[k]), float(means.shrunk_sigma[k]), p.measure),
            "turn_on": float(turn_on[k]),
            "percentile": _percentile(float(means.shrunk[k]), p.components.mean, spread),
            "z": float(p.outliers.unit_z[k]),
            "outlier": bool(p.outliers.unit_flagged[k]),
            "trend": _unit_trend(p, k),
            "shewhart_alarms": [] if chart is None else _alarms(p, chart, chart.shewhart_flagged),
            "ewma_alarms": [] if chart is None else _alarms(p, chart, chart.ewma_flagged),
            "verdict": None if limits is None else verdict(raw, sigma, limits),
        }
    return units


def _alarms(p: ParameterResult, chart: Any, flagged: NDArray[np.bool_]) -> list[str]:
    return [str(p.day_labels[day]) for day in chart.day[flagged]]


def _percentile(value: float, mean: float, spread: float) -> float | None:
    if spread <= 0.0:
        return None
    return 50.0 * math.erfc((mean - value) / (spread * math.sqrt(2.0)))


def _unit_trend(p: ParameterResult, k: int) -> dict[str, Any] | None:
    if p.trends is None or not math.isfinite(p.trends.slope[k]):
        return None
    return {
        **quantity(float(p.trends.slope[k]), float(p.trends.sigma[k]), f"{p.measure}/year"),
        "significant": bool(p.trends.significant[k]),
    }


def tidy(result: FleetResult) -> "pd.DataFrame":
    """Return one row per value: unit, day, time, parameter, value, sigma, z and flags."""
    frames = []
    for p in result.parameters:
        day = p.rows.day_of_row()
        unit = p.rows.unit_of_day()[day]
        frames.append(
            pd.DataFrame(
                {
                    "parameter": p.name,
                    "unit": p.rows.units[unit].astype(str),
                    "day": p.day_labels[day].astype(str),
                    "year": 1970.0 + p.time / DAYS_PER_YEAR,
                    "value": p.rows.y + p.rows.centre,
                    "sigma": np.sqrt(p.rows.s2),
                    "measure": p.measure,
                    "z": p.outliers.value_z,
                    "value_outlier": p.outliers.value_flagged,
                    "unit_z": p.outliers.unit_z[unit],
                    "unit_outlier": p.outliers.unit_flagged[unit],
                    "path": p.paths.astype(str),
                }
            )
        )
    return pd.concat(frames, ignore_index=True)
