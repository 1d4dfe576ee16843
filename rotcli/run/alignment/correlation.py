"""The shift at which gyro rate and table rate correlate best, over all shifts by the FFT."""

import numpy as np
from numpy.typing import NDArray

from rotcli.run.alignment.series import MIN_BLOCKS, Series
from rotcli.units import FloatArray

Index = NDArray[np.int64]

_TIE = 2e-3  # of correlation: of shifts within it (an oscillation) the smallest is taken
_MIN_OVERLAP = 1.0 / 3.0  # of the log, that both series share at a shift


def correlate(series: Series) -> tuple[float, float]:
    """Return the lag (s), in full blocks, at which both rates agree best, and the correlation.

    A negative correlation means the opposite sense. The table log covers blocks that follow one
    another, so that sums of one rate are differences of its running sums; those of the product,
    over the shared blocks of all shifts, are a correlation by the FFT.
    """
    table, width = series.table, series.width
    first = int(np.searchsorted(series.edges[:-1], table.time[0]))
    stop = int(np.searchsorted(series.edges[1:], table.time[-1], side="right"))
    if stop - first < MIN_BLOCKS:
        return 0.0, 0.0
    x, y = series.rates(0.0)[first:stop], series.measured
    x, y = x - x.mean(), y - y.mean()

    shifts = np.arange(1 - len(y), len(y))  # block k of the table with block k + shift of the gyros
    low, high = np.maximum(first, -shifts), np.minimum(stop, len(y) - shifts)
    shared = np.flatnonzero(high - low >= _MIN_OVERLAP * len(y))
    if not len(shared):
        return 0.0, 0.0
    shifts, low, high = shifts[shared], low[shared], high[shared]
    n = (high - low).astype(float)
    sx, sxx = _sums(x, low - first, high - first)
    sy, syy = _sums(y, low + shifts, high + shifts)
    sxy = _products(x, y, int(np.abs(shifts + first).max()))[shifts + first]
    norm = np.sqrt(np.maximum(sxx - sx**2 / n, 0.0) * np.maximum(syy - sy**2 / n, 0.0))
    usable = norm > 1e-6 * norm.max()
    correlation = np.where(usable, (sxy - sx * sy / n) / np.maximum(norm, 1e-300), 0.0)
    best = float(np.abs(correlation).max())
    ties = np.flatnonzero(np.abs(correlation) >= best - _TIE)
    chosen = int(ties[int(np.argmin(np.abs(shifts[ties])))])
    return float(shifts[chosen] * width), float(correlation[chosen])


def _sums(values: FloatArray, low: Index, high: Index) -> tuple[FloatArray, FloatArray]:
    """Return the sums (k,) of values (n,), and of their squares, from low (k,) to high (k,)."""
    running = np.zeros((2, len(values) + 1))
    np.cumsum(values, out=running[0, 1:])
    np.cumsum(values**2, out=running[1, 1:])
    first, second = running[:, high] - running[:, low]
    return first, second


def _products(x: FloatArray, y: FloatArray, largest: int) -> FloatArray:
    """Return the sums of y_(k + shift) x_k at index shift, -largest to largest: (n,)."""
    size = 1 << int(max(len(x), len(y)) + largest - 1).bit_length()
    return np.asarray(np.fft.irfft(np.fft.rfft(y, size) * np.fft.rfft(x, size).conj(), size))
