"""Text logs that are not plain CSV: delimiters, decimal commas, comments, encodings.

`RecordStream` gives the records of such a text to a fast reader of CSV; `records` yields them line
by line, to find an error.
"""

import codecs
import csv
import io
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from rotcli.dataclass import dataclass

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
DELIMITER_NAMES = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "blank", "|": "bar"}
# Cells without a number, in a log that has blank cells.
BLANK_CELLS = ("", "nan", "NaN", "NAN", "NA", "N/A", "n/a", "null", "NULL", "None")
_BLANK = 32  # ASCII
_BLOCK = 1 << 18  # bytes that are cleaned at a time
_UTF8 = ("utf-8", "utf-8-sig")


@dataclass(frozen=True)
class Dialect:
    """How a text log is written.

    delimiter: one sign; a blank is any run of blanks and tabs. decimal: point or comma. comment:
    start of the lines to skip. encoding: utf-8, or one that is converted. clean: of the format,
    lines to lines that a CSV reader understands. quotes: cells may be in quotation marks.
    """

    delimiter: str = ","
    decimal: str = "."
    comment: str = ""
    encoding: str = "utf-8"
    clean: Callable[[bytes], bytes] | None = None
    quotes: bool = True

    @property
    def is_plain(self) -> bool:
        """Whether a reader of CSV takes the text without conversion."""
        return (
            self.delimiter != " "
            and not self.comment
            and self.encoding in _UTF8
            and self.clean is None
        )

    def split(self, line: str) -> list[str]:
        """Return the cells of a line."""
        line = line.rstrip("\r\n")
        if self.clean is not None:
            line = self.clean(line.encode()).decode("utf-8", "replace")
        if self.delimiter == " ":
            return line.split()
        if not self.quotes or '"' not in line:
            return [cell.strip() for cell in line.split(self.delimiter)]
        cells = next(csv.reader([line.strip(" ")], delimiter=self.delimiter), [])
        return [cell.strip() for cell in cells]

    def is_skipped(self, line: str) -> bool:
        """Return whether a line contains no record: empty, or a comment."""
        line = line.strip()
        return not line or (bool(self.comment) and line.startswith(self.comment))


def is_number(cell: str, decimal: str = ".") -> bool:
    """Return whether a cell is a number, with a decimal comma where that is the sign."""
    if NUMBER.fullmatch(cell):
        return True
    return decimal == "," and DECIMAL_COMMA.fullmatch(cell) is not None


def records(stream: Any, dialect: Dialect, before: int) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number, cells) of every record below the first `before` lines of a text."""
    encoding = "utf-8-sig" if dialect.encoding in _UTF8 else dialect.encoding
    text = io.TextIOWrapper(stream, encoding=encoding, errors="replace", newline=None)
    for number, line in enumerate(text, start=1):
        if number > before and not dialect.is_skipped(line):
            cells = dialect.split(line.replace("\0", "�"))
            if dialect.clean is None or cells not in ([], [""]):  # a message of another kind
                yield number, cells


class RecordStream(io.RawIOBase):
    """The records of a text log as a stream: UTF-8, no comments, one blank between two cells."""

    def __init__(self, stream: Any, dialect: Dialect, before: int) -> None:
        self._stream, self._dialect, self._before = stream, dialect, before
        self._rest, self._ready = b"", b""
        self._at_end = False
        self._comment = dialect.comment.encode()
        self._drop = re.compile(rb"(?m)^[ \t]*" + re.escape(self._comment) + rb".*(\n|$)")
        self._decoder = (
            None
            if dialect.encoding in _UTF8
            else codecs.getincrementaldecoder(dialect.encoding)("replace")
        )

    def readable(self) -> bool:
        """Return True: it can be read."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Return up to `size` bytes, all for -1, none at the end."""
        while not self._at_end and (size < 0 or not self._ready):
            self._ready += self._block()
        size = len(self._ready) if size < 0 else size
        chunk, self._ready = self._ready[:size], self._ready[size:]
        return chunk

    def _block(self) -> bytes:
        """Return the next complete lines, cleaned."""
        new: bytes = self._stream.read(_BLOCK)
        self._at_end = not new
        if self._decoder is not None:
            new = self._decoder.decode(new, final=self._at_end).encode()
        block = self._rest + new
        if b"\r" in block:
            block = block.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if new[-1:] == b"\r":  # its line feed may come next; an empty line does no harm
            block = block[:-1] + b"\n"
        cut = len(block) if self._at_end else block.rfind(b"\n") + 1
        block, self._rest = block[:cut], block[cut:]
        while self._before and block:
            _, newline, block = block.partition(b"\n")
            self._before -= bool(newline)
        if self._comment and self._comment in block:
            block = self._drop.sub(b"", block)
        if self._dialect.clean is not None:
            block = self._dialect.clean(block)
        return _single_blanks(block) if self._dialect.delimiter == " " else block


def _single_blanks(block: bytes) -> bytes:
    """Return lines with one blank between two cells, none at their ends; tabs are blanks."""
    if b"\t" in block:
        block = block.replace(b"\t", b" ")
    if b"  " in block:
        letters = np.frombuffer(block, dtype=np.uint8)
        blank = letters == _BLANK
        dropped = blank.copy()
        dropped[:-1] &= blank[1:]
        dropped[-1] = False
        block = letters[~dropped].tobytes()
    block = block.replace(b"\n ", b"\n").replace(b" \n", b"\n")
    return block.removeprefix(b" ").removesuffix(b" ")
