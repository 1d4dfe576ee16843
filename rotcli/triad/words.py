"""Rank and weak directions of a calibration in words."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.models.triad import parameters as p
from rotcli.models.triad.leastsquares import Rank

IntArray = NDArray[np.int64]

_WORDS: tuple[tuple[frozenset[str], str], ...] = (
    (
        frozenset({"gravity", "Kax", "Kay", "Kaz"}),
        "gravity and a common factor of all accelerometer scale factors (only |f| = g is known)",
    ),
    (frozenset({"clock_accel"}), "the clock of the accelerometers: gravity does not move in them"),
    (frozenset({"clock_gyro"}), "the clock of the gyros: no block has a table acceleration"),
)
_FRAME_TRACES = ({"Kaxy", "Kayx"}, {"Kaxz", "Kazx"}, {"Kayz", "Kazy"})
_LISTED = 6  # names of one direction that are written out


def _in_words(names: Sequence[str]) -> str:
    """Return what a null direction means."""
    members = set(names)
    for keys, text in _WORDS:
        if members == keys or (keys <= members and "gravity" in keys):
            return text
    frames = [pair for pair in _FRAME_TRACES if pair <= members]
    if frames and any(n.startswith("Kg") for n in members):
        base = [n for n in names if n.startswith(("base_", "mounting_", "outer_", "middle_"))]
        return (
            "a common rotation of all sensor axes"
            + (f", with {_list(base)}" if base else "")
            + ": the accelerometer convention has no such parameter"
        )
    if len(names) == 1:
        return f"{names[0]}: it does not change any reading of this motion"
    return f"{_list(names)}: together they change no reading of this motion"


def _list(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_LISTED])
    return shown + (f" and {len(names) - _LISTED} more" if len(names) > _LISTED else "")


def describe_null(rank: Rank, free: IntArray, mountings: int) -> list[dict[str, object]]:
    """Return the null directions: names, coefficients (scaled by typical sizes), words."""
    names = p.names(mountings)
    found: list[dict[str, object]] = []
    for vector in rank.null:
        members = [(names[free[k]], float(v)) for k, v in enumerate(vector) if v != 0.0]
        found.append(
            {
                "parameters": [name for name, _ in members],
                "coefficients": [round(value, 4) for _, value in members],
                "text": _in_words([name for name, _ in members]),
            }
        )
    return found


def reason_of_null(name: str, sigma: float, size: float, unit: str, factor: float) -> str:
    """Return why a parameter is null."""
    return (
        f"sigma {sigma / factor:.3g} {unit} exceeds {p.WEAK_FRACTION:g} of its typical size "
        f"({size / factor:.3g} {unit}); the motion does not show {name}"
    )
