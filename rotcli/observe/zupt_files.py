"""Files beside the zero-velocity filter: the time series, biases saved.

The saved biases are a calibration document, as `navigate` and `observe` read them.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import ResultError
from rotcli.files.documents import quantity
from rotcli.logs.record import PIECE
from rotcli.models.sensors import COLUMN_NAMES
from rotcli.observe.document import ATTITUDE, names_of, units_of
from rotcli.observe.zupt import ZuptResult, ZuptRun
from rotcli.observe.zupt.filter import Estimates
from rotcli.run.correction import KIND as CALIBRATION
from rotcli.run.correction import Correction
from rotcli.units import DEG, PPM

Array = NDArray[np.float64]


def solution(run: ZuptRun, part: Estimates) -> dict[str, Array]:
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


def solution_parts(run: ZuptRun, parts: Iterable[Estimates]) -> Iterator[dict[str, Array]]:
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
    result: ZuptResult, given: Correction | None, unused: Mapping[str, str]
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
