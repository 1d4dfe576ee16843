"""Read calibration documents back as the sensor errors that a command corrects."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.errors import CodedText, ResultError
from rotcli.files.results.documents import number, read_result
from rotcli.models.sensors import AXIS_COLUMN_NAMES, BIAS_NAMES, TriadErrors
from rotcli.units import FloatArray

KIND = "calibration"
_SAME_AXIS = 1.0 - 1e-6  # cosine of the angle between two axes called the same: 0.08 deg
_SHARED = 0.02  # of a window; a ramp or the last sample may be shared
_ACCEL_NAMES = ("accel_bias_x", "accel_bias_y", "accel_bias_z")


@dataclass(frozen=True, eq=False)
class Correction:
    """What a calibration file says of the sensors: axis (3,), rates (rad/s), errors (SI).

    gyro_column: (3,) `N u`, None where the file contains biases only. excluded_biases: unreliable
    biases that were omitted; they are zero here. imu: its name, if any. segments_used: start and
    end (s), segment_rates: rad/s of each; horizon: window (s) that the biases are
    predicted for, None where they are means; log: records, first and last time (s) of the IMU
    log, if stored.
    """

    path: str
    axis: FloatArray
    rates: tuple[float, ...]
    gyro_bias: FloatArray
    gyro_column: FloatArray | None
    accel_bias: FloatArray
    excluded_biases: tuple[str, ...] = ()
    imu: str | None = None
    segments_used: tuple[tuple[float, float], ...] = ()
    log: tuple[float, float, float] | None = None
    segment_rates: tuple[float, ...] = ()
    horizon: tuple[float, float] | None = None

    def gyro_errors(self, *, full: bool) -> TriadErrors:
        """Return the gyro errors to remove: the biases, and with `full` the matrix too.

        Raises ResultError when the file contains no matrix.
        """
        if not full:
            return TriadErrors(bias=self.gyro_bias)
        if self.gyro_column is None:
            raise ResultError(
                f"{self.path}: contains biases but no scale factor; navigate in mode partial",
                code="no-scale-factor",
            )
        return TriadErrors(np.outer(self.gyro_column, self.axis), self.gyro_bias)

    def check_imu_name(self, name: str | None) -> None:
        """Raise ResultError when the correction was made for an IMU of another name."""
        if name and self.imu and name.split() != self.imu.split():
            raise ResultError(
                f"{self.path}: made for the IMU {self.imu}, but the rig names {name}: calibrate "
                "this unit, or correct [imu] name"
            )

    def check_applies(self, axis: FloatArray, rate: float, *, constant_rate: bool) -> str | None:
        """Return what is wrong with using the correction at a table rate (rad/s), or None.

        Raises ResultError when it was made about another axis. MEMS gyros are not linear: a
        calibration is valid at its own rate (R16 section 3); a hundredth of it is granted.
        """
        if abs(float(axis @ self.axis)) < _SAME_AXIS:
            raise ResultError(
                f"{self.path}: made turning about {_axis(self.axis)}, but the rig turns about "
                f"{_axis(axis)}; calibrate about the same axis"
            )
        if not self.rates:  # made on a still table: biases alone, valid at no table rate
            if constant_rate and rate == 0.0:
                return None
            return (
                f"{self.path}: made on a still table, but in the window navigated the table turns"
            )
        made = ", ".join(dict.fromkeys(f"{rate / units.DEG:.6g}" for rate in self.rates))
        if not constant_rate:
            text = (
                f"{self.path}: made at {made} deg/s, but in the window navigated the table does "
                "not turn at one rate"
            )
            return CodedText("calibration-rate-varies", text)
        if any(abs(abs(rate) - abs(own)) <= 0.01 * abs(own) for own in self.rates):
            return None
        return (
            f"{self.path}: made at {made} deg/s, but in the window the table turns at "
            f"{rate / units.DEG:.6g} deg/s"
        )

    def check_independent(
        self, log: tuple[float, float, float], window: tuple[float, float]
    ) -> str | None:
        """Return a warning where the window (s) of the log is what the correction was made on.

        log: records, first and last time (s). Errors over the data of a fit are too small.
        """
        if self.log != log:
            return None
        start, end = window
        shared = sum(max(0.0, min(end, b) - max(start, a)) for a, b in self.segments_used)
        if shared <= _SHARED * (end - start):
            return None
        text = (
            f"{self.path}: was made on {shared:.4g} s of the {end - start:.4g} s navigated: the "
            "errors are those of a fit, smaller than on other data; name other segments under "
            "[stages]"
        )
        return CodedText("calibration-data-navigated", text)


def _axis(vector: FloatArray) -> str:
    for name, unit in zip("xyz", np.eye(3), strict=True):
        if np.array_equal(vector, unit):
            return name
    return f"({', '.join(f'{v:.4g}' for v in vector)})"


def read_correction(path: str) -> Correction:
    """Read a calibration file; raises ResultError."""
    return correction_from_document(read_result(path, KIND), path)


def correction_from_document(doc: Mapping[str, Any], path: str) -> Correction:
    """Return the correction of a calibration document; `path` names it. Raises ResultError."""
    axis = doc.get("axis")
    if isinstance(axis, str) and axis in ("x", "y", "z"):
        name, vector = axis, np.eye(3)["xyz".index(axis)]
    elif isinstance(axis, list) and len(axis) == 3:
        name = "u"
        vector = np.array([number({"axis": a}, path, "axis") for a in axis])
    else:
        raise ResultError(f"{path}: axis: {axis!r} is not x, y, z or a vector; create it again")
    parameters = doc.get("parameters")
    if not isinstance(parameters, dict):
        raise ResultError(f"{path}: parameters: missing; create it again")

    unfit = doc.get("left_out")
    excluded_biases = tuple(n for n in unfit or () if n not in parameters)

    def value(name: str) -> float:
        return 0.0 if name in excluded_biases else number(doc, path, "parameters", name, "value")

    def values(names: tuple[str, ...], unit: float) -> FloatArray:
        return unit * np.array([value(name) for name in names])

    column = AXIS_COLUMN_NAMES[name]
    has_column = any(n in parameters for n in column)
    has_accel = any(n in parameters for n in _ACCEL_NAMES)
    segments = doc.get("segments") or [{"rate_dps": number(doc, path, "rate", "value")}]
    if not isinstance(segments, list) or not all(isinstance(s, dict) for s in segments):
        raise ResultError(f"{path}: segments: not a list of segments; create it again")
    spans = [(s.get("start_s"), s.get("end_s")) for s in segments]
    finite = [s for s in spans if all(isinstance(edge, int | float) for edge in s)]
    rig = doc.get("rig")
    imu = rig.get("imu") if isinstance(rig, dict) else None
    unit = imu.get("name") if isinstance(imu, dict) else None
    return Correction(
        path=path,
        imu=unit if isinstance(unit, str) else None,
        axis=vector,
        rates=tuple(
            units.DEG * number(s, path, "rate_dps") for s in segments if s.get("rate_dps") != 0.0
        ),
        gyro_bias=values(BIAS_NAMES, units.DEG_PER_HOUR),
        gyro_column=values(column, units.PPM) if has_column else None,
        accel_bias=values(_ACCEL_NAMES, 1.0) if has_accel else np.zeros(3),
        excluded_biases=excluded_biases,
        segments_used=tuple((float(a), float(b)) for a, b in finite),
        segment_rates=tuple(units.DEG * number(s, path, "rate_dps") for s in segments),
        horizon=_horizon_of(doc),
        log=_log_of(doc),
    )


def _horizon_of(doc: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the window (s) that the biases of a document are predicted for, None without one."""
    horizon = doc.get("horizon")
    if not isinstance(horizon, dict):
        return None
    start, end = horizon.get("start_s"), horizon.get("end_s")
    if not isinstance(start, int | float) or not isinstance(end, int | float):
        return None
    return float(start), float(end)


def _log_of(doc: Mapping[str, Any]) -> tuple[float, float, float] | None:
    """Return records, first and last time (s) of a document's first input, None where not given."""
    inputs = doc.get("inputs")
    first: Any = inputs[0] if isinstance(inputs, list) and inputs else None
    figures: list[Any] = []
    if isinstance(first, dict):
        figures = [first.get(name) for name in ("rows", "start_s", "end_s")]
    if not figures or not all(isinstance(figure, int | float) for figure in figures):
        return None
    return float(figures[0]), float(figures[1]), float(figures[2])
