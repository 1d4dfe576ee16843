"""What the still table leaves of the corrected readings of a window, as means of equal blocks.

Gyros: corrected reading less Earth rate and table rate. Accelerometers: corrected reading less
gravity and, with a lever arm, the acceleration of the IMU about the axis. A block is a second
(longer in long windows), the means are those of its samples.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.logs.record import ImuLog
from rotcli.models import rotation
from rotcli.models.base import FixedBase
from rotcli.models.expected.companions import block_length
from rotcli.models.sensors import TriadErrors, correct
from rotcli.rig.rig import Rig
from rotcli.run import stages
from rotcli.run.evidence.samples import SampleScan
from rotcli.run.evidence.stillness import check_still
from rotcli.run.findings import Finding
from rotcli.run.recording import NavigationRun
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class WindowResiduals:
    """Mean residuals of a window: gyro (n, 3) rad/s, accel (n, 3) m/s^2 per block.

    start: s, of the first block; length: s; rate: (n,) rad/s, table rate of each block; angle:
    (n,) rad, table angle in its middle.
    mean_gyro: (3,) rad/s over all samples of the window, also those after the last block.
    findings: samples that were not measured.
    """

    start: float
    length: float
    gyro: FloatArray
    accel: FloatArray
    rate: FloatArray
    angle: FloatArray
    mean_gyro: FloatArray
    findings: tuple[Finding, ...] = ()


class WindowMeans:
    """Means of readings, and of cosine and sine of the table angle, over blocks of a run's window.

    `add` takes the chunks of the window in their order, so that the log is read once. start: s, of
    the first block; length: s; count: samples; means (8, blocks) of gyros, accelerometers, cosine,
    sine; total (8,) over all samples.
    """

    def __init__(self, run: NavigationRun) -> None:
        imu = run.imu
        averages = imu.sampling != "instant"
        # The first mean is that of the interval before the window: a ramp may end there.
        self._skipped = int(averages)
        first = run.window.start + self._skipped
        self._run, self.count = run, run.window.stop - first
        size = max(1, round(block_length(self.count * imu.interval) / imu.interval))
        self._size = min(size, self.count)
        self.length = self._size * imu.interval
        # A sample at an instant represents half an interval either side, a mean the one before.
        offset = imu.interval if averages else 0.5 * imu.interval
        self.start = float(imu.times(slice(first, first + 1))[0]) - offset
        self.blocks = self.count // self._size
        self.means, self.total = np.zeros((8, self.blocks)), np.zeros(8)
        self.scan = SampleScan()
        self._done, self._rest = 0, np.empty((8, 0))

    def add(self, chunk: ImuLog, turned: FloatArray) -> None:
        """Add the chunk that follows; turned: (2, n), cosine and sine of half the table angle."""
        self.scan.add(chunk)
        kept = self._rest.shape[1]
        signals = np.empty((8, kept + chunk.samples - self._skipped))
        signals[:, :kept] = self._rest
        new, used = signals[:, kept:], slice(self._skipped, None)
        new[:3], new[3:6] = chunk.gyro[used].T, chunk.accel[used].T
        _turn(self._run, chunk.time[used], turned[:, used], new[6:])
        self._skipped = 0
        self.total += new.sum(axis=1)
        blocks = min(signals.shape[1] // self._size, self.blocks - self._done)
        complete = blocks * self._size
        by_block = signals[:, :complete].reshape(8, blocks, self._size)
        self.means[:, self._done : self._done + blocks] = by_block.mean(axis=2)
        self._done += blocks
        self._rest = signals[:, complete:].copy()


def window_residuals(
    run: NavigationRun,
    base: FixedBase,
    gyro_errors: TriadErrors,
    accel_errors: TriadErrors | None,
    window: WindowMeans,
) -> WindowResiduals:
    """Return the mean residuals of a run's window, corrected for the given errors.

    The rate of a steady window is its mean rate: differences of an encoder's angle over a second
    would add its resolution to the residuals. Correction and rotation are linear in the readings
    and in cosine and sine of the angle, so the means of these suffice.
    """
    axis, means = run.axis, window.means
    edges = window.start + window.length * np.arange(window.blocks + 1, dtype=float)
    angle = run.angle_at(np.clip(edges, *_covered(run)))
    rate, middle = np.diff(angle) / window.length, 0.5 * (angle[1:] + angle[:-1])
    if run.constant_rate:
        rate = np.full(window.blocks, run.rate)
    w_ie_b, g_b = base.w_ie_b, base.specific_force
    gyro = correct(gyro_errors, means[:3].T) - _mean_in_sensor(axis, means[6:], w_ie_b)
    gyro -= rate[:, None] * axis
    accel = means[3:6].T if accel_errors is None else correct(accel_errors, means[3:6].T)
    accel = accel - _mean_in_sensor(axis, means[6:], g_b)
    if np.any(run.lever_arm):
        accel -= _lever_arm_acceleration(axis, run.lever_arm, rate, window.length)
    overall = window.total[:, None] / window.count
    mean = correct(gyro_errors, overall[:3].T) - _mean_in_sensor(axis, overall[6:], w_ie_b)
    mean = mean[0] - run.rate * axis
    invalid = tuple(window.scan.findings(run.imu.path))
    return WindowResiduals(window.start, window.length, gyro, accel, rate, middle, mean, invalid)


def _covered(run: NavigationRun) -> tuple[float, float]:
    """Return the times (s) between which the table angle is known."""
    if run.table is None:
        return -np.inf, np.inf
    return float(run.table.time[0]), float(run.table.time[-1])


def _turn(run: NavigationRun, time: FloatArray, turned: FloatArray, out: FloatArray) -> None:
    """Write cosine and sine of the table angle, (2, n), at samples, or in the middle of means.

    time: (n,) s; turned: (2, n), cosine and sine of half the table angle at these times.
    """
    if not len(time):
        return
    first = _covered(run)[0]
    if run.imu.sampling == "instant" and time[0] >= first:
        cosine, sine = turned
        np.multiply(-2.0 * sine, sine, out=out[0])
        out[0] += 1.0
        np.multiply(2.0 * sine, cosine, out=out[1])
        return
    middle = time - (0.5 * run.imu.interval if run.imu.sampling != "instant" else 0.0)
    angle = run.angle_at(np.maximum(middle, first))
    out[0], out[1] = np.cos(angle), np.sin(angle)


def _mean_in_sensor(axis: FloatArray, means: FloatArray, v_b: FloatArray) -> FloatArray:
    """Return the means (n, 3) in s of a vector (3,) fixed in b.

    means: (2, n), of cosine and sine of the table angle.
    """
    parallel = (axis @ v_b) * axis
    cosine, sine = means[:, :, None]
    result: FloatArray = cosine * (v_b - parallel) - sine * np.cross(axis, v_b) + parallel
    return result


def _lever_arm_acceleration(
    axis: FloatArray, lever_arm: FloatArray, rate: FloatArray, length: float
) -> FloatArray:
    """Return the mean acceleration (n, 3) of the IMU about the axis in blocks of given rates.

    The mean of w^2 over a block is that of its mean rate and a twelfth of its change squared.
    """
    change = np.gradient(rate) if len(rate) > 1 else np.zeros(len(rate))
    centripetal = np.cross(axis, np.cross(axis, lever_arm))
    tangential = np.cross(axis, lever_arm)
    square = rate**2 + change**2 / 12.0
    return np.outer(square, centripetal) + np.outer(change / length, tangential)


@dataclass(frozen=True, eq=False)
class StillAccelerometers:
    """Mean residual (3,) m/s^2 of the accelerometers in a still segment [start, end] (s).

    angle: rad, of the table.
    """

    start: float
    end: float
    bias: FloatArray
    angle: float = 0.0


def still_accelerometers(
    run: NavigationRun, rig: Rig, base: FixedBase, accel_errors: TriadErrors | None
) -> StillAccelerometers | None:
    """Return the accelerometer biases that a still segment of the log shows, None without one.

    A segment that is not clearly still does not serve.
    """
    try:
        segment = run.still or stages.still_segment(rig, run.table, run.imu)
        if run.still is None and check_still(run.imu, segment):
            return None
        span = run.imu.within(segment.start, segment.end)
    except LogError:
        return None
    if span.stop - span.start < 2:
        return None

    def residual(chunk: ImuLog, angle: FloatArray) -> FloatArray:
        f = chunk.accel if accel_errors is None else correct(accel_errors, chunk.accel)
        gravity = rotation.sum_rotated(run.axis, -angle, base.specific_force)
        return np.asarray(f.sum(axis=0) - gravity)

    first, last = (float(run.imu.times(slice(k, k + 1))[0]) for k in (span.start, span.stop - 1))
    angle = float(run.angle_at(np.array([0.5 * (first + last)]))[0])
    return StillAccelerometers(first, last + run.imu.interval, run.mean(span, residual), angle)
