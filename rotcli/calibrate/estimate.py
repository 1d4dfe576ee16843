"""Calibrate a gyro triad from still and turning stretches (R16 section 3).

Turning at rate w about the unit axis u, a gyro triad reads `w_is + w N u + d`: least squares
gives the bias d and `N u`, the scale factor and installation errors that this axis excites.
R16 is "Rotary Inertial Navigation System Based on MEMS IMU", Sensors 2016, 16, 2017.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rotcli.calibrate.slow_noise import covariance_of_means
from rotcli.logs.record import ImuSource, Progress, Segment, TableLog
from rotcli.models import rotation
from rotcli.models.base import FixedBase
from rotcli.models.sensors import BIAS_NAMES, COLUMN_NAMES, NoiseFigures, TriadErrors, correct
from rotcli.run.checks import judge
from rotcli.run.findings import CheckError, Finding
from rotcli.run.gravity import check_gravity
from rotcli.run.table_angle import angle_at
from rotcli.units import show_span

Array = NDArray[np.float64]

_SAME_RATE = 1e-3  # of a rate: two that differ by less are one
_BLOCK = 0.25  # s; here noise is white: slower than the filters of sensors, faster than flicker
_LEAST = 50  # blocks that tell a variance to 20 %
_NO_SLOW_NOISE = Finding(
    "no-slow-noise",
    "the rig has no bias_instability, rate_random_walk or Gauss-Markov figures. The sigmas contain "
    "white noise only and are too small; measure a still log of hours with rotcli allan",
)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of a calibration, SI.

    values: (6,) column of N along the axis (three fractions), then the biases (rad/s);
    covariance (6, 6) in the same order, named by `names`. stretches: those used, still first.
    residual_rms: (3,) rad/s about the model. white: (3,) rad/sqrt(s), the random walk behind the
    covariance. predicted_bias (rad/s), predicted_column (fraction): R16 (35) and (36).
    rate: rad/s, that of the first turning stretch. mean_after: (3,) rad/s, mean corrected gyro
    of the stretches at that rate.
    """

    axis_name: str
    axis: Array
    rate: float
    names: tuple[str, ...]
    values: Array
    covariance: Array
    stretches: tuple[Segment, ...]
    residual_rms: Array
    white: Array
    predicted_bias: float
    predicted_column: float
    mean_after: Array
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> TriadErrors:
        """The constant errors found, for `rotcli.models.sensors.correct`."""
        return TriadErrors(np.outer(self.values[:3], self.axis), self.values[3:])


@dataclass(eq=False)
class _Sums:
    """What calibration needs of the samples of a stretch, summed piece by piece.

    mean (3,), squares (3,): of Z about its mean; steps (3,), pairs: squared differences of the
    means of neighbouring blocks of `_BLOCK` s, and how many; gyro (3,), force (3,): mean reading,
    mean specific force in b. Sums of pieces merge as in Chan, Golub, LeVeque, Am. Statistician 37
    (1983) 242.
    """

    count: int
    mean: Array
    squares: Array
    steps: Array
    gyro: Array
    force: Array
    pairs: int = 0


def _sums(
    pieces: Iterator[tuple[Array, Array, Array, Array]], size: int, told: Progress | None
) -> _Sums:
    """Sum up the pieces (times, Z, gyro, force) of a stretch.

    size: samples in a block; told: the time (s) reached.
    """
    total = _Sums(0, *np.zeros((5, 3)))
    left, before = np.empty((0, 3)), np.empty((0, 3))
    for time, Z, gyro, force in pieces:
        if told:
            told(float(time[-1]))
        n, mean = len(Z), Z.mean(axis=0)
        apart = mean - total.mean
        count = total.count + n
        total.squares += ((Z - mean) ** 2).sum(axis=0) + apart**2 * total.count * n / count
        left = np.concatenate([left, Z])
        whole = len(left) // size
        blocks = left[: whole * size].reshape(whole, size, 3).mean(axis=1)
        steps = np.diff(np.concatenate([before, blocks]), axis=0)
        total.steps += (steps**2).sum(axis=0)
        total.pairs += len(steps)
        left, before = left[whole * size :], blocks[-1:] if whole else before
        total.mean = total.mean + apart * n / count
        total.gyro = total.gyro + (gyro.mean(axis=0) - total.gyro) * n / count
        total.force = total.force + (force.mean(axis=0) - total.force) * n / count
        total.count = count
    return total


