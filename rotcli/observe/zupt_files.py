"""Files next to the zero-velocity filter: the time series, biases saved.

The saved biases are a calibration document, as `navigate` and `observe` read them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from rotcli.errors import ResultError
from rotcli.files.results.documents import quantity
from rotcli.logs.record import CHUNK_SAMPLES
from rotcli.models.sensors import AXIS_COLUMN_NAMES
from rotcli.observe.document import ATTITUDE, names_of, units_of
from rotcli.observe.zupt import ZuptResult, ZuptRun
from rotcli.observe.zupt.filter import Estimates
from rotcli.run.correction import KIND as CALIBRATION
from rotcli.run.correction import Correction
from rotcli.units import DEG, PPM, FloatArray


def solution(run: ZuptRun, part: Estimates) -> dict[str, FloatArray]:
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


def solution_parts(run: ZuptRun, parts: Iterable[Estimates]) -> Iterator[dict[str, FloatArray]]:
    """Yield the time series of a run in chunks of about PIECE rows: the row groups of a file."""
    chunks: list[dict[str, FloatArray]] = []
    rows = 0

    def joined() -> dict[str, FloatArray]:
        return {name: np.concatenate([part[name] for part in chunks]) for name in chunks[0]}

    for part in parts:
        chunks.append(solution(run, part))
        rows += len(part.time)
        if rows >= CHUNK_SAMPLES:
            yield joined()
            chunks, rows = [], 0
    if chunks:
        yield joined()


def calibration_fields(
    result: ZuptResult, correction: Correction | None, unreliable: Mapping[str, str]
) -> dict[str, Any]:
    """Return the fields of a calibration document: the reliable estimates.

    unreliable: the others, by name, with the reason. The scale factor of the correction is kept
    where the filter has none. Raises ResultError when no bias is reliable.
    """
    e, rate, letter = result.estimates, result.rate / DEG, _axis_letter(result)
    names, column = names_of(result), AXIS_COLUMN_NAMES[letter]
    reliable = _reliable(names, column, unreliable)
    order = [names.index(name) for name in reliable]
    unit, factors = zip(*(units_of(e.states)[k] for k in order), strict=True)
    covariance = e.P[np.ix_(order, order)] / np.outer(factors, factors)
    values = e.values[-1, order] / np.array(factors)
    sigma = np.sqrt(np.diag(covariance))
    saved = [name.removeprefix("gyro_") for name in reliable]
    parameters = {
        name: quantity(value, s, unit_name)
        for name, value, s, unit_name in zip(saved, values, sigma, unit, strict=True)
    }
    known = None if correction is None else correction.gyro_column
    if known is not None and column[0] not in parameters:
        for name, value in zip(column, known, strict=True):
            parameters[name] = quantity(value / PPM, None, "ppm")
    span = {"start_s": result.start, "end_s": result.end}
    return {
        "axis": letter if letter != "u" else result.settings.axis,
        "rate": quantity(rate, None, "deg/s"),
        "parameters": parameters,
        "covariance": {"order": saved, "units": list(unit), "matrix": covariance},
        "left_out": {
            name.removeprefix("gyro_"): why for name, why in unreliable.items() if "bias" in name
        },
        "segments": [{**span, "rate_dps": rate, "angle_deg": rate * (result.end - result.start)}],
        "residual_rms": {a: quantity(np.nan, None, "deg/s") for a in "xyz"},
        "predicted_sigma": {
            "bias": quantity(np.nan, None, "deg/h"),
            "scale": quantity(np.nan, None, "ppm"),
        },
        "mean_after": {a: quantity(np.nan, None, "deg/s") for a in "xyz"},
    }


def _axis_letter(result: ZuptResult) -> str:
    """Return x, y or z where the table turns about that axis, else u."""
    for name, unit in zip("xyz", np.eye(3), strict=True):
        if np.array_equal(unit, result.settings.axis):
            return name
    return "u"


def _reliable(
    names: Sequence[str], column: Sequence[str], unreliable: Mapping[str, str]
) -> list[str]:
    """Return the names of the estimates to be saved; raises ResultError without a bias."""
    biases = [f"{s}_bias_{a}" for s in ("gyro", "accel") for a in "xyz"]
    reliable = [name for name in biases if name not in unreliable]
    if not reliable:
        raise ResultError(
            "no bias estimate is reliable; no calibration is written", code="no-reliable-bias"
        )
    if set(column) <= set(names) - set(unreliable):
        reliable += column
    return reliable


CALIBRATION_KIND = CALIBRATION
