"""The readings of an IMU log as the file contains them, in SI: the input of `read_imu`.

Nothing is interpolated, rotated or divided: increments stay increments (rad, m/s), the axes are
the IMU's own, and only the clock becomes one of seconds. `rotcli convert` writes them.
"""

from collections.abc import Mapping, Sequence
from math import log10
from pathlib import Path

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.channels import AXES, BY_NAME, OPTIONAL
from rotcli.logs.container.columns import Loaded
from rotcli.logs.container.header import MAX_BYTES, Header, Progress
from rotcli.logs.container.loading import load
from rotcli.logs.container.opening import open_log
from rotcli.logs.describe.imu import describe_imu
from rotcli.logs.describe.layout import Layout, Problem, Source, raise_all
from rotcli.logs.timing.stamps import read_stamps, seconds
from rotcli.rig.rig import Rig
from rotcli.units import UNITS, FloatArray, show_time

# s: no logger of turntables is faster than 100 kHz, slower than 0.1 Hz, or of the year 5138.
_SHORTEST, _LONGEST, _LATEST = 1e-5, 10.0 * (1.0 - 1e-3), 1e11


@dataclass(frozen=True, eq=False)
class Readings:
    """The content of an IMU log: time (n,) s, not decreasing; values (6, n), gyro then accel.

    values: rad/s and m/s^2; rad and m/s over the interval that ends there for a sensor in
    `increments`; 0 for a channel that is missing. extras: the optional channels that
    the log contains, (n,) each, in the unit of the channel, such as degC. repeated: some stamps
    repeat the one before.
    """

    loaded: Loaded
    layout: Layout
    time: FloatArray
    values: FloatArray
    increments: frozenset[str]
    extras: dict[str, FloatArray]
    warnings: list[str]
    repeated: bool = False

    @property
    def channels(self) -> tuple[str, ...]:
        """The axes that the log contains."""
        return tuple(name for name in AXES if name in self.layout.sources)


def read_readings(
    path: str | Path,
    rig: Rig,
    progress: Progress | None = None,
    table_log: str | Path | None = None,
    max_bytes: int = MAX_BYTES,
    channels: Sequence[str] | None = None,
) -> Readings:
    """Read the time and the axes of an IMU log in any format that rig or file describe.

    progress: gets the share (0 to 1) of a text log that is read. table_log: the file read as
    that, for messages. max_bytes: that may be read at most. channels: the axes that must be there
    (default: all six, or those of the rig). Raises LogError when the file cannot be read, a
    column is missing, or a number or time is invalid.
    """
    header = open_log(path, rig.imu, max_bytes)
    layout = describe_imu(header, rig, channels, table_log)
    found = read_described(header, layout, rig, progress)
    present = [k for k, name in enumerate(AXES) if name in found.channels]
    check_size(found.loaded, found.values[present], found.channels)
    return found


def read_described(
    header: Header, layout: Layout, rig: Rig, progress: Progress | None = None
) -> Readings:
    """Read the records of a log whose layout is known; raises LogError."""
    layout.raise_problems()
    loaded = load(header, layout.wanted, progress=progress)
    loaded = select_instance(loaded, layout)
    check_time_unit(header, layout, first_times(loaded, layout), "imu")
    stamps = read_stamps(loaded, layout, rig.imu, "imu")
    check_times(stamps.loaded, stamps.time)
    values = fill_channels(stamps.loaded, layout, AXES)
    extras = [channel.name for channel in OPTIONAL if channel.name in layout.sources]
    increments = frozenset(
        name.partition("_")[0] for name, source in layout.sources.items() if source.increments
    )
    warnings = [*layout.notes, *stamps.notes]
    return Readings(
        stamps.loaded,
        layout,
        stamps.time,
        values,
        increments,
        dict(zip(extras, fill_channels(stamps.loaded, layout, extras), strict=True)),
        warnings,
        stamps.repeated,
    )


def select_instance(loaded: Loaded, layout: Layout) -> Loaded:
    """Return the records of the selected IMU of a log with several."""
    if layout.selected is None:
        return loaded
    numbers = loaded.column(len(loaded.columns) - 1)
    mask = np.array([str(n).strip() == str(layout.selected[1]) for n in numbers])
    return loaded.select(mask)


def first_times(loaded: Loaded, layout: Layout) -> FloatArray:
    """Return the first times (k,), s, of a numeric time column."""
    if layout.time.kind != "unit":
        return np.empty(0)
    return seconds(loaded, layout.time)[:2000]


