"""Find where a log is disturbed: innovations that are locally too large, jumps of the gyros."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.units import DEG, FloatArray

WINDOW = 5.0  # s
MIN_UPDATES = 10  # per window
_START = 10.0  # s: the filter converges, the innovations depend on the initial sigmas
# Normal quantile of 1e-9: in a day of windows of 5 s, one false alarm in 50,000 logs.
_QUANTILE = 6.0
# Innovations are not white where biases follow another model than a random walk.
_MARGIN = 1.5


# rad, between two updates: an azimuth error of that size rotates a bias of 0.02 m/s^2 by 2.4e-4
# m/s^2, the sigma that accelerometer biases reach.
MIN_JUMP = 0.7 * DEG
_MIN_RATE_SPREAD = 1.0 * DEG  # rad/s, standard deviation of the table rate over the log
_JUMP_SIGMAS = 8.0  # robust sigmas, for coarse encoders and noisy gyros


@dataclass(frozen=True)
class Jump:
    """The largest jump between gyros and table: time (s) from the start of the run, size (rad)."""

    time: float
    size: float
    limit: float


class RelativeRotation:
    """The sensors' rotation about the axis relative to the table, update by update.

    It shows what a velocity on a level table does not: errors of gyro and encoder about up.
    """

    def __init__(self, tau: float) -> None:
        self._tau = tau
        self._angles: list[FloatArray] = []
        # Sums over the updates: number, table angle, its square, relative angle, their product.
        self._sums = np.zeros(5)

    def add(self, table_angle: FloatArray, relative_angle: FloatArray) -> None:
        """Add the rotations (n,), rad, of the updates that follow."""
        t, r = table_angle, relative_angle
        self._angles.append(r.astype(np.float32))  # 1e-7 of it is far below the limit
        self._sums += [len(t), t.sum(), t @ t, r.sum(), t @ r]

    def scale_error(self) -> float | None:
        """Return the slope of the relative over the table's rotation; None at a single rate.

        A bias of 100 deg/h that sets in with the rotation adds 900 ppm at 30 deg/s.
        """
        n, t, tt, r, tr = self._sums
        variance = tt / n - (t / n) ** 2
        if variance < (_MIN_RATE_SPREAD * self._tau) ** 2:
            return None
        return float((tr / n - t / n * r / n) / variance)

    def largest(self) -> Jump | None:
        """Return the largest jump, if it is significant."""
        angles = np.concatenate(self._angles) if self._angles else np.zeros(0)
        if len(angles) < MIN_UPDATES:
            return None
        change = np.abs(np.diff(angles))
        limit = max(MIN_JUMP, _JUMP_SIGMAS * 1.4826 * float(np.median(change)))
        worst = int(np.argmax(change))
        size = float(change[worst])
        return Jump((worst + 1) * self._tau, size, limit) if size > limit else None


@dataclass(frozen=True)
class Disturbance:
    """The window with the largest innovations: time (s) of the largest, from the run's start.

    ratio: mean NIS of the window over the median of all windows; limit: of that ratio.
    """

    time: float
    ratio: float
    limit: float


class InnovationWindows:
    """Means of NIS over windows of a run whose updates come chunk by chunk."""

    def __init__(self, tau: float) -> None:
        self._tau = tau
        self._size = max(MIN_UPDATES, round(WINDOW / tau))
        self._rest: FloatArray = np.zeros(0)
        self._means: list[FloatArray] = []
        self._peaks: list[FloatArray] = []  # position of the largest NIS in each window, updates

    def add(self, nis: FloatArray) -> None:
        """Add the NIS (n,) of the updates that follow."""
        nis = np.concatenate([self._rest, nis])
        count = len(nis) // self._size
        windows = nis[: count * self._size].reshape(count, self._size)
        self._means.append(windows.mean(axis=1))
        self._peaks.append(windows.argmax(axis=1).astype(float))
        self._rest = nis[count * self._size :].copy()

    def largest(self) -> Disturbance | None:
        """Return the window of the largest innovations, if they are significantly too large."""
        means = np.concatenate(self._means) if self._means else np.zeros(0)
        first = int(np.ceil(_START / (self._size * self._tau)))
        if len(means) < first + 4:
            return None
        used = means[first:]
        ratio = used / np.median(used)
        # Quantile of chi-squared over its mean (Wilson and Hilferty, PNAS 17 (1931)).
        c = 2.0 / (9.0 * 3 * self._size)
        limit = _MARGIN * float((1.0 - c + _QUANTILE * np.sqrt(c)) ** 3)
        worst = int(np.argmax(ratio))
        if ratio[worst] <= limit:
            return None
        peak = (first + worst) * self._size + np.concatenate(self._peaks)[first + worst] + 1.0
        return Disturbance(float(peak * self._tau), float(ratio[worst]), limit)
