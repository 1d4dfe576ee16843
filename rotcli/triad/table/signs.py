"""Signs of the encoders and the mounting of the IMU, found from the logs themselves.

An even number of wrong encoder signs is invisible to gyros: turning about two axes backwards
looks like an IMU mounted upside down. Gravity sees it. So for every sign pattern one rotation is
fitted to rates and forces at once (Wahba's problem, solved by SVD); the right pattern leaves
little more than scale errors, and its rotation is the mounting.
"""

from itertools import product

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import Blocks
from rotcli.models.triad.kinematics import Pose, Table, motion
from rotcli.units import DEG, FloatArray

MAX_MISFIT = 0.15  # of the rms reading; scales that differ by 10 %, levers at 100 deg/s stay below
MAX_SCALE = 1.5  # of a triad out of the box, such as raw counts times a nominal factor
CLEAR_RATIO = 2.0  # of the misfits of two patterns, to call one right
MAX_MOUNTING_ANGLE = 10.0 * DEG  # rad; Gauss-Newton converges from there
_NO_ROTATION = 0.05  # misfit of 3 deg; a smaller rotation need not be found here
_SAME_MISFIT = 1e-4  # of the rms reading: no difference between two patterns
_MIN_TURN = 30.0 * DEG  # rad an axis must turn for its sign to show
_MAX_BLOCKS = 3000  # used; more change nothing


@dataclass(frozen=True, eq=False)
class Pattern:
    """One sign pattern: signs (K,), misfit (rms residual over rms reading), rotations (m, 3, 3).

    rotation: takes the sensor axes that the rig describes to those of the readings.
    """

    signs: tuple[int, ...]
    misfit: float
    rotations: FloatArray

    @property
    def angles(self) -> FloatArray:
        """Angle of each mounting's rotation, rad."""
        trace = np.trace(self.rotations, axis1=1, axis2=2)
        return np.asarray(np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0)))


@dataclass(frozen=True, eq=False)
class SignCheck:
    """Outcome: the best pattern, the pattern as logged, and which axes turned enough."""

    best: Pattern
    logged: Pattern
    turned: tuple[bool, ...]

    @property
    def wrong_axes(self) -> tuple[int, ...]:
        """Axes whose sign must change."""
        return tuple(k for k, sign in enumerate(self.best.signs) if sign < 0)

    @property
    def explained(self) -> bool:
        """Whether any pattern explains the readings."""
        return self.best.misfit < MAX_MISFIT


def _fit(reading: FloatArray, model: FloatArray) -> tuple[FloatArray, float]:
    """Return the rotation R (3, 3) of reading = R model, and the squares left.

    reading, model: (3, n), weighted. Source: Markley, J. Astronaut. Sci. 36 (1988) 245.
    """
    U, s, Vt = np.linalg.svd(reading @ model.T)
    sign = float(np.sign(np.linalg.det(U) * np.linalg.det(Vt)))
    total = float(np.sum(reading**2) + np.sum(model**2))
    R = U @ np.diag([1.0, 1.0, sign]) @ Vt
    best = total - 2.0 * (s[0] + s[1] + sign * s[2])
    return R, max(best, 0.0)


def _size(vectors: FloatArray) -> float:
    """Return the RMS of vectors (3, n), never zero."""
    return float(np.sqrt(np.mean(vectors**2))) + 1e-12


def _pattern(table: Table, blocks: Blocks, signs: tuple[int, ...]) -> Pattern:
    x = np.zeros(p.count(table.mounting_count))
    s = np.array(signs, dtype=float)[:, None]
    angles, rates = s * blocks.angles[:, 0], s * blocks.rates[:, 0]
    pose = Pose(table, x, angles, blocks.mounting)
    moved = motion(pose, x, rates, 0.0 * rates)
    model = np.concatenate([moved.table_rate + moved.earth_rate, moved.force])
    size_of = [_size(blocks.means[:3]), _size(blocks.means[3:])]
    # The size of a vector does not depend on rotations: scale errors show there and are removed.
    ratios = np.array(size_of) / [_size(model[:3]), _size(model[3:])]
    ratios = np.clip(ratios, 1.0 / MAX_SCALE, MAX_SCALE)
    reading = blocks.means / np.repeat(size_of, 3)[:, None]
    model = model * np.repeat(ratios / size_of, 3)[:, None]
    rotations, left = [], 0.0
    for m in range(table.mounting_count):
        at = blocks.mounting == m
        one = [np.concatenate([a[:3, at], a[3:, at]], axis=1) for a in (reading, model)]
        R, r = _fit(one[0], one[1])
        # One axis, still or turning, leaves the rotation about it open: then none is right.
        nominal = float(np.sum((one[0] - one[1]) ** 2))
        size = float(np.sum(one[0] ** 2))
        if nominal < max(CLEAR_RATIO**2 * r, _NO_ROTATION**2 * size):
            R, r = np.eye(3), min(r, nominal)
        rotations.append(R)
        left += r
    size = float(np.sum(reading**2))
    misfit = float(np.sqrt(left / size))
    return Pattern(signs, misfit, np.array(rotations))


def check_signs(table: Table, blocks: Blocks) -> SignCheck:
    """Return which signs and mountings explain the readings best."""
    if len(blocks) > _MAX_BLOCKS:
        blocks = blocks.part(np.linspace(0, len(blocks) - 1, _MAX_BLOCKS).astype(np.int64))
    turned = tuple(bool(np.ptp(a) > _MIN_TURN) for a in blocks.angles[:, 0])
    choices = [(1, -1) if t else (1,) for t in turned]
    found = [_pattern(table, blocks, signs) for signs in product(*choices)]
    least = min(q.misfit for q in found)
    likely = [q for q in found if q.misfit <= CLEAR_RATIO * least + _SAME_MISFIT]
    # Two axes reversed look like an IMU turned by 180 deg: the smaller mounting error is right.
    near = [q for q in likely if q.angles.max() <= MAX_MOUNTING_ANGLE]
    best = (
        found[0] if found[0] in near or (found[0] in likely and not near) else (near or likely)[0]
    )
    return SignCheck(best, found[0], turned)


def mount_rows(mount: FloatArray, rotation: FloatArray, *, applied: bool) -> FloatArray:
    """Return the `mount` (3, 3) that the readings show: rows are sensor axes in the mounting.

    mount: of the rig; applied: whether the readings were already transformed by it ([imu] mount),
    in contrast to one of [[mountings]].
    """
    C_sm = mount @ rotation if applied else rotation @ mount
    rounded = np.round(C_sm)
    exact = np.allclose(rounded @ rounded.T, np.eye(3)) and np.abs(C_sm - rounded).max() < 0.2
    return np.asarray(rounded if exact else C_sm)
