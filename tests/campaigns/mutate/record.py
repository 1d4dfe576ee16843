"""The last result of each module, kept in record.json, and the page that is made of them."""

import json
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Self

from tests.campaigns.mutate.trial import ROOT

KEPT = Path(__file__).parent / "record.json"
REMAINING = KEPT.with_name("remaining.toml")
PAGE = ROOT / "docs" / "evidence" / "mutants.md"
MIN_KILLED = 0.95  # of the mutants that change behaviour


@dataclass(frozen=True)
class Result:
    """Mutants of a module (or of several): judged, excused by survivors.toml, and the survivors."""

    module: str
    judged: int
    excused: int
    survivors: list[str] = field(default_factory=list)

    @property
    def killed(self) -> int:
        return self.judged - len(self.survivors)

    @property
    def enough(self) -> bool:
        return self.killed >= MIN_KILLED * self.judged

    @property
    def same_as_kept(self) -> bool:
        """Whether the module is kept with these counts, or not at all."""
        last = kept().get(self.module)
        return last is None or last.judged == self.judged

    @classmethod
    def sum(cls, name: str, results: Iterable["Result"]) -> Self:
        """Return one result for several modules."""
        results = list(results)
        return cls(
            name,
            sum(r.judged for r in results),
            sum(r.excused for r in results),
            [name for r in results for name in r.survivors],
        )

    def __str__(self) -> str:
        return f"{self.module}: {self.killed} of {self.judged} killed, {self.excused} excused"


def keep(result: Result) -> None:
    """Replace the result of a module in record.json."""
    results = kept() | {result.module: result}
    rows = [json.dumps(asdict(results[module])) for module in sorted(results)]
    KEPT.write_text("[\n" + ",\n".join(rows) + "\n]\n", encoding="utf-8")


def write_page(known: dict[str, dict[str, str]]) -> None:
    """Write docs/evidence/mutants.md from record.json and the mutants of survivors.toml."""
    PAGE.write_text("\n".join(_lines(list(kept().values()), known)) + "\n", encoding="utf-8")


def kept() -> dict[str, Result]:
    """Return the last result of each module that still exists."""
    text = KEPT.read_text(encoding="utf-8") if KEPT.exists() else "[]"
    results = [Result(**row) for row in json.loads(text)]
    return {r.module: r for r in results if (ROOT / "rotcli" / f"{r.module}.py").exists()}


def _lines(results: list[Result], known: dict[str, dict[str, str]]) -> Iterator[str]:
    """Yield the lines of the page."""
    total = Result.sum("all", results)
    yield from (
        "# Mutants of the mathematics\n",
        "Made by `make mutate`. Not written by hand.\n",
        "A mutant is a module with one changed operator, sign, function, transpose or number\n"
        "(times 1.01). The tests of the module run on it and must fail. A seeded generator draws\n"
        "the same mutants of a module in every run; the table sums the last run of each module.\n",
        "| modules below rotcli/ | modules | mutants | killed | without effect | survived |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    )
    rooms: dict[str, list[Result]] = {}
    for result in results:
        rooms.setdefault(result.module.partition("/")[0], []).append(result)
    for room, own in [*sorted(rooms.items()), ("all", results)]:
        r = Result.sum(room, own)
        counts = len(own), r.judged + r.excused, r.killed, r.excused, len(r.survivors)
        yield f"| {room} | {' | '.join(map(str, counts))} |"
    share = 100.0 * total.killed / max(total.judged, 1)
    yield (
        f"\nOf the mutants that change behaviour, {share:.1f} % are killed. Survivors of a first "
        "run got tests:\nthe share is that of these mutants, not of ones that no run has drawn.\n"
    )
    if total.survivors:
        yield "## Survivors\n"
        reasons = tomllib.loads(REMAINING.read_text(encoding="utf-8"))
        for result in results:
            why = reasons.get(result.module, {})
            yield from (
                f"- `{result.module}`: `{name}`: {why.get(name, 'a test is missing')}"
                for name in result.survivors
            )
        yield ""
    yield "## Mutants that change no behaviour\n"
    yield "They are not judged; the reason of each:\n"
    for module, reasons in sorted(known.items()):
        yield from (f"- `{module}`: `{name}`: {reason}" for name, reason in reasons.items())
