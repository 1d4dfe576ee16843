"""Median, quantiles and levels by partition or sorting, faster than numpy's own functions.

These also import its masked arrays, which takes a twentieth of the time of a short command.
"""

import numpy as np

from rotcli.units import FloatArray


def median(values: FloatArray) -> float:
    """Return the median of finite values (n,), n > 0, as `numpy.median`.

    >>> median(np.array([3.0, 1.0, 2.0])), median(np.array([4.0, 1.0]))
    (2.0, 2.5)
    """
    middle = len(values) // 2
    parted = np.partition(values, middle)
    high = parted[middle]
    low = high if len(values) % 2 else parted[:middle].max()
    return float(0.5 * (low + high))


def medians(values: FloatArray, axis: int) -> FloatArray:
    """Return the medians of finite values along an axis, which keeps one entry.

    >>> medians(np.array([[3.0, 1.0, 2.0], [4.0, 0.0, 8.0]]), axis=1).tolist()
    [[2.0], [4.0]]
    """
    n = values.shape[axis]
    middle = np.sort(values, axis=axis).take([(n - 1) // 2, n // 2], axis=axis)
    return np.asarray(0.5 * middle.sum(axis=axis, keepdims=True))


def quantile(values: FloatArray, share: float) -> float:
    """Return the value below which a share (0 to 1) of finite values (n,), n > 0, lies.

    Linear between two of them, as `numpy.quantile`.

    >>> quantile(np.array([3.0, 1.0, 2.0]), 0.75)
    2.5
    """
    place = share * (len(values) - 1)
    below = int(place)
    parted = np.partition(values, below)
    low = parted[below]
    high = parted[below + 1 :].min() if below + 1 < len(parted) else low
    part = place - below
    step = high - low
    return float(low + step * part if part < 0.5 else high - step * (1.0 - part))


def distinct(values: FloatArray) -> FloatArray:
    """Return the distinct values (k,) of finite values (n,), n > 0, in order, as `numpy.unique`.

    >>> distinct(np.array([3.0, 1.0, 3.0])).tolist()
    [1.0, 3.0]
    """
    ordered = np.sort(values)
    return np.asarray(ordered[np.append(True, ordered[1:] != ordered[:-1])])