def _tell(progress: Progress, before: float, length: float, time: float) -> None:
    progress((before + time) / length)


def _pieces(
    imu: ImuSource, table: TableLog, stretch: Segment, u: Array, base: FixedBase | None
) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Yield times (n,), Z = gyro - w_ref, gyro (rad/s) and force in b (m/s^2), (n, 3)."""
    for piece in imu.pieces(imu.within(stretch.start, stretch.end)):
        angle = angle_at(table, piece.time)
        Z = piece.gyro - _reference(u, stretch.rate, angle, base)
        yield piece.time, Z, piece.gyro, rotation.rotate_about(u, angle, piece.accel)


def residual_parts(
    imu: ImuSource, table: TableLog, result: Calibration, base: FixedBase | None
) -> Iterator[tuple[Array, Array]]:
    """Yield the times (n,), s, and what the fit leaves of the readings there (n, 3), rad/s."""
    column, bias = result.values[:3], result.values[3:]
    for stretch in result.stretches:
        for time, Z, *_ in _pieces(imu, table, stretch, result.axis, base):
            yield time, Z - stretch.rate * column - bias


def calibrate(
    imu: ImuSource,
    table: TableLog,
    static: Sequence[Segment],
    turning_segments: Sequence[Segment],
    *,
    axis_name: str,
    axis: Array,
    base: FixedBase | None,
    white: Array | None = None,
    wander: Sequence[NoiseFigures] | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Estimate biases and the column `N u` of the gyro triad by least squares, R16 (34).

    axis: (3,) u in b (and s). base: None leaves Earth rate in the data, as the paper does.
    white: (3,) rad/sqrt(s), angle random walks; None estimates them from the data.
    wander: the slow noise of each gyro; None where nothing is known of it.
    progress: told how much (0 to 1) is done.

    The covariance is that of least squares under white noise and, between the means of the
    stretches, under the slow noise since the log's first sample: the biases are those there.
    Raises LogError when the stretches cannot separate the unknowns.
    """
    u = np.asarray(axis, dtype=float)
    stretches = (*static, *turning_segments)
    if not turning_segments:
        raise CheckError(imu.path, "no-turning-segment", "no turning segment; record one")
    rates = np.array([stretch.rate for stretch in stretches])
    if np.ptp(rates) < _SAME_RATE * np.max(np.abs(rates)):
        raise CheckError(
            imu.path,
            "one-rate",
            "all segments have the same rate, so bias and scale factor cannot be separated; add a "
            "still segment or a second rate",
        )
    length = sum(stretch.duration for stretch in stretches)
    size = max(1, min(round(_BLOCK / imu.interval), round(length / imu.interval) // _LEAST))
    sums: list[_Sums] = []
    done = 0.0
    for stretch in stretches:
        told = progress and partial(_tell, progress, done - stretch.start, length)
        sums.append(_sums(_pieces(imu, table, stretch, u, base), size, told))
        done += stretch.duration
    counts = np.array([float(s.count) for s in sums])
    means = np.array([s.mean for s in sums])

    # Per gyro axis, unknowns (N u, d): normal equations on stretches weighted by their samples.
    design = np.column_stack([rates, np.ones_like(rates)])
    inverse = np.linalg.inv(design.T @ (counts[:, None] * design))
    gain = inverse @ (design.T * counts)
    column, bias = gain @ means

    # Differences of neighbours leave out drift and whatever the model does not explain; means of
    # a quarter of a second what a sensor's own filter does to the noise from sample to sample.
    steps = np.sum([s.steps for s in sums], axis=0) / max(1, sum(s.pairs for s in sums))
    seen = np.asarray(np.sqrt(0.5 * size * imu.interval * steps))
    used = seen if white is None else white
    edges = np.array([[s.start, s.end] for s in stretches]).T - imu.time[0]
    start, end = np.maximum(edges, 0.0)
    covariance = np.zeros((6, 6))
    for i in range(3):
        pair = used[i] ** 2 / imu.interval * inverse
        if wander is not None:
            pair = pair + gain @ covariance_of_means(wander[i], start, end) @ gain.T
        covariance[np.ix_([i, 3 + i], [i, 3 + i])] = pair
    left = means - np.outer(rates, column) - bias
    squares = np.sum([s.squares for s in sums], axis=0) + counts @ left**2
    turning = [k for k, stretch in enumerate(stretches) if stretch.rate != 0.0]
    found = TriadErrors(np.outer(column, u), bias)
    rate = turning_segments[0].rate
    alike = [k for k in turning if abs(rates[k] - rate) <= _SAME_RATE * abs(rate)]
    readings = np.average([sums[k].gyro for k in alike], axis=0, weights=counts[alike])

    still_time = sum(s.duration for s in stretches if s.rate == 0.0)
    turning_time = sum(stretches[k].duration for k in turning)
    turned = sum(abs(stretches[k].angle) for k in turning)
    typical = float(np.sqrt(np.mean(used**2)))
    return Calibration(
        axis_name=axis_name,
        axis=u,
        rate=rate,
        names=(*COLUMN_NAMES[axis_name], *BIAS_NAMES),
        values=np.concatenate([column, bias]),
        covariance=covariance,
        stretches=stretches,
        residual_rms=np.sqrt(squares / counts.sum()),
        white=used,
        predicted_bias=typical / np.sqrt(still_time) if still_time else np.inf,
        predicted_column=typical * np.sqrt(turning_time) / turned,
        mean_after=correct(found, readings[None])[0],
        findings=judge(
            "calibrate",
            (
                *_warnings(turning_segments, base, seen, white),
                *_gravity_warnings(imu, sums, base),
                *([] if wander else [_NO_SLOW_NOISE]),
            ),
        ),
    )


def _reference(u: Array, rate: float, angle: Array, base: FixedBase | None) -> Array:
    """Return the true rate w_is_s (m, 3) of a stretch: table rate and, with a base, Earth rate."""
    if base is None:
        return np.broadcast_to(rate * u, (len(angle), 3))
    return base.w_ie_s(u, angle) + rate * u


def _gravity_warnings(
    imu: ImuSource, sums: list[_Sums], base: FixedBase | None
) -> tuple[Finding, ...]:
    """Return what gravity says against the attitude that Earth rate is compensated with."""
    if base is None:
        return ()
    felt = np.mean([s.force for s in sums], axis=0)
    return check_gravity(imu, felt, base.specific_force)


def _warnings(
    turning_segments: Sequence[Segment], base: FixedBase | None, seen: Array, white: Array | None
) -> tuple[Finding, ...]:
    found = []
    for stretch in turning_segments:
        turns = abs(stretch.angle) / (2.0 * np.pi)
        if turns < 1.0:
            leak = "" if base is not None else ". Uncompensated Earth rate biases the result"
            where = show_span(stretch.start, stretch.end)
            text = f"segment {where} covers {turns:.2f} turns, less than one{leak}"
            found.append(Finding("segment-turns", text, "warning", where, turns, 1.0, "turns"))
    ratio = 1.0 if white is None or not np.all(white) else float(np.median(seen / white))
    if not 0.5 < ratio < 2.0:
        text = (
            f"white noise of the log is {ratio:.2g} times angle_random_walk; the sigmas use the rig"
        )
        found.append(Finding("noise-figures", text, "warning", "gyro", ratio, 2.0))
    return tuple(found)
