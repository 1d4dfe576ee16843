"""Residuals on soak temperatures that the fit has not seen, the slow noise kriged."""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import fit_gls
from rotcli.thermal.fit import ThermalFit, design, group_temperatures
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Errors on left-out soaks: temperatures (s,), degC; rms; e^T V^-1 e / n, near 1 when right.

    errors: all prediction errors (n,); blocks: their numbers (n,).
    """

    temperatures: FloatArray
    rms: float
    chi2_per_value: float
    errors: FloatArray
    blocks: NDArray[np.intp]


def leave_one_out(fit: ThermalFit) -> LeaveOneOut | None:
    """Return the errors on every inner soak, predicted from the others.

    None where too few soaks remain for the order.
    """
    problem = fit.problem
    soaks, group = group_temperatures(problem.temperature)
    if len(soaks) - 1 < max(fit.bias_size, fit.scale_size) or len(soaks) < 3:
        return None
    A = design(problem, fit.bias_basis, fit.scale_basis, None, fit.shift)
    S, z = problem.covariance, problem.z
    errors, blocks, chi2, used = [], [], 0.0, []
    for soak in range(1, len(soaks) - 1):
        out = group == soak
        kept = ~out
        try:
            inner = fit_gls(A[kept], z[kept], S[np.ix_(kept, kept)])
        except ValueError:
            continue
        weights = np.linalg.solve(S[np.ix_(kept, kept)], S[np.ix_(kept, out)]).T
        e = z[out] - A[out] @ inner.estimate - weights @ inner.residual
        D = A[out] - weights @ A[kept]
        V = S[np.ix_(out, out)] - weights @ S[np.ix_(kept, out)] + D @ inner.covariance @ D.T
        chi2 += float(e @ np.linalg.solve(V, e))
        errors.append(e)
        blocks.append(np.flatnonzero(out))
        used.append(soaks[soak])
    if not errors:
        return None
    e = np.concatenate(errors)
    return LeaveOneOut(
        np.array(used),
        float(np.sqrt(np.mean(e**2))),
        chi2 / len(e),
        e,
        np.concatenate(blocks),
    )
