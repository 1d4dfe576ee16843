"""An error budget as a result document and as tables."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli import units
from rotcli.budget.advice import recommendation
from rotcli.budget.calibration_time import CalibrationTime
from rotcli.budget.estimate import ACCEL_BIAS, SOURCES, STILL, Budget, NavigationError, TurnError
from rotcli.budget.within import within_fields, within_tables
from rotcli.errors import ResultError
from rotcli.files.results.documents import quantity
from rotcli.files.results.expected_runs import expected_table
from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Table
from rotcli.units import FloatArray

KIND = "budget"
_COMPONENTS = ("east", "north", "up")
# Rounding residuals of figures that cancel are shown as 0: below this share of the row's maximum,
_ROUNDING = 1e-9
_NOTHING = 1e-13  # or below so many m/s, m, deg


def fields(result: Budget, *, within_turn: bool = False) -> dict[str, Any]:
    """Return the fields of the document: m/s and deg per turn, m, m/s and deg over the duration.

    within_turn: with the errors against the table angle.
    """
    base = result.base
    axes = list(dict.fromkeys(t.axis for t in result.turns))
    turns = {(t.axis, t.source): t for t in result.turns}
    growth = {(g.axis, g.source): g for g in result.growth}
    return {
        "rate": quantity(result.rate / units.DEG, None, "deg/s"),
        "latitude": quantity(base.latitude / units.DEG, None, "deg"),
        "gravity": quantity(base.gravity, None, "m/s^2"),
        "period_s": result.period,
        "duration_s": result.duration,
        "parameters": _parameters(result),
        "noise": _noise(result),
        "axes": {axis: {source: _turn(turns[axis, source]) for source in SOURCES} for axis in axes},
        "growth": {
            scheme: {
                source: {
                    "unmodulated": _seen(growth[scheme, source].unmodulated),
                    "navigated": _seen(growth[scheme, source].navigated),
                }
                for source in SOURCES
            }
            for scheme in (*axes, STILL)
        },
        "totals": {scheme: _seen(seen) for scheme, seen in result.totals.items()},
        **({"within_turn": within_fields(result.turns)} if within_turn else {}),
        "calibration": {
            "model": "sigma^2 = N^2/T + (2 ln 2/pi) B^2 + K^2 T/3; of a matrix element, over the "
            "rate; T each for the still and the turning segment",
            "times": [_calibration(row) for row in result.calibration],
            "best": None if result.best is None else _calibration(result.best),
            "best_is_minimum": result.best_is_minimum,
        },
        "recommendation": recommendation(result),
    }


def _noise(result: Budget) -> dict[str, Any]:
    noise, dph = result.noise, units.DEG_PER_HOUR
    return {
        "angle_random_walk": quantity(noise.white / units.DEG_PER_ROOT_HOUR, None, "deg/sqrt(h)"),
        "bias_instability": quantity(noise.bias_instability / dph, None, "deg/h"),
        "rate_random_walk": quantity(noise.rate_random_walk / dph, None, "deg/h/sqrt(s)"),
    }


def _parameters(result: Budget) -> dict[str, Any]:
    biases = {
        f"bias_{axis}": quantity(value / units.DEG_PER_HOUR, None, "deg/h")
        for axis, value in zip("xyz", result.gyro.bias, strict=True)
    }
    matrix = {
        f"Kg{row}" if row == column else f"Kg{row}{column}": quantity(
            result.gyro.matrix[i, j] / units.PPM, None, "ppm"
        )
        for i, row in enumerate("xyz")
        for j, column in enumerate("xyz")
    }
    accel = {
        f"accel_bias_{axis}": quantity(value, None, "m/s^2")
        for axis, value in zip("xyz", result.accel_bias, strict=True)
    }
    return {**biases, **matrix, **accel}


def _vector(values: FloatArray, unit: str) -> dict[str, float]:
    scale = units.DEG if unit == "deg" else 1.0
    return {f"{name}_{unit}": float(v / scale) for name, v in zip(_COMPONENTS, values, strict=True)}


def _turn(turn: TurnError) -> dict[str, Any]:
    velocity = turn.source == ACCEL_BIAS
    unit = "mps" if velocity else "deg"
    return {
        "error": "velocity" if velocity else "attitude",
        "closed_form": _vector(turn.closed_form, unit),
        "integrated": _vector(turn.integrated, unit),
        "navigated": None if turn.navigated is None else _seen(turn.navigated),
    }


def _seen(seen: NavigationError) -> dict[str, float]:
    return {
        **_vector(seen.attitude, "deg"),
        **_vector(seen.velocity, "mps"),
        **_vector(seen.position, "m"),
    }


def _calibration(row: CalibrationTime) -> dict[str, Any]:
    dph, ppm = units.DEG_PER_HOUR, units.PPM
    return {
        "time_s": row.time,
        "bias_predicted_dph": row.bias_predicted / dph,
        "scale_predicted_ppm": row.column_predicted / ppm,
        "bias_dph": row.bias / dph,
        "bias_white_dph": row.bias_white / dph,
        "scale_ppm": row.column / ppm,
        "scale_white_ppm": row.column_white / ppm,
    }


def budget_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the tables of budget documents for a report; raises ResultError for a broken one."""
    found = []
    for source in sources:
        try:
            found += tables(source.doc)
        except (KeyError, TypeError, ValueError, AttributeError) as fault:
            raise ResultError(
                f"{source.path}: incomplete budget: {fault!r}; create it again with rotcli budget"
            ) from fault
    return found


