"""Nominal motion of a still table during a window, and the error dynamics about it.

States x = [dp (m), dv (m/s), eps (rad)], each East, North, Up, computed minus true,
`C_hat = (I + [eps x]) C_nominal`. On a still base F is constant except for the specific force:

    dp' = dv
    dv' = -2 w_ie x dv + eps x f + (0, 0, 2 g/R dp_U) + C_nominal db
    eps' = -w_ie x eps + (dv_N/R_M, -dv_E/R_N, -dv_E tan L/R_N)
           + (0, w_ie sin L, -w_ie cos L) dp_N/R_M + C_nominal dw

(Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd ed., chapter 12, in
East-North-Up). The Earth rate changes the figures of 300 s by less than 0.03 %, Schuler's loop by
about 1 %; both cost nothing.

The nominal attitude is the computed one: an axis column K that a mode leaves in turns the
computed frame about the fixed sensor direction u + K, exactly and for any schedule of the table,
`C_nominal = C(0) exp([(theta - theta(0)) (u + K)] x)`. A known large error is no perturbation.
"""

from collections.abc import Callable
from dataclasses import field
from enum import IntEnum

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import earth, rotation
from rotcli.units import DEG, FloatArray

AngleFunction = Callable[[FloatArray], FloatArray]

POSITION, VELOCITY, ATTITUDE = slice(0, 3), slice(3, 6), slice(6, 9)
_E, _N, _U = 0, 1, 2

# Coarse times: some 60 keep the mean squares within 0.4 % of 150; the choice avoids aliasing.
_COARSE_STEPS = range(57, 68)
# Fine blocks: 24 deg of turn keeps everything within 0.4 % (36 deg: 1 %), 1 s the flicker.
_MAX_BLOCK_TURN = 24.0 * DEG
_MAX_BLOCK_LENGTH = 1.0  # s
# E is dense, n x n, and its product with the responses grows as n^2: 2500 blocks take 0.1 s.
MAX_BLOCKS = 2500


class ErrorName(IntEnum):
    """Rows of the outputs: the errors that `navigate` reports, in its order."""

    LATITUDE = 0
    LONGITUDE = 1
    HEIGHT = 2
    V_NORTH = 3
    V_EAST = 4
    V_UP = 5
    PITCH = 6
    ROLL = 7
    AZIMUTH = 8


@dataclass(frozen=True, eq=False)
class StillTable:
    """Site and attitude of the table: rad, m, m/s^2; axis (3,) in the body frame at angle 0."""

    latitude: float
    height: float
    gravity: float
    pitch: float = 0.0
    roll: float = 0.0
    azimuth: float = 0.0
    axis: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    hold_height: bool = False

    @property
    def C_nb(self) -> FloatArray:
        """Return the attitude matrix (3, 3) of the body at angle 0."""
        return rotation.attitude_matrix(self.pitch, self.roll, self.azimuth)


@dataclass(frozen=True, eq=False)
class Blocks:
    """The window cut into M coarse steps of r fine blocks of `length` s each.

    angle: (2n + 1,) rad, table angle at the ends and middles of the n = M r blocks.
    """

    start: float
    length: float
    coarse: int
    fine: int
    angle: FloatArray

    @property
    def rate(self) -> FloatArray:
        """Return the mean table rate (n,) of each block, rad/s."""
        return np.diff(self.angle[::2]) / self.length

    @property
    def duration(self) -> float:
        """Return the length of the window, s."""
        return self.length * self.coarse * self.fine


class TooManyBlocksError(ValueError):
    """The window is too long at this rate for a dense covariance."""


