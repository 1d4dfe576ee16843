"""Compare the results of `make campaign observe srins` with the papers; print and write the table.

`python -m tests.campaigns.papers [-o FILE.md]`; the Makefile's target `papers` makes the results.
"""

import argparse
import shutil
import sys
from pathlib import Path

from rotcli.files.tables.markup import to_markdown
from rotcli.files.tables.text import to_text
from tests.campaigns.papers import o17, r16, srins
from tests.campaigns.papers.item import DIFFERS, as_table, in_order

_WIDTH, _WIDE = 96, 140  # letters of a line: what a row needs; where there is no terminal


def main() -> int:
    """Print the comparison, and write it as Markdown if requested."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaign", type=Path, default=Path("campaign"))
    parser.add_argument("--observe", type=Path, default=Path("observe"))
    parser.add_argument("--srins", type=Path, default=Path("srins"))
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    items = [
        *r16.formula_items(),
        *r16.campaign_items(given.campaign),
        *o17.formula_items(),
        *o17.campaign_items(given.observe),
        *srins.items_of(given.srins),
    ]
    items = in_order(items)
    table = as_table(items)
    columns = max(_WIDTH, shutil.get_terminal_size((_WIDE, 24)).columns)
    print(to_text(table, columns))
    if given.output is not None:
        given.output.write_text(to_markdown(table), encoding="utf-8")
    differ = [item for item in items if item.verdict == DIFFERS]
    print(f"{len(items)} comparisons, {len(differ)} differ.", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
