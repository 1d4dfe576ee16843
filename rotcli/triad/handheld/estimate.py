"""Calibrate both triads from a hand-held log of many still poses, without a table.

Accelerometers: in a pose |f| equals gravity. Gyros: they carry the direction of gravity from one
pose to the next. Both stages use the accelerometer convention; without a table its frame is the
only one that exists, and levers, clocks and table errors do not.

After Tedaldi, Pretto and Menegatti, ICRA 2014, with g-sensitivity, a bias for each move from both
neighbouring poses, and uncertainties.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.rotation import (
    conjugate,
    cross,
    cumulative_product,
    multiply,
    quaternion_from_vector,
    rotate,
)
from rotcli.triad.handheld.poses import Poses
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_LOWER = np.tril_indices(3)
_PASSES = 12  # of Gauss-Newton; seven suffice from raw counts (scale errors of 25 %)
_STEP = 1e-6  # of the finite differences; parameters are of size 1
_CONVERGED = 1e-7  # a tenth of a ppm, far below any sigma of a hand-held log
MIN_DIRECTION_SPREAD = 0.05  # smallest eigenvalue of mean(u u^T); 1/3 when all directions occur


@dataclass(frozen=True, eq=False)
class AccelFit:
    """Accelerometer triad of the poses.

    matrix M (3, 3) lower triangular, bias (3,) m/s^2, K2 (3,) s^2/m (zero unless estimated);
    covariance of (six of M row by row, bias, K2), scaled by chi2/dof; rms of |f| - g, m/s^2.
    """

    matrix: FloatArray
    bias: FloatArray
    K2: FloatArray
    covariance: FloatArray
    rms: float
    rms_before: float
    chi2: float
    dof: int
    residuals: FloatArray

    def force(self, accel: FloatArray) -> FloatArray:
        """Return the specific force (n, 3) of readings (n, 3): (I + M)^-1 (u), K2 undone first."""
        u = accel - self.bias
        u = u - self.K2 * u**2
        return np.asarray(u @ np.linalg.inv(np.eye(3) + self.matrix).T)


@dataclass(frozen=True, eq=False)
class GyroFit:
    """Gyro triad: N, g-sensitivity G (rad/s per m/s^2), bias (3,) rad/s; covariances; residuals.

    residuals (moves, 2): gravity carried through each move against the next pose, rad, and with
    the biases alone corrected (residuals_before); rms and
    excluded_rms: of its angle, rad, on the moves of the fit and on moves left out of it (two-fold).
    """

    matrix: FloatArray
    G: FloatArray
    bias: FloatArray
    covariance: FloatArray
    G_sigma: FloatArray
    bias_sigma: FloatArray
    rms: float
    excluded_rms: float
    rms_before: float
    chi2: float
    dof: int
    residuals: FloatArray
    residuals_before: FloatArray


@dataclass(frozen=True)
class GyroModel:
    """Which gyro model carries gravity: with or without g-sensitivity, bias of which poses."""

    g_sensitivity: bool = True
    bias: str = "neighbours"  # or "first": the first pose alone, as published by others


def _gauss_newton(
    residual: Callable[[FloatArray], FloatArray], start: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the solution (p,), residuals (m,) there, and the Jacobian (m, p)."""
    x = start.copy()
    J = np.zeros((0, 0))
    for _ in range(_PASSES):
        r = residual(x)
        J = np.empty((len(r), len(x)))
        for k in range(len(x)):
            up = x.copy()
            up[k] += _STEP
            J[:, k] = (residual(up) - r) / _STEP
        step = np.linalg.lstsq(J, -r, rcond=None)[0]
        x = x + step
        if np.abs(step).max() < _CONVERGED:
            break
    return x, residual(x), J


