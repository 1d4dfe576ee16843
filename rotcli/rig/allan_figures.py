"""The noise of an Allan result as figures of a rig's [imu], for a filter."""

from dataclasses import replace
from typing import Any

import numpy as np

from rotcli.files.results.documents import number, read_result, sound
from rotcli.rig.rig import ImuSettings
from rotcli.units import DEG_PER_ROOT_HOUR, METRE_PER_SECOND_PER_ROOT_HOUR, factor

# Units an Allan result may give next to those of `units`: walks, their size in SI.
_WALKS = {
    "deg/sqrt(h)": DEG_PER_ROOT_HOUR,
    "rad/s/sqrt(Hz)": 1.0,
    "rad/sqrt(s)": 1.0,
    "m/s/sqrt(h)": METRE_PER_SECOND_PER_ROOT_HOUR,
    "m/s/sqrt(s)": 1.0,
    "m/s^2/sqrt(Hz)": 1.0,
}
# Of each kind of sensor the rig's figures: white noise, then those of the slow noise of the bias.
_FIGURES = {
    "gyro": (
        "angle_random_walk",
        {
            "bias_instability": "bias_instability",
            "rate_random_walk": "rate_random_walk",
            "sigma": "gauss_markov_gyro_sigma",
            "correlation_time_s": "gauss_markov_gyro_time",
        },
    ),
    "accel": (
        "velocity_random_walk",
        {
            "bias_instability": "accel_bias_instability",
            "sigma": "gauss_markov_accel_sigma",
            "correlation_time_s": "gauss_markov_accel_time",
        },
    ),
}


def with_allan(path: str, imu: ImuSettings) -> ImuSettings:
    """Return the settings of an IMU with the noise figures of an Allan result.

    Each figure is the root mean square of the axes that have it. Where the result contains slow
    noise of a sensor, it replaces all slow noise of the rig. Raises ResultError for a file that is
    no Allan result.
    """
    with sound(path, "allan"):
        doc = read_result(path, "allan")
        axes = doc.get("axes")
        axes = axes if isinstance(axes, dict) else {}
        figures: dict[str, Any] = {}
        for sensor, (white, slow) in _FIGURES.items():
            axes_found = [(name, axis) for name, axis in axes.items() if name.startswith(sensor)]
            found = {ours: _figure(doc, path, axes_found, name) for name, ours in slow.items()}
            if any(found.values()):
                figures |= found
            walk = _figure(doc, path, axes_found, "random_walk")
            figures |= {white: walk} if walk else {}
        return replace(imu, **figures)


def _figure(
    doc: dict[str, Any], path: str, axes: list[tuple[str, dict[str, Any]]], name: str
) -> float | None:
    """Return the root mean square of a figure over the axes that have it, SI; None of none."""
    found = []
    for axis, axes_found in axes:
        room = "gauss_markov" if name in ("sigma", "correlation_time_s") else "coefficients"
        q = (axes_found.get(room) or {}).get(name)
        if name == "correlation_time_s" and not isinstance(q, dict):
            q = {"value": q, "unit": "s"}
        if q and q.get("value") is not None:
            keys = ("axes", axis, room, name)
            plain = not isinstance(axes_found[room][name], dict)
            value = number(doc, path, *keys) if plain else number(doc, path, *keys, "value")
            found.append(value * _size(str(q.get("unit", ""))))
    return float(np.sqrt(np.mean(np.square(found)))) if any(found) else None


def _size(unit: str) -> float:
    """Return the size of a figure's unit in SI, 0 for one that is not known."""
    known = _WALKS.get(unit) or factor(unit, "rate", "acceleration", "time")
    base = unit.removesuffix("/sqrt(s)")  # of a rate random walk
    return known or (factor(base, "rate", "acceleration") or 0.0)
