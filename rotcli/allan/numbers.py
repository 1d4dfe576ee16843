"""Which number goes where: the coefficients as programs and data sheets ask for them.

One value for three axes is their root mean square, as `rotcli export` writes it. Where a
coefficient is not significant its 95 % upper limit takes its place.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.files.tables import Cell, Column, Table
from rotcli.models.noise_numbers import (
    ACCEL_UNITS,
    ACCEL_WALK_DENSITY,
    ACCEL_WALK_PER_ROOT_HOUR,
    FORCE_DENSITY,
    GYRO_UNITS,
    GYRO_WALK_DENSITY,
    GYRO_WALK_PER_ROOT_HOUR,
    KALIBR_KEYS,
    RATE_DENSITY,
    NoiseUnit,
    per_sample,
    root_mean_square,
    walk_per_sample,
)

_NEXT_SAMPLE = "bias, from one sample to the next"


@dataclass(frozen=True)
class Number:
    """One row: coefficient (a key of results), symbol, unit, its size in SI, and where it is used.

    convert: from the coefficient and the rate (Hz) to the number in SI.
    """

    coefficient: str
    symbol: str
    unit: str
    size: float
    use: str
    convert: Callable[[float, float], float] = lambda value, rate: value


def _rows(
    sensor: str,
    units: Mapping[str, NoiseUnit],
    reading: str,
    density: NoiseUnit,
    walk: tuple[str, NoiseUnit],
) -> tuple[Number, ...]:
    """Return the rows of a sensor: its units, that of a reading, of densities and of walks."""
    white, flicker = units["random_walk"], units["bias_instability"]
    walk_density, walk_sheet = walk
    white_key, walk_key = KALIBR_KEYS[sensor, "white"], KALIBR_KEYS[sensor, "walk"]
    integral = "angle" if sensor == "gyro" else "velocity"
    return (
        Number("random_walk", "N", white.si, 1.0, f"Kalibr {white_key}"),
        Number("random_walk", "N sqrt(f)", reading, 1.0, "sigma of one sample", per_sample),
        Number("random_walk", "N", white.name, white.size, f"data sheet, {integral} random walk"),
        Number("random_walk", "N", density.name, density.size, "data sheet, noise density"),
        Number("bias_instability", "B", flicker.name, flicker.size, "data sheet, bias instability"),
        Number("rate_random_walk", "K", walk_density, 1.0, f"Kalibr {walk_key}"),
        Number("rate_random_walk", "K/sqrt(f)", reading, 1.0, _NEXT_SAMPLE, walk_per_sample),
        Number("rate_random_walk", "K", walk_sheet.name, walk_sheet.size, "data sheet"),
    )


_UNITS = {"gyro": GYRO_UNITS, "accel": ACCEL_UNITS}
_GYRO_WALK = (GYRO_WALK_DENSITY, GYRO_WALK_PER_ROOT_HOUR)
_ACCEL_WALK = (ACCEL_WALK_DENSITY, ACCEL_WALK_PER_ROOT_HOUR)
NUMBERS = {
    "gyro": _rows("gyro", GYRO_UNITS, "rad/s", RATE_DENSITY, _GYRO_WALK),
    "accel": _rows("accel", ACCEL_UNITS, "m/s^2", FORCE_DENSITY, _ACCEL_WALK),
}


def numbers(axes: Mapping[str, Mapping[str, Any]], rate: float) -> list[dict[str, Any]]:
    """Return the numbers of a document's axes at a rate (Hz), in the units of `NUMBERS`.

    Each has `axes` (name to value and is_limit) and `all`, the root mean square of the axes.
    """
    rows: list[dict[str, Any]] = []
    for sensor, entries in NUMBERS.items():
        names = [name for name in axes if name.startswith(sensor)]
        for entry in entries if names else ():
            cells = {name: _cell(axes[name], entry, _UNITS[sensor], rate) for name in names}
            rows.append(
                {
                    "sensor": sensor,
                    "coefficient": entry.coefficient,
                    "symbol": entry.symbol,
                    "unit": entry.unit,
                    "use": entry.use,
                    "axes": cells,
                    "all": _together(list(cells.values())),
                }
            )
    return rows


def _cell(
    axis: Mapping[str, Any], entry: Number, units: Mapping[str, NoiseUnit], rate: float
) -> dict[str, Any]:
    found = axis["coefficients"][entry.coefficient]
    is_limit = found["value"] is None and found["upper"] is not None
    value = found["upper"] if is_limit else found["value"]
    value = None if value is None else value * units[entry.coefficient].size
    number = None if value is None else entry.convert(value, rate) / entry.size
    return {"value": number, "is_limit": is_limit}


def _together(cells: list[dict[str, Any]]) -> dict[str, Any]:
    values = [cell["value"] for cell in cells if cell["value"] is not None]
    if len(values) < len(cells):
        return {"value": None, "is_limit": False}
    is_limit = any(cell["is_limit"] for cell in cells)
    return {"value": root_mean_square(np.array(values)), "is_limit": is_limit}


def numbers_table(doc: Mapping[str, Any]) -> Table | None:
    """Return the numbers of an allan document as a table; None for a document without them."""
    entries = doc.get("numbers")
    if not entries:
        return None
    rows: list[tuple[Cell, ...]] = [
        (entry["sensor"], entry["symbol"], _shown(entry["all"]), entry["unit"], entry["use"])
        for entry in entries
    ]
    rate = 1.0 / doc["interval_s"]
    note = f"f: the rate of the log, {rate:.6g} Hz. The random walk of Kalibr is K, never B."
    if any(entry["all"]["is_limit"] for entry in entries):
        note += " <: not significant, 95 % upper limit."
    columns = (
        Column("sensor"),
        Column("number"),
        Column("value", ".4g"),
        Column("unit"),
        Column("use"),
    )
    several = any(len(entry["axes"]) > 1 for entry in entries)
    together = " (root mean square of the axes)" if several else ""
    return Table(f"Which number goes where{together}", columns, rows, note)


def _shown(cell: Mapping[str, Any] | None) -> str | None:
    if cell is None or cell["value"] is None:
        return None
    return f"{'<' if cell['is_limit'] else ''}{cell['value']:.4g}"
