"""Reference logs: position and velocity of GNSS, a Doppler log or a simulation."""

from pathlib import Path

import numpy as np

from rotcli.errors import LogError
from rotcli.files.channels import REFERENCE_CHANNELS
from rotcli.logs.container.header import MAX_BYTES
from rotcli.logs.container.loading import load
from rotcli.logs.container.opening import open_log
from rotcli.logs.describe.layout import Layout, Problem, Source
from rotcli.logs.describe.time import column_index, describe_time, missing_column
from rotcli.logs.describe.units import choose_unit
from rotcli.logs.readings import (
    check_size,
    check_time_unit,
    check_times,
    fill_channels,
    first_times,
)
from rotcli.logs.record import ReferenceLog
from rotcli.logs.timing.stamps import read_stamps
from rotcli.rig.rig import LogSettings


def read_reference(
    path: str | Path, settings: LogSettings | None = None, *, max_bytes: int = MAX_BYTES
) -> ReferenceLog:
    """Read a reference log: `time` and whichever of position and velocity it contains.

    settings: [reference] of the rig. max_bytes: that may be read at most. Raises LogError when
    the file cannot be read, none of the columns is there, or a number is invalid.
    """
    settings = settings or LogSettings()
    header = open_log(path, settings, max_bytes)
    own = header.form.rig_defaults(header.head) if header.form else {}
    time, problems, notes = describe_time(header, settings, own, "reference")
    sources: dict[str, Source] = {}
    for channel in REFERENCE_CHANNELS:
        column = settings.columns.get(channel.name, channel.name)
        index = column_index(header, column)  # type: ignore[arg-type]
        if index is None:
            if channel.name in settings.columns:
                problems.append(
                    missing_column(header, column, channel.name, "reference")  # type: ignore[arg-type]
                )
            continue
        choice = choose_unit(
            header,
            index,
            channel.group,
            (channel.quantity,),
            settings.units,
            own,
            "reference",
        )
        problems += choice.problems
        notes += choice.notes
        scale = settings.scale.get(channel.name, settings.scale.get("all", 1.0))
        offset = settings.offset.get(channel.name, settings.offset.get("all", 0.0))
        sources[channel.name] = Source(
            index, scale * choice.size(channel.quantity), offset, choice.unit or channel.unit
        )
    if not sources and not problems:
        names = ", ".join(channel.name for channel in REFERENCE_CHANNELS)
        finding = f"no reference column; at least one of {names} is needed"
        problems.append(Problem(finding, advice="set [reference] columns"))
    layout = Layout(header.path, time, sources, notes=tuple(notes), problems=tuple(problems))
    layout.raise_problems()
    loaded = load(header, layout.wanted)
    check_time_unit(header, layout, first_times(loaded, layout), "reference")
    stamps = read_stamps(loaded, layout, settings, "reference")
    if np.any(np.diff(stamps.time) <= 0.0):
        raise LogError(header.path, "time stamps repeat; remove the repeated records")
    check_times(stamps.loaded, stamps.time)
    values = fill_channels(stamps.loaded, layout, tuple(sources))
    check_size(stamps.loaded, values, tuple(sources), section="reference")
    return ReferenceLog(
        path=header.path,
        time=stamps.time,
        values=dict(zip(sources, values, strict=True)),
        rows=stamps.loaded.rows,
        warnings=(*notes, *stamps.notes),
        stamp=header.stamp,
    )
