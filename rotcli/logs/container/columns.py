"""Columns of numbers of a log: which ones are wanted, and those that were loaded.

A row is the line of a text (the header is row 1), or a record counted from 1.
"""

from dataclasses import field, replace
from itertools import islice
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.logs.container.header import Header, as_log_error, stream_of
from rotcli.units import FloatArray

with lazily():
    from rotcli.logs.container import lines

Chunks = list[NDArray[Any]]


@dataclass(frozen=True)
class Wanted:
    """Which columns to load.

    values: those whose absence makes a record empty, in a log with blank cells (`sparse`).
    texts: column to `timestamp`, `time of day`, `text` (another time) or `name`.
    """

    columns: tuple[int, ...]
    values: tuple[int, ...] = ()
    texts: dict[int, str] = field(default_factory=dict)
    sparse: bool = False


@dataclass(frozen=True)
class Loaded:
    """The numbers of the wanted columns, in the chunks they were read in.

    first: records of the log before these. kept: which of the records they are, where some were
    left out.
    """

    header: Header
    rows: int
    columns: list[Chunks]
    first: int = 0
    kept: NDArray[np.int64] | None = None

    def row(self, index: int) -> int:
        """Return the row of record `index` as the user counts."""
        index = int(self.kept[index]) if self.kept is not None and len(self.kept) else index
        index += self.first
        if not self.header.is_text:
            return index + 1
        with as_log_error(self.header.path), stream_of(self.header) as stream:
            return next(islice(lines.text_lines(self.header, stream), index, None))[0]

    def fill(self, out: FloatArray, column: int, factor: float, offset: float = 0.0) -> None:
        """Write (one column - offset) times `factor` into out (rows,)."""
        start = 0
        for chunk in self.columns[column]:
            part = out[start : start + len(chunk)]
            if offset:
                np.subtract(chunk, offset, out=part)
                part *= factor
            elif chunk.dtype.kind in "iu" and _is_decimal_part(factor):
                # Integers beyond float64, such as ns of Unix time, keep their digits.
                per_second = round(1.0 / factor)
                complete = chunk // per_second
                np.multiply(chunk - complete * per_second, factor, out=part)
                part += complete
            else:
                np.multiply(chunk, factor, out=part)
            start += len(chunk)

    def column(self, index: int) -> NDArray[Any]:
        """Return one column as it was read."""
        chunks = self.columns[index]
        return chunks[0] if len(chunks) == 1 else np.concatenate(chunks) if chunks else np.empty(0)

    def select(self, mask: NDArray[np.bool_]) -> "Loaded":
        """Return the records of a mask."""
        kept = np.flatnonzero(mask)
        columns = [[self.column(k)[kept]] for k in range(len(self.columns))]
        before = kept if self.kept is None else self.kept[kept]
        return replace(self, rows=len(kept), columns=columns, kept=before)


def _is_decimal_part(factor: float) -> bool:
    """Return whether a factor is 1 / n for an integer n: ms, us or ns."""
    return 0.0 < factor < 1.0 and abs(round(1.0 / factor) * factor - 1.0) < 1e-12


def to_chunks(column: Any) -> Chunks:
    """Return the numbers of a column without nulls, as they are in memory.

    Arrow's own `to_numpy` imports pandas, which takes longer than reading the log.
    """
    if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
        column = pa.chunked_array([c.view(pa.int64()) for c in column.chunks], pa.int64())
    letter = (
        "f"
        if pa.types.is_floating(column.type)
        else "iu"[pa.types.is_unsigned_integer(column.type)]
    )
    dtype = np.dtype(f"{letter}{column.type.bit_width // 8}")
    return [
        np.frombuffer(chunk.buffers()[1], dtype, len(chunk), chunk.offset * dtype.itemsize)
        for chunk in column.chunks
        if len(chunk)
    ]
