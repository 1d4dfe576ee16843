"""Read the temperature of an IMU log, or of a thermometer's log, as means over one second.

A column `temperature` (or the one that [imu] columns names), in degC, K or degF. A log of two
days is read chunk by chunk: two columns, and 173,000 means remain.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.columns import Loaded, load, load_batches
from rotcli.logs.formats import layout_of
from rotcli.logs.header import MAX_BYTES, Header, open_log
from rotcli.logs.readings import counts_time, increasing, require, unit_factor
from rotcli.logs.record import PIECE, ImuSource
from rotcli.models.thermometer import smooth
from rotcli.rig.rig import Rig
from rotcli.units import SPELLINGS, TEMPERATURE_ZERO, UNITS, show_span

FloatArray = NDArray[np.float64]

MEAN = 1.0  # s over which the readings are averaged
FILTER = 10.0  # s: steps of a thermometer of 1 degC would else be 0.29 degC d'(T) of noise
# Chambers for IMUs reach from -70 to 180 degC; what is outside is no temperature in degC.
_LOWEST, _HIGHEST = -120.0, 250.0
_SLACK = 60.0  # s that the temperature may end before the readings: thermometers are slow
_NAMES = ("temperature", "temp", "imu_temperature", "imu_temp", "gyro_temp", "chip_temp")
_TIME_NAMES = ("time", "timestamp", "t")
# `Name [unit]`, `Name (unit)`, `name_unit`.
_BRACKET = re.compile(r"^(.*?)\s*[\[(]\s*(.*?)\s*[\])]$")


@dataclass(frozen=True, eq=False)
class TemperatureLog:
    """Temperature over time: time (m,) s, celsius (m,) degC, filtered over 10 s."""

    path: str
    time: FloatArray
    celsius: FloatArray
    rows: int
    stamp: tuple[int, int] | None = None

    def at(self, time: FloatArray) -> FloatArray:
        """Return the temperature (n,), degC, at times (n,), s.

        Raises LogError where they lie more than 60 s outside the log.
        """
        low, high = float(np.min(time)), float(np.max(time))
        if low < self.time[0] - _SLACK or high > self.time[-1] + _SLACK:
            what = (
                f"the temperature spans {show_span(self.time[0], self.time[-1])}, but it is "
                f"needed from {show_span(low, high)}; check the clocks of the logs"
            )
            raise LogError(self.path, what)
        return np.asarray(np.interp(time, self.time, self.celsius))

    def slope(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """Return the mean time derivative (k,), degC/s, over intervals [start, end], s."""
        return np.asarray((self.at(end) - self.at(start)) / (end - start))


def read_temperature(
    imu: ImuSource,
    rig: Rig,
    *,
    log: str | Path | None = None,
    tau: float = FILTER,
    max_bytes: int = MAX_BYTES,
) -> TemperatureLog | None:
    """Return the temperature of an IMU log, or of a thermometer's log; None if it has none.

    log: a file of its own with `time` and `temperature`, on the IMU's clock. tau: s of the
    filter. Raises LogError when a number is no temperature or the log cannot be read.
    """
    own = log is not None
    path = imu.path if log is None else log
    header = open_log(path, None if own else layout_of(rig.imu).dialect, max_bytes)
    column = _temperature_column(header, rig, own)
    if column is None:
        if own:
            what = "no temperature column; name it temperature [degC]"
            raise LogError(header.path, what)
        return None
    scale, zero = _to_celsius(header, column, rig.imu.units.get("temperature"))
    sums: dict[int, tuple[float, float, int]] = {}
    rows = 0
    for time, raw, loaded in _records(header, column, rig, imu, own):
        celsius = scale * raw + zero
        _check(loaded, header, column, celsius)
        rows += len(time)
        _add(sums, time, celsius)
    keys = sorted(sums)
    count = np.array([sums[k][2] for k in keys], dtype=float)
    mean_time = np.array([sums[k][0] for k in keys]) / count
    mean = np.array([sums[k][1] for k in keys]) / count
    return TemperatureLog(header.path, mean_time, smooth(mean_time, mean, tau), rows, header.stamp)


def _temperature_column(header: Header, rig: Rig, own: bool) -> int | None:
    """Return the temperature's column: the rig's, a usual name, of a thermometer a usual unit."""
    named = rig.imu.columns.get("temperature")
    if named is not None and not own:
        return require(header, "temperature", named, "correct [imu] columns in the rig")
    bare = [_bare(name)[0] for name in header.names]
    found = [i for name in _NAMES for i, other in enumerate(bare) if other == name]
    if not found and own:
        units = [_unit(header, i) for i in range(len(header.names))]
        found = [i for i, unit in enumerate(units) if unit in TEMPERATURE_ZERO]
    return found[0] if found else None


def _bare(name: str) -> tuple[str, str | None]:
    """Return a column's name in small letters without its unit, and the unit."""
    match = _BRACKET.match(name)
    text, unit = (match[1], match[2]) if match else (name, None)
    return re.sub(r"[\s_]+", "_", text.strip().lower()), unit


