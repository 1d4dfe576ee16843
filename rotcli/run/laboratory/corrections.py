"""Corrections over rate (model `scale`) and over temperature (model `thermal`).

Several calibrations together: each bias and each scale factor counts once. A thermal calibration
contains bias and scale factor about its axis, so a triad calibration keeps the other elements; a
scale curve next to another calibration adds its deviation from the scale factor of that
calibration, without bias. Order: thermal, triad or column, scale.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.errors import LogError, ResultError
from rotcli.files.results.documents import number, sound
from rotcli.lazy import lazily
from rotcli.logs.record import ImuLog, ImuSource
from rotcli.models.sensors import BIAS_NAMES
from rotcli.units import DEG, DEG_PER_HOUR, PPM, FloatArray, show_time

with lazily():
    from scipy import interpolate

    from rotcli.models.laboratory import rate_curve, thermal_curve
    from rotcli.models.triad import parameters

if TYPE_CHECKING:
    from rotcli.logs.temperature import TemperatureLog
    from rotcli.models.laboratory.rate_curve import GyroCurve, RateCurve
    from rotcli.models.laboratory.thermal_curve import ThermalCurve
    from rotcli.run.corrections import ReadingCorrection

Document = tuple[str, str, Mapping[str, Any]]  # path, model, document


def _axis(doc: Mapping[str, Any]) -> FloatArray:
    axis = doc["axis"]
    if isinstance(axis, str):
        return np.asarray(np.eye(3)["xyz".index(axis)])
    return np.array(axis, dtype=float)


def _imu_name(doc: Mapping[str, Any]) -> str | None:
    imu = doc.get("rig", {}).get("imu", {})
    name = imu.get("name") if isinstance(imu, dict) else None
    return name if isinstance(name, str) else None


@dataclass(frozen=True, eq=False)
class ScaleCorrection:
    """Error curve over rate of a scale factor test.

    removed: (2, 3), biases (rad/s) and scale factors of the curve that another calibration
    corrects; with_bias: whether this calibration corrects the biases; clamp: whether rates outside
    the test are allowed.
    """

    path: str
    imu: str | None
    curve: "RateCurve"
    removed: FloatArray
    with_bias: bool = True
    clamp: bool = False

    equation: str = "w = gyro - d - e(u.w), three passes from w = gyro - d"

    def apply(self, log: ImuLog) -> tuple[FloatArray, FloatArray]:
        """Return corrected readings; LogError for rates outside those of the test."""
        outside = self.outside(log)
        if np.any(outside) and not self.clamp:
            first = int(np.argmax(outside))
            rate = float((log.gyro[first] - self.curve.bias) @ self.curve.axis) / DEG
            low, high = self.curve.knots[0] / DEG, self.curve.knots[-1] / DEG
            raise LogError(
                log.path,
                f"{rate:.4g} deg/s at {show_time(log.time[first])} s is outside {low:.4g} to "
                f"{high:.4g} deg/s, the rates of {self.path}; calibrate at this rate, or clamp",
            )
        bias = self.curve.bias if self.with_bias else np.zeros(3)
        offset, slope = self.removed
        curve = replace(self.curve, bias=bias, removed=slope, removed_bias=offset)
        return rate_curve.correct(curve, log.gyro), log.accel

    def outside(self, log: ImuLog) -> NDArray[np.bool_]:
        """Return which samples (n,) have rates, means over 1 s, outside those of the test."""
        return self.curve.outside(log.gyro, round(1.0 / log.interval))

    def biases_alone(self) -> "ReadingCorrection":
        """Return the correction of the biases without the curve."""
        flat = rate_curve.GyroCurve("line", np.zeros(1), 0.0 * self.curve.knots, 0.0)
        curve = replace(self.curve, gyros=(flat, flat, flat))
        return replace(self, curve=curve, removed=np.zeros((2, 3)))


@dataclass(frozen=True, eq=False)
class ThermalCorrection:
    """Bias and scale factor over temperature.

    accel: None where the test contains no accelerometers; temperature: of the log (or a constant,
    degC), None until `bind`.
    """

    path: str
    imu: str | None
    gyro: "ThermalCurve"
    accel: "ThermalCurve | None"
    temperature: "TemperatureLog | float | None" = None
    clamp: bool = False

    equation: str = "w = (I + k(T) u^T)^-1 (gyro - d(T)), f = accel - b(T)"

    def apply(self, log: ImuLog) -> tuple[FloatArray, FloatArray]:
        """Return corrected readings; LogError for temperatures outside the range."""
        T = self.at(log.time, log.path)
        self.check(log.time, T, log.path)
        T = np.clip(T, self.gyro.low, self.gyro.high)
        gyro = thermal_curve.correct(self.gyro, log.gyro, T)
        if self.accel is None:
            return gyro, log.accel
        return gyro, thermal_curve.correct(self.accel, log.accel, T)

    def at(self, time: FloatArray, path: str) -> FloatArray:
        """Return the temperature (n,), degC, at times (n,), s."""
        if self.temperature is None:
            raise LogError(
                path,
                f"no temperature column, but {self.path} depends on the temperature; add the "
                "column or set a constant temperature",
            )
        if isinstance(self.temperature, float):
            return np.full(len(time), self.temperature)
        return self.temperature.at(time)

    def check(self, time: FloatArray, T: FloatArray, path: str) -> None:
        """Raise LogError for temperatures outside the range, unless they are clamped."""
        outside = self.gyro.outside(T)
        if np.any(outside) and not self.clamp:
            first = int(np.argmax(outside))
            raise LogError(
                path,
                f"{T[first]:.1f} degC at {show_time(float(time[first]))} s is outside "
                f"{self.gyro.low:.1f} to {self.gyro.high:.1f} degC, the range of {self.path}; "
                "calibrate at this temperature, or clamp",
                column="temperature",
            )

    def biases_alone(self) -> "ReadingCorrection":
        """Return the correction of the biases without the scale factor."""
        return replace(self, gyro=replace(self.gyro, column=0.0 * self.gyro.column))


def read_curve(path: str, doc: Mapping[str, Any]) -> "RateCurve":
    """Return the curve of a document of model scale; raises ResultError for an invalid one."""
    with sound(path, "calibration"):
        curve = doc["curve"]

        def gyro(name: str) -> "GyroCurve":
            one = curve["gyros"][name]
            return rate_curve.GyroCurve(
                str(one["model"]),
                DEG_PER_HOUR * np.array(one["coefficients_dph"], dtype=float),
                DEG_PER_HOUR * np.array(one["values_dph"], dtype=float),
                PPM * float(one["slope_ppm"]),
            )

        bias = [number(doc, path, "parameters", name, "value") for name in BIAS_NAMES]
        return rate_curve.RateCurve(
            axis=_axis(doc),
            bias=DEG_PER_HOUR * np.array(bias),
            full_scale=DEG * number(doc, path, "curve", "full_scale_dps"),
            knots=DEG * np.array(curve["knots_dps"], dtype=float),
            gyros=(gyro("x"), gyro("y"), gyro("z")),
        )


def read_scale(path: str, doc: Mapping[str, Any]) -> ScaleCorrection:
    """Return the correction of a document of model scale."""
    return ScaleCorrection(path, _imu_name(doc), read_curve(path, doc), np.zeros((2, 3)))


def read_thermal(path: str, doc: Mapping[str, Any]) -> ThermalCorrection:
    """Return the correction of a document of model thermal."""
    with sound(path, "calibration"):
        curve, axis = doc["curve"], _axis(doc)
        T = np.array(curve["temperature_degC"], dtype=float)
        grid = thermal_curve.temperature_grid(float(T[0]), float(T[-1]))
        between = _line if curve.get("between") == "line" else _cubic

        def triad(kind: str, unit: float) -> "ThermalCurve":
            entries = [curve[f"{kind}_{name}"] for name in "xyz"]
            bias = [between(T, unit * np.array(e["bias"], dtype=float), grid) for e in entries]
            none = np.zeros(len(T))
            column = [
                between(T, PPM * np.array(e.get("scale_ppm", none), dtype=float), grid)
                for e in entries
            ]
            return thermal_curve.ThermalCurve(
                grid,
                np.column_stack(bias),
                np.column_stack(column),
                axis,
                float(T[0]),
                float(T[-1]),
            )

        accel = triad("accel", 1.0) if "accel_x" in curve else None
        return ThermalCorrection(path, _imu_name(doc), triad("gyro", DEG_PER_HOUR), accel)


def _cubic(T: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Return stored values on the grid: a cubic spline through the polynomial's points."""
    return np.asarray(interpolate.CubicSpline(T, values)(grid))


