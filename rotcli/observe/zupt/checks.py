"""What is looked at before the filter runs: the window, the motion, the table's rates."""

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.record import PIECE, ImuSource, TableLog, own_clock
from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt.options import Options
from rotcli.rig.rig import Rig
from rotcli.run.table_angle import angle_at
from rotcli.units import DEG, DEG_PER_HOUR, PPM, show_span

Array = NDArray[np.float64]

TURNING = 0.05 * DEG  # rad/s: below it the table is still
SINGLE_RATE_TOLERANCE = 0.1  # rates closer than this fraction are one rate


def window(
    imu: ImuSource, table: TableLog | None, named: tuple[float, float] | None
) -> tuple[float, float]:
    """Return the window named, else all that both logs cover."""
    start, end = float(imu.time[0]), float(imu.time[-1])
    if table is not None:
        start, end = max(start, float(table.time[0])), min(end, float(table.time[-1]))
    if end <= start:
        raise LogError(imu.path, "shares no time with the table log; check [table] time_offset")
    if named is None:
        return start, end
    if named[0] < start - imu.interval or named[1] > end + imu.interval:
        raise LogError(
            imu.path,
            f"the window {show_span(*named)} lies outside what the logs cover, "
            f"{show_span(start, end)}{own_clock(named, (start, end))}; name another --window",
        )
    return named


def rates_of(imu: ImuSource, table: TableLog | None, span: slice, step: int) -> Array:
    """Return the table's mean rates (n,), rad/s, over whole `step` samples of a span."""
    count = (span.stop - span.start - 1) // step
    if table is None:
        return np.zeros(count)
    rates = np.empty(count)
    several = max(1, PIECE // step)
    for done in range(0, count, several):
        n = min(several, count - done)
        first = span.start + done * step
        theta = angle_at(table, imu.times(slice(first, first + n * step + 1))[::step])
        rates[done : done + n] = np.diff(theta) / (step * imu.interval)
    return rates


def dominant_rate(rates: Array) -> float:
    """Return the median size of the rates while turning, with the sense that prevails.

    0 for a table that turns in less than a tenth. A table that goes back and forth turns.
    """
    turning = np.abs(rates) > TURNING
    if turning.mean() <= 0.1:
        return 0.0
    size = float(np.median(np.abs(rates[turning])))
    return size if rates[turning].sum() >= 0.0 else -size


def has_single_rate(rates: Array) -> bool:
    """Tell whether the table has one rate throughout, but for a twentieth of the time."""
    low, high = (np.quantile(np.abs(rates), share) for share in (0.05, 0.95))
    return bool(high - low <= max(SINGLE_RATE_TOLERANCE * high, TURNING))


def rate_warnings(
    rates: Array, options: Options, scale: float, rig: Rig, gyro_errors: TriadErrors | None
) -> list[str]:
    """Return what the rates (n,), rad/s, leave in doubt of lever arm, scale and installation.

    scale: the initial sigma of the gyros' scale factor and installation, 0 where left out.
    """
    found = []
    if options.estimate_lever_arm and has_single_rate(rates):
        found.append(
            f"the table keeps one rate ({dominant_rate(rates) / DEG:.4g} deg/s): the lever arm "
            "cannot be told from the accelerometer biases across the axis (their estimates hold "
            "a share of it); log a second rate"
        )
    rate = dominant_rate(rates)
    if scale and options.scale is None and rig.imu.scale_sigma is None:
        found.append(
            "no calibration of the gyros' scale factor and installation was given, and no "
            f"scale_sigma in the rig: {scale / PPM:g} ppm of either assumed and carried along, "
            "which widens the gyro biases; see rotcli calibrate, or --sigma-scale"
        )
    if rate and not scale and (gyro_errors is None or not np.any(gyro_errors.matrix)):
        found.append(
            "no calibration of the gyros' scale factor and installation was given: 1e-3 of either "
            f"would show as {abs(rate) * 1e-3 / DEG_PER_HOUR:.3g} deg/h in the gyro biases; see "
            "rotcli calibrate, or --sigma-scale"
        )
    return found
