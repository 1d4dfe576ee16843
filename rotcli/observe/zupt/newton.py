"""The updates of the slaved ZUPT filter, solved together by Newton's method.

With known gains the closed loop is a recursion s_k = f_k(s_{k-1}) of the state (velocity, C_error,
bias estimates), nearly linear. One update after the other costs 35 calls on arrays of three
numbers. Instead all updates of a part are guessed, evaluated as arrays, and corrected:

1. Guess: the state at the part's start, constant.
2. Evaluate f_k at the guess for all k; residual r_k = f_k(guess_{k-1}) - guess_k.
3. Solve d_k = A_k d_{k-1} + r_k for all k, one triangular banded system; add d to the guess.

Steps 2 and 3 are repeated until the next correction is below `TOLERANCE` of a sigma; a last
evaluation gives the results. Each pass gains a factor of 1e3 to 1e4. The slopes A_k need not be
exact: they change the number of passes, not the result. They must contain the rotation back to
the table's azimuth (R_k): a bias along the vertical that is not observed rotates the computed
frame by 0.05 rad within a part.

Perturbations are (velocity, left rotation vector of C_error, bias estimates):

    A_k = R_k (1 + D K_k H_k) J_k,

J_k is the slope of the mechanization, D the signs with which a correction is fed back.
"""

from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.models.kalman import FilterGains
from rotcli.models.rotation import skew
from rotcli.observe.zupt.model import ATTITUDE, AZIMUTH, ESTIMATED, VELOCITY, UpdateModel
from rotcli.observe.zupt.updates import (
    LEVEL,
    FilterState,
    UpdateIncrements,
    UpdateResults,
    among_estimated,
    filter_updates,
    to_nearest_rotation,
)
from rotcli.units import FloatArray

with lazily():
    from scipy.linalg import lapack

PART = 1024  # updates solved together; 500 to 2000 are as fast
TOLERANCE = 1e-11  # sigmas: estimates and the sum of all azimuths agree to 2e-11 after 6 h
MAX_PASSES = 10  # beyond, the part is filtered one update after the other (a jump, NaN)
# A pass that gains less has slopes that are too old: they are built again.
_MIN_GAIN = 50.0
_SERIES_ANGLE = 0.05  # rad: the series of the rotation matrix is then exact to 1e-17


def solve_updates(
    model: UpdateModel, increments: UpdateIncrements, state: FilterState, gains: FilterGains
) -> UpdateResults:
    """Return the results of all updates of a model, part by part, as `filter_updates` does."""
    n = len(increments.dv_n)
    results: UpdateResults | None = None
    for first in range(0, n, PART):
        part = _Part(model, increments, gains, slice(first, min(first + PART, n)))
        solved = part.solve(state)
        if solved is None:
            solved = part.step_by_step(state)
        state = solved.last(state.updates)
        state = replace(state, C_error=to_nearest_rotation(state.C_error))
        results = solved if results is None else results.join(solved)
    if results is None:
        raise ValueError("a model without updates")
    return results


@dataclass(eq=False)
class _Guess:
    """The states before each update of a part, and after the last: (n + 1, ...)."""

    M: FloatArray
    v: FloatArray
    estimates: FloatArray

    def correct(self, d: FloatArray) -> None:
        """Add corrections d (n, m) to the states after each update."""
        self.v[1:] += d[:, VELOCITY]
        self.M[1:] = rotation_matrices(d[:, ATTITUDE]) @ self.M[1:]
        self.estimates[1:] += d[:, ESTIMATED]


