"""Compare the gyros with the table: rotation axis, sense and rate, in segments and oscillations."""

from collections.abc import Sequence

import numpy as np

from rotcli.logs.record import ImuLog, ImuSource, Segment, TableLog
from rotcli.models.rotation import attitude_matrix
from rotcli.rig.rig import Rig
from rotcli.run.evidence.wrong_unit import unit_cause
from rotcli.run.findings import Finding
from rotcli.units import DEG, STANDARD_GRAVITY, format_span

# rad/s: the datasheet's turn-on bias of the coarser IMU of R16, 3600 deg/h, and a half more.
TURN_ON_BIAS = 1.5 * DEG
# rad turned in a segment: a quarter of a turn shows axis and sense against a turn-on bias at
# 0.3 deg/s and more, while a segment of less is named by hand in tests of single positions.
MIN_TURN_FOR_AXIS = 0.5 * np.pi
_MAX_CHECK_DURATION = 3600.0  # s: axis and sense are clear after an hour
_MAX_RATE_DIFFERENCE = 0.2  # of the rate; a scale factor error of 20 % is a wrong unit
_RATE_BLOCK = 0.1  # s: rates of an oscillation are compared over it; ten per second of swing
_MAX_OSCILLATION_DURATION = 600.0  # s: axis and sense are clear after hundred oscillations of 6 s
_MIN_OSCILLATION = 2.0 * DEG  # rad/s: scatter of the table rate above the noise of a 12-bit encoder
_MIN_CORRELATION = 0.9  # of two rates that are equal up to a factor: noise of half the signal
_NOT_SENSED = 0.02  # of the table rate: a gyro that measures less does not sense the rotation
_RAW_COUNTS = 100.0  # rad/s (5700 deg/s): no gyro reads more; raw counts do
_ALONG_GRAVITY = 0.8  # of g along the axis, within 37 deg of the vertical


def check_direction(
    imu: ImuSource, table: TableLog, rig: Rig, segment: Segment
) -> tuple[Finding, ...]:
    """Compare the mean gyro rate of a turning segment with the encoder's.

    The rig's axis is fixed in the turning sensor. A turn-on bias of 1.5 deg/s is allowed. One
    finding at most: axis, sense, or rate.
    """
    log = imu.crop(segment.start, min(segment.end, segment.start + _MAX_CHECK_DURATION))
    axis = rig.table.axis
    mean = log.gyro.mean(axis=0)
    parallel = float(mean @ axis)
    perpendicular = float(np.linalg.norm(mean - parallel * axis))
    rate = segment.rate
    where = format_span(segment.start, segment.end)
    measured = f"({', '.join(f'{v / DEG:.4g}' for v in mean)}) deg/s"
    place = f"{table.path}: {where}: table {rate / DEG:.6g} deg/s, gyros {measured}"
    unit = unit_cause(log, rig, parallel / rate)
    if unit is None and float(np.abs(mean).max()) > _RAW_COUNTS:
        text = f"{place}: raw counts or another unit; set [imu] units, or scale and offset"
        return (Finding("rotation-rate", text, where=where),)
    difference = abs(parallel - rate)
    if perpendicular > max(abs(parallel), 0.5 * abs(rate)) and perpendicular > 2.0 * TURN_ON_BIAS:
        text = f"{place} about another axis; check [table] axis and [imu] mount"
        return (Finding("rotation-axis", text, where=where),)
    opposite = parallel * rate < 0.0 and abs(parallel) > 0.5 * abs(rate)
    if opposite and difference > max(abs(rate), TURN_ON_BIAS):
        return (Finding("rotation-sense", f"{place}: {sense_advice(log, rig)}", where=where),)
    limit = _MAX_RATE_DIFFERENCE * abs(rate) + TURN_ON_BIAS
    if difference > limit:
        if unit is not None:
            text = f"{place}: {unit}"
        elif float(np.abs(mean).max()) < max(_NOT_SENSED * abs(rate), TURN_ON_BIAS):
            text = (
                f"{place}: the gyros do not sense the rotation; check for a defect or a wrong log"
            )
        else:
            text = f"{place}: not the same rate; check the units of both logs and [table] axis"
        values = difference / DEG, limit / DEG
        return (Finding("rotation-rate", text, "warning", where, *values, "deg/s"),)
    return ()


