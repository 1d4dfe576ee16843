"""Voyages that are wrong in silence: that of `files.prepare`, with one fault put in."""

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from rotcli.files.columns import write_columns
from rotcli.units import DEG, STANDARD_GRAVITY
from tests.campaigns.faults.runs import rotcli
from tests.campaigns.faults.silent import is_alarm

LOGS = ("imu", "table", "gnss", "doppler")
_GYRO, _ACCEL = slice(1, 4), slice(4, 7)
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Fault:
    """Which log is spoilt and how, or what is replaced in the rig, and what must be said."""

    says: str
    log: str = "imu"
    change: Callable[[Columns], Columns] | None = None
    rig: tuple[str, str] | None = None


def _scaled(part: slice, factor: float) -> Callable[[Columns], Columns]:
    def change(log: Columns) -> Columns:
        return {**log, **{name: factor * log[name] for name in list(log)[part]}}

    return change


def _order(part: slice, order: tuple[int, ...], signs=(1, 1, 1)) -> Callable[[Columns], Columns]:
    def change(log: Columns) -> Columns:
        names = list(log)[part]
        there = [log[name] for name in names]
        new = (sign * there[k] for k, sign in zip(order, signs, strict=True))
        return {**log, **dict(zip(names, new, strict=True))}

    return change


def _later(seconds: float) -> Callable[[Columns], Columns]:
    def change(log: Columns) -> Columns:
        return {**log, "time [s]": log["time [s]"] + seconds}

    return change


def _without(log: Columns) -> Columns:
    lost = np.concatenate([start + np.arange(4) for start in (1000, 3000, 7000)])
    return {name: np.delete(values, lost) for name, values in log.items()}


def _quantised(log: Columns) -> Columns:
    name = list(log)[1]
    step = np.ptp(log[name]) / 6.0
    return {**log, name: step * np.round(log[name] / step)}


_PART = r"the gyro heading and the table angle differ by .* check \[table\] direction and units"
_WHERE = r"gravity is 180.0 deg .*correct \[imu\] mount|check the unit, and the order"
FAULTS: dict[str, Fault] = {
    "nothing": Fault("", change=dict),
    "deg/s read as rad/s": Fault(_PART, change=_scaled(_GYRO, 1 / DEG)),
    "rad/s read as deg/s": Fault(_PART, change=_scaled(_GYRO, DEG)),
    "g read as m/s^2": Fault(
        r"in g\? set the unit in the header", change=_scaled(_ACCEL, 1 / STANDARD_GRAVITY)
    ),
    "accelerometer axes swapped": Fault(_WHERE, change=_order(_ACCEL, (2, 0, 1))),
    "accelerometer axes flipped": Fault(_WHERE, change=_order(_ACCEL, (0, 1, 2), (-1, 1, -1))),
    "gyro axes swapped": Fault(_PART, change=_order(_GYRO, (2, 0, 1))),
    "gyro axes flipped": Fault(_PART, change=_order(_GYRO, (0, 1, 2), (1, -1, -1))),
    "table turning the other way": Fault(_PART, rig=("direction = 1", "direction = -1")),
    "IMU stamps in ms read as s": Fault(
        r"records per second, .* set units time", change=_scaled(slice(0, 1), 1e3)
    ),
    "table stamps in ms read as s": Fault(
        r"records per second, .* set units time", "table", _scaled(slice(0, 1), 1e3)
    ),
    "clocks offset by two samples": Fault(
        r"set \[table\] time_offset = -0.4", "table", _later(0.4)
    ),
    "no azimuth": Fault(r"azimuth: missing; set the heading", rig=("azimuth = ", "# ")),
    "a stuck axis": Fault("is constant .* stuck", change=_scaled(slice(1, 2), 0.0)),
    "quantised data": Fault("distinct values, .* log more digits", change=_quantised),
    "samples dropped in bursts": Fault(
        r"3 gaps \(12 samples\), .* exclude these parts", change=_without
    ),
    "clipped samples": Fault(
        "at or past the range .* exclude this part",
        rig=('name = "SRINS"', 'name = "SRINS"\ngyro_range = 5.0'),
    ),
    "GNSS latitude in deg read as rad": Fault(
        r"impossible for a latitude .* set \[reference\] units latitude",
        "gnss",
        _scaled(slice(1, 2), 1 / DEG),
    ),
}


def judge(name: str, sound: Path, call=rotcli) -> str | None:
    """Spoil a copy of a sound voyage and calibrate it; return None when it is reported of.

    Of the sound one nothing must be said.
    """
    fault = FAULTS[name]
    place = sound.with_name("spoilt")
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(sound, place)
    if fault.change is not None:
        path = place / f"{fault.log}.parquet"
        table = pq.read_table(path)
        log = {column: np.asarray(table[column]) for column in table.column_names}
        write_columns(path, fault.change(log))
    if fault.rig is not None:
        text = (place / "rig.toml").read_text()
        assert fault.rig[0] in text
        (place / "rig.toml").write_text(text.replace(*fault.rig))
    logs = {log: str(place / f"{log}.parquet") for log in LOGS}
    line = ["srins", "calibrate", logs["imu"], logs["table"], "--settle", "0.3"]
    done = call([*line, "--reference", logs["gnss"], "--speed", logs["doppler"]])
    reported = [text for text in done.stderr.splitlines() if is_alarm(text)]
    errors = [text for text in reported if text.startswith("rotcli: error: ")]
    if len(errors) == done.returncode and done.returncode in (0, 1):
        if not fault.says and not reported:
            return None
        if fault.says and any(re.search(fault.says, text) for text in reported):
            return None
    return f"{done.returncode}: {done.stderr or 'not a word'}"
