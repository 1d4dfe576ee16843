"""The comment at the top of every exported file: source, rate, rules, losses, both unit systems."""

import math
from collections.abc import Sequence

import numpy as np

from rotcli import units
from rotcli.export.numbers import Numbers, TriadNumbers

_UG = units.UNITS["acceleration"]["ug"]
_Unit = tuple[float, str, str]  # size of the datasheet unit in SI, its name, the SI unit
_GYRO: dict[str, _Unit] = {
    "white": (units.DEG_PER_ROOT_HOUR, "deg/sqrt(h)", "rad/s/sqrt(Hz)"),
    "flicker": (units.DEG_PER_HOUR, "deg/h", "rad/s"),
    "walk": (units.DEG_PER_HOUR, "deg/h/sqrt(s)", "rad/s^2/sqrt(Hz)"),
}
_ACCEL: dict[str, _Unit] = {
    "white": (_UG, "ug/sqrt(Hz)", "m/s^2/sqrt(Hz)"),
    "flicker": (_UG, "ug", "m/s^2"),
    "walk": (_UG, "ug/sqrt(s)", "m/s^3/sqrt(Hz)"),
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


def _triad_lines(label: str, triad: TriadNumbers, column: dict[str, _Unit], rule: str) -> list[str]:
    lines = []
    for quantity, (size, unit, si) in column.items():
        values = getattr(triad, quantity)
        if not np.isfinite(values).any():
            continue
        axes = " ".join("-" if math.isnan(v) else f"{v / size:.7g}" for v in values)
        one = triad.one(values, rule)
        lines.append(f"{label} {_SYMBOLS[quantity]}: x y z {axes} {unit}; {rule} {one:.7g} {si}")
    return lines
