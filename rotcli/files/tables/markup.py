"""Tables in Markdown and HTML."""

import html
from collections.abc import Sequence

from rotcli.files.tables.model import Table

_SHORT = 14  # rows of a table that a page does not break


def to_markdown(table: Table) -> str:
    """Return the table in GitHub's Markdown, title as a heading of level 3."""

    def row(cells: Sequence[str]) -> str:
        return "| " + " | ".join(markdown_text(cell) for cell in cells) + " |"

    rules = ["---:" if column.is_number else "---" for column in table.columns]
    parts = [f"### {markdown_text(table.title)}", "", row(table.headings)]
    parts += ["| " + " | ".join(rules) + " |", *(row(cells) for cells in table.shown)]
    return "\n".join(parts + (["", markdown_text(table.note)] if table.note else [])) + "\n"


def markdown_text(text: str) -> str:
    """Return text that Markdown shows letter by letter, on one line."""
    text = html.escape(" ".join(text.split()), quote=False)
    for sign in "\\`*_[]|":
        text = text.replace(sign, "\\" + sign)
    return text


def to_html(table: Table) -> str:
    """Return an HTML table with caption and note; everything is escaped."""
    sides = ["num" if column.is_number else "text" for column in table.columns]

    def row(cells: Sequence[str], tag: str) -> str:
        return (
            "<tr>"
            + "".join(
                f'<{tag} class="{side}">{html.escape(cell)}</{tag}>'
                for side, cell in zip(sides, cells, strict=True)
            )
            + "</tr>"
        )

    short = " short" if len(table.rows) <= _SHORT else ""
    note = f'<p class="note">{html.escape(table.note)}</p>' if table.note else ""
    return (
        f'<div class="boxed{short}"><div class="table" tabindex="0" role="region" '
        f'aria-label="{html.escape(table.title)}">'
        f"<table><caption>{html.escape(table.title)}</caption>"
        f"<thead>{row(table.headings, 'th')}</thead>"
        f"<tbody>{''.join(row(cells, 'td') for cells in table.shown)}</tbody></table></div>"
        f"{note}</div>"
    )
