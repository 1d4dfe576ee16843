"""Estimate all parameters of the full calibration by Gauss-Newton least squares with QR.

The first pass makes the Jacobian and its triangular factor. When the step is small, the
following passes only make new residuals and keep that factor; otherwise the Jacobian is made
again. Residuals, goodness and sigma use the last parameters.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import KIND_NAMES, Blocks, expected_means
from rotcli.models.triad.information import CHUNK_BLOCKS, Problem, prior_rows, weighted_rows
from rotcli.models.triad.leastsquares import Rank, TriangularSum, covariance_of, rank_of
from rotcli.triad.drift import Drift, eliminate, smoothed

FloatArray = NDArray[np.float64]

MAX_PASSES = 8  # four suffice from scale errors of 24 % and 2 deg of tilt
CONVERGED = 1e-3  # sigma; a smaller step changes no digit of a result
KEPT_BLOCKS = 20_000  # their Jacobian rows (50 MB) stay in memory between passes
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
    squared; residuals (6, m) of the block means, without drift; chi2 and dof of the data with
    priors; rank of the data without priors; drift: whether bias nodes took part.
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
    kept: list[FloatArray] | None = [] if len(blocks) <= KEPT_BLOCKS else None
    data, total = _factor(problem, x, blocks, drift, kept)
    step = total.solve()
    rank = rank_of(data.R)  # at the start: there no error blurs a null direction
    passes, frozen = 1, bool(np.max(np.abs(step)) < FROZEN_STEP)
    base = x.copy()
    while True:
        step = np.clip(step, -MAX_STEP, MAX_STEP)
        x[free] += step * size
        sigma = np.sqrt(np.diag(covariance_of(total.R)))
        if np.max(np.abs(step) / sigma) < CONVERGED or passes >= MAX_PASSES:
            break
        passes += 1
        if frozen:
            step = _frozen_step(problem, x, base, blocks, drift, total.R, kept)
        else:
            _, total = _factor(problem, x, blocks, drift, kept)
            step = total.solve()
            base = x.copy()
            frozen = bool(np.max(np.abs(step)) < FROZEN_STEP)
    found = _finish(problem, x, blocks, drift, rank, total, passes)
    return replace(found, converged=bool(np.max(np.abs(step) / sigma) < CONVERGED))


def _weight(problem: Problem, blocks: Blocks) -> FloatArray:
    """Return 1 / sigma (6, m) of each block mean."""
    return np.asarray(np.sqrt(blocks.count) / problem.sigma_1[:, None])


def _factor(
    problem: Problem,
    x: FloatArray,
    blocks: Blocks,
    drift: Drift | None,
    kept: list[FloatArray] | None,
) -> tuple[TriangularSum, TriangularSum]:
    """Return the triangular factors of the data alone and of data and priors.

    kept: receives the weighted rows of all chunks, unless it is None or bias nodes take part.
    """
    count = len(problem.free)
    total = TriangularSum(count)
    if kept is not None:
        kept.clear()
    if drift is None:
        for chunk in blocks.chunks(CHUNK_BLOCKS):
            rows = weighted_rows(problem, x, chunk)
            r = (chunk.means - expected_means(problem.table, x, chunk)) * _weight(problem, chunk)
            total.add(rows.reshape(-1, count), r.ravel())
            if kept is not None:
                kept.append(rows)
    else:
        weight = _weight(problem, blocks)
        r = _residuals(problem, x, blocks) * weight
        for channel, rows in _channels(problem, x, blocks, kept):
            joined = np.concatenate([rows, r[channel][:, None]], axis=1)
            joined = eliminate(drift, channel, blocks.time, weight[channel], joined)
            total.add(joined[:, :-1], joined[:, -1])
        total.rows = 6 * len(blocks)
    data = total.copy()
    total.add(*prior_rows(problem, x))
    return data, total


def _channels(
    problem: Problem, x: FloatArray, blocks: Blocks, kept: list[FloatArray] | None
) -> Iterator[tuple[int, FloatArray]]:
    """Yield the weighted rows (m, p_free) of each channel; a long log is worked on in chunks."""
    if kept is not None:
        kept.extend(weighted_rows(problem, x, chunk) for chunk in blocks.chunks(CHUNK_BLOCKS))
    for channel in range(6):
        parts = (
            kept
            if kept is not None
            else (weighted_rows(problem, x, chunk) for chunk in blocks.chunks(CHUNK_BLOCKS))
        )
        yield channel, np.concatenate([rows[channel] for rows in parts])


def _residuals(problem: Problem, x: FloatArray, blocks: Blocks) -> FloatArray:
    """Return means less the model (6, m)."""
    parts = [c.means - expected_means(problem.table, x, c) for c in blocks.chunks(CHUNK_BLOCKS)]
    return np.concatenate(parts, axis=1)


def _without_drift(
    drift: Drift | None, time: FloatArray, weight: FloatArray, residuals: FloatArray
) -> FloatArray:
    """Return residuals (6, m) less the drift of each channel that explains them best."""
    if drift is None:
        return residuals
    parts = [smoothed(drift, c, time, weight[c], residuals[c]) for c in range(6)]
    return np.asarray(residuals - np.array(parts))


def _frozen_step(
    problem: Problem,
    x: FloatArray,
    base: FloatArray,
    blocks: Blocks,
    drift: Drift | None,
    R: FloatArray,
    kept: list[FloatArray] | None,
) -> FloatArray:
    """Return the next step (p_free,) from new residuals and the Jacobian at `base`.

    With drift the inverse covariance of the residuals times them is their weight times what the
    drift does not explain.
    """
    gradient = np.zeros(len(problem.free))
    weight = _weight(problem, blocks)
    left = _residuals(problem, x, blocks)
    left = _without_drift(drift, blocks.time, weight, left) * weight
    done = 0
    for k, chunk in enumerate(blocks.chunks(CHUNK_BLOCKS)):
        rows = kept[k] if kept is not None else weighted_rows(problem, base, chunk)
        part = left[:, done : done + len(chunk)]
        gradient += part.ravel() @ rows.reshape(-1, len(gradient))
        done += len(chunk)
    prior, prior_left = prior_rows(problem, x)
    gradient += prior.T @ prior_left
    return np.asarray(np.linalg.solve(R, np.linalg.solve(R.T, gradient)))


def _finish(
    problem: Problem,
    x: FloatArray,
    blocks: Blocks,
    drift: Drift | None,
    rank: Rank,
    total: TriangularSum,
    passes: int,
) -> Fit:
    """Return the result with its goodness."""
    weight = _weight(problem, blocks)
    residuals = _without_drift(drift, blocks.time, weight, _residuals(problem, x, blocks))
    squares = (residuals * weight) ** 2
    prior, left = prior_rows(problem, x)
    # The nodes have priors of their own sum of squares, which is small against that of all rows.
    chi2 = float(squares.sum() + left @ left)
    dof = squares.size + len(prior) - len(problem.free)
    ratio = chi2 / max(dof, 1)
    significant = ratio > 1.0 + SCALE_SIGNIFICANCE * np.sqrt(2.0 / max(dof, 1))
    scale = float(np.sqrt(ratio)) if significant else 1.0
    size = problem.size
    covariance = covariance_of(total.R) * np.outer(size, size) * scale**2
    return Fit(
        problem, x, covariance, residuals, chi2, dof, scale, passes, rank,
        _by_kind(blocks, squares), drift is not None, True,
    )  # fmt: skip


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