def _unit(header: Header, column: int) -> str | None:
    """Return the unit that the header names, in our spelling."""
    unit = header.units[column] or _bare(header.names[column])[1]
    if unit is None:
        return None
    unit = unit.strip()
    return SPELLINGS.get(unit, unit)


def _to_celsius(header: Header, column: int, rig_unit: str | None) -> tuple[float, float]:
    """Return factor and offset to degC; the default unit is degC."""
    unit = _unit(header, column) or rig_unit or "degC"
    unit = SPELLINGS.get(unit, unit)
    if unit not in TEMPERATURE_ZERO:
        what = f"unit {unit!r} is no temperature; use one of {', '.join(TEMPERATURE_ZERO)}"
        raise LogError(header.path, what, column=header.names[column])
    return UNITS["temperature"][unit], TEMPERATURE_ZERO[unit]


def _records(
    header: Header, column: int, rig: Rig, imu: ImuSource, own: bool
) -> Iterator[tuple[FloatArray, FloatArray, Loaded]]:
    """Yield times (n,), s, raw temperatures (n,) and the records that they come from."""
    if not own and counts_time(header, rig):
        loaded = load(header, [column])
        raw = np.empty(loaded.rows)
        loaded.fill(raw, 0, 1.0)
        yield np.linspace(imu.time[0], imu.time[-1], loaded.rows), raw, loaded
        return
    clock, factor = _clock(header, rig, own)
    last: float | None = None
    for loaded, _ in load_batches(header, [clock, column], PIECE):
        time, raw = np.empty(loaded.rows), np.empty(loaded.rows)
        loaded.fill(time, 0, factor)
        loaded.fill(raw, 1, 1.0)
        time = increasing(loaded, time, last)
        last = float(time[-1])
        yield time, raw, loaded


def _clock(header: Header, rig: Rig, own: bool) -> tuple[int, float]:
    """Return the time's column and its factor to s."""
    layout = layout_of(rig.imu)
    if not own:
        clock = require(header, "time", layout.columns.get("time"), "rename the column")
        return clock, unit_factor(header, clock, "time", layout.units.get("time"), "[imu]", [])
    bare = [_bare(name)[0] for name in header.names]
    found = [bare.index(name) for name in _TIME_NAMES if name in bare]
    if not found:
        raise LogError(header.path, "no time column; name it time [s]")
    unit = _unit(header, found[0]) or "s"
    if unit not in UNITS["time"]:
        what = f"unit {unit!r} is no time; use one of {', '.join(UNITS['time'])}"
        raise LogError(header.path, what, column=header.names[found[0]])
    return found[0], UNITS["time"][unit]


def _check(loaded: Loaded, header: Header, column: int, celsius: FloatArray) -> None:
    """Raise LogError for the first value that is no temperature of a test."""
    bad = np.flatnonzero((celsius < _LOWEST) | (celsius > _HIGHEST))
    if len(bad):
        what = f"{celsius[bad[0]]:.4g} degC is no temperature; name the unit or remove the row"
        row = loaded.row(int(bad[0]))
        raise LogError(header.path, what, row=row, column=header.names[column])


def _add(sums: dict[int, tuple[float, float, int]], time: FloatArray, celsius: FloatArray) -> None:
    """Add readings to the sums (time, temperature, count) of their second."""
    second = np.floor(time / MEAN).astype(np.int64)
    keys, first = np.unique(second, return_index=True)
    edges = np.append(first, len(time))
    times = np.add.reduceat(time, first)
    temperatures = np.add.reduceat(celsius, first)
    for i, key in enumerate(keys.tolist()):
        t, c, n = sums.get(key, (0.0, 0.0, 0))
        count = int(edges[i + 1] - edges[i])
        sums[key] = t + float(times[i]), c + float(temperatures[i]), n + count