def cut_window(start: float, end: float, angle: AngleFunction, max_rate: float) -> Blocks:
    """Return the blocks of a window [start, end], s; angle gives the table angle at times.

    max_rate: rad/s, largest magnitude of the table rate. Coarse steps must not be close to half
    a turn or a full turn: the oscillation of the errors at the turning rate would alias.
    Raises TooManyBlocksError beyond MAX_BLOCKS.
    """
    duration = end - start
    turns = max_rate * duration / (2.0 * np.pi)
    coarse = max(_COARSE_STEPS, key=lambda m: _distance_from_half_turn(turns / m))
    # A still window that is long needs no block of a second: a 2000th of it resolves flicker.
    longest = max(_MAX_BLOCK_LENGTH, duration / 2000.0)
    needed = max(duration / longest, max_rate * duration / _MAX_BLOCK_TURN)
    fine = max(1, int(np.ceil(needed / coarse - 1e-9)))
    if coarse * fine > MAX_BLOCKS:
        raise TooManyBlocksError(
            f"{duration:.4g} s at {max_rate / DEG:.4g} deg/s need {coarse * fine} blocks, "
            f"limit {MAX_BLOCKS}"
        )
    n = coarse * fine
    times: FloatArray = start + duration / (2 * n) * np.arange(2 * n + 1, dtype=float)
    return Blocks(start, duration / n, coarse, fine, angle(times))


def _distance_from_half_turn(turns: float) -> float:
    """Return how far a step of so many turns is from a multiple of half a turn (0 to 0.25)."""
    if turns < 0.05:  # still, or too slow to alias at any choice
        return 0.25
    fraction = (2.0 * turns) % 1.0
    return 0.5 * min(fraction, 1.0 - fraction)


@dataclass(frozen=True, eq=False)
class Nominal:
    """Computed attitude without noise: what the errors are linear about.

    C_ns: (2n + 1, 3, 3) at ends and middles of the blocks; Q: (n, 3, 3) = C_nominal C_true^T at
    the middles; pitch, azimuth: (M + 1,) rad, computed, of the body at the coarse times;
    offset: (M + 1, 3) rad, computed minus true Euler angles, azimuth continuous.
    tilt: rad, largest angle between computed and true vertical.
    """

    C_ns: FloatArray
    Q: FloatArray
    pitch: FloatArray
    azimuth: FloatArray
    offset: FloatArray
    tilt: float


def nominal_motion(table: StillTable, blocks: Blocks, column: FloatArray) -> Nominal:
    """Return the attitude that a computer finds which leaves in the axis column (3,)."""
    C_nb, theta = table.C_nb, blocks.angle
    true = C_nb @ rotation.axis_rotation(table.axis, theta)
    n, M = blocks.coarse * blocks.fine, blocks.coarse
    if not np.any(column):
        identity = np.broadcast_to(np.eye(3), (n, 3, 3))
        level = np.full(M + 1, table.pitch), np.full(M + 1, table.azimuth)
        return Nominal(true, identity, *level, np.zeros((M + 1, 3)), 0.0)
    direction = table.axis + column
    size = float(np.linalg.norm(direction))
    turned = rotation.axis_rotation(direction / size, size * (theta - theta[0]))
    computed = true[0] @ turned
    Q = computed[1::2] @ np.swapaxes(true[1::2], 1, 2)
    step = 2 * blocks.fine
    body = computed[::step] @ np.swapaxes(rotation.axis_rotation(table.axis, theta[::step]), 1, 2)
    pitch, roll, azimuth = rotation.euler_angles(body)
    q = np.empty((4, M + 1))
    if abs(table.pitch) > rotation.MAX_EULER_PITCH:  # else the Euler angles suffice
        q = np.stack([rotation.quaternion_from_matrix(C) for C in body], axis=1)
    reference = table.pitch, table.roll, table.azimuth
    offset = rotation.attitude_errors(q, (pitch, roll, azimuth), reference)
    if abs(table.pitch) > rotation.MAX_EULER_PITCH:
        pitch, azimuth = np.full(M + 1, table.pitch), np.full(M + 1, table.azimuth)
    # Between coarse times the azimuth may pass half a turn: the offset is made continuous.
    continuous = np.unwrap(np.column_stack(offset), axis=0)
    tilt = float(np.arccos(np.clip(Q[:, _U, _U].min(), -1.0, 1.0)))
    return Nominal(computed, Q, pitch, azimuth, continuous, tilt)


