"""The records of a text log line by line, to find an error and its row."""

import csv
import io
from collections.abc import Iterator
from typing import Any, Literal

from rotcli.files.dialect import records as text_records
from rotcli.logs.container.header import Header


def text_lines(header: Header, stream: Any) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number, cells) of each record that is not empty."""
    if header.dialect is not None:
        yield from text_records(stream, header.dialect, header.before)
        return
    text = io.TextIOWrapper(stream, encoding="utf-8-sig", errors="replace", newline="")
    lines = (line.replace("\0", "�") for line in text)
    quoting: Literal[0, 3] = 0 if header.plain.quotes else 3  # minimal, or none
    reader = csv.reader(lines, delimiter=header.plain.delimiter, quoting=quoting)
    for cells in reader:
        if cells and reader.line_num > header.before:
            yield reader.line_num, cells
