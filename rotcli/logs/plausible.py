"""Check a log for readings and rates that no working sensor or logger writes.

A log may be read without an error and still be wrong: its clock in another unit, an axis stuck,
readings of a few levels, gyros in another unit. Clean logs pass these checks: each limit is far
outside of what sensors do (the comments say how far).
"""

from collections.abc import Sequence

import numpy as np

from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.logs.timing.mixed import RecordSpacing
from rotcli.units import DEG, DEG_PER_ROOT_HOUR, STANDARD_GRAVITY, FloatArray, format_span

# Hz; IMUs on turntables log at 50 to 2000 Hz, tables at 1 to 1000 Hz. Stamps in ms that are read
# as s are a thousand times too slow.
MIN_RATE, MAX_RATE = 1.0, 20_000.0
_CHUNK_RECORDS = 100_000  # records of a table checked at a time
_MIN_COUNTABLE = 1e-7  # s; among spacings below it gaps cannot be counted
JITTER_WARNING = 0.1  # of a sample
_MIN_NOISE_STEPS = 8  # steps that show whether a row has noise
_MIN_LEVELS = 16  # distinct values; fewer are noise of less than four steps
_LEVEL_SAMPLES = 4096  # samples in which levels are counted first
# s and samples of one value: noise of a third of a step has a chance of 1e-20.
_MIN_STUCK = 0.5, 50
# Share of neighbouring steps that change sign: 2/3 in white noise, 0 in a smooth curve.
_MIN_SIGN_CHANGES = 0.3
_MAX_REST_RATE = 3.0 * DEG  # rad/s; turn-on biases of the coarsest turntable IMUs are 1 deg/s
# rad/sqrt(s); the coarser IMU of the papers has 3 deg/sqrt(h), in deg/s read as rad/s 172.
_MAX_REST_NOISE = 15.0 * DEG_PER_ROOT_HOUR
_MIN_NOISE_RATIO = 0.04  # times the rig's angle random walk; rad/s read as deg/s have a 57th
_MAX_NOISE_RATIO = 20.0  # times the rig's angle random walk; deg/s read as rad/s have 57 times it
_MAX_REST_SCATTER = 1.0 * DEG  # rad/s, of a sample; below it a slow log of much noise is correct
_OVERFLOWS = np.errstate(over="ignore", invalid="ignore")  # numbers of 1e200 cause a warning too
# Share by which the specific force at rest may differ from gravity: biases and scale factors.
_GRAVITY_TOLERANCE = 0.1
_MIN_GRAVITY = 0.1  # m/s^2; below it, gravity was removed before
_INCREMENT_TOLERANCE = 0.05  # share by which increments may differ from gravity x interval


def check_rate(path: str, interval: float) -> None:
    """Raise LogError for an interval (s) that no IMU logs at."""
    what = _implausible_rate(interval)
    if what:
        raise LogError(path, what, column="time")


