"""Find readings that were linearly interpolated to a higher rate, and the rate of the sensor.

Between two readings of the sensor the second difference of the log is zero up to rounding. White
noise of N at the rate f0, interpolated, has the density `N^2 sinc^4(f / f0)`, sampled again at the
rate of the log (Crochiere and Rabiner, Multirate Digital Signal Processing, 1983, section 2.3).
"""

import numpy as np

from rotcli.units import FloatArray

_SAMPLES = 100_000  # that are searched: 25,000 readings at a quarter of the log's rate
_MAX_RATIO = 50  # of the rates
_MIN_PER_PHASE = 100  # second differences, whose mean square then scatters by 15 %
_LARGEST = 0.99  # quantile at which second differences are cut off: spikes
# Mean square of the second differences between readings over that at readings: white noise has 1,
# rounding of the digits less.
_MAX_BETWEEN = 0.2
_ZERO = 3e-4  # of the largest second differences: single precision of 1 g has 1e-4
_SMALL, _MAX_SMALL = 0.05, 0.35  # of the largest, and share: random sizes have a tenth below
_MIN_ZEROS = 0.25  # share of second differences that are zero: rates that differ by 2.7 or more
_ONE_EACH = 1.3  # second differences in a row that are not zero: two each where the grids differ
_MULTIPLE = 1e-6  # of the ratio of the rates: an integer up to rounding
_ALIASES = 8  # of the density that are added: sinc^4 has fallen to 1e-6


def source_rate(readings: FloatArray, interval: float) -> float | None:
    """Return the rate (Hz) of readings (n,) before they were interpolated; None if they were not.

    A rate of which that of the log is a multiple is found behind coarse digits too.
    """
    second = np.abs(np.diff(readings[:_SAMPLES], 2))
    if len(second) < 2 * _MIN_PER_PHASE:
        return None
    scale = float(np.quantile(second, _LARGEST))
    ratio = _integer_ratio(np.minimum(second, scale) ** 2)
    if ratio is not None:
        return 1.0 / (ratio * interval)
    bent = second > _ZERO * scale
    bends = int(np.count_nonzero(bent))
    if not bends or bends > (1.0 - _MIN_ZEROS) * len(bent):
        return None
    if np.count_nonzero(bent & (second < _SMALL * scale)) > _MAX_SMALL * bends:
        return None  # rounding of the digits: their number says nothing
    runs = int(np.count_nonzero(np.diff(bent.astype(np.int8)) == 1)) + int(bent[0])
    each = 1.0 if bends < _ONE_EACH * runs else 2.0
    return float(bends / each / (len(bent) * interval))


def _integer_ratio(square: FloatArray) -> int | None:
    """Return the ratio of the rates from the squares (n,) of second differences.

    One phase of the ratio has them, or two in a row where the readings lie between those of the
    log. Divisors of the ratio look alike: the largest counts.
    """
    found = None
    for ratio in range(2, min(_MAX_RATIO, len(square) // _MIN_PER_PHASE) + 1):
        count = len(square) // ratio
        phases = square[: count * ratio].reshape(count, ratio).mean(axis=0)
        best = int(np.argmax(phases))
        after = (best + 1) % ratio
        before = (best - 1) % ratio
        next_best = after if phases[after] > phases[before] else before
        own = [best] if ratio == 2 else [best, next_best]
        others = np.delete(phases, own)
        if others.max() < _MAX_BETWEEN * phases[best]:
            found = ratio
    return found


def interpolated_shape(frequency: FloatArray, rate: float, interval: float) -> FloatArray:
    """Return the density (k,) of interpolated white noise over that of the noise, at frequencies.

    rate: Hz, of the sensor; interval: s, of the log. Where its rate is a multiple, the triangle
    between two readings has the same samples each time, and its spectrum is that of the samples.
    """
    ratio = 1.0 / (rate * interval)
    if abs(ratio - round(ratio)) < _MULTIPLE:
        x = np.pi * np.maximum(frequency, 1e-9 / interval) * interval
        return np.asarray((np.sin(round(ratio) * x) / (round(ratio) * np.sin(x))) ** 4)
    shape = np.zeros(len(frequency))
    for k in range(-_ALIASES, _ALIASES + 1):
        shape += np.sinc((frequency + k / interval) / rate) ** 4
    return shape
