"""`rotcli inspect`: what a log is, and what to write into the rig to read it."""

import json
from typing import TYPE_CHECKING

import click

from rotcli import __version__
from rotcli.cli import loading, messages, options, output
from rotcli.dataclass import dataclass
from rotcli.files.text import visible
from rotcli.lazy import lazily

with lazily():
    from rotcli.cli.look import starter_rig
    from rotcli.files.results import documents
    from rotcli.logs import inspect as inspections
    from rotcli.logs import record as records
    from rotcli.run import inspection

if TYPE_CHECKING:
    from rotcli.logs.inspect import Inspection


@dataclass(frozen=True)
class InspectCommand:
    """Options of `rotcli inspect`."""

    logs: tuple[str, ...]
    write_rig: str | None
    rig_path: str | None
    quiet: bool
    output: str | None


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --csv -o run",
        "rotcli inspect run/imu.csv run/table.csv",
    )
)
@click.argument("logs", metavar="LOG [TABLE_LOG]", nargs=-1, required=True)
@click.option(
    "--write-rig",
    metavar="FILE",
    help="Write a commented rig with the keys that describe the logs.",
)
@options.max_bytes
@options.rig
@options.output
@options.collect(InspectCommand)
def command(given: InspectCommand) -> None:
    """Show format, columns, units, clock and plausibility of one or two logs.

    All problems are listed at once, each with the rig line that solves it. With an IMU log and a
    table log the overlap, the axis, the sense and the segments are shown too.
    """
    if len(given.logs) > 2:
        raise click.UsageError("one or two logs are inspected, an IMU log and a table log")
    output.check_outputs(
        [*given.logs[1:], given.rig_path],
        {"-o": given.output, "--write-rig": given.write_rig},
        log=given.logs[0],
    )
    rig = loading.load_rig(given.rig_path, given.logs[0])
    limit = loading.byte_limit()
    reports = [
        inspections.inspect_log(given.logs[0], rig, "imu" if given.logs[1:] else None, **limit)
    ]
    reports += [inspections.inspect_log(log, rig, "table", **limit) for log in given.logs[1:]]
    run: dict[str, object] = {}
    notes: list[str] = []
    table = next((r.log for r in reports if isinstance(r.log, records.TableLog)), None)
    for report in reports:
        if isinstance(report.log, records.ImuLog):
            facts, found = inspection.examine_readings(report.log, rig, table)
            report.readings.update(facts)
            plain = [text.removeprefix(f"{report.path}: ") for text in found]
            report.notes.extend(text for text in plain if text not in report.notes)
    logs = [report.log for report in reports]
    if (
        len(logs) == 2
        and isinstance(logs[0], records.ImuLog)
        and isinstance(logs[1], records.TableLog)
    ):
        run, notes = inspection.compare_logs(logs[0], logs[1], rig)
    if given.write_rig:
        starter_rig.write_starter_rig(given.write_rig, reports, notes, rig)
        messages.info(f"{given.write_rig}: rig for {', '.join(given.logs)}", given.quiet)
    if given.output:
        text = json.dumps(_document(reports, run, notes), indent=2, ensure_ascii=False) + "\n"
        if given.output == "-":
            click.echo(text, nl=False)
        else:
            documents.write_text(given.output, text)
        return
    click.echo(visible(_screen(reports, run, notes)))


def _document(
    reports: "list[Inspection]", run: dict[str, object], notes: list[str]
) -> dict[str, object]:
    """Return the report as a JSON object."""
    logs = [
        {
            "path": report.path,
            "kind": report.kind,
            "file": report.file,
            "channels": report.channels,
            "clock": report.clock,
            "readings": report.readings,
            "problems": [
                {"finding": p.finding, "advice": p.advice, "rig": p.rig, "lines": p.lines}
                for p in report.problems
            ],
            "warnings": report.notes,
            "rig": report.rig,
        }
        for report in reports
    ]
    return {
        "kind": "inspection",
        "schema": 1,
        "rotcli": __version__,
        "logs": logs,
        "run": run,
        "warnings": notes,
    }


def _screen(reports: "list[Inspection]", run: dict[str, object], notes: list[str]) -> str:
    """Return the report as text for a terminal."""
    lines: list[str] = []
    for report in reports:
        kind = "IMU log" if report.kind == "imu" else "table log"
        lines += [f"{report.path}: {kind}", ""]
        facts = {**report.file, **report.clock, **report.readings}
        width = max((len(name) for name in facts), default=0)
        lines += [f"  {name:<{width}}  {_value(value)}" for name, value in facts.items()]
        if report.channels:
            lines += ["", *_table(report.channels)]
        lines += _numbered("problems", [problem.text for problem in report.problems])
        lines += _numbered("warnings", report.notes)
        if not report.problems and not report.notes:
            lines += ["", "  no problems"]
        lines.append("")
    if run:
        lines.append("run")
        width = max(map(len, run))
        for name, value in run.items():
            values = value if isinstance(value, list) and name == "segments" else [_value(value)]
            lines += [f"  {name if k == 0 else '':<{width}}  {v}" for k, v in enumerate(values)]
        lines += _numbered("warnings", notes)
    return "\n".join(lines).rstrip()


def _value(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _table(rows: list[dict[str, str]]) -> list[str]:
    names = list(rows[0])
    widths = {n: max(len(n), *(len(str(row[n])) for row in rows)) for n in names}
    head = "  " + "  ".join(f"{n:<{widths[n]}}" for n in names)
    return [head.rstrip()] + [
        ("  " + "  ".join(f"{row[n]!s:<{widths[n]}}" for n in names)).rstrip() for row in rows
    ]


def _numbered(title: str, texts: list[str]) -> list[str]:
    if not texts:
        return []
    return ["", f"  {title}", *(f"  {k}. {text}" for k, text in enumerate(texts, start=1))]
