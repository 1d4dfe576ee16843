"""Refine the edges of segments by the gyros, where the encoder shows a ramp too late.

An encoder of one degree shows the first degree of a ramp only after it; a gyro shows a ramp at
once. Near each edge the gyro rate along the axis is compared with that further inside.
"""

from dataclasses import replace

import numpy as np

from rotcli.logs.record import ImuSource, Segment
from rotcli.units import DEG, FloatArray

# rad: below it a ramp of 1 deg/s^2 shows within a tenth of a second, less than a gyro block
FINE_RESOLUTION = 4e-3 * DEG
_BLOCK = 0.1  # s, over which the gyro rate is averaged
_MAX_ZONE = 10.0  # s at either end that are searched for a ramp: as long as the slowest ramp
_SIGMAS = 6.0  # of a block mean, from the scatter inside
_MIN_DEVIATION = 2e-3 * DEG  # rad/s: of noise-free simulations
_RIPPLE = 1e-3  # of the rate: a table at constant rate deviates by less
_MIN_SHARE = 0.5  # of the trimmed blocks must deviate: a spike further inside is no ramp


def refine_edges(
    imu: ImuSource, axis: FloatArray, segment: Segment, min_duration: float
) -> Segment:
    """Return the segment without the ramps that the gyros show at its ends.

    axis: (3,) unit vector in the sensor frame. The segment keeps its rate. Unchanged where too
    little would remain (min_duration, s).
    """
    zone = min(_MAX_ZONE, segment.duration / 3.0)
    lead = _ramp_time(imu, axis, segment.start, segment.start + zone, segment.rate, at_end=False)
    tail = _ramp_time(imu, axis, segment.end - zone, segment.end, segment.rate, at_end=True)
    start, end = segment.start + lead, segment.end - tail
    if end - start < min_duration:
        return segment
    return replace(segment, start=start, end=end, angle=segment.rate * (end - start))


def _ramp_time(
    imu: ImuSource, axis: FloatArray, start: float, end: float, rate: float, *, at_end: bool
) -> float:
    """Return the time (s) at an edge of [start, end] in which the gyros show a ramp."""
    log = imu.crop(start, end)
    size = max(1, round(_BLOCK / imu.interval))
    count = log.samples // size
    if count < 8:
        return 0.0
    gyro = log.gyro @ axis
    used = gyro[-count * size :] if at_end else gyro[: count * size]
    means = used.reshape(count, size).mean(axis=1)
    if at_end:
        means = means[::-1]
    inner = means[count // 2 :]
    centre = float(np.median(inner))
    sigma = 1.48 * float(np.median(np.abs(inner - centre)))
    limit = max(_SIGMAS * sigma, _MIN_DEVIATION + _RIPPLE * abs(rate))
    deviates = np.abs(means[: count // 2] - centre) > limit
    trimmed = 0
    for k in np.flatnonzero(deviates):
        if np.count_nonzero(deviates[: k + 1]) >= _MIN_SHARE * (k + 1):
            trimmed = int(k) + 1
    return 0.0 if not trimmed else (trimmed + 1) * size * imu.interval