def _line(T: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Return stored values on the grid: straight lines between them."""
    return np.asarray(np.interp(grid, T, values))


def combine(
    documents: Sequence[Document], corrections: Mapping[str, "ReadingCorrection"]
) -> "list[ReadingCorrection]":
    """Return the corrections (by path) in their order, adapted so that each error counts once.

    documents: all calibrations of a command; those without an entry in `corrections` are applied
    elsewhere, but count. Raises ResultError for calibrations that contradict each other.
    """
    by_model: dict[str, Document] = {}
    for path, model, doc in documents:
        if model in by_model and model in ("scale", "thermal", "triad"):
            raise ResultError(
                f"{path}: a second calibration of model {model}, next to {by_model[model][0]}; "
                "omit one of them"
            )
        by_model[model] = (path, model, doc)
    if "thermal" in by_model and "column" in by_model:
        raise ResultError(
            f"{by_model['column'][0]}: bias and scale factor are those of "
            f"{by_model['thermal'][0]} as well, at every temperature; omit this calibration"
        )
    order = {"thermal": 0, "triad": 1, "column": 1, "scale": 2}
    found = []
    for path, model, _ in sorted(documents, key=lambda d: order.get(d[1], 1)):
        if path not in corrections:
            continue
        correction = corrections[path]
        if model == "triad" and "thermal" in by_model:
            correction = _without_thermal(correction, _axis(by_model["thermal"][2]))
        if isinstance(correction, ScaleCorrection) and len(by_model) > 1:
            others = [d for name, d in by_model.items() if name != "scale"]
            correction = _without_line(correction, others)
        found.append(correction)
    return found


def _without_thermal(correction: "ReadingCorrection", axis: FloatArray) -> "ReadingCorrection":
    """Return a triad correction without the biases and the gyro column of a thermal one."""
    x: FloatArray = getattr(correction, "x").copy()  # noqa: B009 (the protocol has no x)
    x[parameters.GYRO_BIAS] = 0.0
    N = x[parameters.N].reshape(3, 3)
    x[parameters.N] = (N - np.outer(N @ axis, axis)).ravel()
    return replace(correction, x=x)  # type: ignore[type-var]


def _without_line(correction: ScaleCorrection, others: Sequence[Document]) -> ScaleCorrection:
    """Return a scale correction without bias and without the line of the other calibrations.

    Their bias and scale factor are those of the line that fits the curve at their rates, weighted
    by the seconds at each: of rest and one rate the line through both.
    """
    slope = np.array([gyro.slope for gyro in correction.curve.gyros])
    line = np.vstack([np.zeros(3), slope])
    for _, model, doc in others:
        rates, seconds = _rates(model, doc)
        if len(rates) > 1:
            values = correction.curve.error(rates)
            line = np.polyfit(rates, values, 1, w=np.sqrt(seconds))[::-1]
            break
    return replace(correction, removed=line, with_bias=False)


def _rates(model: str, doc: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    """Return the distinct rates (r,), rad/s, of a calibration and the seconds at each."""
    key = {"column": "segments", "thermal": "blocks"}.get(model)
    rows = doc.get(key) if key else None
    seconds: dict[float, float] = {}
    for row in rows if isinstance(rows, list) else []:
        rate = round(float(row["rate_dps"]), 3)
        duration = float(row["end_s"]) - float(row["start_s"])
        seconds[rate] = seconds.get(rate, 0.0) + duration
    rates = sorted(seconds)
    return DEG * np.array(rates), np.array([seconds[rate] for rate in rates])


def bind(
    corrections: "Sequence[ReadingCorrection]",
    source: ImuSource,
    temperature: "TemperatureLog | float | None",
    *,
    clamp: bool = False,
) -> "tuple[list[ReadingCorrection], list[str]]":
    """Return the corrections with the temperature of a log, and warnings about clamped samples.

    clamp: hold the value at the edge outside the range of temperatures, continue with the slope
    of the line outside the range of rates; else both are errors.
    """
    found: list[ReadingCorrection] = []
    warnings = []
    for correction in corrections:
        if isinstance(correction, ThermalCorrection):
            correction = replace(correction, temperature=temperature, clamp=clamp)
            warnings += _thermal_clamped(correction, source) if clamp else []
        elif isinstance(correction, ScaleCorrection):
            correction = replace(correction, clamp=clamp)
            warnings += _rates_clamped(correction, source) if clamp else []
        found.append(correction)
    return found, warnings


def _thermal_clamped(correction: ThermalCorrection, source: ImuSource) -> list[str]:
    """Return a warning with the seconds outside the range of temperatures."""
    time = np.arange(float(source.time[0]), float(source.time[-1]), 1.0)
    T = correction.at(time, source.path)
    outside = correction.gyro.outside(T)
    if not np.any(outside):
        return []
    seconds = int(np.count_nonzero(outside))
    samples = round(seconds / source.interval)
    return [
        f"{source.path}: {samples} samples ({seconds} s), first at "
        f"{show_time(time[int(np.argmax(outside))])} s, are outside {correction.gyro.low:.1f} to "
        f"{correction.gyro.high:.1f} degC of {correction.path}. The values at the edge are used"
    ]


def _rates_clamped(correction: ScaleCorrection, source: ImuSource) -> list[str]:
    """Return a warning with the number of samples outside the range of rates."""
    count = 0
    for chunk in source.chunks(slice(0, source.samples)):
        count += int(np.count_nonzero(correction.outside(chunk)))
    if not count:
        return []
    low, high = correction.curve.knots[0] / DEG, correction.curve.knots[-1] / DEG
    return [
        f"{source.path}: {count} samples are outside {low:.4g} to {high:.4g} deg/s of "
        f"{correction.path}. The slope of its straight line is used there"
    ]
