"""Simulate a fleet: calibration results of many units, days and turn-ons with known components.

The results have the form that `calibrate` writes, so the chain from files to components can
be checked. A truth file states the components and the mean of each unit.
"""

import json
from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.files.results.documents import SCHEMA, quantity, write_error, write_result
from rotcli.units import FloatArray
from rotcli.version import __version__

FIRST_DAY = date(2026, 1, 5)
DAY_STEP = 14  # days between the test days of a unit


@dataclass(frozen=True)
class ParameterTruth:
    """Mean, standard deviations of unit, day and turn-on, and range of the sigma of one value."""

    mean: float
    unit: float
    day: float
    turn_on: float
    sigma: tuple[float, float]
    measure: str


# Sizes of a tactical MEMS triad; bias_z and its components are those of the reference fleet.
PARAMETERS = {
    "bias_x": ParameterTruth(120.0, 30.0, 8.0, 5.0, (2.0, 12.0), "deg/h"),
    "bias_y": ParameterTruth(-90.0, 30.0, 8.0, 5.0, (2.0, 12.0), "deg/h"),
    "bias_z": ParameterTruth(60.0, 30.0, 8.0, 5.0, (2.0, 12.0), "deg/h"),
    "Kgxz": ParameterTruth(-1100.0, 150.0, 10.0, 5.0, (20.0, 60.0), "ppm"),
    "Kgyz": ParameterTruth(800.0, 150.0, 10.0, 5.0, (20.0, 60.0), "ppm"),
    "Kgz": ParameterTruth(1200.0, 200.0, 40.0, 20.0, (20.0, 60.0), "ppm"),
}


@dataclass(frozen=True)
class FleetSize:
    """Number of units, of days per unit, of turn-ons per day."""

    units: int
    days: int
    turn_ons: int

    @property
    def results(self) -> int:
        """Number of results."""
        return self.units * self.days * self.turn_ons


def simulate(size: FleetSize, seed: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield path (below the fleet's folder) and document of each result."""
    values, sigmas = _draw(size, seed)
    for unit in range(size.units):
        serial = f"SN{unit + 1:04d}"
        for day in range(size.days):
            text = (FIRST_DAY + timedelta(days=DAY_STEP * day)).isoformat()
            for turn in range(size.turn_ons):
                index = (unit, day, turn)
                stamp = f"{text}T{8 + turn // 4:02d}:{15 * (turn % 4):02d}:00"
                parameters = {
                    name: quantity(
                        float(values[name][index]), float(sigmas[name][index]), truth.measure
                    )
                    for name, truth in PARAMETERS.items()
                }
                yield f"{serial}/{text}/{turn + 1:02d}.json", _document(serial, stamp, parameters)


def _draw(size: FleetSize, seed: int) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return values and sigmas (units, days, turn-ons) of each parameter."""
    rng = np.random.default_rng(seed)
    shape = (size.units, size.days, size.turn_ons)
    values, sigmas = {}, {}
    for name, truth in PARAMETERS.items():
        low, high = truth.sigma
        sigma = low * (high / low) ** rng.random(shape)  # log-uniform
        unit = truth.unit * rng.standard_normal((size.units, 1, 1))
        day = truth.day * rng.standard_normal((size.units, size.days, 1))
        turn_on = truth.turn_on * rng.standard_normal(shape)
        values[name] = truth.mean + unit + day + turn_on + sigma * rng.standard_normal(shape)
        sigmas[name] = sigma
    return values, sigmas


def _document(serial: str, stamp: str, parameters: dict[str, Any]) -> dict[str, Any]:
    return {
        "kind": "calibration",
        "schema": SCHEMA,
        "rotcli": __version__,
        "inputs": [],
        "rig": {"imu": {"name": "simulated"}, "unit": {"serial": serial, "date": stamp}},
        "unit": {"serial": serial, "date": stamp},
        "model": "column",
        "axis": "z",
        "rate": quantity(100.0, None, "deg/s"),
        "parameters": parameters,
        "warnings": [],
    }


def truth(size: FleetSize, seed: int) -> dict[str, Any]:
    """Return the truth document of the fleet: components of each parameter."""
    return {
        "kind": "simulation",
        "schema": SCHEMA,
        "rotcli": __version__,
        "fleet": {"units": size.units, "days": size.days, "turn_ons": size.turn_ons},
        "seed": seed,
        "components": {
            name: {
                "mean": p.mean,
                "sigma_unit": p.unit,
                "sigma_day": p.day,
                "sigma_turn_on": p.turn_on,
                "unit": p.measure,
            }
            for name, p in PARAMETERS.items()
        },
    }


def write_fleet(folder: str, size: FleetSize, seed: int) -> None:
    """Write the results and the truth below a folder; raises ResultError."""
    made: set[Path] = set()
    try:
        for name, doc in simulate(size, seed):
            path = Path(folder) / name
            if path.parent not in made:
                path.parent.mkdir(parents=True, exist_ok=True)
                made.add(path.parent)
            path.write_text(json.dumps(doc, indent=2) + "\n", encoding="utf-8")
    except OSError as fault:
        raise write_error(folder, fault) from fault
    write_result(str(Path(folder) / "truth.json"), truth(size, seed))
