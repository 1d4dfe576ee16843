"""Inspect a log: format, columns, units, clock, plausibility, and all problems with rig lines.

Nothing is rejected: where a problem has a rig line, the line is applied and the inspection goes
on, so that one pass shows every problem of a log.
"""

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import LogError, RotcliError
from rotcli.logs.container.header import MAX_BYTES, Header
from rotcli.logs.container.opening import open_log
from rotcli.logs.describe.imu import describe_imu
from rotcli.logs.describe.layout import Layout, Problem
from rotcli.logs.describe.table import describe_table
from rotcli.logs.record import ImuLog, ImuSource, TableLog
from rotcli.logs.stream import MAX_IN_MEMORY_RECORDS, open_imu
from rotcli.logs.table import read_table
from rotcli.rig.rig import Rig
from rotcli.units import DEG, STANDARD_GRAVITY

Kind = Literal["imu", "table"]
# Times the usual length of a log in memory; of a longer one the start is described.
_LONG = 5.0
_MAX_PROBLEMS = 12  # of one log; each applied line may show another one
_REST_SECONDS = 5.0  # s at the start that are assumed at rest for the mean readings
_BANDWIDTH_SAMPLES = 4096
_HALF = 0.5  # of the noise density at low frequency: the bandwidth
_DOWN = -0.8  # of gravity along z: the z axis points down


@dataclass(frozen=True)
class Inspection:
    """The report on one log.

    file: facts about the file (format, encoding, delimiter …). channels: name, column, unit and
    the origin of the unit. clock, readings: facts with their unit in the name. problems: what
    prevents reading. notes: warnings. rig: sections and keys that describe the log.
    """

    path: str
    kind: Kind
    file: dict[str, Any]
    channels: list[dict[str, str]] = field(default_factory=list)
    clock: dict[str, Any] = field(default_factory=dict)
    readings: dict[str, Any] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    rig: dict[str, dict[str, Any]] = field(default_factory=dict)
    log: ImuLog | TableLog | None = None


def guess_kind(path: str | Path, rig: Rig) -> Kind:
    """Return whether a log is that of an IMU or of a table, by its columns."""
    header = open_log(path, rig.imu)
    try:
        layout = describe_imu(header, rig)
    except LogError:
        return "table"
    if layout.sources or any(n.startswith("gyro") for n in header.names):
        return "imu"
    table = describe_table(open_log(path, rig.table), rig.table)
    readable = not table.layout.problems and bool(table.layout.sources)
    return "table" if readable else "imu"


def inspect_log(
    path: str | Path, rig: Rig, kind: Kind | None = None, max_bytes: int = MAX_BYTES
) -> Inspection:
    """Return the report on a log; raises LogError only where the file cannot be opened."""
    kind = kind or guess_kind(path, rig)
    problems: list[Problem] = []
    applied: dict[str, dict[str, Any]] = {}
    while len(problems) < _MAX_PROBLEMS:
        try:
            return _inspect(path, rig, kind, problems, applied, max_bytes)
        except LogError as error:
            found = [p for p in error.problems if isinstance(p, Problem)]
            new = [p for p in found if p.finding not in {q.finding for q in problems}]
            if not new:
                text = str(error).removeprefix(f"{path}: ")
                finding, _, advice = text.partition("; ")
                problems += [*found[:1]] if found else [Problem(finding, advice=advice)]
                break
            problems += new
            changed = _apply(rig, new, applied)
            if changed is None:
                break
            rig = changed
    header = _open(path, rig, kind, max_bytes)
    layout = _layout(header, rig, kind)
    return Inspection(
        str(path),
        kind,
        _file_facts(header),
        [] if layout is None else _channel_facts(header, layout),
        problems=problems,
        notes=[] if layout is None else _plain(layout.notes, path),
        rig=applied,
    )


