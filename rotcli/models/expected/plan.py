"""Expected errors before any test: R16's run with given sensors, per axis, mode, rate and time.

Still for a minute, turning for a minute at the rate of the navigation, then navigation (R16
section 4); conventional: still for a minute, then navigation on the still table. Biases and axis
column are estimated from the two minutes by least squares.
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.expected.errors import ExpectedErrors, expected_errors
from rotcli.models.expected.motion import StillTable, cut_window
from rotcli.models.expected.sources import (
    AccelSource,
    AxisSource,
    GyroSource,
    least_squares_contrast,
    still_contrast,
)
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.numerics.blas_threads import one_thread
from rotcli.units import FloatArray

Mode = Literal["conventional", "partial", "full"]
CONVENTIONAL, PARTIAL, FULL = "conventional", "partial", "full"
STILL_TIME = TURNING_TIME = 60.0  # s, R16 section 3
_RAMP = 1.0  # s, between still and turning


@dataclass(frozen=True, eq=False)
class PlannedSensors:
    """What is known of the sensors before a test, SI; noise: N and slow noise of 1 or 3 axes.

    matrix: (3, 3) N of the gyros that `partial` leaves in; matrix_sigma: of its elements where
    they are not known; accel_bias (3,) and its sigma (3,) where no still segment will show it:
    the still minute of the run does, so the sigma is that of what changes later.
    """

    gyro: tuple[tuple[float, SlowNoise], ...]
    accel: tuple[tuple[float, SlowNoise], ...]
    matrix: FloatArray
    matrix_sigma: float = 0.0
    accel_bias: FloatArray | None = None


def planned_errors(
    sensors: PlannedSensors,
    table: StillTable,
    mode: Mode,
    rate: float,
    duration: float,
    attitude_sigma: FloatArray | None = None,
) -> ExpectedErrors:
    """Return the expected errors of a planned run; rate: rad/s about table.axis, duration: s.

    Raises TooManyBlocksError for a run with too many turns.
    """
    w = 0.0 if mode == CONVENTIONAL else rate
    turning = STILL_TIME + _RAMP
    start = STILL_TIME if mode == CONVENTIONAL else turning + TURNING_TIME
    if mode == FULL:
        begin, end = np.array([0.0, turning]), np.array([STILL_TIME, start])
        contrast = least_squares_contrast(begin, end, np.array([0.0, w]))
    else:
        contrast = still_contrast(0.0, STILL_TIME)
    partial = mode == PARTIAL
    gyro = GyroSource(
        tuple(AxisSource(white, slow, contrast) for white, slow in sensors.gyro),
        column=sensors.matrix @ table.axis if partial else np.zeros(3),
        column_sigma=np.full(3, sensors.matrix_sigma if partial else 0.0),
    )
    still = still_contrast(0.0, STILL_TIME)
    accel = AccelSource(
        tuple(AxisSource(white, slow, still) for white, slow in sensors.accel),
        np.zeros(3) if sensors.accel_bias is None else sensors.accel_bias,
    )
    blocks = cut_window(start, start + duration, lambda time: w * (time - start), abs(w))
    if mode == CONVENTIONAL:
        attitude_sigma = None  # the still minute has the same attitude: its errors cancel
    with one_thread():
        return expected_errors(table, blocks, gyro, accel, attitude_sigma)


def turned_about(table: StillTable, axis: FloatArray) -> StillTable:
    """Return the same table turning about another axis (3,) of the body."""
    return replace(table, axis=axis)