class _Part:
    """Some consecutive updates that are solved together."""

    def __init__(
        self,
        model: UpdateModel,
        increments: UpdateIncrements,
        gains: FilterGains,
        updates: slice,
    ) -> None:
        self.model, self.increments, self.gains, self.updates = model, increments, gains, updates
        layout = model.settings.layout
        self.dv_n = increments.dv_n[updates]
        self.relative_rotation = increments.relative_rotation[updates]
        self.jacobian = increments.bias_jacobian[updates]
        self.K = gains.K[updates]
        self.scale = gains.sigma[updates]
        rest = model.linear.H_rest
        self.H_lever = None if rest is None else rest[updates]
        self.lever_arm_velocity = model.lever_arm_velocity[1:][updates]
        self.lever = among_estimated(layout.LEVER_ARM)

    def step_by_step(self, state: FilterState) -> UpdateResults:
        """Filter the part one update after the other."""
        i = self.increments
        part = replace(
            i,
            dv_n=self.dv_n,
            relative_rotation=self.relative_rotation,
            bias_jacobian=self.jacobian,
        )
        u = self.updates
        model = replace(
            self.model,
            lever_arm_velocity=self.model.lever_arm_velocity[u.start : u.stop + 1],
            linear=self.model.linear.part(u),
        )
        gains = FilterGains(self.K, self.gains.S[u], self.scale, self.gains.P)
        return filter_updates(model, part, state, gains, self.gains.P)[0]

    def solve(self, state: FilterState) -> UpdateResults | None:
        """Return the results from the state at the start; None where the passes do not converge."""
        n = len(self.dv_n)
        guess = _Guess(
            np.broadcast_to(state.C_error, (n + 1, 3, 3)).copy(),
            np.broadcast_to(state.velocity, (n + 1, 3)).copy(),
            np.broadcast_to(state.bias_estimates, (n + 1, len(state.bias_estimates))).copy(),
        )
        last_step, band = np.inf, None
        for _ in range(MAX_PASSES):
            results = self._evaluate(guess)
            if band is None:
                band = _band(self._slopes(guess, results))
            r = np.concatenate(
                [
                    results.velocity - guess.v[1:],
                    _rotation_vectors(results.C_error @ np.swapaxes(guess.M[1:], 1, 2)),
                    results.bias_estimates - guess.estimates[1:],
                ],
                axis=1,
            )
            d = _solve_band(band, r)
            step = float(np.max(np.abs(d) / self.scale))
            if not step < np.inf:
                return None
            guess.correct(d)
            predicted = step if last_step == np.inf else min(step, step**2 / last_step)
            if predicted < TOLERANCE:
                return self._evaluate(guess)
            if step * _MIN_GAIN > last_step:
                band = None
            last_step = step
        return None

    def _evaluate(self, guess: _Guess) -> UpdateResults:
        """Return the results of all updates, each from the guess of the state before it."""
        i = self.increments
        M, v, estimates = guess.M[:-1], guess.v[:-1], guess.estimates[:-1]
        known = _times(self.jacobian, estimates)
        v = v @ i.coriolis_matrix.T + i.gravity_dv
        v += _times(M, self.dv_n + known[:, VELOCITY]) @ i.earth_rotation[3:].T
        M = i.earth_rotation[:3] @ (M @ rotation_matrices(known[:, ATTITUDE]))
        M = M @ self.relative_rotation
        z = v - self.lever_arm_velocity
        if self.H_lever is not None:
            z -= _times(self.H_lever, estimates[:, self.lever])
        x = _times(self.K, z)
        v -= x[:, VELOCITY]
        M = rotation_matrices(-LEVEL * x[:, ATTITUDE]) @ M
        sine, cosine = M[:, 1, 0] - M[:, 0, 1], M[:, 0, 0] + M[:, 1, 1]
        azimuth = np.arctan2(sine, cosine)
        size = np.hypot(sine, cosine)
        back = _rotations_back(sine / size, cosine / size)
        return UpdateResults(back @ M, _times(back, v), estimates + x[:, ESTIMATED], azimuth, x, z)

    def _slopes(self, guess: _Guess, results: UpdateResults) -> FloatArray:
        """Return the slopes A (n, m, m) of the updates, to first order in small angles."""
        i, n, m = self.increments, len(self.dv_n), self.K.shape[1]
        M = guess.M[:-1]
        J = np.zeros((n, m, m))
        J[:, VELOCITY, VELOCITY] = i.coriolis_matrix
        force = _times(M, self.dv_n + _times(self.jacobian[:, VELOCITY], guess.estimates[:-1]))
        J[:, VELOCITY, ATTITUDE] = -skew(force)
        J[:, ATTITUDE, ATTITUDE] = i.earth_rotation[:3]
        J[:, VELOCITY, ESTIMATED] = M @ self.jacobian[:, VELOCITY]
        J[:, ATTITUDE, ESTIMATED] = M @ self.jacobian[:, ATTITUDE]
        J[:, ESTIMATED, ESTIMATED] = np.eye(m - ESTIMATED.start)
        HJ = J[:, VELOCITY].copy()
        if self.H_lever is not None:
            HJ[:, :, self.model.settings.layout.LEVER_ARM] -= self.H_lever
        signs = np.ones(m)
        signs[VELOCITY], signs[ATTITUDE] = -1.0, -LEVEL
        A = J + (signs[:, None] * self.K) @ HJ
        c, s = np.cos(results.azimuth), np.sin(results.azimuth)
        for east in (VELOCITY.start, ATTITUDE.start):
            first, second = A[:, east].copy(), A[:, east + 1].copy()
            A[:, east] = c[:, None] * first + s[:, None] * second
            A[:, east + 1] = c[:, None] * second - s[:, None] * first
        A[:, AZIMUTH] = 0.0  # it is zero after each update
        return A