def fit_accelerometers(poses: Poses, gravity: float, *, second_order: bool = False) -> AccelFit:
    """Return M, b (and K2) that make |f| equal gravity (m/s^2) in all poses."""
    sigma = np.sqrt(np.mean(poses.accel_noise**2)) / np.sqrt(poses.count)
    scale = np.concatenate([np.ones(6), np.full(3, gravity), np.full(3, 1.0 / gravity)])

    def unpack(x: FloatArray) -> AccelFit:
        v = x * scale[: len(x)]
        matrix = np.zeros((3, 3))
        matrix[_LOWER] = v[:6]
        K2 = v[9:12] if second_order else np.zeros(3)
        nothing = np.zeros((0, 0))
        return AccelFit(matrix, v[6:9], K2, nothing, 0.0, 0.0, 0.0, 0, np.zeros(0))

    def residual(x: FloatArray) -> FloatArray:
        force = unpack(x).force(poses.accel)
        return np.asarray((np.linalg.norm(force, axis=1) - gravity) / sigma)

    count = 12 if second_order else 9
    x, r, J = _gauss_newton(residual, np.zeros(count))
    chi2, dof = float(r @ r), len(r) - count
    covariance = np.asarray(np.linalg.inv(J.T @ J) * np.outer(scale[:count], scale[:count]))
    found, left = unpack(x), r * sigma
    before = np.linalg.norm(poses.accel, axis=1) - gravity
    return AccelFit(
        found.matrix, found.bias, found.K2, covariance * max(1.0, chi2 / dof),
        float(np.sqrt(np.mean(left**2))), float(np.sqrt(np.mean(before**2))), chi2, dof, left,
    )  # fmt: skip


