"""Check that the table is logged often enough: less than half a turn from record to record."""

from itertools import pairwise

import numpy as np

from rotcli.logs.record import ImuSource, TableLog
from rotcli.run.findings import Finding
from rotcli.units import DEG, FloatArray, show_time

_MIN_INTERVAL = 0.2  # s: half a turn in less is 900 deg/s, beyond the tables and gyros of the rig
_MAX_RECORDS = 200  # intervals that are searched


def check_record_interval(imu: ImuSource, table: TableLog, axis: FloatArray) -> tuple[Finding, ...]:
    """Return the finding of a table that turns half a turn or more between two of its records.

    The gyros show the turn; the angle of a turntable leaves complete turns open. axis: (3,).
    """
    steps = np.diff(table.time)
    # With more than half of the steps below the limit, so is their median.
    if 2 * np.count_nonzero(steps < _MIN_INTERVAL) > len(steps) or not len(steps):
        return ()
    interval = float(np.median(steps))
    inside = (table.time >= imu.time[0]) & (table.time <= imu.time[-1])
    times = table.time[inside][: _MAX_RECORDS + 1]
    for start, end in pairwise(times):
        log = imu.crop(float(start), float(end))
        if not log.samples:
            continue
        turned = abs(float((log.gyro @ axis).mean())) * float(end - start)
        if turned < np.pi or end - start > 2.0 * interval:
            continue
        text = (
            f"{table.path}: one record in {interval:.3g} s, and the gyros turn {turned / DEG:.0f} "
            f"deg from {show_time(float(start))} to {show_time(float(end))} s: complete turns are "
            "lost between records. Log the table faster, or use a lower rate; if records are "
            "closer in truth, set [table] units time"
        )
        return (Finding("record-interval", text, "error", "", turned / DEG, 180.0, "deg"),)
    return ()
