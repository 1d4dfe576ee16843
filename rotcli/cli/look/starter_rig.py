"""Write a commented starter rig from the inspection of logs."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rotcli.errors import ResultError
from rotcli.lazy import lazily

with lazily():
    from rotcli.files import toml_schema
    from rotcli.files.results import documents

if TYPE_CHECKING:
    from rotcli.logs.inspect import Inspection

_HEAD = """\
# Rig for {logs}, from rotcli inspect. Complete the lines with "?".

# [site]
# latitude = ?        # deg; needed for Earth rate and gravity
# longitude = ?
# height = ?          # m

# [attitude]          # of the body frame against East-North-Up at the start, deg
# pitch = 0.0
# roll = 0.0
# azimuth = ?         # clockwise from north
"""


def write_starter_rig(target: str, reports: "list[Inspection]", notes: list[str]) -> None:
    """Write the rig; raises ResultError where the file exists or cannot be written."""
    if Path(target).exists():
        raise ResultError(f"{target}: exists; choose another name or remove it")
    lines = [_HEAD.format(logs=", ".join(report.path for report in reports))]
    for report in reports:
        lines += _section(report)
    lines += [f"# {note}" for note in notes]
    documents.write_text(target, "\n".join(lines).rstrip() + "\n")


def _section(report: "Inspection") -> list[str]:
    """Return the section of one log: lines of its problems, found columns and units."""
    section = report.kind
    keys: dict[str, Any] = dict(report.rig.get(section, {}))
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
        keys["units"] = {**groups, **keys.get("units", {})}
        comments["units"] = "the log does not name these units; check them"
    lines = [f"[{section}]"]
    if section == "table":
        lines += ['axis = "z"            # ? rotation axis in the body frame: x, y or z']
        lines += ["direction = 1         # ? -1 if the angle grows clockwise"]
    for key, value in keys.items():
        reason = comments.get(key)
        lines.append(f"{key} = {toml_schema.to_toml(value)}" + (f"  # {reason}" if reason else ""))
    columns = ", ".join(f"{name} from {row['column']!r}" for name, row in found.items())
    lines.append(f"# columns: {columns}" if columns else "# no columns were recognised")
    lines += [f"# {note}" for note in report.notes]
    return [*lines, ""]


def _reason(report: "Inspection", key: str) -> str:
    for problem in report.problems:
        if any(key in keys for keys in problem.rig.values()):
            return " ".join(problem.finding.split())[:100] + (
                f"; {problem.advice}" if problem.advice else ""
            )
    return ""
