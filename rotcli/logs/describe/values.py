"""What the values of an IMU log decide: units, raw counts, missing gravity, several IMUs."""

import itertools
from collections.abc import Iterable
from typing import Any

import numpy as np

from rotcli.files.toml_schema import to_toml
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
_COUNTS = 100.0  # a norm of accelerometers above it is in no unit but mg, cm/s^2 or mm/s^2
_INCREMENT_TOLERANCE = 0.05  # share by which increments may differ from gravity x interval
_CLEARLY = 0.3  # of two explanations the one whose error is this share of the other's
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
    interval = _sample_interval(header, time)
    if sensor == "gyro":
        return _gyro_unit(header, imu, indices, accel_indices, interval)
    return _accel_unit(header, imu, indices, interval)


def _gyro_unit(
    header: Header,
    imu: ImuSettings,
    indices: list[int],
    accel_indices: list[int],
    interval: float | None,
) -> tuple[Choice, list[Problem], list[str]]:
    """Return deg/s where still gyros are too noisy in rad/s, a problem where in deg/s as well."""
    si = Choice(None, "assumed")
    increments = imu.sampling == "increment"
    if look.looks_raw(header, accel_indices):
        return si, [], []  # the accelerometers lead to the scale
    walk = look.still_walk(header, indices, accel_indices, interval)
    if walk is None or not interval:
        return si, [], []
    walk /= interval if increments else 1.0
    if not look.is_absurd_walk(walk):
        return si, [], []
    rad, deg = ("rad", "deg") if increments else ("rad/s", "deg/s")
    if not look.is_absurd_walk(walk, "deg/s"):
        note = (
            f"{header.path}: the gyros have no unit and are still; in {rad} their noise is absurd. "
            f'They are read as {deg}; set [imu] units = {{ gyro = "{deg}" }} to confirm, or '
            "another unit"
        )
        kind = "angle" if increments else "rate"
        return Choice(deg, "values", kind), [], [note]
    finding = f"the gyros have no unit and are still; in {rad} and in {deg} their noise is absurd"
    if look.are_integers(header, indices):
        rig: dict[str, Any] = {"scale": {"gyro": 1.0}, "units": {"gyro": deg}}
        advice = "with the sensitivity of the data sheet, deg/s per count, in place of 1.0"
        return si, [Problem(f"{finding}: raw counts", {"imu": rig}, advice)], []
    other = "arcsec" if increments else "mdeg/s"
    advice = 'or "deg/h", or scale for raw counts' if not increments else "or another unit"
    return si, [Problem(finding, {"imu": {"units": {"gyro": other}}}, advice)], []


def _accel_unit(
    header: Header, imu: ImuSettings, indices: list[int], interval: float | None
) -> tuple[Choice, list[Problem], list[str]]:
    """Return the unit in which the accelerometers measure gravity, or what else they show."""
    si = Choice(None, "assumed")
    size = look.gravity_size(header, indices)
    unit = look.acceleration_unit(size)
    counts = unit is None and size is not None and size > _COUNTS and look.is_still(header, indices)
    if counts or look.looks_raw(header, indices):
        middle = look.common_offset(header, indices) or 0.0
        return si, [_raw_problem(header, indices, middle, unit)], []
    if size is None:
        return si, [], []
    if imu.sampling == "instant":
        problem = _increment_problem(size, unit, interval)
        if problem:
            return si, [problem], []
    if unit in (None, "m/s^2") or imu.sampling == "increment":
        return si, [], []
    note = (
        f"{header.path}: the accelerometers have no unit and read {size:.4g} in all, gravity in "
        f'{unit}. They are read as {unit}; set [imu] units = {{ accel = "{unit}" }}'
    )
    return Choice(unit, "values"), [], [note]


def _increment_problem(size: float, unit: str | None, interval: float | None) -> Problem | None:
    """Return the problem of accelerometers that read gravity times the sampling interval.

    Near 10 Hz increments in m/s look like accelerations in g; where both fit, both are named.
    """
    wrong = look.increment_error(size, interval)
    other = look.gravity_error(size, unit) if unit else 1.0
    rig: dict[str, Any] = {"imu": {"sampling": "increment"}}
    if wrong < _INCREMENT_TOLERANCE and not other < _CLEARLY * wrong:
        finding = (
            f"the accelerometers read {size:.4g}, which is gravity times the sampling interval of "
            f"{interval:.4g} s: increments"
        )
        if unit is None or wrong < _CLEARLY * other:
            return Problem(finding, rig)
        return Problem(
            f"{finding}, or accelerations in {unit}",
            rig,
            f'or units = {{ accel = "{unit}" }}',
        )
    if unit is None and look.increment_error(size, interval, 1.0) < _INCREMENT_TOLERANCE:
        finding = (
            f"the accelerometers read {size:.4g}, which is 1 g times the sampling interval of "
            f"{interval:.4g} s: increments in g s"
        )
        return Problem(finding, {"imu": {**rig["imu"], "scale": {"accel": STANDARD_GRAVITY}}})
    return None


