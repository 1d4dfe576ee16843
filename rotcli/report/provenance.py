"""Where the results of a report come from: devices, result files, logs with hashes, rigs."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli.files.results.groups import Source
from rotcli.files.results.identity import KNOWN_KEYS, identity
from rotcli.files.tables import Cell, Column, Table, drop_empty_columns
from rotcli.version import __version__

_MAX_RIGS = 6  # side by side; of more only what they have in common


def devices(sources: Sequence[Source]) -> list[Table]:
    """Return who and what was measured, of the rigs' [unit] tables; none where they say nothing."""
    rows: dict[tuple[Cell, ...], int] = {}
    extra: list[str] = []
    found = [(source, identity(source.doc)) for source in sources]
    for _, one in found:
        extra += [key for key in one.extra if key not in extra]
    for source, one in found:
        known = [getattr(one, key) for key in KNOWN_KEYS]
        row = (source.imu, *known, *(one.extra.get(key) for key in extra))
        rows[row] = rows.get(row, 0) + 1
    columns = [Column("IMU"), *(Column(key) for key in (*KNOWN_KEYS, *extra))]
    columns.append(Column("results", "d"))
    if all(value is None for row in rows for value in row[1:]):
        return []
    counted = [(*row, count) for row, count in rows.items()]
    counted.sort(key=lambda row: tuple(str(cell) for cell in row))
    return [drop_empty_columns("Devices under test", columns, counted, "")]


def provenance(sources: Sequence[Source]) -> list[Table]:
    """Return where the results come from: result files, logs with their hashes, rigs."""
    files = [
        (source.path, str(source.doc["kind"]), source.imu, str(source.doc.get("rotcli", "-")))
        for source in sources
    ]
    columns = (Column("file"), Column("kind"), Column("IMU"), Column("made by rotcli"))
    made = [Table("Results", columns, files, f"Report made by rotcli {__version__}.")]
    logs = sorted({row for source in sources for row in _logs(source)}, key=str)
    if logs:
        log_columns = (
            Column("log"),
            Column("rows", "d"),
            Column("from, s", "g"),
            Column("to, s", "g"),
            Column("SHA-256"),
        )
        made.append(Table("Logs", log_columns, logs))
    return [*made, *_rigs(sources)]


def provenance_line(sources: Sequence[Source]) -> str:
    """Return the provenance in one sentence."""
    logs = {row for source in sources for row in _logs(source)}
    versions = sorted({str(source.doc.get("rotcli", "unknown")) for source in sources})
    results = f"{len(sources)} result{'s' * (len(sources) != 1)}"
    inputs = f" from {len(logs)} log{'s' * (len(logs) != 1)}" if logs else ""
    return f"{results}{inputs}, made by rotcli {', '.join(versions)}"


def _logs(source: Source) -> list[tuple[Cell, ...]]:
    members = source.doc.get("inputs")
    rows: list[tuple[Cell, ...]] = []
    for log in members if isinstance(members, list) else []:
        if isinstance(log, dict):
            span = (log.get("rows"), log.get("start_s"), log.get("end_s"))
            numbers = [value if isinstance(value, int | float) else None for value in span]
            rows.append((str(log.get("path")), *numbers, str(log.get("sha256"))))
    return rows


def _rigs(sources: Sequence[Source]) -> list[Table]:
    """Return the distinct rigs side by side, a column each, without their stages."""
    rigs: dict[tuple[tuple[str, str], ...], str] = {}
    for source in sources:
        if flat := _flat(source.section("rig")):
            rigs.setdefault(tuple(flat.items()), source.imu)
    if not rigs:
        return []
    named = sorted(((imu, dict(flat)) for flat, imu in rigs.items()), key=str)
    keys = list(dict.fromkeys(key for _, rig in named for key in rig))
    if len(named) <= _MAX_RIGS:
        rows = [(key, *(rig.get(key) for _, rig in named)) for key in keys]
        columns = (Column("key"), *(Column(imu) for imu, _ in named))
        return [Table("Rigs", columns, rows)]
    common = [key for key in keys if len({rig.get(key) for _, rig in named}) == 1]
    different = ", ".join(key for key in keys if key not in common)
    note = f"{len(named)} different rigs; they differ in {different}."
    rows = [(key, named[0][1][key]) for key in common]
    return [Table("Rigs", (Column("key"), Column("all")), rows, note)]


def _flat(rig: Mapping[str, Any]) -> dict[str, str]:
    return {
        f"[{section}] {key}": value if isinstance(value, str) else str(value)
        for section, keys in rig.items()
        if section != "stages" and isinstance(keys, dict)
        for key, value in keys.items()
    }