def _times(A: FloatArray, x: FloatArray) -> FloatArray:
    """Return A x (n, r) of A (n, r, c) and x (n, c)."""
    result: FloatArray = (A @ x[:, :, None])[:, :, 0]
    return result


def rotation_matrices(phi: FloatArray) -> FloatArray:
    """Return the rotation matrices (n, 3, 3) of rotation vectors (n, 3), rad (Rodrigues).

    >>> rotation_matrices(np.array([[0.0, 0.0, np.pi / 2]])).round(12)[0, 0]
    array([ 0., -1.,  0.])
    """
    x, y, z = phi.T
    square = x * x + y * y + z * z
    if square.max(initial=0.0) < _SERIES_ANGLE**2:  # first omitted terms: angle^8 / 9!, / 10!
        first = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
        second = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0))
    else:
        angle = np.sqrt(square)
        first, half = np.sinc(angle / np.pi), np.sinc(0.5 * angle / np.pi)
        second = 0.5 * half * half
    result = np.empty((len(phi), 3, 3))
    a, b, c = second * x, second * y, second * z
    result[:, 0, 0], result[:, 1, 1] = 1.0 - (b * y + c * z), 1.0 - (a * x + c * z)
    result[:, 2, 2] = 1.0 - (a * x + b * y)
    xy, xz, yz = a * y, a * z, b * z
    x, y, z = first * x, first * y, first * z
    result[:, 0, 1], result[:, 1, 0] = xy - z, xy + z
    result[:, 0, 2], result[:, 2, 0] = xz + y, xz - y
    result[:, 1, 2], result[:, 2, 1] = yz - x, yz + x
    return result


def _rotation_vectors(M: FloatArray) -> FloatArray:
    """Return the rotation vectors (n, 3), rad, of M (n, 3, 3) near the identity, to 2nd order."""
    result = np.empty((len(M), 3))
    result[:, 0] = M[:, 2, 1] - M[:, 1, 2]
    result[:, 1] = M[:, 0, 2] - M[:, 2, 0]
    result[:, 2] = M[:, 1, 0] - M[:, 0, 1]
    return 0.5 * result


def _rotations_back(sine: FloatArray, cosine: FloatArray) -> FloatArray:
    """Return the rotations (n, 3, 3) about up by the negative angle."""
    back = np.zeros((len(sine), 3, 3))
    back[:, 0, 0] = back[:, 1, 1] = cosine
    back[:, 0, 1], back[:, 1, 0] = sine, -sine
    back[:, 2, 2] = 1.0
    return back


def _band(A: FloatArray) -> FloatArray:
    """Return the band (2 m, n m) of the system d_k - A_k d_{k-1} = r_k, A (n, m, m).

    Lower band storage of LAPACK: row i of column j contains element (i + j, j). The block -A_k
    lies m + r - c rows below the diagonal: seen from its first element, a step to the next column
    of A advances by 2 m - 1 numbers, a step to the next row by one.
    """
    n, m, _ = A.shape
    W = np.zeros((n, m, 2 * m))
    W[:, :, 0] = 1.0
    item = W.itemsize
    blocks = np.lib.stride_tricks.as_strided(
        W[:, 0, m:], shape=(n - 1, m, m), strides=(2 * m * m * item, item, (2 * m - 1) * item)
    )
    blocks[...] = -A[1:]
    return W.reshape(n * m, 2 * m).T


def _solve_band(band: FloatArray, r: FloatArray) -> FloatArray:
    """Return d (n, m) of d_k = A_k d_{k-1} + r_k, d_{-1} = 0, by forward substitution."""
    d, info = lapack.dtbtrs(band, r.reshape(-1, 1), uplo="L", diag="U")
    if info:
        raise ValueError(f"dtbtrs: argument {-info} is invalid")
    return np.asarray(d).reshape(r.shape)
