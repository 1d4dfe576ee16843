"""Autopilots: parameter files of PX4 and ArduPilot.

Both subtract offsets and correct the bias over temperature in the sensor frame, before the board
rotation. Sources: ArduPilot AP_InertialSensor_tempcal.cpp (cubic about 35 degC, coefficients times
1e6, no constant); PX4 TemperatureCompensation.cpp (cubic about TREF with constant).
The noise settings of their filters are tuned for vibration, so they appear as comments only.
"""

import math
from collections.abc import Iterable

import numpy as np

from rotcli import units
from rotcli.errors import ResultError
from rotcli.export.figures import SensorFigures
from rotcli.export.numbers import Numbers
from rotcli.export.numbers import write_number as _n
from rotcli.export.polynomials import Recentred, largest_change, to_order
from rotcli.export.target import Body, Format
from rotcli.export.thermal import Thermal
from rotcli.units import FloatArray

ARDUPILOT_CENTRE = 35.0  # degC, TEMP_REFERENCE of AP_InertialSensor_tempcal.cpp
ARDUPILOT_SCALE = 1e6  # of the coefficients in the parameters
EKF_STEP = 0.01  # s, prediction step of PX4's EKF2
# Defaults of the filters, for comparison: gyro, accelerometer, gyro bias, accelerometer bias.
_EKF2 = (0.015, 0.35, 0.001, 0.003)
_EK3 = (0.015, 0.35, 0.001, 0.02)
_EKF2_NAMES = ("EKF2_GYR_NOISE", "EKF2_ACC_NOISE", "EKF2_GYR_B_NOISE", "EKF2_ACC_B_NOISE")
_EK3_NAMES = ("EK3_GYRO_P_NSE", "EK3_ACC_P_NSE", "EK3_GBIAS_P_NSE", "EK3_ABIAS_P_NSE")
_FLOAT, _INT = 9, 6  # MAV_PARAM_TYPE of QGroundControl's parameter files


def to_frame(rows: FloatArray, frame: str) -> FloatArray:
    """Return vector components (3, …) in the sensor frame or as forward, right, down.

    rotcli's sensor frame is x right, y forward, z up: (y, x, -z) is forward, right, down.
    """
    if frame != "frd":
        return rows
    return np.stack([rows[1], rows[0], -rows[2]])


def _to_frame_unsigned(values: FloatArray, frame: str) -> FloatArray:
    return values[[1, 0, 2]] if frame == "frd" else values


def ardupilot(numbers: Numbers) -> Body:
    """Return ArduPilot parameters: offsets, accelerometer scale, temperature calibration."""
    figures, k = numbers.figures, numbers.settings.instance
    frame, notes = numbers.settings.frame, _frame_notes(numbers)
    lines: list[str] = []
    thermal = figures.thermal
    second = "" if k == 1 else str(k)
    if thermal is not None:
        lines += _ardupilot_thermal(
            thermal, f"INS_TCAL{k}_", f"INS_GYR{second}OFFS_", numbers, notes
        )
        lines += [f"INS_GYR{k}_CALTEMP,{_n(ARDUPILOT_CENTRE)}"]
    elif np.isfinite(figures.gyro_bias).any():
        lines += _by_axis(f"INS_GYR{second}OFFS_", to_frame(figures.gyro_bias, frame))
        notes.append("no temperature of the calibration is known: INS_GYRn_CALTEMP is not written")
    lines += _ardupilot_accel(figures, second, frame)
    if not lines:
        raise _nothing(figures)
    notes.append("set INS_GYR_CAL 0, or ArduPilot measures the gyro offsets again at start-up")
    return Body([*lines, *_filter_comments(numbers, _EK3_NAMES, _EK3, "ArduPilot EK3")], notes)


