"""What a target program is described by: one `Format`, whose function writes a `Body`."""

from collections.abc import Callable
from dataclasses import field

from rotcli.dataclass import dataclass
from rotcli.export.numbers import Numbers


@dataclass(frozen=True)
class Body:
    """The lines of one format without its header, and notes that belong into the header."""

    lines: list[str]
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Format:
    """One target program.

    contains: the figures that the format can store, of `FIGURES`; comment: start and end of a
    comment line; first: a line that must come before the header; noise: whether it needs noise.
    """

    name: str
    title: str
    file_name: str
    contains: frozenset[str]
    body: Callable[[Numbers], Body]
    comment: tuple[str, str] = ("# ", "")
    first: str | None = None
    noise: bool = True
