"""From the files that a command names to rig and logs: what they hold, options laid over it.

What reads them is imported on use, so that `--help` loads none of it.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from rotcli.cli.messages import progress, tell

_MAX_BYTES = "rotcli.max_bytes"


def load_rig(
    rig_path: str | None,
    first_log: str | None,
    changes: Mapping[str, Mapping[str, Any]] | None = None,
) -> Any:
    """Return the rig named, or the one beside the first log, or the default; options on top."""
    from rotcli.rig.rig import default_rig, read_rig

    if rig_path is None and first_log is not None:
        beside = Path(first_log).with_name("rig.toml")
        rig_path = str(beside) if beside.is_file() else None
    found = default_rig() if rig_path is None else read_rig(rig_path)
    tell(f"rig: {rig_path}" if rig_path else "no rig.toml: defaults")
    return lay_over(found, changes or {})


def lay_over(found: Any, changes: Mapping[str, Mapping[str, Any]]) -> Any:
    """Return the rig with the options that were given (not None) laid over it."""
    wanted = {
        section: {key: value for key, value in values.items() if value is not None}
        for section, values in changes.items()
    }
    wanted = {section: values for section, values in wanted.items() if values}
    from rotcli.errors import RigError

    try:
        return found.override(wanted) if wanted else found
    except RigError as fault:  # the rig itself was read before: an option is at fault
        text = str(fault).removeprefix(f"{found.path or 'rig'}: ")
        key = re.sub(r"^\[\w+\] (\w+)", lambda m: "--" + m[1].replace("_", "-"), text)
        raise click.UsageError(key) from fault


def load_logs(
    imu_log: str, table_log: str | None, rig: Any, max_gap: int | None, held: float = 1.0
) -> tuple[Any, Any]:
    """Return the IMU log, a long one not held, and the table log (None where there is none).

    held: times the usual length up to which a log is held.
    """
    from rotcli.logs.plausible import check_spans
    from rotcli.logs.stream import open_imu
    from rotcli.logs.table import read_table
    from rotcli.units import show_span

    limit = byte_limit()
    table = None if table_log is None else read_table(table_log, rig, imu_log=imu_log, **limit)
    with progress("reading") as told:
        imu = open_imu(
            imu_log, rig, max_gap=max_gap, table_log=table_log, progress=told, held=held, **limit
        )
    if table is not None:
        check_spans(table.path, table.time, table.interval, imu.time)
    for log in [log for log in (imu, table) if log is not None]:
        span = show_span(log.time[0], log.time[-1])
        tell(f"read {log.path}: {log.rows} records, {span}, {1.0 / log.interval:.6g} Hz")
    return imu, table


def note_max_bytes(ctx: click.Context, _: click.Parameter, value: int | None) -> None:
    """Keep what `--max-bytes` says for `byte_limit`; the option's callback."""
    ctx.meta[_MAX_BYTES] = value


def byte_limit() -> dict[str, Any]:
    """Return `max_bytes` as the readers take it, nothing where the option was not given."""
    ctx = click.get_current_context(silent=True)
    value = None if ctx is None else ctx.meta.get(_MAX_BYTES)
    return {} if value is None else {"max_bytes": value}


def rig_needs(rig: Any) -> str:
    """Return what a rig must go on saying of readings kept as they are; empty for nothing."""
    held = rig.effective().get("imu", {})
    needs = [f'sampling = "{rig.imu.sampling}"'] if rig.imu.sampling != "instant" else []
    turned = held.get("mount") not in (None, [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    needs += [f"mount = {_whole(held['mount'])}"] if turned else []
    return f"; its rig: [imu] {', '.join(needs)}" if needs else ""


def _whole(rows: Any) -> str:
    return "[" + ", ".join("[" + ", ".join(f"{n:g}" for n in row) + "]" for row in rows) + "]"