def fill_channels(loaded: Loaded, layout: Layout, names: Sequence[str]) -> FloatArray:
    """Return channels (k, n) in SI, 0 for those that the log lacks."""
    values = np.empty((len(names), loaded.rows))
    first = len(layout.time.columns)
    places = {name: first + k for k, name in enumerate(layout.sources)}
    for row, name in zip(values, names, strict=True):
        if name in places:
            source = layout.sources[name]
            loaded.fill(row, places[name], source.scale, source.offset)
        else:
            row[:] = 0.0
    return values


def file_columns(readings: Readings) -> dict[str, FloatArray]:
    """Return the readings as named columns of a plain log, each (n,), SI."""
    columns = {"time [s]": readings.time}
    for name, row in zip(AXES, readings.values, strict=True):
        if name in readings.channels:
            sensor = name.partition("_")[0]
            units = {"gyro": ("rad/s", "rad"), "accel": ("m/s^2", "m/s")}[sensor]
            columns[f"{name} [{units[sensor in readings.increments]}]"] = row
    for name, row in readings.extras.items():
        columns[f"{name} [{BY_NAME[name].unit}]"] = row
    return columns


def check_time_unit(header: Header, layout: Layout, time: FloatArray, section: str) -> None:
    """Raise LogError for times (n,) that cannot be s, where nothing names their unit."""
    source = layout.time
    if len(time) < 2 or source.kind != "unit" or source.origin not in ("assumed", "values"):
        return
    moving = np.diff(time)
    moving = moving[moving > 0.0]
    if not moving.size:
        return
    step = float(np.median(moving))
    if _SHORTEST <= step < _LONGEST and abs(time[0]) < _LATEST:
        return
    name = header.names[source.columns[0]]
    finding = (
        f"{name} has no unit, stamps from {show_time(time[0])} in steps of {step:.3g} are not a "
        "plausible sampling interval in s"
    )
    unit = _nearest_unit(step)
    if unit == "s":  # the start is absurd, not the step: digits of a date, for instance
        advice = f'write seconds, or set [{section}] clock = "count" and rate if no sample was lost'
        raise LogError(header.path, f"{finding}; {advice}", column="time")
    line = {section: {"units": {"time": unit}}}
    problem = Problem(f"time: {finding}", line, f"or write `{name} [{unit}]`")
    raise_all(header.path, [problem])


def _nearest_unit(step: float) -> str:
    """Return the unit of time in which a step is nearest to that of 100 Hz."""
    distance = {unit: abs(log10(step * size) + 2.0) for unit, size in UNITS["time"].items()}
    return min(distance, key=lambda unit: distance[unit])


def check_times(loaded: Loaded, time: FloatArray) -> None:
    """Raise LogError for times (n,), s, that no clock shows: they leave no digits."""
    if not len(time) or max(-time[0], time[-1]) < _LATEST:
        return
    i = 0 if time[0] <= -_LATEST else int(np.argmax(time >= _LATEST))
    finding = f"{time[i]:.6g} s is not a time of a clock; correct the row or set the unit of time"
    raise LogError(loaded.header.path, finding, row=loaded.row(i), column="time")


def _with_article(noun: str) -> str:
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def check_size(
    loaded: Loaded,
    values: FloatArray,
    names: Sequence[str],
    sources: Mapping[str, Source] | None = None,
    limits: Mapping[str, float] | None = None,
    section: str = "imu",
) -> None:
    """Raise LogError for the first of values (k, n), SI, that is beyond what its channel allows.

    limits: of channels whose values are in another unit than SI, with the unit in sources.
    """
    found = []
    for k, (row, name) in enumerate(zip(values, names, strict=True)):
        limit = (limits or {}).get(name, BY_NAME[name].limit)
        if row.size and max(row.max(), -row.min()) > limit:
            found.append((int(np.argmax(np.abs(row) > limit)), k, limit))
    if found:
        i, k, limit = min(found)
        channel = BY_NAME[names[k]]
        unit = sources[names[k]].unit if limits and sources else channel.unit
        finding = (
            f"{values[k][i]:.6g} {unit} is impossible for {_with_article(channel.noun)} (limit "
            f"{limit:.6g}); remove the row or set [{section}] units {channel.group}"
        )
        raise LogError(loaded.header.path, finding, row=loaded.row(i), column=names[k])
