"""The log of a table of one to three axes: one angle column per axis, on one clock."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.logs.container.header import MAX_BYTES
from rotcli.logs.table import read_table
from rotcli.rig.rig import Rig
from rotcli.rig.values import AXIS_COLUMNS
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class AxesLog:
    """A table log: time (m,), s, on the IMU's clock; angles (m, K), rad, outermost axis first."""

    path: str
    time: FloatArray
    angles: FloatArray
    interval: float
    rows: int
    warnings: tuple[str, ...]
    stamp: tuple[int, int] | None


def table_axes(rig: Rig) -> tuple[FloatArray, ...]:
    """Return the axes (3,) in the body frame, outermost first: [table] axes, else axis."""
    return rig.table.axes or (rig.table.axis,)


def read_table_axes(
    path: str | Path, rig: Rig, *, imu_log: str | Path | None = None, max_bytes: int = MAX_BYTES
) -> AxesLog:
    """Read the angles of all axes of the rig, each checked and unwrapped as `read_table` does.

    Raises RigError when `directions` does not fit `axes`, LogError as `read_table`.
    """
    axes = table_axes(rig)
    settings = rig.table
    directions = settings.directions or (settings.direction,) * len(axes)
    if len(directions) != len(axes):
        raise RigError(
            f"{rig.path or 'rig'}: [table] directions: {len(directions)} for {len(axes)} axes; "
            "give one for each axis"
        )
    names = AXIS_COLUMNS[len(axes)]
    logs = []
    for name, direction in zip(names, directions, strict=True):
        column = settings.columns.get(name, settings.column if len(axes) == 1 else name)
        assert not isinstance(column, tuple)  # only the time has two columns
        one = replace(settings, column=column, direction=direction)
        logs.append(read_table(path, replace(rig, table=one), imu_log=imu_log, max_bytes=max_bytes))
    first = logs[0]
    warnings = tuple(dict.fromkeys(text for log in logs for text in log.warnings))
    angles = np.column_stack([log.angle for log in logs])
    return AxesLog(
        first.path, first.time, angles, first.interval, first.rows, warnings, first.stamp
    )