def sense_advice(log: ImuLog, rig: Rig) -> str:
    """Return the advice for gyros of the opposite sense: a sensor upside down, or the encoder."""
    expected = np.array([0.0, 0.0, 1.0])
    if rig.attitude.pitch is not None and rig.attitude.roll is not None:
        expected = attitude_matrix(rig.attitude.pitch, rig.attitude.roll, 0.0)[2]
    # The component along the axis is the same in the sensor and in the body frame.
    axis = rig.table.axis
    force = log.accel.mean(axis=0) / STANDARD_GRAVITY
    measured, gravity = float(force @ axis), float(expected @ axis)
    if gravity > _ALONG_GRAVITY and measured < -_ALONG_GRAVITY:
        return (
            "opposite sense, and gravity along the axis is reversed too: the IMU points down; set "
            "[imu] mount = [[0, 1, 0], [1, 0, 0], [0, 0, -1]] (forward-right-down)"
        )
    return f"opposite sense; set [table] direction = {-rig.table.direction}"


def check_oscillation(
    imu: ImuSource, table: TableLog, rig: Rig, start: float, end: float
) -> tuple[Finding, ...]:
    """Compare the oscillation of the gyros between start and end (s) with that of the table rate.

    Biases do not matter; a constant rate shows nothing.
    """
    axis = rig.table.axis
    block = max(2, round(_RATE_BLOCK / imu.interval))
    start = max(start, float(table.time[0]))
    end = min(end, float(table.time[-1]), start + _MAX_OSCILLATION_DURATION)
    log = imu.crop(start, end)
    count = log.samples // block
    if count < 10:
        return ()
    measured = log.gyro[: count * block].reshape(count, block, 3).mean(axis=1)
    lead = 1.0 if imu.sampling == "average" else 0.5
    edges = log.time[0] + imu.interval * (block * np.arange(count + 1.0) - lead)
    rate = np.diff(np.interp(edges, table.time, table.angle)) / (block * imu.interval)
    rate, measured = rate - rate.mean(), measured - measured.mean(axis=0)
    if rate.std() < _MIN_OSCILLATION:
        return ()
    slope = rate @ measured / (rate @ rate)
    parallel = float(slope @ axis)
    perpendicular = float(np.linalg.norm(slope - parallel * axis))
    projected = measured @ axis
    norms = float(np.linalg.norm(rate)) * float(np.linalg.norm(projected))
    correlated = abs(float(rate @ projected)) > _MIN_CORRELATION * norms
    factors = ", ".join(f"{s:.3g}" for s in slope)
    where = format_span(start, end)
    place = f"{table.path}: {where}: the gyro rates are ({factors}) times the table rate"
    if perpendicular > max(abs(parallel), 0.5):
        text = f"{place}: about another axis; check [table] axis and [imu] mount"
        return (Finding("rotation-axis", text, where=where),)
    if correlated and parallel < 0.0:
        text = f"{place}: opposite sense; set [table] direction = {-rig.table.direction}, or"
        text += " [table] time_offset if it is half a period"
        return (Finding("rotation-sense", text, where=where, value=parallel),)
    if correlated and not 0.5 < parallel < 2.0:
        text = f"{place}: not the same rate; check the units of both logs and [table] axis"
        return (Finding("rotation-rate", text, where=where, value=parallel),)
    return ()


def check_segments(
    imu: ImuSource, table: TableLog, rig: Rig, segments: Sequence[Segment]
) -> tuple[Finding, ...]:
    """Return the findings of `check_direction` of all turning segments."""
    return tuple(f for s in segments for f in check_direction(imu, table, rig, s))
