"""Find parts of a log that repeat an earlier part: a logger that writes a buffer again."""

import numpy as np
from numpy.typing import NDArray

from rotcli.files.channels import AXES
from rotcli.logs.record import ImuSource
from rotcli.run.still.scan import KEY_BITS, BlockStatistics, runs

Flags = NDArray[np.bool_]

_MIN_MARKS = 5  # marked rows that follow each other at one distance: about 320 rows
_MIN_LAG = 1 << KEY_BITS  # rows; repeated single readings are a faster logger, not a copy
_VERIFIED = 65536  # rows compared at a time


def find_copies(log: ImuSource, span: slice, statistics: BlockStatistics) -> Flags:
    """Flag the rows (n,) of a span that are equal, reading for reading, to earlier rows.

    The marked rows of the scan, one in 64 chosen by their readings, are found again in a copy,
    all at one distance. Then every row is compared. Copies of 10 s at 100 Hz are always found;
    noise never repeats, and coarse digits do not repeat at one distance.
    """
    n = span.stop - span.start
    copied = np.zeros(n, dtype=bool)
    order = np.argsort(statistics.keys, kind="stable")
    same = np.flatnonzero(statistics.keys[order][1:] == statistics.keys[order][:-1])
    later = statistics.marks[order[same + 1]]
    lag = later - statistics.marks[order[same]]
    by_time = np.argsort(later, kind="stable")
    later, lag = later[by_time], lag[by_time]
    if len(later) < _MIN_MARKS:
        return copied
    follows = (np.diff(lag) == 0) & (lag[1:] >= _MIN_LAG)
    for first, last in runs(follows):
        if last - first + 1 < _MIN_MARKS:
            continue
        distance = int(lag[first])
        # The copy may begin before its first mark and end after its last one.
        begin = max(int(later[first]) - 8 * _MIN_LAG, distance)
        end = min(int(later[last]) + 8 * _MIN_LAG, n)
        equal = _equal_rows(log, span.start, begin, end, distance)
        inside = runs(equal)
        for a, b in inside[inside[:, 1] - inside[:, 0] >= _MIN_LAG]:
            copied[begin + a : begin + b] = True
    return copied


def _equal_rows(log: ImuSource, offset: int, begin: int, end: int, distance: int) -> Flags:
    """Return which rows [begin, end) equal those `distance` rows before."""
    equal = np.ones(end - begin, dtype=bool)
    for at in range(begin, end, _VERIFIED):
        stop = min(at + _VERIFIED, end)
        here, before = np.empty(stop - at), np.empty(stop - at)
        for name in AXES:
            log.fill(here, name, slice(offset + at, offset + stop))
            log.fill(before, name, slice(offset + at - distance, offset + stop - distance))
            equal[at - begin : stop - begin] &= here == before
    return equal