def still_sensitivity(
    poses: Poses, force: FloatArray, *, vertical_earth: float, gravity: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return G, its sigma (3, 3), the mean bias (3,) and its sigma from the means of the poses.

    gyro = d + drift t + G f; vertical_earth: rad/s, the upward part of the Earth rate, turns with
    the sensor as f does and is subtracted from the diagonal.
    """
    t = poses.time - poses.time.mean()
    span = max(float(np.ptp(t)), 1.0)
    A = np.column_stack([np.ones(len(t)), t / span, force])
    found = np.linalg.lstsq(A, poses.gyro, rcond=None)[0]
    left = poses.gyro - A @ found
    variance = np.sum(left**2, axis=0) / (len(t) - A.shape[1])
    spread = np.diag(np.linalg.inv(A.T @ A))
    sigma = np.sqrt(np.outer(variance, spread))
    G = found[2:].T - np.eye(3) * vertical_earth / gravity
    return G, sigma[:, 2:], found[0], sigma[:, 0]


class Moves:
    """Readings of all moves between neighbouring poses, ready to be integrated many times."""

    def __init__(
        self, gyro: FloatArray, force: FloatArray, poses: Poses, still_force: FloatArray
    ) -> None:
        """Collect the samples; gyro (n, 3) rad/s, force (n, 3) calibrated, m/s^2."""
        # From the middle of the cut margins on, both ends of a move are still.
        first, last = poses.end[:-1] - 1, poses.first[1:]
        self.index = np.concatenate([np.arange(a, b + 1) for a, b in zip(first, last, strict=True)])
        self.length = last - first + 1
        self.start = np.concatenate([[0], np.cumsum(self.length)[:-1]])
        self.owner = np.repeat(np.arange(len(first)), self.length)
        self.gyro, self.force = gyro[self.index].T, force[self.index].T
        self.interval = poses.interval
        u = still_force / np.linalg.norm(still_force, axis=1, keepdims=True)
        self.before, self.after = u[:-1].T, u[1:].T
        self.duration = (self.length - 1) * poses.interval
        reference = np.where(np.abs(self.after[0]) < 0.7, 0, 1)
        axis = np.eye(3)[reference].T
        first_side = cross(self.after, axis)
        self.side = first_side / np.linalg.norm(first_side, axis=0)
        self.other = cross(self.after, self.side)

    def carried(self, N: FloatArray, bias: FloatArray, G: FloatArray) -> FloatArray:
        """Return gravity's direction (3, moves) at the end of each move; bias (3, moves), rad/s."""
        rate = np.linalg.solve(np.eye(3) + N, self.gyro - bias[:, self.owner] - G @ self.force)
        h = self.interval
        step = (rate[:, :-1] + rate[:, 1:]) * (0.5 * h)
        step = step + cross(rate[:, :-1], rate[:, 1:]) * (h * h / 12.0)
        q = quaternion_from_vector(np.concatenate([np.zeros((3, 1)), step], axis=1))
        q[:, self.start] = np.array([[1.0], [0.0], [0.0], [0.0]])  # between two moves nothing
        total = cumulative_product(q)
        ends = self.start + self.length - 1
        turned = multiply(conjugate(total[:, self.start]), total[:, ends])
        return rotate(conjugate(turned), self.before)

    def residual(self, N: FloatArray, bias: FloatArray, G: FloatArray) -> FloatArray:
        """Return the two components (2, moves), rad, of the error across the final direction."""
        error = self.carried(N, bias, G) - self.after
        return np.stack([np.sum(error * self.side, axis=0), np.sum(error * self.other, axis=0)])


def move_biases(poses: Poses, force: FloatArray, G: FloatArray, model: GyroModel) -> FloatArray:
    """Return the bias (3, moves), rad/s, of each move from the poses around it."""
    still = (poses.gyro - force @ G.T).T
    if model.bias == "first":
        return np.repeat(still[:, :1], len(poses) - 1, axis=1)
    return np.asarray(0.5 * (still[:, :-1] + still[:, 1:]))


def fit_gyros(
    gyro: FloatArray,
    accel: FloatArray,
    poses: Poses,
    triad: AccelFit,
    *,
    gravity: float,
    vertical_earth: float,
    model: GyroModel | None = None,
) -> GyroFit:
    """Return N, G and the mean bias from readings (n, 3) each, rad/s and m/s^2."""
    model = model or GyroModel()
    still = triad.force(poses.accel)
    G, G_sigma, bias, bias_sigma = still_sensitivity(
        poses, still, vertical_earth=vertical_earth, gravity=gravity
    )
    # What the gyros read in proportion to f includes the vertical part of the Earth rate.
    carried = G + np.eye(3) * vertical_earth / gravity
    carried = carried if model.g_sensitivity else np.zeros((3, 3))
    moves = Moves(gyro, triad.force(accel), poses, still)
    biases = move_biases(poses, still, carried, model)
    sigma = _move_sigma(poses, moves, gravity)

    def residuals(x: FloatArray, which: BoolArray | slice) -> FloatArray:
        return np.asarray((moves.residual(x.reshape(3, 3), biases, carried) / sigma)[:, which])

    def solve(
        which: BoolArray | slice, start: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        return _gauss_newton(lambda x: residuals(x, which).ravel(), start)

    x, r, J = solve(slice(None), np.zeros(9))
    chi2, dof = float(r @ r), len(r) - 9
    left = moves.residual(x.reshape(3, 3), biases, carried)
    before = moves.residual(np.zeros((3, 3)), biases, np.zeros((3, 3)))
    return GyroFit(
        matrix=x.reshape(3, 3),
        G=G,
        bias=bias,
        covariance=np.asarray(np.linalg.inv(J.T @ J) * max(1.0, chi2 / max(dof, 1))),
        G_sigma=G_sigma,
        bias_sigma=bias_sigma,
        rms=_rms_angle(left),
        excluded_rms=_excluded_rms(moves, biases, carried, lambda which: solve(which, x)[0]),
        rms_before=_rms_angle(before),
        chi2=chi2,
        dof=dof,
        residuals=left.T,
        residuals_before=before.T,
    )


def _move_sigma(poses: Poses, moves: Moves, gravity: float) -> FloatArray:
    """Return the sigma (moves,), rad: both poses' directions and the gyros' random walk."""
    tilt = np.mean(poses.accel_noise**2) / gravity**2 * (1 / poses.count[:-1] + 1 / poses.count[1:])
    walk = np.mean(poses.gyro_noise**2) * poses.interval * moves.duration
    return np.asarray(np.sqrt(tilt + walk))


def _excluded_rms(
    moves: Moves,
    biases: FloatArray,
    G: FloatArray,
    solve: Callable[[BoolArray], FloatArray],
) -> float:
    """Return the rms angle (rad) on moves that the fit did not use: even by odd, odd by even."""
    odd = np.arange(biases.shape[1]) % 2 == 1
    left = np.empty((2, len(odd)))
    for used in (odd, ~odd):
        x = solve(used)
        left[:, ~used] = moves.residual(x.reshape(3, 3), biases, G)[:, ~used]
    return _rms_angle(left)


def _rms_angle(residual: FloatArray) -> float:
    """Return the rms (rad) of the angle of residuals (2, moves)."""
    return float(np.sqrt(np.mean(np.sum(residual**2, axis=0))))


def direction_spread(force: FloatArray) -> float:
    """Return the smallest eigenvalue of mean(u u^T) over the poses' directions u: 1/3 at best."""
    u = force / np.linalg.norm(force, axis=1, keepdims=True)
    return float(np.linalg.eigvalsh(u.T @ u / len(u))[0])
