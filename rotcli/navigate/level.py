"""Level of a turning table from the accelerometers, free of their biases.

Gravity that is wrong in the rig turns with the table angle in the sensor frame, an accelerometer
bias does not: least squares of the block residuals on both separates them. A component along the
axis looks like a bias and is not estimated. White noise and flicker noise at the turning rate
bound it: sigma^2 = (N^2 + B^2 / (2 pi f)) / T per component, m/s^2.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import rotation
from rotcli.models.base import FixedBase, level
from rotcli.models.expected.sources import AccelSource, three_axes
from rotcli.navigate.residuals import WindowResiduals
from rotcli.units import FloatArray

_MIN_TURNS = 1.0
# Over a block the modulation is averaged: below this fraction its noise would dominate.
_MIN_ATTENUATION = 0.2
# rad; tables are levelled to a minute of arc or two, which 300 s turn into 70 m.
_LEVEL_TOLERANCE = np.deg2rad(0.02)
# Scale factor and misalignment of accelerometers as delivered, relative to the gravity that turns.
ACCEL_SCALE_TOLERANCE = 3e-3
_SIGMAS = 5.0


@dataclass(frozen=True, eq=False)
class LevelEstimate:
    """Table level from the accelerometers: pitch, roll (rad), sigma (rad) of either.

    gravity: (3,) m/s^2, what is added to the rig's gravity in the body frame; turned: (n, 3) what
    it is in the block residuals; significant: whether it exceeds its limit.
    """

    pitch: float
    roll: float
    sigma: float
    gravity: FloatArray
    turned: FloatArray
    significant: bool


def estimate_level(
    residuals: WindowResiduals, axis: FloatArray, base: FixedBase, source: AccelSource
) -> LevelEstimate | None:
    """Return the level of a table that turns, None where it does not turn enough.

    residuals: of the accelerometers against the rig's gravity.
    """
    turn = residuals.rate * residuals.length
    attenuation = np.sinc(turn / (2.0 * np.pi))
    turns = float(np.sum(np.abs(turn))) / (2.0 * np.pi)
    if turns < _MIN_TURNS or float(np.min(np.abs(attenuation))) < _MIN_ATTENUATION:
        return None
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    across = np.stack([first, np.cross(axis, first)])
    shapes = attenuation[:, None, None] * np.stack(
        [rotation.rotate_about(axis, -residuals.angle, np.tile(e, (len(turn), 1))) for e in across],
        axis=2,
    )  # (n, 3, 2)
    centred = residuals.accel - residuals.accel.mean(axis=0)
    design = (shapes - shapes.mean(axis=0)).reshape(-1, 2)
    found = np.linalg.lstsq(design, centred.ravel(), rcond=None)[0]
    g_b = base.specific_force
    delta = across.T @ found
    delta = delta - g_b * (delta @ g_b) / (g_b @ g_b)  # a longer gravity is a scale factor
    pitch, roll = level(g_b + delta)
    duration = len(turn) * residuals.length
    frequency = turns / duration
    axes = three_axes(source)
    noise = max(a.white**2 + a.slow.bias_instability**2 / (2.0 * np.pi * frequency) for a in axes)
    g = float(np.linalg.norm(g_b))
    sigma = float(np.sqrt(noise / duration)) / g
    turning_part = float(np.linalg.norm(g_b - axis * (axis @ g_b))) / g
    limit = max(_SIGMAS * sigma, _LEVEL_TOLERANCE, ACCEL_SCALE_TOLERANCE * turning_part)
    return LevelEstimate(
        pitch=pitch,
        roll=roll,
        sigma=sigma,
        gravity=delta,
        turned=np.asarray(shapes @ (across @ delta)),
        significant=float(np.linalg.norm(delta)) / g > limit,
    )
