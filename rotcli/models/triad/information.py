"""Information of blocks about the parameters: weighted Jacobian rows, covariance by design.

Columns are scaled by typical sizes, so that ranks do not depend on units.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import Blocks
from rotcli.models.triad.jacobian import jacobian
from rotcli.models.triad.kinematics import Table
from rotcli.models.triad.leastsquares import TriangularSum, covariance_of
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]

CHUNK_BLOCKS = 2048  # blocks per chunk of Jacobian rows: 5 MB at 54 parameters


@dataclass(frozen=True, eq=False)
class Problem:
    """What the estimate knows: table, free parameters, priors, noise.

    free: indices of the parameters estimated; prior_sigma: (p,) of all parameters, SI, infinite
    where there is none; sigma_1: (6,) white noise of one sample, rad/s and m/s^2.
    """

    table: Table
    free: IntArray
    prior_sigma: FloatArray
    sigma_1: FloatArray

    @property
    def size(self) -> FloatArray:
        """Typical sizes of the free parameters."""
        return p.typical_sizes(self.table.mounting_count)[self.free]


def scaled_rows(problem: Problem, x: FloatArray, blocks: Blocks) -> FloatArray:
    """Return the rows (6, m, p_free) of the Jacobian at the middle of each block.

    In SI units per typical size of the parameters.
    """
    J = jacobian(
        problem.table,
        x,
        blocks.angles[:, 0],
        blocks.rates[:, 0],
        blocks.accelerations[:, 0],
        blocks.mounting,
    )
    rows: FloatArray = J[:, problem.free].transpose(0, 2, 1) * problem.size
    return rows


def weighted_rows(problem: Problem, x: FloatArray, blocks: Blocks) -> FloatArray:
    """Return `scaled_rows` divided by the white noise of each block mean."""
    weight = np.sqrt(blocks.count) / problem.sigma_1[:, None]
    return scaled_rows(problem, x, blocks) * weight[:, :, None]


def prior_rows(problem: Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return scaled rows (q, p_free) and right-hand side (q,) of the priors around zero."""
    sigma = problem.prior_sigma[problem.free]
    known = np.flatnonzero(np.isfinite(sigma))
    rows = np.zeros((len(known), len(problem.free)))
    rows[np.arange(len(known)), known] = problem.size[known] / sigma[known]
    return rows, -x[problem.free][known] / sigma[known]


def information_factor(problem: Problem, x: FloatArray, blocks: Blocks) -> TriangularSum:
    """Return the triangular factor of the data alone, without priors."""
    total = TriangularSum(len(problem.free))
    for chunk in blocks.chunks(CHUNK_BLOCKS):
        rows = weighted_rows(problem, x, chunk).reshape(-1, len(problem.free))
        total.add(rows, np.zeros(len(rows)))
    return total


def design_covariance(problem: Problem, blocks: Blocks) -> FloatArray:
    """Return the covariance (p_free, p_free), SI, that a perfect sensor on these blocks gives."""
    x = np.zeros(p.count(problem.table.mounting_count))
    total = information_factor(problem, x, blocks)
    total.add(*prior_rows(problem, x))
    return np.asarray(covariance_of(total.R) * np.outer(problem.size, problem.size))
