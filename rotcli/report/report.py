"""Any set of result files into one report: summary, tables, figures, warnings.

How the results of a kind are shown is said by `rotcli.report.kinds`.
"""

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.results.documents import sound
from rotcli.files.results.find import find_results, read_results
from rotcli.files.results.groups import NAMELESS, Source
from rotcli.files.tables import Table, with_values
from rotcli.report.kinds import KINDS, SKIPPED_KINDS, Kind, is_reported, load, section_of
from rotcli.report.summary import Verdict, verdicts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.figures import Drawing

_OBJECTS = 100_000  # new objects before a collection: some ten figures
MAX_HEADLINES = 12  # sentences of one kind in the summary
_SHAPE_FAULTS = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)


@dataclass(frozen=True)
class Section:
    """The results of one kind."""

    kind: Kind
    sources: tuple[Source, ...]
    tables: tuple[Table, ...]
    published: bool = False

    def figures(self) -> "list[Drawing]":
        """Return title and drawing function of each figure; matplotlib is loaded on drawing."""
        options = {"published": self.published} if self.kind.compares else {}
        return self._drawings(self.kind.figures, **options)

    def overview(self) -> "list[Drawing]":
        """Return the figures that show all units at once; none of a kind without such."""
        return self._drawings(self.kind.overview)

    def _drawings(self, name: str | None, **options: bool) -> "list[Drawing]":
        if name is None:
            return []
        with sound(self.names, self.kind.heading):
            drawn: list[Drawing] = load(name)(self.sources, **options)
        return [(title, partial(self._draw, drawing)) for title, drawing in drawn]

    def _draw(self, drawing: "Callable[[], Figure]") -> "Figure":
        with sound(self.names, self.kind.heading):
            try:
                return drawing()
            except StopIteration as fault:
                raise LookupError("a part of it is missing") from fault

    @property
    def names(self) -> str:
        """The first files, for messages."""
        return ", ".join(source.path for source in self.sources[:3])


@dataclass(frozen=True)
class Report:
    """A report on results.

    warnings: (file, text), part of the report. remarks: on the choice of files, for the user who
    makes the report.
    """

    title: str
    verdicts: tuple[Verdict, ...]
    sentences: tuple[str, ...]
    sections: tuple[Section, ...]
    warnings: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]
    sources: tuple[Source, ...]

    @property
    def summary(self) -> list[str]:
        """The summary as sentences."""
        return [*(verdict.sentence for verdict in self.verdicts), *self.sentences]

    @property
    def tables(self) -> list[Table]:
        """The tables of all sections."""
        return [table for section in self.sections for table in section.tables]


@contextmanager
def rare_collections() -> Iterator[None]:
    """Collect garbage rarely: documents and figures are many objects, an eighth of the time."""
    before = gc.get_threshold()
    gc.set_threshold(max(before[0], _OBJECTS), *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


def gather(paths: Sequence[str], title: str, *, published: bool = False) -> Report:
    """Read result files, folders and patterns and put the report together.

    A result given twice counts once, whatever the file's name. The order of the files is of no
    consequence. published: compare with the values of the papers, which are about the same IMUs.
    Raises ResultError for a file that is no result or of a kind without a table.
    """
    sources, remarks = _read(paths)
    by_kind: dict[str, list[Source]] = {}
    for source in sources:
        by_kind.setdefault(section_of(source.doc), []).append(source)
    sections = [
        Section(kind, members, tuple(_tables(name, kind, members, published)), published)
        for name, kind in KINDS.items()
        if (members := tuple(by_kind.get(name, ())))
    ]
    return Report(
        title=title,
        verdicts=tuple(verdicts(by_kind.get("navigation", []))),
        sentences=tuple(text for section in sections for text in _sentences(section)),
        sections=tuple(sections),
        warnings=tuple((source.path, text) for source in sources for text in source.warnings),
        remarks=tuple(remarks),
        sources=tuple(sources),
    )


def _sentences(section: Section) -> list[str]:
    """Return the summary of a section."""
    kind, sources = section.kind, section.sources
    with sound(section.names, kind.heading):
        if kind.summary is not None:
            found = list(load(kind.summary)(sources))
        elif kind.headline is not None:
            line = load(kind.headline)
            found = [f"{_label(source)}: {line(source.doc)}" for source in sources]
        elif section.kind is KINDS["navigation"]:
            return []  # its verdicts are the summary
        else:
            found = [f"{table.title}." for table in section.tables]
    more = len(found) - MAX_HEADLINES
    rest = [f"{kind.heading}: {more} more results, see the tables."] if more > 0 else []
    return found[:MAX_HEADLINES] + rest


def _label(source: Source) -> str:
    return source.path if source.imu == NAMELESS else source.imu


def _tables(name: str, kind: Kind, members: tuple[Source, ...], published: bool) -> list[Table]:
    """Return the tables of a kind; a document of wrong shape is named."""
    show = load(kind.tables)
    options = {"published": published} if kind.compares else {}
    try:
        made = list(show(members, **options))
    except _SHAPE_FAULTS:
        for source in members:
            with sound(source.path, name):
                show((source,), **options)
        with sound(", ".join(source.path for source in members[:3]), name):
            raise
    everything = tuple(source.path for source in members) if len(members) == 1 else ()
    return [
        replace(table, origins=[everything] * len(table.rows))
        if everything and not table.origins
        else table
        for table in map(with_values, made)
    ]


def _read(paths: Sequence[str]) -> tuple[list[Source], list[str]]:
    """Return the distinct results, and remarks on the files that were not used."""
    named = set(find_results(paths)[1])
    found = read_results(paths, is_reported)
    remarks = found.remarks()
    sources: list[Source] = []
    known: dict[str, list[Source]] = {}
    for path, doc in sorted(found.documents, key=lambda pair: pair[0]):
        if path in named and doc["kind"] in SKIPPED_KINDS:
            remarks.append(f"{path}: truth file of a simulation, not a result; skipped")
            continue
        if not is_reported(doc):
            raise ResultError(
                f"{path}: a report has no table for results of kind '{doc['kind']}'; known are "
                f"{', '.join(KINDS)}; leave the file out"
            )
        twins = known.setdefault(_fingerprint(doc), [])
        twin = next((source.path for source in twins if source.doc == doc), None)
        if twin is not None:
            remarks.append(f"{path}: the same result as {twin}; counted once")
            continue
        sources.append(Source(path, doc))
        twins.append(sources[-1])
    if not sources:
        raise ResultError(f"{', '.join(sorted(paths))}: no results to report on")
    return sources, remarks


def _fingerprint(doc: Mapping[str, Any]) -> str:
    """Return a text that is the same for equal documents, and rarely for others."""
    return repr([doc.get(key) for key in ("kind", "mode", "inputs")])
