"""Times and channels of the chunks of a log that is read in passes, and those that are kept."""

from collections.abc import Sequence

import numpy as np

from rotcli.logs.container.columns import Loaded
from rotcli.logs.container.header import Header
from rotcli.logs.container.parquet_file import count_rows
from rotcli.logs.describe.layout import Layout
from rotcli.units import FloatArray

# Bytes of decoded readings that stay in memory: six hours at 100 Hz, with a temperature.
MAX_KEPT_BYTES = 125_000_000


class NotStreamableError(Exception):
    """Stamps that go back or repeat need the complete log in memory."""


class ChunkValues:
    """Converts loaded chunks to SI by the layout of their log; names: its channels, in order."""

    def __init__(self, layout: Layout, names: Sequence[str]) -> None:
        self._layout = layout
        self.sources = [layout.sources[name] for name in names]

    def times(self, loaded: Loaded, before: float | None) -> FloatArray:
        """Return the times (n,), s, of loaded records; before: s, of the record before them.

        Raises NotStreamableError where they go back or repeat.
        """
        time = np.empty(loaded.rows)
        loaded.fill(time, 0, self._layout.time.scale[0])
        if (before is not None and time[0] <= before) or np.diff(time).min(initial=np.inf) <= 0.0:
            raise NotStreamableError
        return time

    def values(
        self, loaded: Loaded, columns: list[int], first: int, out: FloatArray | None = None
    ) -> FloatArray:
        """Return channels (k, n) in SI; the columns of `loaded` from `first` on are theirs.

        Increments remain increments; out: (k, n), where they are written.
        """
        values = np.empty((len(columns), loaded.rows)) if out is None else out
        for k, (row, column) in enumerate(zip(values, columns, strict=True)):
            source = self.sources[column]
            loaded.fill(row, first + k, source.scale, source.offset)
        return values

    def rates(
        self, values: FloatArray, columns: list[int], interval: float | FloatArray
    ) -> FloatArray:
        """Return channels (k, n) with increments of one interval (s) as mean rates."""
        divisors = [interval if self.sources[column].increments else None for column in columns]
        if all(divisor is None for divisor in divisors):
            return values
        rows = [r if d is None else r / d for r, d in zip(values, divisors, strict=True)]
        return np.array(rows)


class KeptValues:
    """The readings (k, n) of a log that is decoded once."""

    def __init__(self, values: FloatArray) -> None:
        """Start without any; values: where they are written."""
        self._values = values
        self._rows = 0

    @classmethod
    def of(cls, header: Header, channels: int) -> "KeptValues | None":
        """Return the memory for a log, None for a Parquet file beyond MAX_KEPT_BYTES.

        Memory that is never written costs nothing, so that the records of a text are not counted.
        None as well where the system does not grant it.
        """
        rows = MAX_KEPT_BYTES // (8 * channels)
        if header.kind == "parquet" and count_rows(header) > rows:
            return None
        try:
            return cls(np.empty((channels, rows)))
        except MemoryError:
            return None

    def room(self, rows: int) -> FloatArray | None:
        """Return where the next readings (k, rows) are to be written, None beyond the limit."""
        first, self._rows = self._rows, self._rows + rows
        return self._values[:, first : self._rows] if self._rows <= self._values.shape[1] else None

    def between(self, columns: list[int], first: int, stop: int) -> FloatArray:
        """Return channels (k, n) of the records from `first` to `stop`, the end excluded."""
        part = self._values[:, first : min(stop, self._rows)]
        low, high = min(columns), max(columns) + 1
        return part[low:high] if columns == list(range(low, high)) else part[columns]