def _apply(rig: Rig, problems: list[Problem], applied: dict[str, dict[str, Any]]) -> Rig | None:
    """Return the rig with the lines of problems, None where there is none or it is invalid."""
    lines = [problem.rig for problem in problems if problem.rig]
    if not lines:
        return None
    for line in lines:
        for section, keys in line.items():
            target = applied.setdefault(section, {})
            for key, value in keys.items():
                both = isinstance(value, Mapping) and isinstance(target.get(key), Mapping)
                target[key] = {**target[key], **value} if both else value
    try:
        return rig.override(applied)
    except RotcliError:
        return None


def _open(path: str | Path, rig: Rig, kind: Kind, max_bytes: int) -> Header:
    return open_log(path, rig.imu if kind == "imu" else rig.table, max_bytes)


def _layout(header: Header, rig: Rig, kind: Kind) -> Layout | None:
    try:
        if kind == "imu":
            return describe_imu(header, rig)
        return describe_table(header, rig.table).layout
    except LogError:
        return None


def _inspect(
    path: str | Path,
    rig: Rig,
    kind: Kind,
    problems: list[Problem],
    applied: dict[str, dict[str, Any]],
    max_bytes: int,
) -> Inspection:
    """Return the report on a log that this rig can read; raises LogError else."""
    header = _open(path, rig, kind, max_bytes)
    report = Inspection(
        str(path), kind, _file_facts(header), problems=list(problems), rig=dict(applied)
    )
    if kind == "table":
        described = describe_table(header, rig.table)
        described.layout.raise_problems()
        table = read_table(path, rig, max_bytes=max_bytes)
        turned = float(np.ptp(table.angle)) / DEG
        return replace(
            report,
            channels=_channel_facts(header, described.layout),
            clock=_clock_facts(table.time, table.interval, table.rows),
            readings={"angle range (deg)": round(turned, 4)},
            notes=_plain(table.warnings, path),
            log=table,
        )
    layout = describe_imu(header, rig)
    layout.raise_problems()
    source = open_imu(path, rig, max_gap=None, max_bytes=max_bytes, in_memory_factor=_LONG)
    clock = _clock_facts(source.time, source.interval, source.rows)
    log = source if isinstance(source, ImuLog) else _first_part(source)
    clock["missing samples"] = source.samples - source.rows
    notes = [*_plain(log.warnings, path), *_frame_notes(log, rig)]
    return replace(
        report,
        channels=_channel_facts(header, layout),
        clock=clock,
        readings=_reading_facts(log),
        notes=notes,
        log=log,
    )


def _first_part(source: ImuSource) -> ImuLog:
    """Return the first samples of a long log, with a note that the readings are theirs."""
    start = float(source.time[0])
    log = source.crop(start, start + (_LONG * MAX_IN_MEMORY_RECORDS - 1.0) * source.interval)
    note = (
        f"readings and motion are those of the first {log.samples} of {source.samples} samples; "
        "the others were only searched for errors"
    )
    return replace(log, warnings=(*log.warnings, f"{source.path}: {note}"))


def _plain(texts: Any, path: str | Path) -> list[str]:
    return [text.removeprefix(f"{path}: ") for text in texts]


def _file_facts(header: Header) -> dict[str, Any]:
    """Return what kind of file a log is and how it is written."""
    if header.kind in ("parquet", "bag"):
        facts: dict[str, Any] = {"format": "Parquet" if header.kind == "parquet" else "ROS bag"}
        if header.topic:
            facts["topic"] = header.topic
        return facts
    names = {"\t": "tab", " ": "blanks", ",": "comma", ";": "semicolon", "|": "bar"}
    facts = {"format": header.form.title if header.form else "CSV"}
    if header.kind != "csv":
        facts["compression"] = header.kind
    facts["encoding"] = header.plain.encoding
    facts["delimiter"] = names.get(header.plain.delimiter, header.plain.delimiter)
    facts["decimal sign"] = "comma" if header.plain.decimal == "," else "point"
    facts["header line"] = header.header_line or "none"
    facts["first record in line"] = header.before + 1
    return facts


