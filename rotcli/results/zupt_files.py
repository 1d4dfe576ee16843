"""Files beside the zero-velocity filter: noise figures from an Allan result, biases saved.

The saved biases are a calibration document, as `navigate` and `observe` read them.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.models.sensors import BIAS_NAMES, COLUMN_NAMES
from rotcli.models.zero_velocity import Noise
from rotcli.results.calibration import KIND as CALIBRATION
from rotcli.results.calibration import Correction
from rotcli.results.files import number, quantity, read_result
from rotcli.stages.zupt import WANDER_TIME, Filtered
from rotcli.units import DEG, DEG_PER_HOUR, PPM, factor

Array = NDArray[np.float64]

# Units an Allan result may give: rates and the SI ones of a datasheet.
_WALK_UNITS = {
    "deg/sqrt(h)": DEG / 60.0,
    "rad/s/sqrt(Hz)": 1.0,
    "rad/sqrt(s)": 1.0,
    "m/s/sqrt(h)": 1.0 / 60.0,
    "m/s/sqrt(s)": 1.0,
    "m/s^2/sqrt(Hz)": 1.0,
}


def noise_from_allan(path: str, rig_noise: Noise) -> Noise:
    """Return the noise figures of an Allan result, the rig's where it has none.

    White noise is the root mean square of the axes'; bias wander that of their Gauss-Markov
    figures (2 sigma^2 / time). Raises ResultError for a file that is no Allan result.
    """
    doc = read_result(path, "allan")
    axes = doc.get("axes")
    axes = axes if isinstance(axes, dict) else {}

    def white(sensor: str, default: float) -> float:
        found = []
        for name, axis in axes.items():
            q = (axis.get("coefficients") or {}).get("random_walk")
            if name.startswith(sensor) and q and q.get("value") is not None:
                unit = _WALK_UNITS.get(q.get("unit"), 0.0)
                keys = ("axes", name, "coefficients", "random_walk", "value")
                found.append(number(doc, path, *keys) * unit)
        return float(np.sqrt(np.mean(np.square(found)))) if any(found) else default

    def wander(sensor: str, default: float) -> float:
        drives = []
        for name, axis in axes.items():
            held = axis.get("gauss_markov") or {}
            sigma, time = held.get("sigma"), held.get("correlation_time_s")
            time = time.get("value") if isinstance(time, dict) else time
            if name.startswith(sensor) and isinstance(sigma, dict) and time and sigma.get("value"):
                unit = factor(sigma.get("unit", ""), "rate", "acceleration") or 0.0
                drives.append((sigma["value"] * unit) ** 2 / time)
        return float(np.sqrt(np.mean(drives) * WANDER_TIME)) if any(drives) else default

    return Noise(
        angle_random_walk=white("gyro", rig_noise.angle_random_walk),
        velocity_random_walk=white("accel", rig_noise.velocity_random_walk),
        gyro_wander=wander("gyro", rig_noise.gyro_wander),
        gyro_time=WANDER_TIME,
        accel_wander=wander("accel", rig_noise.accel_wander),
        accel_time=WANDER_TIME,
    )


def calibration_fields(result: Filtered, given: Correction | None) -> dict[str, Any]:
    """Return a calibration document's fields: the estimated biases, a given scale factor kept."""
    axis = result.settings.axis
    letter = next(
        (n for n, u in zip("xyz", np.eye(3), strict=True) if np.array_equal(u, axis)), "u"
    )
    e = result.estimates
    P = e.P if e.P.ndim == 2 else e.P[0]
    order = [9, 10, 11, 6, 7, 8]
    names = [*BIAS_NAMES, *(f"accel_bias_{a}" for a in "xyz")]
    units = ["deg/h"] * 3 + ["m/s^2"] * 3
    scale = np.array([DEG_PER_HOUR] * 3 + [1.0] * 3)
    covariance = P[np.ix_(order, order)] / np.outer(scale, scale)
    values = e.values[0, -1, order] / scale
    parameters = {
        name: quantity(value, sigma, unit)
        for name, value, sigma, unit in zip(
            names, values, np.sqrt(np.diag(covariance)), units, strict=True
        )
    }
    if given is not None and given.gyro_column is not None:
        for name, value in zip(COLUMN_NAMES[letter], given.gyro_column, strict=True):
            parameters[name] = quantity(value / PPM, None, "ppm")
    return {
        "axis": letter if letter != "u" else axis,
        "rate": quantity(result.rate / DEG, None, "deg/s"),
        "parameters": parameters,
        "covariance": {"order": names, "units": units, "matrix": covariance},
        "segments": [
            {
                "start_s": result.start,
                "end_s": result.end,
                "rate_dps": result.rate / DEG,
                "angle_deg": result.rate / DEG * (result.end - result.start),
            }
        ],
        "residual_rms": {a: quantity(np.nan, None, "deg/s") for a in "xyz"},
        "predicted_sigma": {
            "bias": quantity(np.nan, None, "deg/h"),
            "scale": quantity(np.nan, None, "ppm"),
        },
        "mean_after": {a: quantity(np.nan, None, "deg/s") for a in "xyz"},
    }


CALIBRATION_KIND = CALIBRATION
