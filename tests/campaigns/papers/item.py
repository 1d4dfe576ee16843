"""One line of the comparison with the papers."""

from collections.abc import Sequence
from dataclasses import dataclass

from rotcli.files.tables import Column, Table

AGREES = "agrees"  # within the stated tolerance, or to the printed digits
IN_KIND = "in kind"  # recordings of real units: the same picture, within the stated factor
CORRECTED = "corrected"  # the published value rests on a misprint; ours is right
CONTRADICTED = "contradicted"  # the statement is not true
INCOMPATIBLE = "incompatible"  # two published figures exclude each other
DIFFERS = "differs"
VERDICTS = (AGREES, IN_KIND, CORRECTED, CONTRADICTED, INCOMPATIBLE, DIFFERS)


@dataclass(frozen=True)
class Item:
    """An item of a paper, as docs/papers.md names it; what is compared, ours, published."""

    item: str
    what: str
    ours: str
    published: str
    verdict: str


def agreement(ours: float, published: float, tolerance: float) -> str:
    """Return whether two numbers agree within a relative tolerance."""
    return AGREES if abs(ours - published) <= tolerance * abs(published) else DIFFERS


def likeness(ours: float, published: float, factor: float) -> str:
    """Return whether two positive numbers are within a factor of each other."""
    return IN_KIND if 1.0 / factor <= ours / published <= factor else DIFFERS


def as_table(items: Sequence[Item]) -> Table:
    """Return the comparison as a table."""
    names = ("item", "what", "ours", "published", "verdict")
    counts = ", ".join(
        f"{sum(item.verdict == verdict for item in items)} {verdict}"
        for verdict in VERDICTS
        if any(item.verdict == verdict for item in items)
    )
    return Table(
        "The papers: ours next to the published values",
        tuple(Column(name) for name in names),
        [(i.item, i.what, i.ours, i.published, i.verdict) for i in items],
        f"{counts}. The recordings of the papers are not public: simulated logs with the published "
        "sensor figures replace them. docs/papers.md has every item and what is corrected.",
    )


def in_order(items: Sequence[Item]) -> list[Item]:
    """Return the items paper by paper: equations, tables, figures, the rest, each by number."""
    papers, kinds = ("R16", "O17", "S"), ("(", "properties", "table", "figure", "claims")

    def place(item: Item) -> tuple[int, int, int]:
        paper, _, name = item.item.partition(" ")
        kind = next(k for k, word in enumerate(kinds) if name.startswith(word))
        number = "".join(c if c.isdigit() else " " for c in name).split()
        return papers.index(paper), kind, int(number[0]) if number else 0

    return sorted(items, key=place)