def _sample_interval(header: Header, time: Any) -> float | None:
    """Return the sampling interval of the first records, s, where the time shows it."""
    if time.kind == "none":
        return float(time.interval) or None
    if time.kind == "counter":
        return 1.0 / float(time.scale[0]) if time.scale[0] else None
    if time.kind != "unit":
        return None
    return look.step(look.numbers(header, time.columns[0])) * time.scale[0] or None


def _raw_problem(header: Header, indices: list[int], middle: float, unit: str | None) -> Problem:
    """Return the problem of raw counts: the line for scale and offset, from gravity."""
    rows = [look.numbers(header, k) - middle for k in indices]
    size = float(np.median(np.sqrt(sum(row**2 for row in rows))))
    accel = float(f"{STANDARD_GRAVITY / size:.4g}")
    rig: dict[str, Any] = {"scale": {"gyro": 1.0, "accel": accel}, "units": {"gyro": "deg/s"}}
    about = f" about {middle:.6g}" if middle else ""
    if middle:
        rig["offset"] = middle
    integers = look.are_integers(header, indices)
    kind = "integers" if integers else "numbers in no unit of acceleration"
    finding = f"the readings are {kind}{about}: raw counts (gravity is {size:.5g} counts)"
    advice = "with the gyro sensitivity of the data sheet, deg/s per count, in place of 1.0"
    if unit and not middle:
        advice += f'; if the accelerometers are in {unit}: units = {{ accel = "{unit}" }}'
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
    finding = (
        f"the accelerometers read {size:.3g} m/s^2 in all, gravity is missing: linear acceleration"
    )
    line = {"imu": {"channels": ["gyro"]}}
    return [Problem(finding, line, "or log the accelerometers with gravity")]


def find_instance(
    header: Header, imu: ImuSettings, channels: Iterable[int] = ()
) -> tuple[tuple[int, Any] | None, list[str], list[Problem]]:
    """Return the column that numbers the IMUs of a log and the one that is read.

    channels: columns that contain readings.
    """
    if not header.is_text:
        return None, [], []
    index = aliases.find_named(header.names, words.INSTANCE_NAMES)
    alternating = None if index is not None else _alternating(header, set(channels))
    index = alternating if index is None else index
    if index is None:
        if imu.instance is not None:
            finding = f"no column that numbers the IMUs (the log has: {listed(header)})"
            return None, [], [Problem(finding, advice="remove [imu] instance")]
        return None, [], []
    values = _values(header, index)
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
    name, shown = header.raw[index], ", ".join(values)
    line = f"set [imu] instance = {to_toml(_value(values[0]))}"
    if alternating is not None:
        note = (
            f"{header.path}: {name} alternates ({shown}). If it numbers {len(values)} IMUs, {line} "
            "or another"
        )
        return None, [note], []
    note = (
        f"{header.path}: the log contains {len(values)} IMUs ({name} = {shown}). The records of "
        f"{values[0]} are used; {line} or another"
    )
    return (index, values[0]), [note], []


def _values(header: Header, index: int) -> list[str]:
    """Return the different values of a column in the first records."""
    cells = [c[index] for c in header.records if index < len(c)]
    return list(dict.fromkeys(cell for cell in cells if cell))


def _alternating(header: Header, channels: set[int]) -> int | None:
    """Return the column whose few values take turns from record to record, None without one."""
    for k in range(len(header.raw)):
        if k in channels or len(header.records) < _MIN_RECORDS:
            continue
        values = _values(header, k)
        if not 2 <= len(values) <= _MAX_INSTANCES:
            continue
        cells = [c[k] for c in header.records if k < len(c)]
        turns = [cells[i] == cells[i - len(values)] for i in range(len(values), len(cells))]
        changes = [a != b for a, b in itertools.pairwise(cells)]
        if all(changes) and sum(turns) >= 0.9 * len(turns):
            return k
    return None


def _value(text: str) -> int | str:
    return int(text) if text.isdigit() else text
