"""Read the temperature of an IMU log, or of a thermometer's log, as means over one second.

A column `temperature` (or the one that [imu] columns names), in degC, K or degF. A log of two
days is read chunk by chunk: two columns, and 173,000 means remain.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.channels import TEMPERATURE
from rotcli.logs.container.columns import Loaded, Wanted
from rotcli.logs.container.header import MAX_BYTES, Header
from rotcli.logs.container.loading import load, load_chunks
from rotcli.logs.container.opening import open_log
from rotcli.logs.describe import aliases
from rotcli.logs.describe.imu import describe_imu
from rotcli.logs.describe.layout import Layout, Source
from rotcli.logs.describe.time import describe_time
from rotcli.logs.describe.units import choose_unit
from rotcli.logs.record import CHUNK_SAMPLES, ImuLog, ImuSource
from rotcli.logs.timing.stamps import read_stamps
from rotcli.models.laboratory.thermometer import smooth
from rotcli.rig.rig import LogSettings, Rig
from rotcli.units import TEMPERATURE_ZERO, UNITS, FloatArray, format_span

MEAN = 1.0  # s over which the readings are averaged
FILTER = 10.0  # s: steps of a thermometer of 1 degC would else be 0.29 degC d'(T) of noise
# Chambers for IMUs reach from -70 to 180 degC; what is outside is no temperature in degC.
_LOWEST, _HIGHEST = -120.0, 250.0
_SLACK = 60.0  # s that the temperature may end before the readings: thermometers are slow


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
                f"the temperature spans {format_span(self.time[0], self.time[-1])}, but it is "
                f"needed from {format_span(low, high)}; check the clocks of the logs"
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
    if log is None:
        header = open_log(imu.path, rig.imu, max_bytes)
        layout = describe_imu(header, rig)
        if "temperature" not in layout.sources:
            return None
    else:
        header = open_log(log, LogSettings(), max_bytes)
        layout = _describe_thermometer(header)
    layout.raise_problems()
    source = layout.sources["temperature"]
    sums: dict[int, tuple[float, float, int]] = {}
    rows = 0
    for time, celsius, loaded in _records(header, layout, imu, log is not None):
        _check(loaded, header, source.column, celsius)
        rows += len(time)
        _add(sums, time, celsius)
    keys = sorted(sums)
    count = np.array([sums[k][2] for k in keys], dtype=float)
    mean_time = np.array([sums[k][0] for k in keys]) / count
    mean = np.array([sums[k][1] for k in keys]) / count
    return TemperatureLog(header.path, mean_time, smooth(mean_time, mean, tau), rows, header.stamp)


def _describe_thermometer(header: Header) -> Layout:
    """Return the layout of a thermometer's log: a usual name, else the first usual unit."""
    time, problems, notes = describe_time(header, LogSettings(), {}, "imu")
    column = aliases.find_named(header.names, TEMPERATURE.names, TEMPERATURE.quantity)
    if column is None:
        found = [i for i, unit in enumerate(header.units) if unit in TEMPERATURE_ZERO]
        # Of several thermometers that of the gyros, not of the processor.
        found.sort(key=lambda i: "gyro" not in header.names[i].lower())
        column = found[0] if found else None
    if column is None:
        raise LogError(header.path, "no temperature column; name it temperature [degC]")
    choice = choose_unit(header, column, "temperature", ("temperature",), {}, {}, "imu")
    unit = choice.unit or "degC"
    size = UNITS["temperature"][unit]
    source = Source(column, size, -TEMPERATURE_ZERO[unit] / size, unit, choice.origin)
    return Layout(
        header.path,
        time,
        {"temperature": source},
        notes=tuple(notes),
        problems=(*problems, *choice.problems),
    )


def _records(
    header: Header, layout: Layout, imu: ImuSource, own: bool
) -> Iterator[tuple[FloatArray, FloatArray, Loaded | None]]:
    """Yield times (n,), s, temperatures (n,), degC, and the records that they come from."""
    source = layout.sources["temperature"]
    if own:
        loaded = load(header, layout.wanted)
        stamps = read_stamps(loaded, layout, LogSettings(), "reference")
        celsius = np.empty(stamps.loaded.rows)
        stamps.loaded.fill(celsius, len(layout.time.columns), source.scale, source.offset)
        yield stamps.time, celsius, stamps.loaded
        return
    if isinstance(imu, ImuLog) and imu.temperature is not None:
        yield imu.time, imu.temperature, None
        return
    columns = (*layout.time.columns, source.column)
    for loaded, _ in load_chunks(header, Wanted(columns), CHUNK_SAMPLES):
        time, celsius = np.empty(loaded.rows), np.empty(loaded.rows)
        loaded.fill(time, 0, layout.time.scale[0])
        loaded.fill(celsius, 1, source.scale, source.offset)
        yield time, celsius, loaded


def _check(loaded: Loaded | None, header: Header, column: int, celsius: FloatArray) -> None:
    """Raise LogError for the first value that is no temperature of a test."""
    bad = np.flatnonzero((celsius < _LOWEST) | (celsius > _HIGHEST))
    if len(bad):
        what = (
            f"{celsius[bad[0]]:.4g} degC is not a temperature of a test; set the unit or remove "
            "the row"
        )
        row = None if loaded is None else loaded.row(int(bad[0]))
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
