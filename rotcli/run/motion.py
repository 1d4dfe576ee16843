"""The rule for still and turning, and the motion of the table in a time interval.

Every part of rotcli that needs to know whether the table is still or turning asks `is_still`, or
a `Segment` or an `IntervalMotion` that was made with it: both have the rate 0 when still.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import TableLog
from rotcli.models.turntable import STILL_RATE
from rotcli.units import DEG, FloatArray

# rad: 0.01 deg, the resolution of common encoders and the width of a servo's position loop; as a
# rotation of the IMU it is a fifth of the attitude accuracy of a levelled table.
STILL_ANGLE = 0.01 * DEG
# rad: quarter of the range of a servo's hunting about its position, R16 section 4.
_MIN_RESOLUTION = 1e-3 * DEG
# rad: the angle of a table at constant rate may deviate by this from a straight line; at 10 deg/s
# it corresponds to 0.1 s, so that a ramp of a second at either end does not pass.
_CONSTANT_RATE_TOLERANCE = 1.0 * DEG
# s: angles are averaged over it before their range is taken; shorter than any oscillation of a
# table, long enough to reduce the noise of an encoder.
_AVERAGING_TIME = 1.0
_ROUNDING = 1e-9  # rad: of the digits of an angle of many turns in double precision
_MIN_NOISY_SHARE = 0.02  # of the records: fewer are the kinks of a noise-free ramp
_MIN_MOVING_SHARE = 0.2  # of the records that move: noise is in all, kinks only at the ends
_MIN_STEPS = 20  # differences that must be multiples of a step
_MIN_IRREGULAR = 0.4  # of the records that change their rate: 0.1 in ideal ramps, 0.7 in steps
_MAX_MULTIPLE = 300.0  # steps per record
_RESOLUTION_SIGMAS = 4.0  # sigma of an angle within the resolution
_RESOLUTION_RECORDS = 1_000_000  # five hours at 50 Hz show an encoder's noise


def is_still(angle: float, duration: float, resolution: float = 0.0) -> bool:
    """Return whether a table that moves through `angle` (rad) in `duration` (s) is still.

    resolution: rad, of the encoder. Still is what the encoder cannot distinguish from no motion,
    STILL_ANGLE, and STILL_RATE over the duration; 0.03 deg in 300 s is still.
    """
    return abs(angle) <= max(STILL_ANGLE, 2.0 * resolution, STILL_RATE * duration)


@dataclass(frozen=True)
class EncoderNoise:
    """Noise of a table log.

    resolution: rad, within which angles agree with a straight line; time_jitter: s, 95 % quantile
    of the second differences of its time stamps; sigma: rad, 1 sigma of an angle.
    """

    resolution: float
    time_jitter: float
    sigma: float = 0.0

    @property
    def time_sigma(self) -> float:
        """1 sigma (s) of a time stamp: second differences have sqrt(6) of it, 1.96 at 95 %."""
        return self.time_jitter / (1.96 * math.sqrt(6.0))


@lru_cache(maxsize=2)  # every check of a run asks for it
def encoder_noise(table: TableLog) -> EncoderNoise:
    """Return the angle resolution and the time jitter of a table log, estimated once for each.

    Fourth differences contain the noise and next to nothing of the motion (median of their size
    0.6745 sqrt(70) sigma). Where the angle does not change the encoder shows nothing, so only
    records with a fourth difference count: those of a staircase of steps s have 0.4 s by this
    measure, a little more than the s/sqrt(12) of a uniform error. Kinks alone are no noise.
    """
    sigma, jitter, step = 0.0, 0.0, 0.0
    if len(table.angle) > 8:
        time, angle = table.time[:_RESOLUTION_RECORDS], table.angle[:_RESOLUTION_RECORDS]
        sigma, step = _noise_sigma(angle), encoder_step(angle)
        jitter = float(np.quantile(np.abs(np.diff(time, 2)), 0.95))
    if sigma < step:  # what the fourth differences show is the step itself
        sigma = step / 12.0**0.5
        return EncoderNoise(_MIN_RESOLUTION + 0.5 * step, jitter, sigma)
    return EncoderNoise(_MIN_RESOLUTION + _RESOLUTION_SIGMAS * sigma, jitter, sigma)


def _noise_sigma(angle: FloatArray) -> float:
    """Return the sigma (rad) of an angle (m,) by its fourth differences, 0 where few have noise."""
    fourth = np.diff(angle, 4)
    fourth = np.abs(fourth, out=fourth)
    real = fourth[fourth > _ROUNDING]
    moving = np.count_nonzero(np.abs(np.diff(angle)) > _ROUNDING)
    if real.size <= max(_MIN_NOISY_SHARE * len(angle), _MIN_MOVING_SHARE * moving):
        return 0.0
    return float(1.48 / np.sqrt(70.0) * np.median(real))


def encoder_step(angle: FloatArray) -> float:
    """Return the step (rad) of which all differences of an angle (m,) are multiples, 0 if none.

    The digits of the log may be finer than the encoder: 0.0879 deg printed to 1e-5 deg. So the
    candidate is the smallest first or second difference above a thousandth of the typical one, and
    differences must be multiples of it to a twentieth.
    """
    differences = np.diff(angle)
    moved = np.abs(differences)
    moved = moved[moved > _ROUNDING]
    if moved.size < _MIN_STEPS:
        return 0.0
    differences = np.diff(differences)
    second, third = np.abs(differences), np.diff(differences)
    least = max(1e-3 * float(np.median(moved)), _ROUNDING)
    candidates = (moved[moved > least].min(), second[second > least].min(initial=np.inf))
    step = float(min(candidates))
    # Ideal motion at constant rate and acceleration has differences that are multiples, too, but
    # its third differences vanish, except at kinks; those of steps do not.
    changing = np.count_nonzero(second > 0.5 * step)
    irregular = np.count_nonzero(np.abs(third, out=third) > 0.5 * step)
    if changing < _MIN_STEPS or irregular < _MIN_IRREGULAR * changing:
        return 0.0
    multiples = moved / step
    error = np.abs(multiples - np.rint(multiples))
    small = multiples < _MAX_MULTIPLE  # of larger ones the step's own error is seen
    if np.count_nonzero(small) < _MIN_STEPS or np.mean(error[small] < 0.05) < 0.99:
        return 0.0
    # Where all records that move do so by one step, a table at one rate without ramps does the
    # same; the rate of a slow one that shows steps changes at each of them.
    few = changing < _MIN_MOVING_SHARE * moved.size
    return 0.0 if few and float(multiples.max()) < 1.5 else step


@dataclass(frozen=True)
class IntervalMotion:
    """Motion of the table from start to end (s): rate (rad/s), 0 when still; range (rad).

    rate: mean rate from the angles at start and end. constant_rate: whether it is the only rate,
    as it is when still.
    """

    start: float
    end: float
    rate: float
    angle_range: float
    constant_rate: bool

    @property
    def still(self) -> bool:
        """Whether the table is still."""
        return self.constant_rate and self.rate == 0.0

    @property
    def angle(self) -> float:
        """Angle (rad) from start to end, 0 when still."""
        return self.rate * (self.end - self.start)


def motion_between(
    table: TableLog | None, start: float, end: float, angles: tuple[float, float] | None = None
) -> IntervalMotion:
    """Return the motion of the table from start to end (s); without a table log it is still.

    angles: rad, at start and end, if the caller knows them; default by linear interpolation.
    """
    if table is None:
        return IntervalMotion(start, end, 0.0, 0.0, constant_rate=True)
    if angles is None:
        first, last = np.interp([start, end], table.time, table.angle)
        angles = float(first), float(last)
    moved = angle_range(table, start, end)
    rate = (angles[1] - angles[0]) / (end - start)
    if is_still(moved, end - start, encoder_noise(table).resolution):
        return IntervalMotion(start, end, 0.0, moved, constant_rate=True)
    deviation = max_angle_deviation(table, start, end, angles[0], rate)
    return IntervalMotion(start, end, rate, moved, deviation < _CONSTANT_RATE_TOLERANCE)


def angle_range(table: TableLog, start: float, end: float) -> float:
    """Return the range (rad) of the table angle from start to end (s).

    Records next to start and end count. Angles are averaged over a second, which reduces the
    noise of the encoder, but not over more than an eighth of the interval.
    """
    first, last = np.searchsorted(table.time, [start, end])
    angle = table.angle[max(first - 1, 0) : last + 1]
    if len(angle) < 2:
        return 0.0
    spacing = max(table.interval, 1e-9)
    count = max(1, min(round(_AVERAGING_TIME / spacing), len(angle) // 8))
    blocks = len(angle) // count
    base = angle[0]
    means = (angle[: blocks * count] - base).reshape(blocks, count).mean(axis=1)
    tail = float(np.mean(angle[-count:] - base))
    return float(max(means.max(), tail) - min(means.min(), tail))


def max_angle_deviation(
    table: TableLog, start: float, end: float, angle: float, rate: float
) -> float:
    """Return the largest deviation (rad) from constant rate and `angle` (rad) at the start.

    A record that deviates more than both of its neighbours is wrong by itself; it counts as the
    farther neighbour.
    """
    first, last = (int(k) for k in np.searchsorted(table.time, [start, end]))
    largest = 0.0
    for part in record_chunks(slice(first, last)):
        expected = angle + rate * (table.time[part] - start)
        deviation = np.abs(table.angle[part] - expected)
        if len(deviation) > 2:
            candidate = np.maximum(deviation[:-2], deviation[2:])
            deviation = np.minimum(deviation[1:-1], candidate)
        largest = max(largest, float(deviation.max()))
    return largest


_CHUNK_RECORDS = 250_000  # records handled at a time: 2 MB for each array


def record_chunks(span: slice) -> list[slice]:
    """Return the slices that make up a span of records, so that a step needs little memory."""
    return [
        slice(first, min(first + _CHUNK_RECORDS, span.stop))
        for first in range(span.start, span.stop, _CHUNK_RECORDS)
    ]


def crop_table(table: TableLog, start: float, end: float) -> TableLog:
    """Return the records of a table log from start to end (s)."""
    near = slice(*(int(k) for k in np.searchsorted(table.time, [start, end])))
    return replace(table, time=table.time[near], angle=table.angle[near])