def tables(doc: Mapping[str, Any]) -> list[Table]:
    """Return a budget document as tables: one turn, as navigated, growth, calibration time."""
    found = [_turn_table(doc), *_navigated_tables(doc), _growth_table(doc)]
    if doc.get("within_turn"):
        found[1:1] = within_tables(doc)
    if (doc.get("expected") or {}).get("runs"):
        found.append(expected_table(doc["expected"]))
    return [*found, _calibration_table(doc)] if doc["calibration"]["times"] else found


def _name(source: str) -> str:
    return source.replace("_", " ")


def _clean(value: float, greatest: float) -> float:
    return 0.0 if abs(value) <= max(_ROUNDING * greatest, _NOTHING) else value


def _figures(vectors: list[Mapping[str, float]], unit: str) -> list[list[float]]:
    """Return the components of vectors in one unit; rounding residuals become 0."""
    rows = [[vector[f"{name}_{unit}"] for name in _COMPONENTS] for vector in vectors]
    greatest = max(abs(value) for row in rows for value in row)
    return [[_clean(value, greatest) for value in row] for row in rows]


def _shown_unit(key: str) -> str:
    return {"mps": "m/s"}.get(key, key)


def _turn_table(doc: Mapping[str, Any]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for axis, sources in doc["axes"].items():
        for source, entry in sources.items():
            unit = "mps" if entry["error"] == "velocity" else "deg"
            figures = _figures([entry["closed_form"], entry["integrated"]], unit)
            rows.append(
                (axis, _name(source), entry["error"], _shown_unit(unit), *figures[0], *figures[1])
            )
    names = [f"{kind}, {name}" for kind in ("formula", "integral") for name in "ENU"]
    return Table(
        title=f"Error after one turn at {_rate(doc)} ({doc['period_s']:.6g} s)",
        columns=(
            Column("axis"),
            Column("source"),
            Column("error"),
            Column("unit"),
            *(Column(name, ".4g") for name in names),
        ),
        rows=rows,
        note=f"{doc['recommendation']} Latitude {doc['latitude']['value']:.6g} deg. Formula: R16 "
        "table 1; integral: of the sensor errors turned into East, North, Up.",
    )


def _navigated_tables(doc: Mapping[str, Any]) -> list[Table]:
    """Return what navigation shows after one turn; nothing where a turn takes too long."""
    rows: list[tuple[Cell, ...]] = []
    for axis, sources in doc["axes"].items():
        for source, entry in sources.items():
            if entry["navigated"] is None:
                continue
            figures = [_figures([entry["navigated"]], unit)[0] for unit in ("deg", "mps")]
            rows.append((axis, _name(source), *figures[0], *figures[1]))
    kinds = (("attitude", "deg"), ("velocity", "m/s"))
    names = [f"{kind} {name}, {unit}" for kind, unit in kinds for name in "ENU"]
    shown = Table(
        title=f"Navigation error after one turn at {_rate(doc)}",
        columns=(Column("axis"), Column("source"), *(Column(name, ".4g") for name in names)),
        rows=rows,
        note="Nonlinear, with the rotation of the Earth and gravity in the tilted axes, which "
        "R16 table 1 omits.",
    )
    return [shown] if rows else []


def _growth_table(doc: Mapping[str, Any]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for scheme, sources in doc["growth"].items():
        for source, entry in sources.items():
            left, seen = entry["unmodulated"], entry["navigated"]
            linear = (
                _level(left, "deg"),
                _clean(abs(left["up_deg"]), 0.0),
                _level(left, "mps"),
                _level(left, "m"),
                _clean(abs(left["up_m"]), 0.0),
            )
            rows.append((scheme, _name(source), *linear, *_position(seen)))
        total = (doc.get("totals") or {}).get(scheme)
        if total:
            rows.append((scheme, "all together", *[None] * 5, *_position(total)))
    names = (
        *("tilt, deg", "azimuth, deg", "velocity, m/s", "position, m", "height, m"),
        *("position, full model, m", "height, full model, m"),
    )
    return Table(
        title=f"Error growth over {doc['duration_s']:g} s at {_rate(doc)}",
        columns=(Column("axis"), Column("source"), *(Column(name, ".4g") for name in names)),
        rows=rows,
        note="Magnitudes; tilt, velocity and position are horizontal. First the unmodulated part "
        "alone, R16 (26), (27), linear in the tilt. Full model: nonlinear navigation with the "
        "rotation of the Earth and with the modulated part, whose mean is not zero.",
    )


def _position(seen: Mapping[str, float]) -> tuple[float, float]:
    return _level(seen, "m"), _clean(abs(seen["up_m"]), 0.0)


def _level(entry: Mapping[str, float], unit: str) -> float:
    return _clean(float(np.hypot(entry[f"east_{unit}"], entry[f"north_{unit}"])), 0.0)


def _calibration_table(doc: Mapping[str, Any]) -> Table:
    calibration = doc["calibration"]
    best = calibration["best"]
    listed = {row["time_s"]: row for row in (*calibration["times"], *([best] if best else []))}
    biases = ("bias_predicted_dph", "bias_dph", "bias_white_dph")
    keys = ("time_s", *biases, "scale_predicted_ppm", "scale_ppm", "scale_white_ppm")
    shown = sorted(listed.items())
    if best is None:
        note = "No best time: it needs white noise and a bias instability or rate random walk."
    elif calibration["best_is_minimum"]:
        note = (
            f"Best: {best['time_s']:.4g} s; beyond it, rate random walk increases the error (R16 "
            "section 4)."
        )
    else:
        note = (
            f"Best: {best['time_s']:.4g} s, where white noise equals the floor of the bias "
            "instability; more time reduces the sigma by less than a factor of 1.41."
        )
    note += (
        " First columns: what calibrate prints, the bias of the 300 s that follow and the "
        "difference of both segments. Allan: the mean over a segment. R16 (36) takes the bias as "
        "known; white noise makes the difference larger by sqrt(2)."
    )
    return Table(
        title="Predicted sigma of a calibration against the time still and the time turning at "
        + _rate(doc),
        columns=(
            Column("time, s", ".4g"),
            Column("bias, deg/h", ".2f"),
            Column("Allan", ".2f"),
            Column("white noise (R16 (35))", ".2f"),
            Column("scale and installation, ppm", ".2f"),
            Column("Allan", ".2f"),
            Column("white noise (R16 (36))", ".2f"),
        ),
        rows=[tuple(row.get(key) for key in keys) for _, row in shown],
        note=note,
    )


def _rate(doc: Mapping[str, Any]) -> str:
    return f"{doc['rate']['value']:.6g} deg/s"