def check_median_rate(path: str, time: FloatArray) -> None:
    """Raise LogError for increasing times (n,), s, most of which follow within a tenth of a us."""
    if len(time) > 1:
        spread = max(1, (len(time) - 1) // _LEVEL_SAMPLES)
        usual = float(np.median(time[1::spread] - time[:-1:spread]))
        if usual < _MIN_COUNTABLE:
            check_rate(path, usual)


def check_mixed(path: str, spacing: RecordSpacing) -> None:
    """Raise LogError for a log in which two recordings are mixed by their times."""
    finding = spacing.finding()
    if finding:
        raise LogError(path, finding, column="time")


def check_table_rate(path: str, interval: float) -> list[str]:
    """Return a warning for an interval (s) at which hardly a table logs."""
    what = _implausible_rate(interval)
    return [f"{path}: time: {what}"] if what else []


def check_spans(path: str, table: FloatArray, interval: float, imu: FloatArray) -> None:
    """Raise LogError for a table log whose slow stamps reach far beyond the IMU's.

    table, imu: first and last time, s. interval: s, of the table's records. A slow log of the same
    run is believed.
    """
    what = _implausible_rate(interval)
    if what and table[-1] - table[0] > 20.0 * (imu[-1] - imu[0]):
        spans = f"{format_span(table[0], table[-1])}, the IMU log {format_span(imu[0], imu[-1])}"
        raise LogError(path, f"spans {spans}; {what}", column="time")


def _implausible_rate(interval: float) -> str | None:
    rate = 1.0 / interval if interval > 1e-300 else np.inf
    if MIN_RATE <= rate <= MAX_RATE:
        return None
    return (
        f"{rate:.4g} records per second, expected {MIN_RATE:g} to {MAX_RATE:g}; set units time, or "
        "rate for a counter"
    )


@_OVERFLOWS
def check_axes(
    path: str, time: FloatArray, values: FloatArray, names: Sequence[str] = AXES
) -> list[str]:
    """Return warnings about axes that are stuck, constant for a while, or have a few levels only.

    time: (n,) s; values: (k, n) of the axes `names`. A log without any noise (of a simulation)
    causes no warning.
    """
    if len(time) < 2 * _MIN_STUCK[1] or not any(is_noisy(row) for row in values):
        return []
    found = [_axis(time, row, name) for name, row in zip(names, values, strict=True)]
    return [f"{path}: {text}" for text in found if text]


def is_noisy(row: FloatArray) -> bool:
    """Return whether neighbouring steps change sign as those of a sensor's noise do."""
    steps = np.diff(row[:: max(1, len(row) // _LEVEL_SAMPLES)])
    if len(steps) < _MIN_NOISE_STEPS:
        return False
    return bool(np.mean(steps[1:] * steps[:-1] < 0.0) > _MIN_SIGN_CHANGES)


def _axis(time: FloatArray, row: FloatArray, name: str) -> str | None:
    levels = np.unique(row[:: max(1, len(row) // _LEVEL_SAMPLES)])
    if len(levels) < _MIN_LEVELS:
        levels = np.unique(row)
    span = f"from {format_span(time[0], time[-1])}"
    if len(levels) == 1:
        return (
            f"{name} is constant ({row[0]:.6g}) {span}: stuck, not connected or not logged. "
            "Results of this axis are invalid"
        )
    if len(levels) < _MIN_LEVELS:
        return (
            f"{name} has only {len(levels)} distinct values, {np.diff(levels).min():.3g} apart, "
            f"{span}: the resolution is coarser than the noise; log more digits or use a smaller "
            "range"
        )
    frozen = _longest_run(row, max(_MIN_STUCK[1], round(_MIN_STUCK[0] / _interval(time))))
    if frozen is None:
        return None
    first, last = frozen
    return (
        f"{name} is constant ({row[first]:.6g}) from {format_span(time[first], time[last])}: "
        "sensor stuck or saturated, or logger stopped; exclude this part"
    )


def _interval(time: FloatArray) -> float:
    return float(time[-1] - time[0]) / (len(time) - 1)


def _longest_run(row: FloatArray, least: int) -> tuple[int, int] | None:
    """Return first and last index of the longest run of one value, None below `least` samples.

    Such a run contains two neighbours of a grid half as wide, so only there it need be looked for.
    """
    grid = least // 2
    marks = row[::grid]
    same = np.flatnonzero(marks[1:] == marks[:-1])
    best: tuple[int, int] | None = None
    end = -1
    for k in same:
        start = int(k) * grid
        if start < end or np.ptp(row[start : start + grid + 1]) != 0.0:
            continue
        low, value = start, row[start]
        while low > 0 and row[low - 1] == value:
            low -= 1
        other = np.flatnonzero(row[start:] != value)
        end = start + (int(other[0]) if other.size else len(row) - start)
        if end - low >= least and (best is None or end - low > best[1] - best[0] + 1):
            best = low, end - 1
    return best


@_OVERFLOWS
def check_rest_readings(
    path: str, gyro: FloatArray, interval: float, white: FloatArray | None = None
) -> list[str]:
    """Return a warning where gyros (n, 3), rad/s, at rest have impossible readings.

    white: (3,) rad/sqrt(s), the rig's angle random walks; twenty times as much shows another
    unit, too, and so does a twenty-fifth, over seconds as well as over samples: a filtered log is
    as smooth from sample to sample.
    """
    if len(gyro) < 10:
        return []
    mean = gyro.mean(axis=0)
    noise = np.sqrt(0.5 * interval * np.mean(np.diff(gyro, axis=0) ** 2, axis=0))
    causes = "wrong unit (set [imu] units gyro), raw counts (set [imu] scale, offset)"
    if np.max(np.abs(mean)) > _MAX_REST_RATE:
        measured = ", ".join(f"{v / DEG:.4g}" for v in mean)
        return [
            f"{path}: the gyros read ({measured}) deg/s at rest: {causes}, or a turning IMU "
            "(choose a still window)"
        ]
    ratio = 0.0 if white is None or not np.all(white) else float(np.median(noise / white))
    if white is not None and np.all(white) and np.all(noise):
        share = max(ratio, float(np.median(_slow_noise(gyro, interval) / white)))
        if share < _MIN_NOISE_RATIO:
            size = ", ".join(f"{v / DEG_PER_ROOT_HOUR:.3g}" for v in noise)
            return [
                f"{path}: gyro noise at rest is ({size}) deg/sqrt(h), {share:.2g} times "
                "angle_random_walk of the rig; check [imu] units gyro (probably rad/s) or "
                "angle_random_walk"
            ]
    loud = noise / np.sqrt(interval) > _MAX_REST_SCATTER
    noisy = float(np.median(noise)) > _MAX_REST_NOISE or ratio > _MAX_NOISE_RATIO
    if np.count_nonzero(loud) > 1 and noisy:
        size = ", ".join(f"{v / DEG_PER_ROOT_HOUR:.3g}" for v in noise)
        than = (
            f", {ratio:.3g} times angle_random_walk of the rig" if ratio > _MAX_NOISE_RATIO else ""
        )
        return [
            f"{path}: gyro noise at rest is ({size}) deg/sqrt(h){than}: {causes}; the unit is "
            "probably deg/s"
        ]
    return []


def _slow_noise(gyro: FloatArray, interval: float) -> FloatArray:
    """Return the white noise (3,) rad/sqrt(s) that the means of seconds of gyros (n, 3) show."""
    size = max(1, min(round(1.0 / interval), len(gyro) // 5))
    means = gyro[: len(gyro) // size * size].reshape(-1, size, 3).mean(axis=1)
    return np.asarray(np.sqrt(0.5 * size * interval * np.mean(np.diff(means, axis=0) ** 2, axis=0)))


@_OVERFLOWS
def check_gravity_magnitude(
    path: str, accel: FloatArray, interval: float | None = None
) -> list[str]:
    """Return a warning where accelerometers (n, 3), m/s^2, at rest do not measure gravity.

    interval: s, of the samples; increments read gravity times it.
    """
    size = float(np.linalg.norm(accel.mean(axis=0)))
    relative = size / STANDARD_GRAVITY
    if abs(relative - 1.0) < _GRAVITY_TOLERANCE or not np.isfinite(size):
        return []
    if interval and abs(relative / interval - 1.0) < _INCREMENT_TOLERANCE:
        cause = 'It equals gravity x interval; set [imu] sampling = "increment"'
    elif size < _MIN_GRAVITY:  # gravity was removed before
        return []
    elif abs(size - 1.0) < _GRAVITY_TOLERANCE:
        cause = 'It is 1 in g; set [imu] units = { accel = "g" }'
    elif abs(size / 1000.0 - 1.0) < _GRAVITY_TOLERANCE:
        cause = 'It is 1000 in mg; set [imu] units = { accel = "mg" }'
    else:
        cause = "check the unit: set [imu] units accel or scale"
    return [f"{path}: mean specific force at rest is {size:.4g} m/s^2, expected 9.8. {cause}"]


@_OVERFLOWS
def check_table_gaps(path: str, time: FloatArray, angle: FloatArray, usual: float) -> list[str]:
    """Return warnings about gaps of a table log: time (m,) s, angle (m,) rad unwrapped.

    usual: s, the median spacing. In gaps the angle is interpolated linearly, and an angle that
    wraps may lose full turns.
    """
    gaps, longest, after = 0, 0.0, 0
    fast: int | None = None
    for first in range(0, len(time) - 1, _CHUNK_RECORDS):
        part = slice(first, first + _CHUNK_RECORDS + 1)
        steps = np.diff(time[part])
        gaps += int(np.count_nonzero(steps > 2.5 * usual))
        k = int(np.argmax(steps))
        if steps[k] > longest:
            longest, after = float(steps[k]), first + k
        far = np.abs(np.diff(angle[part])) > 0.4 * 2.0 * np.pi
        if fast is None and far.any():
            fast = first + int(np.argmax(far))
    warnings = []
    if gaps:
        count = f"{gaps} gap{'s' * (gaps > 1)}"
        warnings.append(
            f"{path}: {count} in the table log, longest {longest:.3g} s after {time[after]:.6g} s. "
            "The angle is interpolated linearly; exclude this part"
        )
    if fast is not None:
        turned = (angle[fast + 1] - angle[fast]) / DEG
        warnings.append(
            f"{path}: the angle changes by {turned:.4g} deg within "
            f"{time[fast + 1] - time[fast]:.3g} s after {time[fast]:.6g} s. Full turns may be "
            "lost; log the table faster"
        )
    return warnings
