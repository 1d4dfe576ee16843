"""Models of the error curve over the normalised rate x = w / w_FS and their columns.

Coefficients have the unit rad/s at full scale; divided by w_FS they are fractions of full scale.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.models.laboratory.rate_curve import MODELS, TABLE, polynomial_columns
from rotcli.units import FloatArray

__all__ = ["MODELS", "TABLE", "available_models", "group_rates", "polynomial_columns"]


# Rates of the same command: the encoder's mean rate repeats to 0.1 %, at low rates to 0.002 deg/s.
# With a scale error of 1e-3 the difference is worth 0.4 deg/h at 100 deg/s, a tenth of the white
# noise of a minute of a MEMS gyro.
SAME_RATE_RELATIVE = 1e-3
SAME_RATE = np.deg2rad(0.002)  # rad/s
_RANK_TOLERANCE = 1e-6  # of the largest singular value: columns that the rates cannot separate


def group_rates(rate: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the distinct rates (R,), rad/s, ascending, and the group of each block (k,)."""
    order = np.argsort(rate, kind="stable")
    ascending = rate[order]
    tolerance = SAME_RATE + SAME_RATE_RELATIVE * np.abs(ascending[1:])
    number = np.concatenate([[0], np.cumsum(np.diff(ascending) > tolerance)])
    group = np.empty(len(rate), dtype=np.intp)
    group[order] = number
    count = np.bincount(group)
    return np.bincount(group, weights=rate) / count, group


def available_models(rates: FloatArray) -> list[str]:
    """Return the polynomial models whose columns the distinct rates (R,) can separate.

    Even columns need rates of both signs; abs(x) against x^2 needs three magnitudes, so below
    that only abs(x) is tried. At least three distinct rates: with two only the line is there.
    """
    x = rates / np.max(np.abs(rates)) if np.any(rates) else rates
    both_signs = np.any(rates > 0) and np.any(rates < 0)
    magnitudes = len(group_rates(np.abs(rates))[0])
    models = []
    for model, names in MODELS.items():
        even = "abs(x)" in names or "x^2" in names
        if even and not both_signs:
            continue
        if "x^2" in names and magnitudes < 3:
            continue
        A = np.column_stack([np.ones(len(x)), polynomial_columns(model, x)])
        if np.linalg.matrix_rank(A, tol=_RANK_TOLERANCE * np.linalg.norm(A)) == A.shape[1]:
            models.append(model)
    return models
