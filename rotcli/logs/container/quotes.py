"""Quotation marks of a CSV log: a misplaced one would swallow all records up to the next one.

A mark opens at the start of a cell and closes at its end, on the same line. Doubled marks inside a
quoted text are right.
"""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.container.header import Header, stream_of

_QUOTE, _NEWLINE = ord('"'), ord("\n")
_BLOCK = 1 << 20  # bytes, of the search for the row
_ADVICE = "a quotation mark is not one of a quoted cell; remove it"


class CheckedStream(io.RawIOBase):
    """The text of a log as it is; `read` raises LogError at a quotation mark that is not right."""

    def __init__(self, stream: Any, header: Header) -> None:
        self._stream, self._header = stream, header
        self._boundary = _boundaries(header.plain.delimiter)
        self._skip = _free_lines(header) if header.dialect is None else 0
        self._rest = b""

    def readable(self) -> bool:
        """Return True: it can be read."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Read on."""
        chunk: bytes = self._stream.read(size) if size >= 0 else self._stream.read()
        at_end = not chunk or size < 0
        if b'"' in chunk or b'"' in self._rest or self._skip:
            self._check(self._rest + chunk, at_end)
        else:
            self._rest = chunk[chunk.rfind(b"\n") + 1 :] if b"\n" in chunk else self._rest + chunk
        return chunk

    def _check(self, text: bytes, at_end: bool) -> None:
        """Check the complete lines of a text that starts with a line."""
        cut = len(text) if at_end else text.rfind(b"\n") + 1
        lines, self._rest = text[:cut], text[cut:]
        while self._skip and lines:
            _, newline, lines = lines.partition(b"\n")
            self._skip -= bool(newline)
        if b'"' in lines and _first_fault(lines, self._boundary) is not None:
            if self._header.dialect is None:
                _raise_row(self._header, self._boundary)
            raise LogError(self._header.path, _ADVICE)


def _free_lines(header: Header) -> int:
    """Return the number of lines before the names, which may contain any text."""
    return header.header_line - 1 if header.header_line else header.before


def _boundaries(delimiter: str) -> NDArray[np.bool_]:
    """Return which bytes (256,) may be outside a mark: delimiters, blanks, line ends, marks."""
    allowed = np.zeros(256, dtype=bool)
    allowed[np.frombuffer(f'{delimiter}\n\r\t "'.encode(), dtype=np.uint8)] = True
    return allowed


def _first_fault(lines: bytes, boundary: NDArray[np.bool_]) -> int | None:
    """Return the place of the first line with a wrong mark, counted from 0, or None."""
    data = np.frombuffer(b"\n" + lines + b"\n", dtype=np.uint8)
    marks = np.flatnonzero(data == _QUOTE)
    line = np.searchsorted(np.flatnonzero(data == _NEWLINE), marks) - 1
    first = np.searchsorted(line, line)  # of the marks of the same line
    opening = (np.arange(len(marks)) - first) % 2 == 0
    outside = data[np.where(opening, marks - 1, marks + 1)]
    wrong = ~boundary[outside]
    last = np.append(line[1:] != line[:-1], True)  # an opening mark that ends a line's marks
    wrong |= last & opening
    return int(line[np.argmax(wrong)]) if wrong.any() else None


def _raise_row(header: Header, boundary: NDArray[np.bool_]) -> None:
    """Raise LogError for the first row with a wrong mark."""
    row, rest, free = 0, b"", _free_lines(header)
    with stream_of(header) as stream:
        while True:
            chunk: bytes = stream.read(_BLOCK)
            text = rest + chunk
            cut = text.rfind(b"\n") + 1 if chunk else len(text)
            lines, rest = text[:cut], text[cut:]
            while row < free and lines:
                _, _, lines = lines.partition(b"\n")
                row += 1
            found = _first_fault(lines, boundary) if b'"' in lines else None
            if found is not None:
                raise LogError(header.path, _ADVICE, row=row + found + 1)
            if not chunk:
                return
            row += lines.count(b"\n")
