"""Estimate all parameters of the full calibration by Gauss-Newton least squares with QR.

The first pass makes the Jacobian and its triangular factor. When the step is small, the
following passes only make new residuals and keep that factor; otherwise the Jacobian is made
again. Residuals and goodness are those before the last step, which is below 1e-3 sigma.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import KIND_NAMES, Blocks, expected_means
from rotcli.models.triad.information import CHUNK_BLOCKS, Problem, prior_rows, scaled_rows
from rotcli.models.triad.leastsquares import Rank, TriangularSum, covariance_of, rank_of
from rotcli.triad.drift import KEPT_BLOCKS, Drift, Whitening
from rotcli.units import FloatArray

MAX_PASSES = 8  # four suffice from scale errors of 24 % and 2 deg of tilt
CONVERGED = 1e-3  # sigma; a smaller step changes no digit of a result
FROZEN_STEP = 10.0  # typical sizes (1 %): below it the Jacobian of the first pass serves
MAX_STEP = 500.0  # typical sizes; twice the scale error of raw counts scaled by guess
SCALE_SIGNIFICANCE = 4.0  # standard deviations of chi2/dof above 1 before sigmas are scaled


@dataclass(frozen=True, eq=False)
class KindGoodness:
    """Chi-squared of the blocks of one kind: rows, sums of gyros and accelerometers per row."""

    kind: str
    blocks: int
    gyro: float
    accel: float


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of the least squares.

    x (p,) all parameters, SI; covariance (p_free, p_free) of the free ones, SI, scaled by `scale`
    squared; residuals (6, m) of the block means; chi2 and dof of the data with priors; rank of
    the data without priors; drift: whether slow noise of the biases took part. rows: of each
    piece of the whitening, the whitened rows (6, n, p_free) of the last Jacobian, None of a long
    log; innovations: (6, m) whitened residuals, of variance one.
    """

    problem: Problem
    x: FloatArray
    covariance: FloatArray
    residuals: FloatArray
    chi2: float
    dof: int
    scale: float
    passes: int
    rank: Rank
    kinds: list[KindGoodness]
    drift: bool
    converged: bool
    rows: list[FloatArray] | None
    innovations: FloatArray
    whitening: Whitening

    @property
    def sigma(self) -> FloatArray:
        """Sigmas (p,) of all parameters, SI; zero where a parameter was not free."""
        sigma = np.zeros(len(self.x))
        sigma[self.problem.free] = np.sqrt(np.diag(self.covariance))
        return sigma


def estimate(
    problem: Problem, blocks: Blocks, *, drift: Drift | None = None, start: FloatArray | None = None
) -> Fit:
    """Return the estimate from block means; `start` (p,) is zero by default."""
    x = np.zeros(p.count(problem.table.mounting_count)) if start is None else start.copy()
    size, free = problem.size, problem.free
    whitening = Whitening(blocks, problem.sigma_1, drift)
    kept: list[FloatArray] | None = [] if len(blocks) <= KEPT_BLOCKS else None
    data, total = _factor(problem, x, blocks, whitening, kept)
    step = total.solve()
    rank = rank_of(data.R)  # at the start: there no error blurs a null direction
    passes, frozen = 1, bool(np.max(np.abs(step)) < FROZEN_STEP)
    base, residuals, innovations = x.copy(), None, None
    while True:
        step = np.clip(step, -MAX_STEP, MAX_STEP)
        x[free] += step * size
        sigma = np.sqrt(np.diag(covariance_of(total.R)))
        converged = bool(np.max(np.abs(step) / sigma) < CONVERGED)
        if converged or passes >= MAX_PASSES:
            break
        passes += 1
        if frozen:
            gradient, residuals, innovations = _gradient(problem, x, base, blocks, whitening, kept)
            step = np.linalg.solve(total.R, np.linalg.solve(total.R.T, gradient))
        else:
            _, total = _factor(problem, x, blocks, whitening, kept)
            step, base, residuals = total.solve(), x.copy(), None
            frozen = bool(np.max(np.abs(step)) < FROZEN_STEP)
    if residuals is None or innovations is None or not converged:
        _, residuals, innovations = _gradient(problem, x, base, blocks, whitening, kept)
    chi2, dof, scale = _goodness(problem, x, innovations)
    covariance = covariance_of(total.R) * np.outer(size, size) * scale**2
    return Fit(
        problem, x, covariance, residuals, chi2, dof, scale, passes, rank,
        _by_kind(blocks, innovations**2), drift is not None, converged, kept, innovations,
        whitening,
    )  # fmt: skip


