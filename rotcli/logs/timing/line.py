"""The even clock of a log as a straight line through its time stamps."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

Index = NDArray[np.int64]


@dataclass(frozen=True)
class SampleClock:
    """The even clock of a log: record i was sampled at start + interval * slots[i].

    max_deviation, rms: s, the distance of the stamps from it. counted: the records were counted
    because their stamps scatter beyond half a sample. fitted: start and interval of least squares,
    not rounded to decimals.
    """

    start: float
    interval: float
    slots: Index
    max_deviation: float
    rms: float
    counted: bool = False
    fitted: tuple[float, float] | None = None

    @property
    def count(self) -> int:
        """Samples from the first to the last, the missing ones counted."""
        return int(self.slots[-1]) + 1

    def times(self) -> FloatArray:
        """Return the even times (count,), s."""
        return self.start + self.interval * np.arange(self.count, dtype=float)


def fit_line(
    zero: float, x: FloatArray, index: Index | None, offset: float, interval: float
) -> SampleClock:
    """Fit start and interval to x (n,), s after `zero`, by least squares; slot 0 is the first.

    index: (n,) slots after `offset` (s), near the line of this interval; None counts the records.
    """
    if index is None:
        slots, (k, mean_k, kk) = np.arange(len(x)), _counted(len(x))
    else:
        slots = index - index[0]
        offset += float(index[0]) * interval
        mean_k = float(slots.mean())
        k = slots - mean_k
        kk = float(k @ k)
    rest = x - (offset + interval * mean_k)
    rest -= interval * k
    mean_rest = float(rest.mean())
    rest -= mean_rest
    slope = float(k @ rest) / kk
    interval += slope
    offset += mean_rest - slope * mean_k
    rest -= slope * k
    max_deviation = float(max(rest.max(), -rest.min()))
    rms = float(np.sqrt(rest @ rest / len(rest)))
    rounded = decimal(zero, offset, interval, int(slots[-1]))
    return SampleClock(*rounded, slots, max_deviation, rms, fitted=(zero + offset, interval))


@lru_cache(maxsize=2)  # the chunks of a log have one length
def _counted(n: int) -> tuple[FloatArray, float, float]:
    """Return the numbers of n records less their mean, the mean, and the sum of the squares."""
    mean = 0.5 * (n - 1)
    return np.arange(n, dtype=float) - mean, mean, n * (n * n - 1) / 12.0


def decimal(zero: float, offset: float, interval: float, slots: int) -> tuple[float, float]:
    """Return start and interval of a line of `slots` intervals, in decimals where as good."""
    # Decimal numbers where they are as good: 0.01 s, not 0.010000000000000002 s.
    rounded = float(f"{interval:.10g}")
    if abs(rounded - interval) * slots < 1e-9 * interval:
        interval = rounded
    start = float(np.round(zero + offset, 9))
    if abs(start - zero - offset) > 1e-9 * interval:
        start = zero + offset
    return start, float(interval)
