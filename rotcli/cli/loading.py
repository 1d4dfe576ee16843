"""Load rig and logs of a command, with its options in place of rig values.

The readers are imported on use, so that `--help` loads none of them.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import click

from rotcli.cli.messages import progress, verbose
from rotcli.errors import RigError
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.logs import plausible, stream
    from rotcli.logs import table as table_logs
    from rotcli.logs import temperature as thermometers
    from rotcli.rig import rig as rigs
    from rotcli.run.laboratory import corrections as laboratory_corrections

if TYPE_CHECKING:
    from rotcli.logs.record import ImuSource, TableLog
    from rotcli.rig.rig import Rig
    from rotcli.run.corrections import ReadingCorrection

    # Section of the rig to keys and values; None leaves the value of the rig.
    Overrides = Mapping[str, Mapping[str, object]]

_MAX_BYTES: ContextVar[int | None] = ContextVar("max_bytes", default=None)


class ByteLimit(TypedDict, total=False):
    """Keyword of the readers for the largest size of a log, bytes."""

    max_bytes: int


def load_rig(
    rig_path: str | None, first_log: str | None, overrides: "Overrides | None" = None
) -> "Rig":
    """Return the rig of a file, of the folder of the first log, or the default; with overrides."""
    if rig_path is None and first_log is not None:
        candidate = Path(first_log).with_name("rig.toml")
        rig_path = str(candidate) if candidate.is_file() else None
    rig = rigs.default_rig() if rig_path is None else rigs.read_rig(rig_path)
    verbose(f"rig: {rig_path}" if rig_path else "no rig.toml: defaults")
    return apply_overrides(rig, overrides or {})


def apply_overrides(rig: "Rig", overrides: "Overrides") -> "Rig":
    """Return the rig with the options that are not None in place of its values."""
    sections = {
        section: {key: value for key, value in values.items() if value is not None}
        for section, values in overrides.items()
    }
    sections = {section: values for section, values in sections.items() if values}

    try:
        return rig.override(sections) if sections else rig
    except RigError as error:  # the file itself is valid: an option is at fault
        text = str(error).removeprefix(f"{rig.path or 'rig'}: ")
        option = re.sub(r"^\[\w+\] (\w+)", lambda m: "--" + m[1].replace("_", "-"), text)
        raise click.UsageError(option) from error


def load_imu(
    imu_log: str,
    rig: "Rig",
    max_gap: int | None = None,
    *,
    table_log: str | None = None,
    in_memory_factor: float = 1.0,
    channels: "Sequence[str] | None" = None,
) -> "ImuSource":
    """Return the IMU log; a long one is streamed.

    channels: axes that must be there; None leaves it to [imu] channels. in_memory_factor:
    times the usual length up to which a log is kept in memory.
    """
    with progress("reading") as update:
        imu = stream.open_imu(
            imu_log,
            rig,
            max_gap=max_gap,
            table_log=table_log,
            progress=update,
            in_memory_factor=in_memory_factor,
            channels=channels,
            **byte_limit(),
        )
    _log_read(imu)
    return imu


def load_run(
    imu_log: str,
    table_log: str,
    rig: "Rig",
    max_gap: int | None = None,
    channels: "Sequence[str] | None" = None,
) -> "tuple[ImuSource, TableLog]":
    """Return the IMU log and the table log of one run; raises LogError if they do not overlap."""
    table = table_logs.read_table(table_log, rig, imu_log=imu_log, **byte_limit())
    imu = load_imu(imu_log, rig, max_gap, table_log=table_log, channels=channels)
    plausible.check_spans(table.path, table.time, table.interval, imu.time)
    _log_read(table)
    return imu, table


def load_logs(
    imu_log: str,
    table_log: str | None,
    rig: "Rig",
    max_gap: int | None = None,
    channels: "Sequence[str] | None" = None,
) -> "tuple[ImuSource, TableLog | None]":
    """Return the IMU log and, if there is one, the table log."""
    if table_log is None:
        return load_imu(imu_log, rig, max_gap, channels=channels), None
    return load_run(imu_log, table_log, rig, max_gap, channels)


def bind_corrections(
    corrections: "Sequence[ReadingCorrection]",
    imu: "ImuSource",
    rig: "Rig",
    temperature: float | None,
    extrapolate: str | None,
) -> "tuple[list[ReadingCorrection], list[str]]":
    """Return corrections with the temperature of the log, and warnings about clamped samples.

    temperature: a constant in degC instead of the log's column; extrapolate: `clamp` or None.
    """
    measured = None
    if temperature is None and any(
        isinstance(c, laboratory_corrections.ThermalCorrection) for c in corrections
    ):
        measured = thermometers.read_temperature(imu, rig, **byte_limit())
    used = measured if temperature is None else float(temperature)
    return laboratory_corrections.bind(corrections, imu, used, clamp=extrapolate == "clamp")


def _log_read(log: "ImuSource | TableLog") -> None:
    span = units.format_span(log.time[0], log.time[-1])
    verbose(f"read {log.path}: {log.rows} records, {span}, {1.0 / log.interval:.6g} Hz")


def note_max_bytes(ctx: click.Context, _: click.Parameter, value: int | None) -> None:
    """Store the value of `--max-bytes` for `byte_limit`; callback of the option."""
    token = _MAX_BYTES.set(value)
    ctx.call_on_close(lambda: _MAX_BYTES.reset(token))


@contextmanager
def max_bytes_of(job_limit: ByteLimit) -> Iterator[None]:
    """Apply the `byte_limit` of the command in the worker that runs one of its jobs."""
    token = _MAX_BYTES.set(job_limit.get("max_bytes"))
    try:
        yield
    finally:
        _MAX_BYTES.reset(token)


def byte_limit() -> ByteLimit:
    """Return `max_bytes` for the readers; empty without the option."""
    value = _MAX_BYTES.get()
    return {} if value is None else {"max_bytes": value}


# Keys of a rig that describe the file which was converted, not the new one.
_CONVERTED_KEYS = (
    "columns", "units", "scale", "offset", "rate", "reports_gravity", "instance", "topic",
    "delimiter", "decimal", "comment", "skip", "encoding",
)  # fmt: skip


def required_rig_keys(rig: "Rig") -> str:
    """Return the rig keys that still apply to readings written as they are, and those to remove.

    Empty where there are none.
    """
    present = rig.effective().get("imu", {})
    mount = present.get("mount")
    keys = [f'sampling = "{rig.imu.sampling}"'] if rig.imu.sampling != "instant" else []
    if mount not in (None, [[1, 0, 0], [0, 1, 0], [0, 0, 1]]):
        rows = ", ".join("[" + ", ".join(f"{n:g}" for n in row) + "]" for row in mount)
        keys.append(f"mount = [{rows}]")
    text = f"; its rig: [imu] {', '.join(keys)}" if keys else ""
    gone = [key for key in _CONVERTED_KEYS if key in present]
    return text + (f"; remove from its rig: [imu] {', '.join(gone)}" if gone else "")
