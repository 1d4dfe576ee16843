"""One-sided clipping: readings that pile up on their largest or smallest value."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

# Readings on the extreme value that noise does not have: its distribution falls towards its ends,
# so that the extreme digit of a quantised log is rarer than the one before it.
_MIN_COUNT = 20
_MIN_RATIO = 3.0  # to the readings on the next value
MAX_SHARE = 1e-3  # of the readings; of more, the white noise is too small by a sigma of an hour


@dataclass(frozen=True)
class Clipping:
    """Value (unit of the readings) at which readings are clipped, and their share of all."""

    value: float
    share: float


def find_clipping(readings: FloatArray) -> Clipping | None:
    """Return the clipping of readings (n,), None if there is none.

    >>> find_clipping(np.minimum(np.random.default_rng(0).standard_normal(10_000), 1.5)).value
    1.5
    """
    found: Clipping | None = None
    for extreme, beyond in ((readings.max(), np.max), (readings.min(), np.min)):
        count = int(np.count_nonzero(readings == extreme))
        if count < _MIN_COUNT or count == len(readings):
            continue
        following = beyond(readings[readings != extreme])
        if count < _MIN_RATIO * np.count_nonzero(readings == following):
            continue
        if found is None or count / len(readings) > found.share:
            found = Clipping(float(extreme), count / len(readings))
    return found
