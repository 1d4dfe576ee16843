"""What no sound sensor or logger writes: told, or refused, before anything is made of it.

A log may be read without an error and still be wrong: its clock in another unit, an axis stuck,
readings cut to a few levels, gyros in another unit. Clean logs never trip these checks: each
limit stands far outside of what sensors do (the comments say how far).
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.units import DEG, DEG_PER_ROOT_HOUR, STANDARD_GRAVITY, show_span

Array = NDArray[np.float64]

# Hz; turntable IMUs log at 50 to 2000, tables at 1 to 1000. Stamps in ms read as s are a thousand
# times too slow.
SLOWEST, FASTEST = 1.0, 20_000.0
_ENOUGH = 1_000_000  # records of a table looked at at a time; the first tell its spacing
_INSTANT = 1e-7  # s; beside spacings below it gaps cannot be counted
JITTER_WORTH_TELLING = 0.1  # of a sample
_FEW = 16  # distinct values: noise of less than four steps
_SAMPLE = 4096  # samples in which to look for them first
_FROZEN = 0.5, 50  # s and samples of one value: noise of a third of a step has a chance of 1e-20
_NOISY = (
    0.3  # share of neighbouring steps that change sign; 2/3 in white noise, 0 in a smooth curve
)
_REST = 3.0 * DEG  # rad/s; turn-on biases of the coarsest turntable IMUs are 1 deg/s
_REST_NOISE = 15.0 * DEG_PER_ROOT_HOUR  # the papers' coarser IMU has 3, in deg/s read as rad/s 172
_SILENT = 0.04  # times the rig's angle random walk; rad/s read as deg/s have a 57th
_REST_SCATTER = 1.0 * DEG  # rad/s, of a sample; a slow log of much noise is not mistaken
_ABSURD = np.errstate(over="ignore", invalid="ignore")  # numbers of 1e200 are told all the same
_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


def check_rate(path: str, interval: float) -> None:
    """Raise LogError for an interval (s) that no IMU logs at."""
    what = _implausible_rate(interval)
    if what:
        raise LogError(path, what, column="time")


def check_median_rate(path: str, time: Array) -> None:
    """Raise LogError for increasing times (n,), s, most of which follow within a tenth of a us."""
    if len(time) > 1:
        usual = float(np.median(np.diff(time)))
        if usual < _INSTANT:
            check_rate(path, usual)


def check_table_rate(path: str, interval: float) -> list[str]:
    """Return a warning for an interval (s) at which hardly a table logs."""
    what = _implausible_rate(interval)
    return [f"{path}: time: {what}"] if what else []


def check_spans(path: str, table: Array, interval: float, imu: Array) -> None:
    """Raise LogError for a table log whose slow stamps reach far beyond the IMU's.

    table, imu: first and last time, s. interval: s, of the table's records. A slow log of the same
    run is believed.
    """
    what = _implausible_rate(interval)
    if what and table[-1] - table[0] > 20.0 * (imu[-1] - imu[0]):
        spans = f"{show_span(table[0], table[-1])}, the IMU log {show_span(imu[0], imu[-1])}"
        raise LogError(path, f"spans {spans}; {what}", column="time")


def _implausible_rate(interval: float) -> str | None:
    rate = 1.0 / interval if interval > 1e-300 else np.inf
    if SLOWEST <= rate <= FASTEST:
        return None
    return (
        f"{rate:.4g} records a second are not plausible ({SLOWEST:g} to {FASTEST:g} are): name "
        "the unit of the time stamps in the header, as in time [ms], or in the rig"
    )


@_ABSURD
def check_axes(path: str, time: Array, values: Array) -> list[str]:
    """Return warnings about axes that are stuck, frozen for a while, or cut to a few levels.

    time: (n,) s; values: (6, n), gyro then accelerometer. A log without any noise (of a
    simulation) is left alone.
    """
    if len(time) < 2 * _FROZEN[1] or not any(_noisy(row) for row in values):
        return []
    found = [_axis(time, row, name) for name, row in zip(_AXES, values, strict=True)]
    return [f"{path}: {text}" for text in found if text]


def _noisy(row: Array) -> bool:
    """Tell whether neighbouring steps change sign as those of a sensor's noise do."""
    steps = np.diff(row[:: max(1, len(row) // _SAMPLE)])
    return bool(np.mean(steps[1:] * steps[:-1] < 0.0) > _NOISY)


def _axis(time: Array, row: Array, name: str) -> str | None:
    levels = np.unique(row[:: max(1, len(row) // _SAMPLE)])
    if len(levels) < _FEW:
        levels = np.unique(row)
    span = f"from {show_span(time[0], time[-1])}"
    if len(levels) == 1:
        return (
            f"{name} holds {row[0]:.6g} all the way {span}: the axis is stuck, not connected or "
            "not logged; results along it mean nothing"
        )
    if len(levels) < _FEW:
        return (
            f"{name} has {len(levels)} distinct values only {span}, {np.diff(levels).min():.3g} "
            "apart: quantised beyond its noise; log it with more digits or a smaller range"
        )
    frozen = _longest_run(row, max(_FROZEN[1], round(_FROZEN[0] / _interval(time))))
    if frozen is None:
        return None
    first, last = frozen
    return (
        f"{name} holds {row[first]:.6g} from {show_span(time[first], time[last])}: stuck, past its "
        "range, or a logger that froze; leave that part out"
    )


def _interval(time: Array) -> float:
    return float(time[-1] - time[0]) / (len(time) - 1)


def _longest_run(row: Array, least: int) -> tuple[int, int] | None:
    """Return first and last index of the longest run of one value, None below `least` samples.

    Such a run holds two neighbours of a grid half as wide, so only there it need be looked for.
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


@_ABSURD
def check_rest(path: str, gyro: Array, interval: float, white: Array | None = None) -> list[str]:
    """Return a warning where gyros (n, 3), rad/s, at rest read what no gyro reads at rest.

    white: (3,) rad/sqrt(s), the rig's angle random walks; twenty times as much tells another
    unit, too, and so does a twenty-fifth, over seconds as well as over samples: a filtered log is
    as smooth from sample to sample.
    """
    if len(gyro) < 10:
        return []
    mean = gyro.mean(axis=0)
    noise = np.sqrt(0.5 * interval * np.mean(np.diff(gyro, axis=0) ** 2, axis=0))
    advice = "deg/s read as rad/s? name the unit in the header or as [imu] units gyro"
    if np.max(np.abs(mean)) > _REST:
        felt = ", ".join(f"{v / DEG:.4g}" for v in mean)
        turning = "; or was the IMU turning? then choose a still --window"
        return [f"{path}: at rest the gyros read ({felt}) deg/s: {advice}{turning}"]
    ratio = 0.0 if white is None or not np.all(white) else float(np.median(noise / white))
    if white is not None and np.all(white) and np.all(noise):
        share = max(ratio, float(np.median(_slow_noise(gyro, interval) / white)))
        if share < _SILENT:
            size = ", ".join(f"{v / DEG_PER_ROOT_HOUR:.3g}" for v in noise)
            return [
                f"{path}: at rest the gyros' noise is ({size}) deg/sqrt(h), {share:.2g} times the "
                "rig's angle_random_walk: rad/s read as deg/s? name the unit in the header or as "
                "[imu] units gyro, or correct angle_random_walk"
            ]
    loud = noise / np.sqrt(interval) > _REST_SCATTER
    if np.median(loud) and (np.median(noise) > _REST_NOISE or ratio > 20.0):
        size = ", ".join(f"{v / DEG_PER_ROOT_HOUR:.3g}" for v in noise)
        told = f", {ratio:.3g} times the rig's angle_random_walk" if ratio > 20.0 else ""
        return [f"{path}: at rest the gyros' noise is ({size}) deg/sqrt(h){told}: {advice}"]
    return []


def _slow_noise(gyro: Array, interval: float) -> Array:
    """Return the white noise (3,) rad/sqrt(s) that the means of seconds of gyros (n, 3) show."""
    size = max(1, min(round(1.0 / interval), len(gyro) // 5))
    means = gyro[: len(gyro) // size * size].reshape(-1, size, 3).mean(axis=1)
    return np.asarray(np.sqrt(0.5 * size * interval * np.mean(np.diff(means, axis=0) ** 2, axis=0)))


@_ABSURD
def check_size_of_gravity(path: str, accel: Array) -> list[str]:
    """Return a warning where accelerometers (n, 3), m/s^2, at rest do not feel one gravity."""
    size = float(np.linalg.norm(accel.mean(axis=0)))
    if 0.9 < size / STANDARD_GRAVITY < 1.1 or size < 0.1:  # or gravity was taken out before
        return []
    advice = "check the unit" if not 0.8 < size < 1.25 else "in g?"
    return [
        f"{path}: at rest the mean specific force is {size:.4g} m/s^2, gravity about 9.8: "
        f"{advice}; name the unit in the header or as [imu] units accel"
    ]


@_ABSURD
def check_drop_outs(path: str, time: Array, angle: Array) -> list[str]:
    """Return warnings about a table log's drop-outs: time (m,) s, angle (m,) rad unwrapped.

    Through them the angle is a straight line, and of an angle that wraps whole turns are lost.
    """
    usual = float(np.median(np.diff(time[:_ENOUGH])))
    gaps, longest, after = 0, 0.0, 0
    fast: int | None = None
    for first in range(0, len(time) - 1, _ENOUGH):
        part = slice(first, first + _ENOUGH + 1)
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
        count = f"{gaps} drop-out{'s' * (gaps > 1)}"
        warnings.append(
            f"{path}: {count} of the table log, the longest {longest:.3g} s after "
            f"{time[after]:.6g} s: the angle was bridged by a straight line; leave that part out"
        )
    if fast is not None:
        turned = (angle[fast + 1] - angle[fast]) / DEG
        warnings.append(
            f"{path}: the angle steps by {turned:.4g} deg within "
            f"{time[fast + 1] - time[fast]:.3g} s after {time[fast]:.6g} s, close to half a turn "
            "or more: whole turns may be lost; log the table faster"
        )
    return warnings
