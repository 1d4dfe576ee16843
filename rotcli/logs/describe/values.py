"""What the values of an IMU log decide: units, raw counts, missing gravity, several IMUs."""

from typing import Any

import numpy as np

from rotcli.logs.container.header import Header
from rotcli.logs.describe import aliases, look, words
from rotcli.logs.describe.layout import Problem, Source
from rotcli.logs.describe.time import listed
from rotcli.logs.describe.units import Choice
from rotcli.rig.rig import ImuSettings
from rotcli.units import STANDARD_GRAVITY

SENSOR_NAMES = {"gyro": "gyro", "accel": "accelerometer"}
_MAX_INSTANCES = 16  # IMUs in one log; a column of more values does not number them
_NO_GRAVITY = 0.5  # m/s^2; below it a moving triad has no gravity: linear acceleration
_MIN_RECORDS = 50  # half a second at 100 Hz


def scale_problem(candidates: list[tuple[str, float, float]]) -> list[Problem]:
    """Return the problem of counts whose size the log does not name."""
    lines = [
        f"{{ gyro = {gyro:.9g}, accel = {accel:.9g} }} for {name}"
        for name, gyro, accel in candidates
    ]
    first = candidates[0] if candidates else None
    rig = {"imu": {"scale": {"gyro": first[1], "accel": first[2]}}} if first else {}
    more = f"the size of a count by IMU: {'; '.join(lines)}" if lines else "set [imu] scale"
    return [Problem("the log contains counts and not the type of the IMU", rig, more)]


def unit_from_values(
    header: Header,
    imu: ImuSettings,
    sensor: str,
    indices: list[int],
    accel_indices: list[int],
    time: Any,
) -> tuple[Choice, list[Problem], list[str]]:
    """Return the unit of a triad without one: from decisive values, else SI."""
    si = Choice(None, "assumed")
    if sensor == "gyro" and look.reads_degrees(
        header, indices, accel_indices, _sample_interval(header, time)
    ):
        note = (
            f"{header.path}: the gyros have no unit and are still; in rad/s their noise is absurd. "
            'They are read as deg/s; set [imu] units = { gyro = "deg/s" }'
        )
        return Choice("deg/s", "values", "rate"), [], [note]
    if sensor == "gyro":
        return si, [], []
    size = look.gravity_size(header, indices)
    if look.looks_raw(header, indices):
        middle = look.common_offset(header, indices) or 0.0
        return si, [_raw_problem(header, indices, middle)], []
    unit = look.acceleration_unit(size)
    if imu.sampling == "instant" and unit is None:
        interval = _sample_interval(header, time)
        if look.is_increment(size, interval):
            finding = (
                f"the accelerometers read {size:.4g}, which is gravity times the sampling "
                f"interval of {interval:.4g} s: increments"
            )
            return si, [Problem(finding, {"imu": {"sampling": "increment"}})], []
    if unit in (None, "m/s^2"):
        return si, [], []
    note = (
        f"{header.path}: the accelerometers have no unit and read {size:.4g} in all, gravity in "
        f'{unit}. They are read as {unit}; set [imu] units = {{ accel = "{unit}" }}'
    )
    return Choice(unit, "values"), [], [note]


def _sample_interval(header: Header, time: Any) -> float | None:
    """Return the sampling interval of the first records, s, where the time shows it."""
    if time.kind == "none":
        return float(time.interval) or None
    if time.kind == "counter":
        return 1.0 / float(time.scale[0]) if time.scale[0] else None
    if time.kind != "unit":
        return None
    return look.step(look.numbers(header, time.columns[0])) * time.scale[0] or None


def _raw_problem(header: Header, indices: list[int], middle: float) -> Problem:
    """Return the problem of raw counts: the line for scale and offset, from gravity."""
    rows = [look.numbers(header, k) - middle for k in indices]
    size = float(np.median(np.sqrt(sum(row**2 for row in rows))))
    accel = float(f"{STANDARD_GRAVITY / size:.4g}")
    rig: dict[str, Any] = {"scale": {"gyro": 1.0, "accel": accel}, "units": {"gyro": "deg/s"}}
    about = f" about {middle:.6g}" if middle else ""
    if middle:
        rig["offset"] = middle
    finding = f"the readings are integers{about}: raw counts (gravity is {size:.5g} counts)"
    advice = "with the gyro sensitivity of the data sheet, deg/s per count, in place of 1.0"
    return Problem(finding, {"imu": rig}, advice)


def gravity_problems(
    header: Header, imu: ImuSettings, sources: dict[str, Source], names: list[str], time: Any
) -> list[Problem]:
    """Return the problem of accelerometers that contradict what their unit says."""
    rows = []
    for name in names:
        source = sources[name]
        rows.append((look.numbers(header, source.column) - source.offset) * source.scale)
    count = min(map(len, rows))
    if count < _MIN_RECORDS:
        return []
    values = np.array([row[:count] for row in rows])
    with np.errstate(over="ignore"):
        size = float(np.median(np.sqrt(np.sum(values**2, axis=0))))
    if not 0.0 < size < _NO_GRAVITY or not np.all(values.std(axis=1) > 0.0):
        return []
    if sources[names[0]].increments or look.is_increment(size, _sample_interval(header, time)):
        return []
    if sources[names[0]].origin == "assumed":
        return []
    finding = (
        f"the accelerometers read {size:.3g} m/s^2 in all, gravity is missing: linear acceleration"
    )
    return [Problem(finding, advice="log the accelerometers with gravity, or set [imu] channels")]


def find_instance(
    header: Header, imu: ImuSettings
) -> tuple[tuple[int, Any] | None, list[str], list[Problem]]:
    """Return the column that numbers the IMUs of a log and the one that is read."""
    index = aliases.find_named(header.names, words.INSTANCE_NAMES)
    if index is None or not header.is_text:
        if imu.instance is not None and header.is_text:
            finding = f"no column that numbers the IMUs (the log has: {listed(header)})"
            return None, [], [Problem(finding, advice="remove [imu] instance")]
        return None, [], []
    cells = [c[index] for c in header.records if index < len(c)]
    values = list(dict.fromkeys(cell for cell in cells if cell))
    if len(values) > _MAX_INSTANCES:
        return None, [], []
    if imu.instance is not None:
        wanted = str(imu.instance)
        if wanted not in values:
            finding = f"no records of {header.raw[index]} = {wanted}, there are {', '.join(values)}"
            return None, [], [Problem(finding, {"imu": {"instance": _value(values[0])}})]
        return (index, wanted), [], []
    if len(values) < 2:
        return None, [], []
    note = (
        f"{header.path}: the log contains {len(values)} IMUs ({header.raw[index]} = "
        f"{', '.join(values)}). The records of {values[0]} are used; set [imu] instance"
    )
    return (index, values[0]), [note], []


def _value(text: str) -> int | str:
    return int(text) if text.isdigit() else text
