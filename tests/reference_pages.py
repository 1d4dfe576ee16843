"""`python -m tests.reference_pages`: write the generated pages of docs/reference.

`commands.md` comes from the commands, `schema.md` from the schema of results; the pages that
`rotcli help` prints are copies of pages in docs/reference, so that they are part of the installed
package. A test compares them.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from rotcli.cli.look.help import TOPICS
from rotcli.cli.main import GROUPS
from tests.cli.commands import leaf_commands

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "docs" / "reference"
HELP = ROOT / "rotcli" / "data" / "help"
SCHEMA = ROOT / "rotcli" / "data" / "schema" / "result.json"


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


def schema_page() -> str:
    """Return the page of what is checked when a result is read."""
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    definitions = schema["definitions"]
    parts = [
        "# Checks of results",
        "",
        "Every command checks a result that it reads, and rejects one that breaks these rules in a",
        "line that names the key. `make docs` generates this page from the JSON Schema",
        "`rotcli/data/schema/result.json`. Beyond the schema: no key occurs twice; all numbers are",
        "finite; `axis` is a unit vector and has the parameters of its column; `covariance` has a",
        "row and a column for each parameter with a value, has their units and no negative",
        "variance, and is symmetric and positive definite.",
        "",
    ]
    for heading, rules in (
        ("Every result", schema),
        *((f"`{kind}`", definitions[kind]) for kind in ("allan", "calibration", "navigation")),
    ):
        rows = [f"| `{_cell(key)}` | {_cell(text)} |" for key, text in _rules(rules, definitions)]
        parts += [f"## {heading}", "", "| key | rule |", "| --- | --- |", *rows, ""]
    return "\n".join(parts).rstrip() + "\n"


def _rules(
    rules: dict[str, Any], definitions: dict[str, Any], above: str = ""
) -> Iterator[tuple[str, str]]:
    """Yield the keys below a definition of the schema, patterns as they are, and their rules."""
    below = {**rules.get("properties", {}), **rules.get("patternProperties", {})}
    below |= {"*": more} if (more := rules.get("additionalProperties")) else {}
    below |= {"[]": rules["items"]} if "items" in rules else {}
    for name, given in below.items():
        rule = _resolved(given, definitions)
        key = f"{above}.{name.strip('^$')}".lstrip(".")
        words = []
        kind = rule.get("type")
        if kind:
            words.append(" or ".join([kind] if isinstance(kind, str) else kind))
        if "const" in rule:
            words.append(f"is `{rule['const']}`")
        if "enum" in rule:
            words.append("one of " + ", ".join(f"`{value}`" for value in rule["enum"]))
        limits = {"minimum": "at least", "maximum": "at most", "minItems": "length at least"}
        words += [f"{text} {rule[limit]:g}" for limit, text in limits.items() if limit in rule]
        if "required" in rule:
            words.append("must have " + ", ".join(f"`{value}`" for value in rule["required"]))
        if words:
            yield key, "; ".join(words)
        yield from _rules(rule, definitions, key)
        for choice in rule.get("anyOf", []):
            yield from _rules({"properties": {name: choice}}, definitions, above)


def _resolved(rule: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    """Return a rule with the definitions that it refers to in place."""
    if "$ref" in rule:
        return _resolved(definitions[rule["$ref"].rsplit("/", 1)[1]], definitions)
    if "allOf" not in rule:
        return rule
    found: dict[str, Any] = {}
    for part in (_resolved(part, definitions) for part in rule["allOf"]):
        found |= {**part, "properties": {**found.get("properties", {}), **part["properties"]}}
    return found


def pages() -> dict[Path, str]:
    """Return every generated page and its text."""
    made = {REFERENCE / "commands.md": commands_page(), REFERENCE / "schema.md": schema_page()}
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
