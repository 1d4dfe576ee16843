"""Goodness of fit of an Allan variance curve: chi-squared with the covariance of the curve."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rotcli.allan.fit.model import curve_covariance, noise_type, slopes
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    from scipy import special

Factors = NDArray[np.int64]

_MIN_GOODNESS_DOF = 60.0  # degrees of freedom from which a variance is nearly normal
_SPACING = 1.9  # ratio of cluster times that hardly share their information


@dataclass(frozen=True)
class Goodness:
    """Comparison of curve and model at cluster times a factor of two apart.

    chi2, dof, p_value: with the covariance of the curve. largest, largest_tau: deviation of the
    curve from the model, relative, and its cluster time (s); largest_sigma: in sigmas.
    tau: cluster times (s) that the coefficients rest on.
    """

    chi2: float
    dof: int
    p_value: float
    largest: float
    largest_tau: float
    largest_sigma: float
    tau: tuple[float, ...]


def goodness_of_fit(
    factors: Factors,
    interval: float,
    variance: FloatArray,
    matrix: FloatArray,
    squares: FloatArray,
    degrees_of_freedom: Callable[[Factors, NDArray[np.int64]], FloatArray],
    markov_time: float | None,
) -> Goodness | None:
    """Compare a curve (k,) with its model; None if too few points have enough freedom.

    matrix (k, p), squares (p,): terms and coefficients of the fit. degrees_of_freedom: of cluster
    lengths and their noise types.
    """
    tau = np.asarray(factors * interval, dtype=float)
    model = matrix @ squares
    types = noise_type(slopes(tau, squares, markov_time))
    freedom = degrees_of_freedom(factors, types)
    spread = model * np.sqrt(2.0 / freedom)
    known = np.flatnonzero(freedom >= _MIN_GOODNESS_DOF)
    chosen: list[int] = []
    for k in known:  # neighbours share their samples: a factor of two apart they hardly do
        if not chosen or factors[k] >= _SPACING * factors[chosen[-1]]:
            chosen.append(int(k))
    dof = len(chosen) - int(np.sum(squares > 0.0))
    if dof < 1:
        return None
    index = np.array(chosen)
    covariance = curve_covariance(factors, interval, squares, spread, markov_time)
    # The fit's weights are not those of the chosen points; the smallest chi2 of its terms counts.
    root = np.linalg.cholesky(covariance[np.ix_(index, index)])
    whitened = np.linalg.solve(root, variance[index])
    design = np.linalg.solve(root, matrix[np.ix_(index, np.flatnonzero(squares > 0.0))])
    coefficients = np.linalg.lstsq(design / np.linalg.norm(design, axis=0), whitened, rcond=None)[0]
    residual = whitened - design / np.linalg.norm(design, axis=0) @ coefficients
    chi2 = float(residual @ residual)
    sigmas = (variance - model)[known] / spread[known]
    worst = int(np.argmax(np.abs(sigmas)))
    place = int(known[worst])
    return Goodness(
        chi2=chi2,
        dof=dof,
        p_value=float(special.gammaincc(0.5 * dof, 0.5 * chi2)),
        largest=float(np.sqrt(max(variance[place], 0.0) / model[place]) - 1.0),
        largest_tau=float(tau[place]),
        largest_sigma=float(sigmas[worst]),
        tau=tuple(tau.tolist()),
    )
