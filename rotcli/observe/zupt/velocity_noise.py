"""Estimate the noise of the zero-velocity measurements from the velocity increments of a log.

A table that vibrates with velocities n_k (white from update to update) gives the increments
`dv_k = n_k - n_(k-1) + w_k`, w the white noise of the accelerometers. The differences
`D_k = dv_k - dv_(k-1)` then have the autocovariance sigma^2 at lag 2 whatever w is, and slow
errors (biases, tilts) cancel. Errors that follow the table angle are removed before.
"""

import numpy as np

from rotcli.observe.zupt.model import Settings
from rotcli.units import FloatArray

UPDATES = 6000  # of the log's start, 10 minutes at 10 Hz: sigma^2 to 1/80 of the white noise
MIN_UPDATES = 50  # fewer give no estimate: the default is used
DEFAULT_SIGMA = 2e-3  # m/s, of the paper's filter
# The estimate is not below this share of the white velocity noise of one update: smaller ones do
# not change the estimates (1 %), and increase the weight of errors of the model.
MIN_SHARE = 0.1
MIN_SIGMA = 1e-5  # m/s: the integration over an update is as exact as this
_SIGNIFICANT = 2.0  # sigmas of the estimate that are subtracted: noise is no vibration
_OUTLIERS = 6.0  # robust sigmas of the differences: a touched table is not its vibration


def velocity_sigma(dv_n: FloatArray, theta: FloatArray, settings: Settings, tau: float) -> float:
    """Return the sigma (m/s) of zero-velocity measurements.

    dv_n: (n, 3) m/s, increments in n; theta: (n + 1,) rad, the table angle at the updates; tau: s.
    """
    if len(dv_n) < MIN_UPDATES:
        return DEFAULT_SIGMA
    dv_n, theta = dv_n[:UPDATES], theta[: UPDATES + 1]
    residual = _without_table_angle(dv_n, theta, tau)
    D = np.diff(residual, axis=0)
    scale = 1.4826 * np.median(np.abs(D), axis=0)
    usual = np.asarray((np.abs(D) <= _OUTLIERS * scale).all(axis=1))
    pairs = usual[2:] & usual[:-2]
    squares = (D[2:] * D[:-2])[pairs]
    white = settings.noise.velocity_random_walk * np.sqrt(tau)
    smallest = max(MIN_SHARE * white, MIN_SIGMA)
    if not len(squares):
        return DEFAULT_SIGMA
    # Products of neighbours are correlated: their mean scatters by up to 1.5 times as much.
    scatter = 1.5 * float(squares.std()) / np.sqrt(squares.size)
    variance = float(squares.mean()) - _SIGNIFICANT * scatter
    return float(max(np.sqrt(max(variance, 0.0)), smallest))


def _without_table_angle(dv_n: FloatArray, theta: FloatArray, tau: float) -> FloatArray:
    """Return dv_n without its part that depends on the table's angle and rate.

    Biases are constant or of once per turn in n, scale factor errors of twice, a lever arm
    acts with the square of the rate.
    """
    angle, rate = 0.5 * (theta[1:] + theta[:-1]), np.diff(theta) / tau
    one, c, s = np.ones(len(angle)), np.cos(angle), np.sin(angle)
    square = rate * rate
    columns = [one, c, s, c * c, c * s, square, square * c, square * s]
    A = np.stack(columns, axis=1)
    scale = np.sqrt((A * A).sum(axis=0))
    A = A[:, scale > 0.0] / scale[scale > 0.0]
    coefficients = np.linalg.lstsq(A, dv_n, rcond=1e-9)[0]
    result: FloatArray = dv_n - A @ coefficients
    return result
