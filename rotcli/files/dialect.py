"""Text logs that are not plain CSV: other delimiters, comments, lines to skip, no header line.

`open_text` finds the header and the first record, `records` goes through the records line by
line, `Cleaned` hands them to a fast reader of CSV. Which text is like that stands in `formats`.
"""

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rotcli.errors import LogError

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_BLANKS = re.compile(rb"[ \t]{2,}")
_BLOCK = 1 << 20
_NAMES = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "blanks"}


@dataclass(frozen=True)
class Dialect:
    """How a text log is written.

    delimiter: one sign; a blank stands for any run of blanks and tabs; None is found out.
    comment: what a line to be passed over starts with. skip: lines passed over at the top.
    figures: lines of numbers between the header and the records.
    """

    delimiter: str | None = None
    comment: str = ""
    skip: int = 0
    figures: int = 0

    def split(self, line: str) -> list[str]:
        """Return the cells of a line; the delimiter must be known."""
        if self.delimiter == " ":
            return line.split()
        import csv

        cells = next(csv.reader([line.strip(" ")], delimiter=self.delimiter or ","), [])
        return [cell.strip() for cell in cells]

    def passes_over(self, line: str) -> bool:
        """Tell whether a line holds nothing: empty, or a comment."""
        line = line.strip()
        return not line or (bool(self.comment) and line.startswith(self.comment))


@dataclass(frozen=True)
class Opened:
    """The head of a text log: the dialect with its delimiter, names, and what stands before.

    names: of the columns, empty where there is no header line. before: lines up to the first
    record. comments: the comment lines among them. figures: (line, numbers) of the lines of
    figures. first: the cells of the first record, none in a log without records.
    """

    dialect: Dialect
    names: list[str]
    before: int
    comments: list[str]
    figures: list[tuple[int, list[float]]]
    first: list[str]


def open_text(path: str, head: str, dialect: Dialect) -> Opened:
    """Take the head of a text log apart; `head` holds whole lines, or the whole log.

    Raises LogError where the lines of figures are missing or hold no numbers.
    """
    lines = re.split(r"\r\n|\r|\n", head)
    numbered = list(enumerate(lines, start=1))[dialect.skip :]
    rows = [(k, line) for k, line in numbered if not dialect.passes_over(line)]
    comments = [line for k, line in numbered if line.strip() and dialect.passes_over(line)]
    if not rows:
        raise LogError(path, "no rows of numbers; is this the right file, and its format?")
    if dialect.delimiter is None:
        dialect = Dialect(_delimiter(rows[0][1]), dialect.comment, dialect.skip, dialect.figures)
    names: list[str] = []
    before = rows[0][0] - 1
    cells = dialect.split(rows[0][1])
    if not all(NUMBER.fullmatch(cell) for cell in cells if cell):
        names, before, rows = cells, rows[0][0], rows[1:]
    figures = []
    for k, line in rows[: dialect.figures]:
        figures.append((k, _figures(path, k, dialect.split(line))))
        before = k
    rows = rows[dialect.figures :]
    if len(figures) < dialect.figures:
        raise LogError(path, f"ends before the {dialect.figures} lines of figures at its head")
    first = dialect.split(rows[0][1]) if rows else []
    if names and len(first) == len(names) + 1 and not first[-1]:
        names = [*names, ""]  # every record ends with a delimiter
    return Opened(dialect, names, before, comments, figures, first)


def _delimiter(line: str) -> str:
    """Return the sign that separates the cells of a line."""
    return next((sign for sign in ("\t", ";", ",") if sign in line.strip()), " ")


def _figures(path: str, row: int, cells: list[str]) -> list[float]:
    for cell in cells:
        if not NUMBER.fullmatch(cell):
            what = f"{cell[:40]!r} is not a number; the head of the log holds figures here"
            raise LogError(path, what, row=row)
    return [float(cell) for cell in cells]


def separator(dialect: Dialect | None) -> str:
    """Return the name of the sign between two cells, for messages."""
    sign = "," if dialect is None else dialect.delimiter or ","
    return _NAMES.get(sign, repr(sign))


def records(stream: Any, dialect: Dialect, before: int) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number, cells) of every record below the first `before` lines."""
    text = io.TextIOWrapper(stream, encoding="utf-8-sig", errors="replace", newline=None)
    for number, line in enumerate(text, start=1):
        if number > before and not dialect.passes_over(line):
            yield number, dialect.split(line.rstrip("\n").replace("\0", "�"))


class Cleaned(io.RawIOBase):
    """The records of a text log as a stream: comments left out, one blank between two cells."""

    def __init__(self, stream: Any, dialect: Dialect, before: int) -> None:
        self._stream, self._dialect, self._before = stream, dialect, before
        self._rest, self._ready = b"", b""
        self._at_end = False
        self._comment = dialect.comment.encode()
        self._drop = re.compile(rb"(?m)^[ \t]*" + re.escape(self._comment) + rb".*(\n|$)")

    def readable(self) -> bool:
        """Tell that it can be read."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Return up to `size` bytes, all for -1, none at the end."""
        while not self._at_end and (size < 0 or not self._ready):
            self._ready += self._block()
        size = len(self._ready) if size < 0 else size
        part, self._ready = self._ready[:size], self._ready[size:]
        return part

    def _block(self) -> bytes:
        """Return the next whole lines, cleaned."""
        new: bytes = self._stream.read(_BLOCK)
        self._at_end = not new
        block = (self._rest + new).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if new[-1:] == b"\r":  # its line feed may come next; an empty line does no harm
            block = block[:-1] + b"\n"
        cut = len(block) if self._at_end else block.rfind(b"\n") + 1
        block, self._rest = block[:cut], block[cut:]
        while self._before and block:
            _, newline, block = block.partition(b"\n")
            self._before -= bool(newline)
        if self._comment and self._comment in block:
            block = self._drop.sub(b"", block)
        if self._dialect.delimiter == " ":
            block = block.replace(b"\t", b" ")
            if b"  " in block:
                block = _BLANKS.sub(b" ", block)
            block = block.replace(b"\n ", b"\n").replace(b" \n", b"\n").removeprefix(b" ")
            block = block.removesuffix(b" ")
        return block
