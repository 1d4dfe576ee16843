"""Still poses and moves of a log recorded by hand, without a table.

A sample is still where the readings of the half second around it scatter little more than in the
quietest part of the log. Runs of still samples are poses; between two poses lies one move.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]

WINDOW = 0.5  # s; several periods of the vibration of a hand (5 to 10 Hz)
QUIET_QUANTILE = 0.1  # of all windows; poses are at least a tenth of any multi-position log
ACCEL_FACTOR = 7.0  # times the quiet scatter: a desk that is touched (0.06 against 0.009 m/s^2)
GYRO_FACTOR = 3.6  # times the quiet scatter; a hand turns before it accelerates
MIN_POSE = 1.5  # s
TRIM = 0.3  # s cut at both ends: the hand lets go, the case settles
MIN_POSES = 12  # nine accelerometer parameters, with a margin of three
MAX_MOVE = 30.0  # s; a longer move carries gravity with the drift of its bias


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of a hand-held log: first and end sample (n,) of each, sample rate, noise.

    accel, gyro: (n, 3) means of the readings, m/s^2 and rad/s; accel_noise, gyro_noise: (3,)
    scatter of one sample in the poses.
    """

    first: IntArray
    end: IntArray
    interval: float
    accel: FloatArray
    gyro: FloatArray
    accel_noise: FloatArray
    gyro_noise: FloatArray

    def __len__(self) -> int:
        return len(self.first)

    @property
    def count(self) -> IntArray:
        """Samples of each pose."""
        return self.end - self.first

    @property
    def time(self) -> FloatArray:
        """Middle of each pose since the first sample, s."""
        return np.asarray(0.5 * (self.first + self.end - 1) * self.interval)


def _moving_scatter(v: FloatArray, window: int) -> FloatArray:
    """Return the standard deviation (m, 3) over every window of some samples."""
    centred = v - v.mean(axis=0)
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(centred, axis=0)])
    squares = np.concatenate([np.zeros((1, 3)), np.cumsum(centred**2, axis=0)])
    mean = (sums[window:] - sums[:-window]) / window
    variance = (squares[window:] - squares[:-window]) / window - mean**2
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def find_poses(gyro: FloatArray, accel: FloatArray, interval: float) -> Poses:
    """Return the still poses of readings (n, 3) each, rad/s and m/s^2, `interval` s apart."""
    window = max(3, round(WINDOW / interval))
    still = np.zeros(len(gyro), dtype=bool)
    if len(gyro) > 2 * window:
        quiet = np.ones(len(gyro) - window + 1, dtype=bool)
        for readings, times in ((gyro, GYRO_FACTOR), (accel, ACCEL_FACTOR)):
            scatter = _moving_scatter(readings, window)
            level = np.quantile(scatter, QUIET_QUANTILE, axis=0)
            quiet &= np.all(scatter < times * level, axis=1)
        half = window // 2
        still[half : half + len(quiet)] = quiet
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    first, end = edges[::2], edges[1::2]
    long = (end - first) * interval >= MIN_POSE
    trim = round(TRIM / interval)
    first, end = first[long] + trim, end[long] - trim
    if len(first) == 0:
        empty = np.zeros((0, 3))
        return Poses(first, end, interval, empty, empty, np.zeros(3), np.zeros(3))
    parts = [(gyro[a:b], accel[a:b]) for a, b in zip(first, end, strict=True)]
    return Poses(
        first=first,
        end=end,
        interval=interval,
        accel=np.array([a.mean(axis=0) for _, a in parts]),
        gyro=np.array([g.mean(axis=0) for g, _ in parts]),
        accel_noise=np.sqrt(np.mean([a.var(axis=0, ddof=1) for _, a in parts], axis=0)),
        gyro_noise=np.sqrt(np.mean([g.var(axis=0, ddof=1) for g, _ in parts], axis=0)),
    )
