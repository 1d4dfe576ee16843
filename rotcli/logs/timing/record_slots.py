"""From the records of a long log to the slots of its even clock, and back."""

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]


class RecordSlots:
    """The slots of records on an even clock with gaps.

    gaps: (record after which samples are missing, how many), in order.
    """

    def __init__(self, gaps: list[tuple[int, int]]) -> None:
        counts = [count for _, count in gaps]
        self.gaps = len(gaps)
        self._resume = np.array([record + 1 for record, _ in gaps], dtype=np.int64)
        self._lost = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)

    def of(self, first: int, count: int) -> Index:
        """Return the slots of `count` records from record `first` on."""
        records = np.arange(first, first + count)
        return np.asarray(records + self._lost[np.searchsorted(self._resume, records, "right")])

    def record_before(self, slot: int) -> int:
        """Return a record that is not after a slot."""
        after = self._resume + self._lost[1:]
        lost = int(self._lost[np.searchsorted(after, slot, side="right")])
        longest = int(np.diff(self._lost).max(initial=-1))
        return max(slot - lost - longest - 1, 0)
