"""Merge single-axis calibrations about different axes into one gyro matrix.

Each calibration about an axis u gives the column N u and the biases with their covariance. Three
axes that span space give N: one least squares of 12 parameters from 18 values, weighted by the
three covariances. The six that are too many compare the biases of the runs.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.models.sensors import AXIS_COLUMN_NAMES, BIAS_NAMES
from rotcli.models.triad import parameters as p
from rotcli.run.correction import Correction, read_correction
from rotcli.run.findings import Finding
from rotcli.triad.result import ESTIMATED, Estimate, TriadResult
from rotcli.units import DEG_PER_HOUR, PPM, FloatArray

_SPAN = 0.1  # smallest singular value of the three axes; 1 when they are perpendicular
_BIAS_CHI2 = 22.5  # of 6 degrees of freedom: exceeded by chance once in a thousand


@dataclass(frozen=True, eq=False)
class Column:
    """One single-axis calibration: axis (3,), N u and biases (6,), SI, covariance (6, 6)."""

    path: str
    axis: FloatArray
    values: FloatArray
    covariance: FloatArray


def read_column(path: str, doc: Mapping[str, Any]) -> Column:
    """Return the column of a calibration document; raises ResultError."""
    found: Correction = read_correction(path)
    if found.gyro_column is None:
        raise ResultError(f"{path}: has biases but no scale factor; calibrate on a turning table")
    named = [name for name, unit in zip("xyz", np.eye(3), strict=True)
             if np.array_equal(unit, found.axis)]  # fmt: skip
    wanted = (*AXIS_COLUMN_NAMES[named[0] if named else "u"], *BIAS_NAMES)
    covariance = doc.get("covariance")
    order = covariance.get("order") if isinstance(covariance, dict) else None
    matrix = covariance.get("matrix") if isinstance(covariance, dict) else None
    if not isinstance(order, list) or any(name not in order for name in wanted):
        raise ResultError(f"{path}: covariance: lacks {', '.join(wanted)}; run calibrate again")
    try:
        C = np.array(matrix, dtype=float)
        pick = [order.index(name) for name in wanted]
        C = C[np.ix_(pick, pick)]
    except (TypeError, ValueError, IndexError) as fault:
        raise ResultError(
            f"{path}: covariance: not a square matrix; run calibrate again"
        ) from fault
    unit = np.array([PPM] * 3 + [DEG_PER_HOUR] * 3)
    C = C * np.outer(unit, unit)
    if not np.all(np.isfinite(C)) or np.linalg.eigvalsh(0.5 * (C + C.T))[0] <= 0.0:
        raise ResultError(f"{path}: covariance: not positive definite; run calibrate again")
    values = np.concatenate([found.gyro_column, found.gyro_bias])
    return Column(path, found.axis, values, C)


def merge(columns: Sequence[Column]) -> TriadResult:
    """Return the gyro matrix and biases (model `triad`) of three or more columns."""
    axes = np.array([c.axis for c in columns])
    if len(columns) < 3 or np.linalg.svd(axes)[1][2] < _SPAN:
        raise ResultError(
            f"{', '.join(c.path for c in columns)}: the axes do not span space; give calibrations "
            "about three different axes such as x, y and z"
        )
    information, right, squares = np.zeros((12, 12)), np.zeros(12), 0.0
    for c in columns:
        A = np.zeros((6, 12))
        for row in range(3):
            A[row, 3 * row : 3 * row + 3] = c.axis
            A[3 + row, 9 + row] = 1.0
        weight = np.linalg.inv(c.covariance)
        information += A.T @ weight @ A
        right += A.T @ weight @ c.values
        squares += float(c.values @ weight @ c.values)
    covariance = np.linalg.inv(information)
    x = covariance @ right
    chi2, dof = squares - float(x @ right), 6 * len(columns) - 12
    findings = []
    if chi2 > _BIAS_CHI2 * dof / 6.0:
        findings.append(
            Finding(
                "biases-differ",
                f"{columns[0].path}: the biases of the calibrations differ (chi-squared "
                f"{chi2:.3g}, {dof} degrees of freedom). The turn-on bias changed between the "
                "runs; the merged biases are weighted means",
                value=chi2,
                limit=_BIAS_CHI2 * dof / 6.0,
            )
        )
    factor, unit = p.unit_factors()[:12], p.unit_names()[:12]
    sigma = np.sqrt(np.diag(covariance))
    estimates = tuple(
        Estimate(
            p.NAMES[k], float(x[k] / factor[k]), float(sigma[k] / factor[k]), unit[k], ESTIMATED
        )
        for k in range(12)
    )
    scaled = covariance / np.outer(factor, factor)
    details: dict[str, object] = {"merged": [c.path for c in columns], "axes": axes.tolist()}
    return TriadResult(
        "merged", "table", estimates, scaled, [], None, chi2, dof, 1.0,
        "as in the merged calibrations", (), tuple(findings), details, {},
    )  # fmt: skip