def _ardupilot_thermal(
    thermal: Thermal, prefix: str, offset: str, numbers: Numbers, notes: list[str]
) -> list[str]:
    frame = numbers.settings.frame
    gyro = _cubic(thermal.gyro, thermal, ARDUPILOT_CENTRE, "gyro", notes)
    lines = [
        f"{prefix}ENABLE,1",
        f"{prefix}TMIN,{_n(thermal.low)}",
        f"{prefix}TMAX,{_n(thermal.high)}",
    ]
    lines += _coefficients(f"{prefix}GYR", to_frame(gyro, frame))
    if thermal.accel is not None:
        accel = _cubic(thermal.accel, thermal, ARDUPILOT_CENTRE, "accelerometer", notes)
        lines += _coefficients(f"{prefix}ACC", to_frame(accel, frame))
        lines += _by_axis(offset.replace("GYR", "ACC"), to_frame(accel[:, 0], frame))
        lines.append(f"INS_ACC{numbers.settings.instance}_CALTEMP,{_n(ARDUPILOT_CENTRE)}")
    lines += _by_axis(offset, to_frame(gyro[:, 0], frame))
    _note_scale(thermal, notes)
    return lines


def _coefficients(prefix: str, rows: FloatArray) -> list[str]:
    return [
        f"{prefix}{power}_{axis},{_n(ARDUPILOT_SCALE * row[power])}"
        for power in (1, 2, 3)
        for axis, row in zip("XYZ", rows, strict=True)
        if np.isfinite(row).all()
    ]


def _ardupilot_accel(figures: SensorFigures, second: str, frame: str) -> list[str]:
    lines: list[str] = []
    if figures.thermal is None or figures.thermal.accel is None:
        lines += _by_axis(f"INS_ACC{second}OFFS_", to_frame(figures.accel_bias, frame))
    scale = _to_frame_unsigned(1.0 / (1.0 + np.diag(figures.accel_matrix)), frame)
    return lines + _by_axis(f"INS_ACC{second}SCAL_", scale)


def px4(numbers: Numbers) -> Body:
    """Return PX4 parameters in QGroundControl's format: offsets or temperature calibration."""
    figures, k = numbers.figures, numbers.settings.instance - 1
    notes = _frame_notes(numbers)
    thermal = figures.thermal
    lines: list[str] = []
    if thermal is not None:
        lines += _px4_thermal(thermal, k, numbers, notes)
    elif np.isfinite(figures.gyro_bias).any():
        values = to_frame(figures.gyro_bias, numbers.settings.frame)
        lines += _px4_axes(f"CAL_GYR{k}_", "OFF", values)
    if thermal is None or thermal.accel is None:
        bias = to_frame(figures.accel_bias, numbers.settings.frame)
        lines += _px4_axes(f"CAL_ACC{k}_", "OFF", bias)
    scale = 1.0 / (1.0 + np.diag(figures.accel_matrix))
    lines += _px4_axes(f"CAL_ACC{k}_", "SCALE", _to_frame_unsigned(scale, numbers.settings.frame))
    if not lines:
        raise _nothing(figures)
    return Body([*lines, *_filter_comments(numbers, _EKF2_NAMES, _EKF2, "PX4 EKF2")], notes)


def _px4_thermal(thermal: Thermal, k: int, numbers: Numbers, notes: list[str]) -> list[str]:
    frame, device = numbers.settings.frame, numbers.settings.device
    lines: list[str] = []
    kinds = (("G", "GYR", thermal.gyro), ("A", "ACC", thermal.accel))
    for letter, sensor, powers in kinds:
        if powers is None:
            continue
        label = "gyro" if letter == "G" else "accelerometer"
        rows = to_frame(_cubic(powers, thermal, thermal.reference, label, notes), frame)
        prefix = f"TC_{letter}{k}_"
        lines += [_qgc(f"TC_{letter}_ENABLE", 1, _INT), _qgc(f"{prefix}ID", device, _INT)]
        for name, value in (
            ("TREF", thermal.reference),
            ("TMIN", thermal.low),
            ("TMAX", thermal.high),
        ):
            lines.append(_qgc(f"{prefix}{name}", value, _FLOAT))
        lines += [
            _qgc(f"{prefix}X{power}_{axis}", row[power], _FLOAT)
            for power in range(4)
            for axis, row in enumerate(rows)
            if np.isfinite(row).all()
        ]
        lines += [_qgc(f"CAL_{sensor}{k}_{axis}OFF", 0.0, _FLOAT) for axis in "XYZ"]
    notes.append("CAL_GYRn_XOFF and so on are 0: with TC enabled the offsets would count twice")
    if device == 0:
        notes.append("TC_G0_ID must be the device id of the sensor (CAL_GYR0_ID); set it")
    _note_scale(thermal, notes)
    return lines


