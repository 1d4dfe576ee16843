"""Generalised least squares of segment means: axis column and biases of a gyro triad.

Turning at rate w about the unit axis u, a gyro triad reads `w_is + w N u + d`. Means over all
segments, still and turning at any rates and signs, have the covariance of white noise, flicker
noise, random walk and a Gauss-Markov process that were running before the log
(`rotcli.models.mean_covariance`). The bias is a prediction of its mean over the horizon.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import (
    GlsFit,
    fit_gls,
    predict,
)
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class TriadFit:
    """Result: values (6,), covariance (6, 6): axis column, then biases of the horizon.

    own_sigma: (3,) sigma of the biases as means over the segments themselves. fits: per gyro.
    """

    values: FloatArray
    covariance: FloatArray
    own_sigma: FloatArray
    fits: tuple[GlsFit, ...]


def fit_triad(
    means: SegmentMeans,
    noise: TriadNoise,
    u: FloatArray,
    horizon: tuple[float, float],
    *,
    own_span: bool = True,
) -> TriadFit:
    """Return the generalised least-squares fit of the means; horizon: start and end, s.

    own_span: whether own_sigma is wanted; else it is zero.
    Raises ValueError if the rates cannot separate bias from scale factor.
    """
    values, covariance, own = np.zeros(6), np.zeros((6, 6)), np.zeros(3)
    fits = []
    e = np.array([0.0, 1.0])
    for i in range(3):
        interval_noise = noise.of(means, i)
        S = _regular(noise.covariance(means, i, u))
        fit = fit_gls(means.design, means.z[:, i], S)
        window = interval_noise.horizon(*horizon)
        P = np.eye(2, len(fit.estimate))
        prediction = predict(fit, P, e, window)
        pair = np.ix_([i, 3 + i], [i, 3 + i])
        values[[i, 3 + i]], covariance[pair] = prediction.value, prediction.covariance
        if own_span:
            own[i] = predict(fit, P, e, interval_noise.own_span()).sigma[1]
        fits.append(fit)
    return TriadFit(values, covariance, own, tuple(fits))


def _regular(S: FloatArray) -> FloatArray:
    """Return a covariance that can be factored: of a simulation without noise it is zero."""
    scale = float(np.abs(S).max())
    floor = 1e-12 * scale if scale else 1.0
    result: FloatArray = S + floor * np.eye(len(S))
    return result
