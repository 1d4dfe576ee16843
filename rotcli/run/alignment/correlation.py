"""The shift at which gyro rate and table rate correlate best, over all shifts by the FFT."""

import numpy as np
from numpy.typing import NDArray

from rotcli.run.alignment.series import MIN_BLOCKS, Series

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

_TIE = 2e-3  # of correlation: of shifts within it (an oscillation) the smallest is taken
_MIN_OVERLAP = 1.0 / 3.0  # of the log, that both series share at a shift


def correlate(series: Series) -> tuple[float, float]:
    """Return the lag (s), in full blocks, at which both rates agree best, and the correlation.

    A negative correlation means the opposite sense. Sums over the shared blocks of all shifts are
    correlations by the FFT.
    """
    table, width = series.table, series.width
    covered = (series.edges[:-1] >= table.time[0]) & (series.edges[1:] <= table.time[-1])
    if np.count_nonzero(covered) < MIN_BLOCKS:
        return 0.0, 0.0
    rate, y = series.rates(0.0), series.measured
    weight = covered.astype(float)
    x = (rate - rate[covered].mean()) * weight
    y = y - y.mean()
    ones = np.ones_like(y)

    size = 1 << int(2 * len(y) - 1).bit_length()
    of_ones, of_weight, of_x, of_y, of_xx, of_yy = (
        np.fft.rfft(values, size) for values in (ones, weight, x, y, x**2, y**2)
    )

    def lags(a: Spectrum, b: Spectrum) -> Array:
        """Return the sums of a_(k + shift) b_k for shifts from -(n - 1) to n - 1."""
        circular = np.fft.irfft(a * b.conj(), size)
        return np.concatenate([circular[size - len(y) + 1 :], circular[: len(y)]])

    n = np.maximum(lags(of_ones, of_weight), 1.0)
    sy, sx, sxy = lags(of_y, of_weight), lags(of_ones, of_x), lags(of_y, of_x)
    vx = np.maximum(lags(of_ones, of_xx) - sx**2 / n, 0.0)
    vy = np.maximum(lags(of_yy, of_weight) - sy**2 / n, 0.0)
    norm = np.sqrt(vx * vy)
    usable = (n >= _MIN_OVERLAP * len(y)) & (norm > 1e-6 * norm.max())
    correlation = np.where(usable, (sxy - sx * sy / n) / np.maximum(norm, 1e-300), 0.0)
    shifts = np.arange(-(len(y) - 1), len(y))
    best = float(np.abs(correlation).max())
    ties = np.flatnonzero(np.abs(correlation) >= best - _TIE)
    chosen = int(ties[int(np.argmin(np.abs(shifts[ties])))])
    return float(shifts[chosen] * width), float(correlation[chosen])
