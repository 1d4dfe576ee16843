"""Which frame the sensor frame is: table, accelerometer, z-accelerometer, symmetric convention.

On a table the estimate refers to the table's innermost axis (table convention). Where the mounting
is not known, only quantities that do not depend on the frame have a meaning; a convention fixes
the frame by the accelerometers. With I + M = T Q, Q a rotation, v_new = Q v_table:

- accelerometer: T lower triangular, x accelerometer along x, y in the x-y plane (Kalibr, PSINS);
- z-accelerometer: T upper triangular, z accelerometer along z, y in the y-z plane (imu_tk);
- symmetric: T symmetric (polar decomposition).

The conversion is exact, its derivative is exact, and the covariance goes with it.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.triad import parameters as p
from rotcli.units import FloatArray

CONVENTIONS = ("table", "accelerometer", "z-accelerometer", "symmetric")


@dataclass(frozen=True, eq=False)
class Converted:
    """Parameters in another convention: x (p,), derivative (p, p) of new by old, Q (3, 3)."""

    x: FloatArray
    derivative: FloatArray
    Q: FloatArray


def factor(I_M: FloatArray, convention: str) -> tuple[FloatArray, FloatArray]:
    """Return T and the rotation Q (3, 3 each) with I + M = T Q.

    >>> factor(np.diag([1.0, 2.0, 3.0]), "accelerometer")[0].diagonal().tolist()
    [1.0, 2.0, 3.0]
    """
    if convention == "table":
        return I_M, np.eye(3)
    if convention == "symmetric":
        U, s, Vt = np.linalg.svd(I_M)
        return np.asarray((U * s) @ U.T), np.asarray(U @ Vt)
    flip = np.eye(3)[::-1] if convention == "z-accelerometer" else np.eye(3)
    Qt, Rt = np.linalg.qr((flip @ I_M @ flip).T)
    sign = np.sign(np.diag(Rt))
    return np.asarray(flip @ (Rt.T * sign) @ flip), np.asarray(flip @ (Qt * sign).T @ flip)


def _skew_part(T: FloatArray, dM: FloatArray, Q: FloatArray, convention: str) -> FloatArray:
    """Return the skew matrix dQ Q^T that keeps T in its form when I + M changes by dM."""
    if convention == "symmetric":
        twice = dM @ Q.T - (dM @ Q.T).T
        vector = np.array([twice[2, 1], twice[0, 2], twice[1, 0]])
        w = np.linalg.solve(np.trace(T) * np.eye(3) - T, vector)
        return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    Y = np.linalg.solve(T, dM @ Q.T)
    if convention == "z-accelerometer":
        part = np.tril(Y, -1)
        return np.asarray(part - part.T)
    part = np.triu(Y, 1)
    return np.asarray(part - part.T)


def convert(x: FloatArray, convention: str) -> Converted:
    """Return the parameters x (p,) of the table convention in another one."""
    if convention == "table":
        return Converted(x.copy(), np.eye(len(x)), np.eye(3))
    I_N, I_M = np.eye(3) + x[p.N].reshape(3, 3), np.eye(3) + x[p.M].reshape(3, 3)
    G, R = x[p.G].reshape(3, 3), x[p.LEVERS].reshape(3, 3)
    T, Q = factor(I_M, convention)
    new = x.copy()
    new[p.M], new[p.N] = (T - np.eye(3)).ravel(), (I_N @ Q.T - np.eye(3)).ravel()
    new[p.G], new[p.LEVERS] = (G @ Q.T).ravel(), (R @ Q.T).ravel()
    D = np.eye(len(x))
    for group in (p.N, p.G, p.M, p.LEVERS):
        D[group, group] = 0.0
    for k in range(9):
        unit = np.zeros((3, 3))
        unit[k // 3, k % 3] = 1.0
        for group in (p.N, p.G, p.LEVERS):
            D[group, group.start + k] = (unit @ Q.T).ravel()
        skew = _skew_part(T, unit, Q, convention)
        dQt = (skew @ Q).T
        D[p.M, p.M.start + k] = (unit @ Q.T - T @ skew).ravel()
        D[p.N, p.M.start + k] = (I_N @ dQt).ravel()
        D[p.G, p.M.start + k] = (G @ dQt).ravel()
        D[p.LEVERS, p.M.start + k] = (R @ dQt).ravel()
    return Converted(new, D, Q)


def convert_covariance(
    covariance: FloatArray, free: NDArray[np.int64], D: FloatArray
) -> FloatArray:
    """Return the covariance (p, p) of all new parameters from that of the free old ones."""
    rows = D[:, free]
    return np.asarray(rows @ covariance @ rows.T)
