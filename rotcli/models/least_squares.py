"""Generalised least squares (GLS) of means, prediction of a bias, chi-squared test of the fit.

A bias is a prediction: the mean slow noise over a window of time, the horizon, is estimated from
the residuals of the fit (kriging). Covariances: `rotcli.models.mean_covariance`.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.numerics.chi_squared import upper_limit
from rotcli.models.numerics.triangular import solve_triangular
from rotcli.units import FloatArray

# Probabilities of the chi-squared test of a fit: outside them the noise figures are contradicted.
LOW_QUANTILE, HIGH_QUANTILE = 0.01, 0.99


@dataclass(frozen=True, eq=False)
class Horizon:
    """Slow noise of the window for which a bias is predicted.

    cross: (k,) covariance of its mean with the k block means; variance: of its mean. Both with
    the constant (span) of the fit's S.
    """

    cross: FloatArray
    variance: float


@dataclass(frozen=True, eq=False)
class GlsFit:
    """Result of generalised least squares `z = A x + noise`, noise of covariance S.

    estimate (p,), covariance (p, p) = (A^T S^-1 A)^-1, residual (k,) = z - A x, chi2 =
    r^T S^-1 r, dof = k - p; factor: lower Cholesky factor (k, k) of S; whitened: L^-1 A.
    The variance of the constant in `covariance` means nothing (S is generalised): use `predict`.
    """

    estimate: FloatArray
    covariance: FloatArray
    residual: FloatArray
    chi2: float
    dof: int
    factor: FloatArray
    whitened: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations (p,) of the estimate; that of a constant means nothing."""
        result: FloatArray = np.sqrt(np.diag(self.covariance))
        return result

    @property
    def gain(self) -> FloatArray:
        """B (p, k) of the estimate x = B z."""
        white_gain = self.covariance @ self.whitened.T
        result: FloatArray = solve_triangular(self.factor, white_gain.T, lower=True, trans="T").T
        return result


@dataclass(frozen=True, eq=False)
class Prediction:
    """Values (r,) and error covariance (r, r) of linear functions of a fit and its bias."""

    value: FloatArray
    covariance: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations (r,)."""
        result: FloatArray = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return result

    def correlation(self, i: int, j: int) -> float:
        """Return the correlation of values i and j."""
        return float(self.covariance[i, j] / (self.sigma[i] * self.sigma[j]))


def cholesky(S: FloatArray) -> FloatArray:
    """Return the lower Cholesky factor of S (k, k); ValueError if it is not positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(S), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise ValueError("the covariance of the means is not positive definite") from None


def fit_gls(
    A: FloatArray, z: FloatArray, S: FloatArray, factor: FloatArray | None = None
) -> GlsFit:
    """Return the generalised least-squares fit of z (k,) on the columns of A (k, p).

    S: (k, k) positive definite; factor: its Cholesky factor, if known. QR of the whitened A.
    Raises ValueError if the columns of A are linearly dependent or S is not positive definite.
    Two means and the columns [1 1], [0 w] give the plain difference over w.
    """
    k, p = A.shape
    factor = cholesky(S) if factor is None else factor
    whitened = solve_triangular(factor, A, lower=True)
    q, r = np.linalg.qr(whitened)
    diagonal = np.abs(np.diag(r))
    norms = np.linalg.norm(whitened, axis=0)
    if k < p or np.any(diagonal <= 1e-10 * norms):  # rounding of double precision, times 1e5
        raise ValueError("the columns of the design are linearly dependent")
    white_z = solve_triangular(factor, z, lower=True)
    estimate = solve_triangular(r, q.T @ white_z)
    inverse = solve_triangular(r, np.eye(p))
    white_residual = white_z - whitened @ estimate
    return GlsFit(
        estimate=estimate,
        covariance=inverse @ inverse.T,
        residual=z - A @ estimate,
        chi2=float(white_residual @ white_residual),
        dof=k - p,
        factor=factor,
        whitened=whitened,
    )


def predict(
    fit: GlsFit, P: FloatArray, bias_weight: FloatArray, horizon: Horizon | None = None
) -> Prediction:
    """Return `P x + e G (z - A x)` and its error covariance; G = s_h^T S^-1.

    P: (r, p), rows of parameters or of curve values; bias_weight e: (r,), the weight of the
    constant in each row (1 for a bias, 0 for a slope): the horizon's slow noise enters with it.
    Without a horizon only rows with e = 0 have a meaning.
    """
    e = np.asarray(bias_weight, dtype=float)
    if horizon is None:
        if np.any(e):
            raise ValueError("a bias needs a horizon")
        return Prediction(P @ fit.estimate, P @ fit.covariance @ P.T)
    white_cross = solve_triangular(fit.factor, horizon.cross, lower=True)
    white_residual = solve_triangular(fit.factor, fit.residual, lower=True)
    kriged = float(white_cross @ white_residual)
    remaining = horizon.variance - float(white_cross @ white_cross)
    D = P - np.outer(e, white_cross @ fit.whitened)
    covariance = D @ fit.covariance @ D.T + np.outer(e, e) * remaining
    return Prediction(P @ fit.estimate + e * kriged, covariance)


@dataclass(frozen=True)
class Goodness:
    """Chi-squared test of a fit: statistic, degrees of freedom, limits, factor for all sigmas."""

    chi2: float
    dof: int
    low: float
    high: float
    sigma_factor: float

    @property
    def noise_too_small(self) -> bool:
        """Whether the data scatter more than the noise figures allow (99 % quantile)."""
        return self.sigma_factor > 1.0

    @property
    def noise_too_large(self) -> bool:
        """Whether the data scatter less than the noise figures imply (1 % quantile)."""
        return self.dof > 0 and self.chi2 < self.low


def goodness(chi2: float, dof: int) -> Goodness:
    """Return the test of chi2 on dof degrees of freedom.

    Above the 99 % quantile all sigmas are to be multiplied by sqrt(chi2/dof); they are never
    reduced. Without degrees of freedom nothing is tested and the factor is 1.
    """
    if dof < 1:
        return Goodness(chi2, dof, 0.0, float("inf"), 1.0)
    low, high = upper_limit(dof, 1.0 - LOW_QUANTILE), upper_limit(dof, 1.0 - HIGH_QUANTILE)
    factor = float(np.sqrt(chi2 / dof)) if chi2 > high else 1.0
    return Goodness(chi2, dof, low, high, factor)
