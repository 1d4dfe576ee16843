"""Whether the IMU did what the table's log says: in its stretches, its swings, on one clock."""

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.record import ImuSource, Segment, TableLog
from rotcli.rig.rig import Rig
from rotcli.run import checks, segments
from rotcli.run.lag import check_lag
from rotcli.units import DEG, show_span

Array = NDArray[np.float64]

STILL = 0.01 * DEG  # rad turned in all: less is standing still
MIN_TURN_FOR_AXIS = 0.5 * np.pi  # rad turned in a stretch: enough to tell its axis and sense
_BLOCK = 0.1  # s, over which rates are compared
_ENOUGH = 600.0  # s of a swing that tell its axis and sense
_SWING = 2.0 * DEG  # rad/s, scatter of the table's rate: less is no swing
_ALIKE = 0.9  # correlation of two rates that are one but for a factor


def angle_range(table: TableLog, start: float, end: float) -> float:
    """Return how far (rad) the table moves, records on either side of start and end (s) counted."""
    first, last = np.searchsorted(table.time, [start, end])
    return float(np.ptp(table.angle[max(first - 1, 0) : last + 1]))


def check_motion(
    imu: ImuSource, table: TableLog | None, rig: Rig, start: float, end: float
) -> tuple[str, ...]:
    """Compare what the table does from start to end (s) with what the IMU feels.

    Without a table it is still.

    Returns warnings: still stretches that were touched, two clocks apart. Raises LogError where
    the IMU turns otherwise than the table, or does not keep still.
    """
    white, axis = rig.imu.figure("angle_random_walk"), rig.table.axis
    if table is None or angle_range(table, start, end) < STILL:
        return checks.check_still(imu, Segment(start, end), white)
    told: tuple[str, ...] = ()
    for stretch in segments.find_segments(table):
        first, last = max(stretch.start, start), min(stretch.end, end)
        if last - first < 1.0:
            continue
        stretch = Segment(first, last, stretch.rate, stretch.rate * (last - first))
        if abs(stretch.angle) > MIN_TURN_FOR_AXIS:
            checks.check_direction(imu, table, axis, stretch)
        elif not stretch.rate:
            told += checks.check_still(imu, stretch, white)
    check_oscillation(imu, table, axis, start, end)
    return told + check_lag(imu, table, axis, time_offset=rig.table.time_offset)


def check_oscillation(
    imu: ImuSource, table: TableLog, axis: Array, start: float, end: float
) -> None:
    """Compare the swings of the gyros between start and end (s) with those of the table's rate.

    axis: (3,) unit vector in the body frame. Biases do not matter, one rate tells nothing. Raises
    LogError where the IMU swings about another axis, the other way, or by another factor.
    """
    block = max(2, round(_BLOCK / imu.interval))
    start, end = max(start, float(table.time[0])), min(end, float(table.time[-1]), start + _ENOUGH)
    held = imu.crop(start, end)
    count = held.samples // block
    if count < 10:
        return
    felt = held.gyro[: count * block].reshape(count, block, 3).mean(axis=1)
    lead = 1.0 if imu.sampling == "average" else 0.5
    edges = held.time[0] + imu.interval * (block * np.arange(count + 1.0) - lead)
    rate = np.diff(np.interp(edges, table.time, table.angle)) / (block * imu.interval)
    rate, felt = rate - rate.mean(), felt - felt.mean(axis=0)
    if rate.std() < _SWING:
        return
    slope = rate @ felt / (rate @ rate)
    along = float(slope @ axis)
    across = float(np.linalg.norm(slope - along * axis))
    turned = felt @ axis
    alike = abs(float(rate @ turned)) > _ALIKE * float(np.linalg.norm(rate)) * float(
        np.linalg.norm(turned)
    )
    shares = ", ".join(f"{s:.3g}" for s in slope)
    seen = (
        f"from {show_span(start, end)} the gyros follow the table's rate by the factors ({shares})"
    )
    if across > max(abs(along), 0.5):
        what = f"{seen}: it turns about another axis; correct [table] axis or [imu] mount"
        raise LogError(table.path, what)
    if alike and along < 0.0:
        what = f"{seen}: the IMU turns the other way than [table] direction says; set "
        what += "direction = -1 (or 1 if it is -1), or [table] time_offset if half a swing is lost"
        raise LogError(table.path, what)
    if alike and not 0.5 < along < 2.0:
        what = f"{seen}: not the same rate; check the units of both logs and [table] axis"
        raise LogError(table.path, what)
