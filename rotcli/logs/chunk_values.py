"""Times and channels of the chunks of a log that is read in passes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.logs.container.columns import Loaded
from rotcli.logs.describe.layout import Layout

Array = NDArray[np.float64]


class NotStreamableError(Exception):
    """Stamps that go back or repeat need the complete log in memory."""


class ChunkValues:
    """Converts loaded chunks to SI by the layout of their log; names: its channels, in order."""

    def __init__(self, layout: Layout, names: Sequence[str]) -> None:
        self._layout = layout
        self.sources = [layout.sources[name] for name in names]

    def times(self, loaded: Loaded, before: float | None) -> Array:
        """Return the times (n,), s, of loaded records; before: s, of the record before them.

        Raises NotStreamableError where they go back or repeat.
        """
        time = np.empty(loaded.rows)
        loaded.fill(time, 0, self._layout.time.scale[0])
        steps = np.diff(time, prepend=-np.inf if before is None else before)
        if steps.min() <= 0.0:
            raise NotStreamableError
        return time

    def values(self, loaded: Loaded, columns: list[int], first: int) -> Array:
        """Return channels (k, n) in SI; the columns of `loaded` from `first` on are theirs."""
        values = np.empty((len(columns), loaded.rows))
        for k, (row, column) in enumerate(zip(values, columns, strict=True)):
            source = self.sources[column]
            loaded.fill(row, first + k, source.scale, source.offset)
        return values

    def divide(self, values: Array, columns: list[int], interval: float | Array) -> None:
        """Turn increments of one interval (s) into mean rates, in place."""
        for row, column in zip(values, columns, strict=True):
            if self.sources[column].increments:
                row /= interval
