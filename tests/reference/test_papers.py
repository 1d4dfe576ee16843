"""docs/papers.md has every numbered item of the three papers, and `make papers` agrees with it.

The numbers of items are those of the papers: the highest number of each kind.
"""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rotcli.srins.filter import FilterSettings
from rotcli.srins.model import VehicleMotion
from rotcli.srins.observability import observe
from rotcli.srins.observability_document import fields
from rotcli.srins.reciprocation import RotationScheme
from tests.campaigns.papers import o17, r16, srins
from tests.campaigns.papers.item import DIFFERS, VERDICTS, Item, as_table, in_order

DOCS = Path(__file__).parents[2] / "docs"
NUMBERED = {
    "R16": {"equation": 36, "table": 7, "figure": 12},
    "O17": {"equation": 39, "property": 5, "table": 2, "figure": 10},
    "S": {"equation": 7, "table": 1, "figure": 9},
}


def rows(page):
    """Return the cells of the table rows of a page whose first cell names an item of a paper."""
    text = (DOCS / page).read_text(encoding="utf-8")
    cells = [re.split(r" \| ", line.strip("| \n")) for line in text.splitlines()]
    return [row for row in cells if re.match(r"(R16|O17|S) ", row[0]) and len(row) == 5]


def numbers(text):
    """Return the numbers of a list such as `4 to 6, 8 to 10`."""
    found = set()
    for part in re.split(r", ", text):
        first, _, last = part.partition(" to ")
        found |= set(range(int(first), int(last or first) + 1))
    return found


def named(item):
    """Return paper, kind and numbers of an item such as `R16 (1), (2)` or `S figures 1, 2`."""
    paper, name = item.split(" ", 1)
    kind = re.match(r"(table|figure|property|properties)s?\b", name)
    if kind:
        return paper, kind[1].replace("properties", "property"), numbers(name.split(" ", 1)[1])
    if name.startswith("("):
        return paper, "equation", numbers(re.sub(r"[()]", "", name))
    return paper, name, set()


def test_every_equation_table_and_figure_of_the_papers_has_one_row():
    listed = [named(row[0]) for row in rows("papers.md")]
    for paper, kinds in NUMBERED.items():
        for kind, count in kinds.items():
            found = [n for p, k, members in listed if (p, k) == (paper, kind) for n in members]
            assert sorted(found) == list(range(1, count + 1)), (paper, kind)


def test_every_row_names_a_command_a_place_and_the_agreement():
    for item, content, command, place, agreement in rows("papers.md"):
        assert content, item
        assert place, item
        assert command == "all" or "`" in command or "rig.toml" in command, item
        words = (*VERDICTS, "as printed", "reconstructed")
        assert any(word in agreement for word in words), item


@pytest.mark.parametrize(
    "text",
    [
        "property 5 follow the left-handed (39)",
        "sign of pitch",
        "(33) | derivatives of the biases in n",
        "(38), (39) | rotation matrices",
        "one entry of F",
        "(27) omits the mean of the modulated part",
        "(36) corrected",
        "the velocity of a modulated gyro bias does not cancel",
    ],
)
def test_what_is_corrected_is_said(text):
    assert text in (DOCS / "papers.md").read_text(encoding="utf-8").replace("\n", " ")


def test_the_last_summary_of_make_papers_agrees_with_the_page():
    page = {row[0]: row[4] for row in rows("papers.md")}
    summary = rows("evidence/papers.md")
    assert len(summary) > 80
    for item, what, _ours, _published, verdict in summary:
        assert verdict in page[item], (item, what, verdict)
    # What the page promises is in the summary as well.
    compared = {row[0] for row in summary}
    assert {row[0] for row in rows("papers.md") if row[4].startswith("in kind")} <= (
        compared | {"O17 figures 4 to 6", "O17 figures 8 to 10"}
    )


def test_items_that_follow_from_formulas_are_those_of_the_last_summary():
    rotation = RotationScheme(np.radians(6.0))
    motion = VehicleMotion(np.radians(42.3), v_east=1.0)
    doc = fields(observe(motion, FilterSettings(), rotation, hours=0.1), motion, rotation)
    items = [*r16.formula_items(), *o17.formula_items(), *srins.singular_items(doc)]
    shown = as_table(in_order(items)).rows
    kept = {(row[0], row[1].replace("\\", "")): row for row in rows("evidence/papers.md")}
    for row in shown:
        assert row[4] != DIFFERS
        if row[0] != "R16 table 1":  # rounding
            last = [cell.replace("\\", "") for cell in kept[row[0], row[1]]]
            assert last == list(row)


@pytest.mark.skipif(shutil.which("make") is None, reason="GNU make is not installed")
def test_make_papers_makes_the_results_of_all_three_and_compares_them_at_the_end():
    done = subprocess.run(
        ["make", "--no-print-directory", "-nB", "V=1", "papers"],
        cwd=DOCS.parent, capture_output=True, text=True, check=True,
    )  # fmt: skip
    commands = " ".join(done.stdout.replace("\\\n", " ").split())
    for part in ("-o campaign/report.html", "-o observe/report.html", "-o srins/report.html"):
        assert part in commands
    assert commands.count("--within-turn --plot") == 2
    assert commands.count("--mode partial --mode full --calibration") == 20 + 2
    assert commands.index("-m tests.campaigns.papers") > commands.index("-o srins/report.html")


def test_items_are_in_the_order_of_the_papers():
    names = ["S claims", "R16 figure 6", "O17 table 1", "R16 table 7", "R16 (10) to (25)"]
    found = [item.item for item in in_order([Item(name, "", "", "", "") for name in names])]
    assert found == ["R16 (10) to (25)", "R16 table 7", "R16 figure 6", "O17 table 1", "S claims"]