def _factor(
    problem: Problem,
    x: FloatArray,
    blocks: Blocks,
    whitening: Whitening,
    kept: list[FloatArray] | None,
) -> tuple[TriangularSum, TriangularSum]:
    """Return the triangular factors of the data alone and of data and priors.

    kept: receives the whitened rows of all pieces, unless it is None.
    """
    count = len(problem.free)
    total, whitened = TriangularSum(count), whitening.begin()
    if kept is not None:
        kept.clear()
    for which in whitening.chunks(CHUNK_BLOCKS):
        chunk = blocks.part(which)
        left = chunk.means - expected_means(problem.table, x, chunk)
        joined = np.concatenate([scaled_rows(problem, x, chunk), left[:, :, None]], axis=2)
        joined = whitened.rows(which, joined)
        total.add_joined(joined.reshape(-1, count + 1))
        if kept is not None:
            kept.append(joined[:, :, :-1])
    data = total.copy()
    total.add(*prior_rows(problem, x))
    return data, total


def _gradient(
    problem: Problem,
    x: FloatArray,
    base: FloatArray,
    blocks: Blocks,
    whitening: Whitening,
    kept: list[FloatArray] | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the gradient (p_free,), residuals and whitened residuals (6, m) at x.

    The gradient is that of the Jacobian at `base`, whose whitened rows are `kept`.
    """
    gradient, whitened = np.zeros(len(problem.free)), whitening.begin()
    residuals, innovations = [], []
    for k, which in enumerate(whitening.chunks(CHUNK_BLOCKS)):
        chunk = blocks.part(which)
        left = chunk.means - expected_means(problem.table, x, chunk)
        if kept is None:
            joined = np.concatenate([scaled_rows(problem, base, chunk), left[:, :, None]], axis=2)
            joined = whitened.rows(which, joined)
            rows, white = joined[:, :, :-1], joined[:, :, -1].copy()
        else:
            rows, white = kept[k], whitened.rows(which, left[:, :, None])[:, :, 0]
        gradient += np.einsum("cn,cnp->p", white, rows, optimize=True)
        residuals.append(left)
        innovations.append(white)
    prior, prior_left = prior_rows(problem, x)
    gradient += prior.T @ prior_left
    return gradient, np.concatenate(residuals, axis=1), np.concatenate(innovations, axis=1)


def _goodness(problem: Problem, x: FloatArray, innovations: FloatArray) -> tuple[float, int, float]:
    """Return chi2, degrees of freedom, and the factor of the sigmas."""
    prior, left = prior_rows(problem, x)
    chi2 = float(np.sum(innovations**2) + left @ left)
    dof = innovations.size + len(prior) - len(problem.free)
    ratio = chi2 / max(dof, 1)
    significant = ratio > 1.0 + SCALE_SIGNIFICANCE * np.sqrt(2.0 / max(dof, 1))
    return chi2, dof, float(np.sqrt(ratio)) if significant else 1.0


def _by_kind(blocks: Blocks, squares: FloatArray) -> list[KindGoodness]:
    """Return the chi-squared per row of still, turning and ramping blocks."""
    found = []
    for kind, name in enumerate(KIND_NAMES):
        at = blocks.kind == kind
        count = int(at.sum())
        if count:
            gyro, accel = (float(squares[rows][:, at].mean()) for rows in (slice(3), slice(3, 6)))
            found.append(KindGoodness(name, count, gyro, accel))
    return found
