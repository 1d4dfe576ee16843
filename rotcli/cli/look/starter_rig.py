"""Write a commented starter rig from the inspection of logs."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rotcli.errors import ResultError
from rotcli.lazy import lazily

with lazily():
    from rotcli.files import toml_schema
    from rotcli.files.results import documents

if TYPE_CHECKING:
    from rotcli.logs.inspect import Inspection
    from rotcli.rig.rig import Rig

_HEAD = '# Rig for {logs}, from rotcli inspect. Complete the lines with "?".'
_UNKNOWN = {
    "site": """\
# [site]
# latitude = ?        # deg; needed for Earth rate and gravity
# longitude = ?
# height = ?          # m
""",
    "attitude": """\
# [attitude]          # of the body frame against East-North-Up at the start, deg
# pitch = 0.0
# roll = 0.0
# azimuth = ?         # clockwise from north
""",
}
_AXIS = """\
axis = "z"            # ? rotation axis in the body frame: x, y or z
direction = 1         # ? -1 if the angle grows clockwise"""
# A rig line in a warning: its key and value.
_LINE = re.compile(r"set \[\w+\] (\w+) = (\{[^}]*\}|\[.*?\](?!,)|\"[^\"]*\"|-?[\w.]+)")


def write_starter_rig(
    target: str, reports: "list[Inspection]", notes: list[str], rig: "Rig | None" = None
) -> None:
    """Write the rig; raises ResultError where the file exists or cannot be written.

    rig: that the logs were inspected with; its keys are kept.
    """
    if Path(target).exists():
        raise ResultError(f"{target}: exists; choose another name or remove it")
    present: dict[str, dict[str, object]] = rig.effective() if rig is not None else {}
    lines = [_HEAD.format(logs=", ".join(report.path for report in reports)), ""]
    kinds = {report.kind: report for report in reports}
    for section, text in _UNKNOWN.items():
        lines += [*_keys(section, present[section]), ""] if section in present else [text]
    for kind, report in kinds.items():
        lines += _section(report, present.get(kind, {}))
    for section, keys in present.items():
        if section not in (*_UNKNOWN, *kinds) and isinstance(keys, dict):
            lines += [*_keys(section, keys), ""]
    lines += [_as_comment(note) for note in notes]
    documents.write_text(target, "\n".join(lines).rstrip() + "\n")


def _keys(section: str, keys: Mapping[str, object]) -> list[str]:
    return [f"[{section}]", *(f"{k} = {toml_schema.to_toml(v)}" for k, v in keys.items())]


def _section(report: "Inspection", present: Mapping[str, object]) -> list[str]:
    """Return the section of one log: lines of its problems, found columns and units."""
    section = report.kind
    keys: dict[str, object] = {**present, **report.rig.get(section, {})}
    comments = {key: _reason(report, key) for key in keys}
    found = {row["channel"]: row for row in report.channels}
    groups: dict[str, str] = {}
    for name, row in found.items():
        group = name.partition("_")[0] if name[-2:] in ("_x", "_y", "_z") else name
        if row["unit"] and row["from"] in ("assumed", "values") and row["unit"] not in (
            "text", "counts", "ISO 8601",
        ):  # fmt: skip
            groups.setdefault(group, row["unit"])
    if groups and "scale" not in keys and not keys.get("counts_per_turn"):
        units = keys.get("units")
        if not isinstance(units, str):
            units = {**groups, **(units if isinstance(units, dict) else {})}
        keys["units"] = units
        comments["units"] = "the log does not name these units; check them"
    lines = [f"[{section}]"]
    if section == "table" and not {"axis", "axes"} & set(present):
        lines.append(_AXIS)
    for key, value in keys.items():
        reason = comments.get(key)
        lines.append(f"{key} = {toml_schema.to_toml(value)}" + (f"  # {reason}" if reason else ""))
    columns = ", ".join(f"{name} from {row['column']!r}" for name, row in found.items())
    lines.append(f"# columns: {columns}" if columns else "# no columns were recognised")
    lines += [_as_comment(note, keys) for note in report.notes]
    return [*lines, ""]


def _as_comment(note: str, keys: Iterable[str] = ()) -> str:
    """Return a warning as a comment, with its rig line first so that it is easily activated."""
    match = _LINE.search(note)
    if match is None or match[1] in keys:
        return f"# {note}"
    return f"# {match[1]} = {match[2]}  # {note}"


def _reason(report: "Inspection", key: str) -> str:
    for problem in report.problems:
        if any(key in keys for keys in problem.rig.values()):
            return " ".join(problem.finding.split())[:100] + (
                f"; {problem.advice}" if problem.advice else ""
            )
    return ""