def error_dynamics(base: StillTable, f_n: FloatArray) -> FloatArray:
    """Return F (..., 9, 9) for specific forces f_n (..., 3) in n, m/s^2."""
    R_M, R_N = (float(r) + base.height for r in earth.radii(base.latitude))
    w_ie = earth.earth_rate_n(base.latitude)
    F = np.zeros((*f_n.shape[:-1], 9, 9))
    F[..., POSITION, VELOCITY] = np.eye(3)
    F[..., VELOCITY, VELOCITY] = -2.0 * rotation.skew(w_ie)
    F[..., VELOCITY, ATTITUDE] = -rotation.skew(f_n)
    F[..., 5, 2] = 2.0 * base.gravity / R_M
    F[..., ATTITUDE, ATTITUDE] = -rotation.skew(w_ie)
    F[..., 6, 4] = 1.0 / R_M
    F[..., 7, 3] = -1.0 / R_N
    F[..., 8, 3] = -np.tan(base.latitude) / R_N
    F[..., 7, 1] = w_ie[_U] / R_M
    F[..., 8, 1] = -w_ie[_N] / R_M
    if base.hold_height:
        for state in (2, 5):
            F[..., state, :] = 0.0
            F[..., :, state] = 0.0
    return F


@dataclass(frozen=True, eq=False)
class Transition:
    """Transitions of the error states over a window.

    to_start: (n, 9, 9), from the middle of each block back to the window's start;
    from_start: (M + 1, 9, 9), from the start to the coarse times.
    """

    to_start: FloatArray
    from_start: FloatArray


def transitions(base: StillTable, blocks: Blocks, nominal: Nominal) -> Transition:
    """Return the transition matrices about a nominal motion.

    Half a block back is `exp(-F h/2)` by its series: (F h)^3 is already of the order of Schuler's
    loop, 1e-6 for a block of a second. Products run over all coarse steps at once, then over the
    coarse steps.
    """
    M, r = blocks.coarse, blocks.fine
    gravity = np.array([0.0, 0.0, base.gravity])
    n_forces = nominal.Q @ gravity
    constant = bool(nominal.tilt == 0.0)
    X = -0.5 * blocks.length * error_dynamics(base, n_forces[:1] if constant else n_forces)
    X2 = X @ X
    half = np.eye(9) + X + 0.5 * X2 + X2 @ (X / 6.0 + X2 / 24.0)
    if constant:
        half = np.broadcast_to(half, (M * r, 9, 9))
    half = half.reshape(M, r, 9, 9)
    inside, ends = np.empty((M, r, 9, 9)), np.broadcast_to(np.eye(9), (M, 9, 9))
    for k in range(r):
        inside[:, k] = ends @ half[:, k]
        ends = inside[:, k] @ half[:, k]
    starts = np.empty((M + 1, 9, 9))
    starts[0] = np.eye(9)
    for m in range(M):
        starts[m + 1] = starts[m] @ ends[m]
    to_start = (starts[:-1, None] @ inside).reshape(M * r, 9, 9)
    return Transition(to_start, np.asarray(np.linalg.inv(starts), dtype=float))


def output_rows(pitch: FloatArray, azimuth: FloatArray) -> FloatArray:
    """Return D (m, 9, 9): reported errors of the states at computed pitch and azimuth (m,)."""
    D = np.zeros((len(pitch), 9, 9))
    for row, state in (
        (ErrorName.LATITUDE, 1),
        (ErrorName.LONGITUDE, 0),
        (ErrorName.HEIGHT, 2),
        (ErrorName.V_NORTH, 4),
        (ErrorName.V_EAST, 3),
        (ErrorName.V_UP, 5),
    ):
        D[:, row, state] = 1.0
    D[:, 6:, 6:] = euler_rows(pitch, azimuth)
    return D


def euler_rows(pitch: FloatArray, azimuth: FloatArray) -> FloatArray:
    """Return (m, 3, 3): errors of pitch, roll, azimuth that small eps (E, N, U) make."""
    s, c = np.sin(azimuth), np.cos(azimuth)
    # Near the vertical the errors are a rotation vector (rotation.attitude_errors).
    pitch = np.where(np.abs(pitch) > rotation.MAX_EULER_PITCH, 0.0, pitch)
    rows = np.zeros((len(pitch), 3, 3))
    rows[:, 0, 0], rows[:, 0, 1] = c, -s
    rows[:, 1, 0], rows[:, 1, 1] = s / np.cos(pitch), c / np.cos(pitch)
    rows[:, 2, 0], rows[:, 2, 1] = s * np.tan(pitch), c * np.tan(pitch)
    rows[:, 2, 2] = -1.0
    return rows
