"""The variance of a segment's mean table rate, by the weights that windows give the gyros."""

import numpy as np
import pytest

from rotcli.calibrate.table_rate import _variance

T, SIGMA, WHITE, INTERVAL = 60.0, 2e-4, 3e-4, 0.05


@pytest.mark.parametrize("window", [0.0, 6.0, 15.0])
def test_the_variance_is_that_of_the_weights(window):
    # Mean over the last window less mean over the first one, of an integrated gyro.
    time = (np.arange(60_000) + 0.5) * T / 60_000
    if window:
        rising = np.minimum(time / window, 1.0) * np.minimum((T - time) / window, 1.0)
        weights = np.minimum(rising, 1.0) / (T - window)
    else:
        weights = np.full(60_000, 1.0 / T)
    assert weights.sum() * T / 60_000 == pytest.approx(1.0, rel=1e-6)
    gyro = WHITE**2 * ((weights**2).sum() * T / 60_000 - 1.0 / T)  # that of the plain mean is known
    each = SIGMA**2 / max(1.0, window / INTERVAL)
    expected = 2.0 * each / (T - window) ** 2 + gyro
    assert _variance(T, window, SIGMA, WHITE, INTERVAL) == pytest.approx(
        expected, rel=1e-5, abs=0.0
    )
