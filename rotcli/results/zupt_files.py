"""Files beside the zero-velocity filter: noise of an Allan result, the time series, biases saved.

The saved biases are a calibration document, as `navigate` and `observe` read them.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import ResultError
from rotcli.logs.record import PIECE
from rotcli.models.sensors import COLUMN_NAMES
from rotcli.models.zero_velocity import Noise
from rotcli.models.zero_velocity_run import Estimates
from rotcli.results.calibration import KIND as CALIBRATION
from rotcli.results.calibration import Correction
from rotcli.results.files import number, quantity, read_result, sound
from rotcli.results.observability import ATTITUDE, names_of, units_of
from rotcli.stages.zupt import WANDER_TIME, Filtered, Run
from rotcli.units import DEG, PPM, factor

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
    with sound(path, "allan"):
        return _noise(read_result(path, "allan"), path, rig_noise)


def _noise(doc: dict[str, Any], path: str, rig_noise: Noise) -> Noise:
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


def solution(run: Run, part: Estimates) -> dict[str, Array]:
    """Return every state's estimate and sigma by name, and the attitude errors, with units.

    part: some of a run's updates.
    """
    columns = {"time [s]": part.time}
    names, units = names_of(run), units_of(part.states)
    for k, (name, (unit, scale)) in enumerate(zip(names, units, strict=True)):
        columns[f"{name} [{unit}]"] = part.values[:, k] / scale
        columns[f"sigma_{name} [{unit}]"] = part.sigma[:, k] / scale
    for angle, errors in zip(ATTITUDE, part.attitude_errors.T, strict=True):
        columns[f"err_{angle} [deg]"] = errors / DEG
    columns["nis"] = part.nis
    return columns


def solution_parts(run: Run, parts: Iterable[Estimates]) -> Iterator[dict[str, Array]]:
    """Yield the time series of a run in parts of about PIECE rows: a file's row groups."""
    held: list[dict[str, Array]] = []
    rows = 0

    def joined() -> dict[str, Array]:
        return {name: np.concatenate([part[name] for part in held]) for name in held[0]}

    for part in parts:
        held.append(solution(run, part))
        rows += len(part.time)
        if rows >= PIECE:
            yield joined()
            held, rows = [], 0
    if held:
        yield joined()


def calibration_fields(
    result: Filtered, given: Correction | None, unused: Mapping[str, str]
) -> dict[str, Any]:
    """Return a calibration document's own fields: the estimates that may be used.

    unused: the others, by name, with the reason. A scale factor that was given is kept where the
    filter has none. Raises ResultError when nothing may be used.
    """
    names = names_of(result)
    e = result.estimates
    letter = next(
        (
            n
            for n, u in zip("xyz", np.eye(3), strict=True)
            if np.array_equal(u, result.settings.axis)
        ),
        "u",
    )
    column = COLUMN_NAMES[letter]
    held = [f"{s}_bias_{a}" for s in ("gyro", "accel") for a in "xyz"]
    held = [name for name in held if name not in unused]
    if not held:
        raise ResultError(
            "--save-calibration: none of the biases is to be used, so it was not written; leave "
            "it out to see the estimates and the reasons"
        )
    if set(column) <= set(names) - set(unused):
        held += column
    order = [names.index(name) for name in held]
    unit, factors = zip(*(units_of(e.states)[k] for k in order), strict=True)
    covariance = e.P[np.ix_(order, order)] / np.outer(factors, factors)
    values = e.values[-1, order] / np.array(factors)
    saved = [name.removeprefix("gyro_") for name in held]
    parameters = {
        name: quantity(value, sigma, own)
        for name, value, sigma, own in zip(
            saved, values, np.sqrt(np.diag(covariance)), unit, strict=True
        )
    }
    if given is not None and given.gyro_column is not None and column[0] not in parameters:
        for name, value in zip(column, given.gyro_column, strict=True):
            parameters[name] = quantity(value / PPM, None, "ppm")
    return {
        "axis": letter if letter != "u" else result.settings.axis,
        "rate": quantity(result.rate / DEG, None, "deg/s"),
        "parameters": parameters,
        "covariance": {"order": saved, "units": list(unit), "matrix": covariance},
        "left_out": {
            name.removeprefix("gyro_"): why for name, why in unused.items() if "bias" in name
        },
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
