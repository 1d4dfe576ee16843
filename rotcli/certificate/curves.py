"""Inputs of a certificate, and the data of its small plots."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli.certificate.contents import Curves
from rotcli.certificate.lab_tests import scale_curves
from rotcli.dataclass import dataclass
from rotcli.files.results.identity import identity

MIN_HISTORY = 3  # results that make a chart over time


@dataclass(frozen=True)
class Input:
    """One document: path, SHA-256 of its bytes, contents."""

    path: str
    sha256: str
    doc: Mapping[str, Any]


def real(value: Any) -> float | None:
    """Return a number or None; raises TypeError or ValueError for anything else."""
    if value is None:
        return None
    if isinstance(value, bool | str):
        raise TypeError(f"{value!r} is not a number")
    return float(value)


def read_curves(allans: Sequence[Input], calibrations: Sequence[Input]) -> Curves:
    """Return the data of the small plots from the last noise and scale tests and all results."""
    allan = []
    unit = "deg/h"
    if allans:
        for axis, entry in allans[-1].doc["axes"].items():
            if axis.startswith("gyro") and "deviation" in entry:
                tau, deviation = ([float(v) for v in entry[k]] for k in ("tau_s", "deviation"))
                if len(tau) != len(deviation):
                    raise ValueError(f"{axis}: {len(tau)} times, {len(deviation)} deviations")
                allan.append((axis, tau, deviation))
                unit = str(entry["unit"])
    scale = [e.doc for e in calibrations if e.doc.get("model") == "scale"]
    curves = scale_curves(scale[-1]) if scale else ()
    return Curves(tuple(allan), unit, curves, _history(calibrations))


def _history(
    calibrations: Sequence[Input],
) -> tuple[tuple[str, list[str], list[float], list[float]], ...]:
    """Return the gyro biases over the dated results, deg/h, where there are enough of them."""
    series = []
    for name in ("bias_x", "bias_y", "bias_z"):
        points = [
            (date, float(q["value"]), real(q.get("sigma")) or 0.0)
            for e in calibrations
            if (date := identity(e.doc).date)
            and (q := e.doc["parameters"].get(name)) is not None
            and q.get("value") is not None
            and q["unit"] == "deg/h"
        ]
        if len(points) >= MIN_HISTORY:
            dates, values, sigmas = zip(*points, strict=True)
            series.append((name, list(dates), list(values), list(sigmas)))
    return tuple(series)