def _channel_facts(header: Header, layout: Layout) -> list[dict[str, str]]:
    """Return column, unit and origin of the unit for each channel."""
    rows = []
    time = layout.time
    if time.columns:
        columns = ", ".join(header.raw[k] for k in time.columns)
        unit = time.unit or {"counter": "counts", "text": "text"}.get(time.kind, "s")
        rows.append({"channel": "time", "column": columns, "unit": unit, "from": time.origin})
    elif time.interval:
        rows.append({"channel": "time", "column": "none", "unit": "s", "from": "rate"})
    for name, source in layout.sources.items():
        column = header.raw[source.column] if source.column < len(header.raw) else ""
        rows.append({"channel": name, "column": column, "unit": source.unit, "from": source.origin})
    return rows


def _clock_facts(time: Any, interval: float, rows: int) -> dict[str, Any]:
    return {
        "records": rows,
        "start (s)": round(float(time[0]), 6),
        "end (s)": round(float(time[-1]), 6),
        "rate (Hz)": float(f"{1.0 / interval:.6g}"),
    }


def _reading_facts(log: ImuLog) -> dict[str, Any]:
    """Return mean readings at the start, noise and bandwidth."""
    count = max(2, min(log.samples, round(_REST_SECONDS / log.interval)))
    gyro, accel = log.gyro[:count], log.accel[:count]
    facts: dict[str, Any] = {}
    if "gyro_z" in log.channels:
        facts["mean gyro rates at the start (deg/s)"] = _rounded(gyro.mean(axis=0) / DEG)
    if "accel_z" in log.channels:
        facts["mean specific force at the start (m/s^2)"] = _rounded(accel.mean(axis=0))
        facts["its size in g"] = float(
            f"{np.linalg.norm(accel.mean(axis=0)) / STANDARD_GRAVITY:.5g}"
        )
    bandwidth = noise_bandwidth(log)
    if bandwidth is not None:
        facts["noise bandwidth of the gyros (Hz)"] = float(f"{bandwidth:.3g}")
    return facts


def _rounded(values: Any) -> list[float]:
    return [float(f"{v:.5g}") for v in values]


def noise_bandwidth(log: ImuLog) -> float | None:
    """Return the frequency (Hz) above which gyro noise is half its density, None for white noise.

    From the power spectrum of differences in blocks of 256 samples; a log of fewer than 4096
    samples shows none.
    """
    rows = [log.column(name) for name in log.channels if name.startswith("gyro")]
    if not rows or log.samples < _BANDWIDTH_SAMPLES:
        return None
    size = 256
    window = np.hanning(size)
    density = np.zeros(size // 2 + 1)
    for row in rows:
        blocks = row[: len(row) // size * size].reshape(-1, size)
        blocks = blocks - blocks.mean(axis=1, keepdims=True)
        density += np.median(np.abs(np.fft.rfft(blocks * window, axis=1)) ** 2, axis=0)
    frequency = np.fft.rfftfreq(size, log.interval)
    low = float(np.median(density[4:20]))
    smooth = np.convolve(density, np.full(5, 0.2), "same")
    below = np.flatnonzero((smooth < _HALF * low) & (frequency > frequency[20]))
    below = below[below < len(density) - 3]
    return float(frequency[below[0]]) if below.size else None


def _frame_notes(log: ImuLog, rig: Rig) -> list[str]:
    """Return the note about a sensor whose z axis measures gravity downward."""
    if "accel_z" not in log.channels or rig.imu.reports_gravity:
        return []
    count = max(2, min(log.samples, round(_REST_SECONDS / log.interval)))
    z = float(log.accel[:count, 2].mean()) / STANDARD_GRAVITY
    if z > _DOWN:
        return []
    return [
        f"the accelerometers read {z:.3g} g along z at the start. If the axes are forward, right, "
        'down, set [imu] frame = "frd"; if the accelerometers report gravity, set [imu] '
        "reports_gravity = true"
    ]
