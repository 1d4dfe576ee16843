"""Checks before the filter runs: the window, and the rates of the table."""

import numpy as np

from rotcli.errors import LogError
from rotcli.logs.record import CHUNK_SAMPLES, ImuSource, TableLog, epoch_clock_hint
from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt.options import Options
from rotcli.rig.rig import Rig
from rotcli.run.table_angle import angle_at
from rotcli.units import DEG, DEG_PER_HOUR, PPM, FloatArray, format_span

TURNING = 0.05 * DEG  # rad/s: below it the table is still
# Noise of an axis over that of the two others, relative to the rig: wrong units are 9.8 and 57.
MAX_NOISE_RATIO = 5.0
SINGLE_RATE_TOLERANCE = 0.1  # rates closer than this fraction are one rate


def window(
    imu: ImuSource, table: TableLog | None, requested: tuple[float, float] | None
) -> tuple[float, float]:
    """Return the requested window, else the time that both logs cover."""
    start, end = float(imu.time[0]), float(imu.time[-1])
    if table is not None:
        start, end = max(start, float(table.time[0])), min(end, float(table.time[-1]))
    if end <= start:
        raise LogError(imu.path, "shares no time with the table log; check [table] time_offset")
    if requested is None:
        return start, end
    if requested[0] < start - imu.interval or requested[1] > end + imu.interval:
        raise LogError(
            imu.path,
            f"the window {format_span(*requested)} is not within the time of both logs, "
            f"{format_span(start, end)}{epoch_clock_hint(requested, (start, end))}; "
            "choose another window",
        )
    return requested


def noise_warnings(imu: ImuSource, span: slice, rig: Rig) -> list[str]:
    """Return a warning for a channel whose noise is far from that of the other two of its triad.

    Noise is the scatter of second differences in the first chunk, relative to the rig's figure. A
    low-pass filter changes it on all axes; a wrong unit or exchanged channels on one.
    """
    first = next(imu.chunks(span))
    warnings = []
    for sensor, readings, figure in (
        ("gyro", first.gyro, rig.imu.figure("angle_random_walk")),
        ("accel", first.accel, rig.imu.figure("velocity_random_walk")),
    ):
        scatter = np.median(np.abs(np.diff(readings, n=2, axis=0)), axis=0)
        relative = scatter / (np.ones(3) if figure is None else np.where(figure > 0, figure, 1.0))
        if not (relative > 0.0).all():
            continue  # quantised: the resolution hides the noise
        for axis in range(3):
            others = relative[[k for k in range(3) if k != axis]]
            ratio = float(relative[axis] / np.sqrt(others.prod()))
            alike = others.max() < MAX_NOISE_RATIO * others.min()
            if alike and not 1.0 / MAX_NOISE_RATIO < ratio < MAX_NOISE_RATIO:
                warnings.append(
                    f"{imu.path}: noise of {sensor}_{'xyz'[axis]} is {ratio:.2g} times that of the "
                    "other two axes; check the unit of the channel and the order of the columns"
                )
    return warnings


def rates_of(imu: ImuSource, table: TableLog | None, span: slice, step: int) -> FloatArray:
    """Return the table's mean rates (n,), rad/s, over each `step` samples of a span."""
    count = (span.stop - span.start - 1) // step
    if table is None:
        return np.zeros(count)
    rates = np.empty(count)
    chunk = max(1, CHUNK_SAMPLES // step)
    for done in range(0, count, chunk):
        n = min(chunk, count - done)
        first = span.start + done * step
        theta = angle_at(table, imu.times(slice(first, first + n * step + 1))[::step])
        rates[done : done + n] = np.diff(theta) / (step * imu.interval)
    return rates


def dominant_rate(rates: FloatArray) -> float:
    """Return the median magnitude of the rates while turning, with the prevailing sign.

    0 if the table turns during less than a tenth of the time. An oscillating table turns.
    """
    turning = np.abs(rates) > TURNING
    if turning.mean() <= 0.1:
        return 0.0
    magnitude = float(np.median(np.abs(rates[turning])))
    return magnitude if rates[turning].sum() >= 0.0 else -magnitude


def has_single_rate(rates: FloatArray) -> bool:
    """Return whether the table has a single rate, except for a twentieth of the time."""
    low, high = (np.quantile(np.abs(rates), share) for share in (0.05, 0.95))
    return bool(high - low <= max(SINGLE_RATE_TOLERANCE * high, TURNING))


def rate_warnings(
    rates: FloatArray, options: Options, scale: float, rig: Rig, gyro_errors: TriadErrors | None
) -> list[str]:
    """Return warnings about states that the rates (n,), rad/s, do not separate.

    scale: the initial sigma of the gyro scale factor and installation errors, 0 if omitted.
    """
    warnings = []
    if options.estimate_lever_arm and has_single_rate(rates):
        warnings.append(
            f"a single rate ({dominant_rate(rates) / DEG:.4g} deg/s) does not separate lever arm "
            "and accelerometer biases perpendicular to the axis; record a second rate"
        )
    rate = dominant_rate(rates)
    if scale and options.scale is None and rig.imu.scale_sigma is None:
        warnings.append(
            f"no gyro calibration and no [imu] scale_sigma: {scale / PPM:g} ppm is assumed, which "
            "increases the sigma of the gyro biases; see rotcli calibrate"
        )
    if rate and not scale and (gyro_errors is None or not np.any(gyro_errors.matrix)):
        warnings.append(
            "no gyro calibration, and no states of scale factor and installation errors: 1000 ppm "
            f"of either is {abs(rate) * 1e-3 / DEG_PER_HOUR:.3g} deg/h in the gyro biases; see "
            "rotcli calibrate"
        )
    return warnings
