"""The comment at the top of every exported file: source, rate, rules, losses, both unit systems."""

import math
from collections.abc import Sequence

import numpy as np

from rotcli.export.numbers import Numbers, TriadNumbers
from rotcli.models.noise_numbers import (
    ACCEL_UNITS,
    ACCEL_WALK_DENSITY,
    FORCE_DENSITY,
    GYRO_UNITS,
    GYRO_WALK_DENSITY,
    NoiseUnit,
)

_GYRO: dict[str, NoiseUnit] = {
    "white": GYRO_UNITS["random_walk"],
    "flicker": GYRO_UNITS["bias_instability"],
    "walk": GYRO_UNITS["rate_random_walk"]._replace(si=GYRO_WALK_DENSITY),
}
_ACCEL: dict[str, NoiseUnit] = {
    "white": FORCE_DENSITY,
    "flicker": ACCEL_UNITS["bias_instability"],
    "walk": ACCEL_UNITS["rate_random_walk"]._replace(si=ACCEL_WALK_DENSITY),
}
_SYMBOLS = {"white": "N", "flicker": "B", "walk": "K"}


def header_lines(
    title: str, numbers: Numbers, notes: Sequence[str], lost: Sequence[str], version: str
) -> list[str]:
    """Return the lines of the header comment, without comment signs."""
    figures, settings = numbers.figures, numbers.settings
    device = figures.name or "unknown"
    serial = f", serial {figures.serial}" if figures.serial else ""
    lines = [f"{title}; written by rotcli {version}", f"device: {device}{serial}"]
    lines += [f"source: {s.path} ({s.kind}), sha256 {s.sha256}" for s in figures.sources]
    if numbers.gyro is not None or numbers.accel is not None:
        lines += _noise_lines(numbers)
        rule = "maximum" if settings.axes == "max" else "root mean square"
        lines.append(f"axes: {rule} of the axes where the format has one value for three axes")
        inflation = "none" if settings.inflate == 1.0 else f"densities x {settings.inflate:g}"
        lines.append(f"inflation: {inflation}")
        lines.append("random walk: K, rate random walk (Allan slope +1/2, read at 3 s), never B")
    lines += [f"note: {note}" for note in notes]
    lines.append("lost (no field in this format): " + (", ".join(lost) or "nothing"))
    return lines


def _noise_lines(numbers: Numbers) -> list[str]:
    lines = []
    rate = numbers.settings.rate or numbers.figures.rate
    if rate is not None:
        source = "option" if numbers.settings.rate else "log"
        lines.append(f"rate: {rate:.10g} Hz (from the {source})")
    for label, triad, column in (
        ("gyro", numbers.gyro, _GYRO),
        ("accel", numbers.accel, _ACCEL),
    ):
        if triad is not None:
            lines += _triad_lines(label, triad, column, numbers.settings.axes)
    return lines


def _triad_lines(
    label: str, triad: TriadNumbers, column: dict[str, NoiseUnit], rule: str
) -> list[str]:
    lines = []
    for quantity, (unit, size, si) in column.items():
        values = getattr(triad, quantity)
        if not np.isfinite(values).any():
            continue
        axes = " ".join("-" if math.isnan(v) else f"{v / size:.7g}" for v in values)
        one = triad.one(values, rule)
        lines.append(f"{label} {_SYMBOLS[quantity]}: x y z {axes} {unit}; {rule} {one:.7g} {si}")
    return lines
