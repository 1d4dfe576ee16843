"""Errors within one turn, R16 (10) to (25): fields of the budget's document, and tables."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli import units
from rotcli.budget.estimate import ACCEL_BIAS, GYRO_BIAS, SOURCES, TurnError
from rotcli.files.tables import Cell, Column, Table
from rotcli.units import FloatArray

COMPONENTS = ("east", "north", "up")
_POINTS = 73  # of a turn: every 5 deg
_SHOWN = 9  # rows of a table: every 45 deg
_ROUNDING = 1e-9  # of the largest of a table's block: rounding residuals are shown as 0
_VELOCITY = 0.02  # m/s; below it second-order effects of a bias along the axis remain


def within_fields(turns: Sequence[TurnError]) -> dict[str, Any]:
    """Return the errors within the turn by axis and source, at 5 deg of table angle."""
    fields: dict[str, Any] = {}
    for turn in turns:
        if turn.within is None:
            continue
        within = turn.within
        kept = np.linspace(0, len(within.angle) - 1, _POINTS).round().astype(int)
        unit, factor = _unit(turn.source)
        fields.setdefault(turn.axis, {})[turn.source] = {
            "angle_deg": within.angle[kept] / units.DEG,
            "error": {"unit": unit, **_series(within.error[kept] / factor)},
            "attitude_deg": _series(within.navigated.attitude[kept] / units.DEG),
            "velocity_mps": _series(within.navigated.velocity[kept]),
        }
    return fields


def _unit(source: str) -> tuple[str, float]:
    return ("m/s^2", 1.0) if source == ACCEL_BIAS else ("deg/h", units.DEG_PER_HOUR)


def _series(values: FloatArray) -> dict[str, FloatArray]:
    return {name: values[:, k] for k, name in enumerate(COMPONENTS)}


def within_tables(doc: Mapping[str, Any]) -> list[Table]:
    """Return the errors of the sensors in n, and those of navigation, every 45 deg of a turn."""
    sensors: list[tuple[Cell, ...]] = []
    navigation: list[tuple[Cell, ...]] = []
    for axis, sources in doc["within_turn"].items():
        for source in SOURCES:
            entry = sources[source]
            angle = entry["angle_deg"]
            shown = np.linspace(0, len(angle) - 1, _SHOWN).round().astype(int)
            name = source.replace("_", " ")
            error, attitude, velocity = (
                _rows(entry[key], shown) for key in ("error", "attitude_deg", "velocity_mps")
            )
            for j, k in enumerate(shown):
                sensors.append((axis, name, float(angle[k]), *error[j], entry["error"]["unit"]))
                navigation.append((axis, name, float(angle[k]), *attitude[j], *velocity[j]))
    head = (Column("axis"), Column("source"), Column("angle, deg", ".4g"))
    rate = f"{doc['rate']['value']:.6g} deg/s"
    return [
        Table(
            title=f"Errors of the sensors in East, North, Up within one turn at {rate}",
            columns=(*head, *(Column(name, ".4g") for name in "ENU"), Column("unit")),
            rows=sensors,
            note="R16 (10) to (25): C_ns b, C_ns d, C_ns N w_is_s against the table angle.",
        ),
        Table(
            title=f"Navigation errors within one turn at {rate}",
            columns=(
                *head,
                *(Column(f"attitude {name}, deg", ".4g") for name in "ENU"),
                *(Column(f"velocity {name}, m/s", ".4g") for name in "ENU"),
            ),
            rows=navigation,
            note=contradiction(doc),
        ),
    ]


def _rows(entry: Mapping[str, Any], shown: NDArray[np.int_]) -> list[list[float]]:
    """Return the components at the rows shown; rounding residuals become 0."""
    values = np.array([entry[name] for name in COMPONENTS])
    values[np.abs(values) <= _ROUNDING * np.abs(values).max()] = 0.0
    return [[float(v) for v in values[:, k]] for k in shown]


def contradiction(doc: Mapping[str, Any]) -> str:
    """Return what is left of the velocity that, by R16, a gyro bias has lost after a turn.

    A bias d perpendicular to the axis makes a tilt that goes around a mean of d/w: the velocity
    after the turn is `2 pi g d / w^2`. The unmodulated part, along the axis, is subtracted.
    """
    left = []
    half = 0.5 * doc["gravity"]["value"] * doc["period_s"] * units.DEG
    for axis, sources in doc["within_turn"].items():
        tilt = doc["axes"][axis][GYRO_BIAS]["closed_form"]
        velocity = sources[GYRO_BIAS]["velocity_mps"]
        size = float(
            np.hypot(
                velocity["east"][-1] - half * tilt["north_deg"],
                velocity["north"][-1] + half * tilt["east_deg"],
            )
        )
        if size > _VELOCITY:
            left.append(f"{size:.3g} m/s about {axis}")
    if not left:
        return ""
    return (
        "R16 section 2.2 states that the velocity error of a modulated gyro bias cancels over a "
        f"turn. This is contradicted: {', '.join(left)} remain. The tilt goes around a mean of "
        "d/w (gyro bias over table rate), not around zero."
    )