def _cubic(
    powers: FloatArray, thermal: Thermal, centre: float, label: str, notes: list[str]
) -> FloatArray:
    cubic: Recentred = to_order(powers, thermal.reference, centre, thermal.low, thermal.high)
    residual = cubic.residual + thermal.residual[0 if label == "gyro" else 1]
    if residual > 0.0:
        size, unit = (units.DEG_PER_HOUR, "deg/h") if label == "gyro" else (1.0, "m/s^2")
        notes.append(
            f"{label}: the bias curve is refitted at order 3; added residual up to "
            f"{residual / size:.3g} {unit}"
        )
    return cubic.coefficients


def _note_scale(thermal: Thermal, notes: list[str]) -> None:
    if thermal.scale is None:
        return
    lost = largest_change(thermal.scale, thermal.reference, thermal.low, thermal.high)
    notes.append(
        "scale factor over temperature is lost: "
        f"max |K(T) - K(T_ref)| is {lost / units.PPM:.4g} ppm"
    )


def _frame_notes(numbers: Numbers) -> list[str]:
    if numbers.settings.frame == "frd":
        return ["axes: forward, right, down = (y, x, -z) of rotcli's x right, y forward, z up"]
    note = "axes: sensor frame of the results"
    return [note + " (after the rig's mount)"] if numbers.figures.mounted else [note]


def _nothing(figures: SensorFigures) -> ResultError:
    names = ", ".join(source.path for source in figures.sources) or "no input"
    return ResultError(f"{names}: no bias and no temperature model; add a calibration result")


def _by_axis(prefix: str, values: FloatArray) -> list[str]:
    named = zip("XYZ", values, strict=True)
    return [f"{prefix}{axis},{_n(value)}" for axis, value in named if math.isfinite(value)]


def _px4_axes(prefix: str, suffix: str, values: Iterable[float]) -> list[str]:
    named = zip("XYZ", values, strict=True)
    return [_qgc(f"{prefix}{axis}{suffix}", v, _FLOAT) for axis, v in named if math.isfinite(v)]


def _qgc(name: str, value: float, kind: int) -> str:
    text = str(int(value)) if kind == _INT else _n(float(value))
    return f"1\t1\t{name}\t{text}\t{kind}"


def _filter_comments(
    numbers: Numbers, names: tuple[str, ...], defaults: tuple[float, ...], program: str
) -> list[str]:
    """Return the filter's noise settings as comments next to their defaults."""
    if numbers.gyro is None or numbers.accel is None:
        return []
    values = [*numbers.single("white"), *numbers.single("walk")]
    root = math.sqrt(EKF_STEP)
    lines = [f"# {program} at a step of {EKF_STEP:g} s; tuned for vibration, so not to be loaded:"]
    return lines + [
        f"# {name} {_n(value / root)} (default {default:g})"
        for name, value, default in zip(names, values, defaults, strict=True)
    ]


_CONTAINS = frozenset({"gyro_bias", "accel_bias", "accel_scale", "thermal_bias", "axes"})
FORMATS = (
    Format("px4", "PX4 parameters (QGroundControl)", "px4.params", _CONTAINS, px4, noise=False),
    Format(
        "ardupilot", "ArduPilot parameters", "ardupilot.param", _CONTAINS, ardupilot, noise=False
    ),
)
