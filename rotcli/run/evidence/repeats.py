"""Rows of an IMU log that repeat earlier rows bit for bit: copies, and rows written twice.

Six readings of a sensor with noise never repeat over several rows. A quantised log repeats single
rows by chance, with a probability of 7e-4 where each channel repeats in 0.3; five rows in
succession at one distance then have 1e-16 for a pair of places.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.logs.record import ImuSource
from rotcli.run.evidence.samples import noisy, rows_of_zeros
from rotcli.run.findings import Finding
from rotcli.units import FloatArray, format_span, show_time

MIN_COPIED = 5  # rows in succession
MAX_REPEATED_SHARE = 0.2  # of the rows equal to the row before: a logger faster than the sensor
MAX_ROWS = 1_000_000  # of a log that is searched: 0.3 s
_MAX_SHOWN = 4
# Odd 64-bit constants of a multiplicative hash (Knuth, TAOCP 3, 6.4), one a channel.
_MULTIPLIERS = np.array(
    [
        0x9E3779B97F4A7C15,
        0xC2B2AE3D27D4EB4F,
        0x165667B19E3779F9,
        0xD6E8FEB86659FD93,
        0xA0761D6478BD642F,
        0xE7037ED1A0B428DB,
    ],
    dtype=np.uint64,
)


@dataclass(frozen=True)
class Copy:
    """Rows that repeat earlier ones: count, times (s) of first, last and first original."""

    count: int
    first: float
    last: float
    original: float

    def in_words(self) -> str:
        """Return the times of the copy."""
        span = format_span(self.first, self.last)
        return f"{span} as from {show_time(self.original)} s"


@dataclass(frozen=True)
class Repeats:
    """Copied rows of a log, and the share of its rows that are equal to the row before.

    interval: s, of the log; rate: Hz, at which its rows change.
    """

    copies: tuple[Copy, ...] = ()
    repeated_share: float = 0.0
    interval: float = 0.0

    @property
    def repeating(self) -> bool:
        """Whether the logger writes rows faster than the sensor measures."""
        return self.repeated_share > MAX_REPEATED_SHARE

    @property
    def delay(self) -> float:
        """Time (s) by which the rows of a slower sensor may be late, 0 if none repeats."""
        return self.interval / (1.0 - self.repeated_share) if self.repeating else 0.0

    def summary(self) -> str:
        """Return the copies in words: how many rows, and when."""
        count = sum(copy.count for copy in self.copies)
        shown = ", ".join(copy.in_words() for copy in self.copies[:_MAX_SHOWN])
        more = ", ..." if len(self.copies) > _MAX_SHOWN else ""
        return f"{count} rows repeat earlier rows bit for bit ({shown}{more})"

    def findings(self, path: str) -> tuple[Finding, ...]:
        """Return the findings of an IMU log."""
        found = []
        if self.copies:
            count = float(sum(copy.count for copy in self.copies))
            text = (
                f"{path}: {self.summary()}; they were not measured. Exclude this part, or record "
            )
            text += "again"
            found.append(Finding("copied-rows", text, "warning", "imu", count, 0.0))
        if self.repeating:
            share = self.repeated_share
            rate = (1.0 - share) / self.interval
            text = (
                f"{path}: {100.0 * share:.0f} % of the rows are equal to the row before: the "
                f"sensor measures at {rate:.4g} Hz, and each reading is logged "
                f"{1.0 / (1.0 - share):.2g} times. Log at the sensor's rate, or remove the "
                "repeated rows"
            )
            limit = MAX_REPEATED_SHARE
            found.append(Finding("repeated-rows", text, "warning", "imu", share, limit))
        return tuple(found)


def find_repeats(imu: ImuSource) -> Repeats:
    """Return the rows of a log that repeat earlier ones; none where the log has no noise."""
    if imu.samples > MAX_ROWS or imu.samples < 2 * MIN_COPIED:
        return Repeats()
    keys: list[NDArray[np.uint64]] = []
    known: list[NDArray[np.bool_]] = []
    for chunk in imu.chunks(slice(0, imu.samples)):
        if not keys and not noisy(chunk.gyro):
            return Repeats()
        keys.append(row_keys(chunk.gyro, chunk.accel))
        known.append(_not_logged(chunk.gyro, chunk.accel, chunk.missing))
    rows, excluded = np.concatenate(keys), np.concatenate(known)
    equal = (rows[1:] == rows[:-1]) & ~excluded[1:]
    share = float(np.count_nonzero(equal)) / len(rows)
    found = Repeats(repeated_share=share, interval=imu.interval)
    distance = distances(rows)
    distance[excluded | (distance == 1)] = 0
    runs = constant_runs(distance, MIN_COPIED)
    if found.repeating or not runs:  # of rows written twice each pair repeats the next by chance
        return found
    time = imu.times(slice(0, imu.samples))
    copies = tuple(
        Copy(b - a, float(time[a]), float(time[b - 1]), float(time[a - distance[a]]))
        for a, b in runs
    )
    return Repeats(copies, share, imu.interval)


def row_keys(gyro: FloatArray, accel: FloatArray) -> NDArray[np.uint64]:
    """Return a hash (n,) of the six readings (n, 3), (n, 3) of each row."""
    keys = np.zeros(len(gyro), dtype=np.uint64)
    with np.errstate(over="ignore"):
        for k, multiplier in enumerate(_MULTIPLIERS):
            column = np.ascontiguousarray((gyro if k < 3 else accel)[:, k % 3])
            keys += column.view(np.uint64) * multiplier
    return keys


def _not_logged(
    gyro: FloatArray, accel: FloatArray, missing: NDArray[np.bool_] | None
) -> NDArray[np.bool_]:
    """Return the rows (n,) that are all zeros or that reading has interpolated."""
    zero = rows_of_zeros(gyro, accel)
    return np.asarray(zero if missing is None else zero | missing)


def distances(rows: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Return how many rows (n,) before each the last equal one is, 0 where there is none.

    >>> distances(np.array([5, 6, 5, 6, 7], dtype=np.uint64)).tolist()
    [0, 0, 2, 2, 0]
    """
    result = np.zeros(len(rows), dtype=np.int64)
    ordered = np.sort(rows)  # a tenth of the time of the permutation, which most logs do not need
    if not (ordered[1:] == ordered[:-1]).any():
        return result
    order = np.argsort(rows, kind="stable")
    same = rows[order[1:]] == rows[order[:-1]]
    result[order[1:][same]] = order[1:][same] - order[:-1][same]
    return result


def constant_runs(values: NDArray[np.int64], least: int) -> list[tuple[int, int]]:
    """Return start and stop of the runs of one value other than 0, of at least `least` rows."""
    changes = np.flatnonzero(np.diff(values)) + 1
    edges = np.concatenate([[0], changes, [len(values)]])
    return [
        (int(start), int(stop))
        for start, stop in pairwise(edges)
        if values[start] and stop - start >= least
    ]
