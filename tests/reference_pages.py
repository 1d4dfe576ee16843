"""`python -m tests.reference_pages`: write the generated pages of docs/reference.

`commands.md` comes from the commands themselves; the pages that `rotcli help` prints are copies of
pages in docs/reference, so that they are part of the installed package. A test compares them.
"""

import re
from pathlib import Path

import click

from rotcli.cli.look.help import TOPICS
from rotcli.cli.main import GROUPS
from tests.cli.commands import leaf_commands

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "docs" / "reference"
HELP = ROOT / "rotcli" / "data" / "help"


def commands_page() -> str:
    """Return the page of all commands with their options."""
    leaves = leaf_commands()
    parts = ["# Commands", "", "Generated from the commands by `make docs`.", ""]
    for heading, group in GROUPS.items():
        parts += [f"## {heading}", ""]
        for name, command in leaves:
            if name.split()[0] in group:
                parts += _command(name, command)
    return "\n".join(parts).rstrip() + "\n"


def _command(name: str, command: click.Command) -> list[str]:
    context = click.Context(command, info_name=f"rotcli {name}", max_content_width=90)
    context.terminal_width = 90
    help_text = (command.help or "").replace("\b\n", "")
    usage = " ".join(command.collect_usage_pieces(context))
    rows = ["| option | meaning |", "| --- | --- |"]
    for parameter in command.params:
        record = parameter.get_help_record(context)
        if record is not None:
            option, text = (_cell(part) for part in record)
            rows.append(f"| `{option}` | {text} |")
    example = re.sub(r"^.*?Example:\n", "", command.epilog or "", flags=re.DOTALL)
    shown = ["Example:", "", "```", *(line.strip() for line in example.splitlines()), "```", ""]
    return [f"### {name}", "", f"`rotcli {name} {usage}`", "", help_text, "", *rows, "", *shown]


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def pages() -> dict[Path, str]:
    """Return every generated page and its text."""
    made = {REFERENCE / "commands.md": commands_page()}
    for topic in TOPICS:
        made[HELP / f"{topic}.md"] = (REFERENCE / f"{topic}.md").read_text(encoding="utf-8")
    return made


def main() -> None:
    """Write the pages."""
    for path, text in pages().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
