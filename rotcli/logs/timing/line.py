"""The even clock of a log as a straight line through its time stamps."""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

Index = NDArray[np.int64]


@dataclass(frozen=True)
class SampleClock:
    """The even clock of a log: record i was sampled at start + interval * slots[i].

    max_deviation, rms: s, the distance of the stamps from it. counted: the records were counted
    because their stamps scatter beyond half a sample.
    """

    start: float
    interval: float
    slots: Index
    max_deviation: float
    rms: float
    counted: bool = False

    @property
    def count(self) -> int:
        """Samples from the first to the last, the missing ones counted."""
        return int(self.slots[-1]) + 1

    def times(self) -> FloatArray:
        """Return the even times (count,), s."""
        return self.start + self.interval * np.arange(self.count, dtype=float)


def fit_line(
    zero: float, x: FloatArray, index: Index, offset: float, interval: float
) -> SampleClock:
    """Fit start and interval to x (n,), s after `zero`, by least squares; slot 0 is the first."""
    slots = index - index[0] if index[0] else index
    k = slots.astype(float)
    offset += float(index[0]) * interval
    rest = x - offset
    rest -= interval * k
    mean_k, mean_rest = k.mean(), rest.mean()
    k -= mean_k
    slope = float(k @ rest) / float(k @ k)
    interval += slope
    offset += mean_rest - slope * mean_k
    rest -= mean_rest
    rest -= slope * k
    max_deviation = float(max(rest.max(), -rest.min()))
    start, interval = decimal(zero, offset, interval, int(slots[-1]))
    rms = float(np.sqrt(rest @ rest / len(rest)))
    return SampleClock(start, interval, slots, max_deviation, rms)


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
