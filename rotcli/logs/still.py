"""The stretches of an IMU log in which it stands still, whole and unclipped.

An Allan deviation is of one even, undisturbed record. A sample is spoilt when the logger lost it
in a gap too long to bridge, when it is clipped, or when the IMU moves: a block of about a second
is moving when it shakes far more than the log's quiet blocks, or when its mean rate jumps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.record import ImuLog, own_clock
from rotcli.units import show_span, show_time

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST = 100  # samples
_BRIDGED = 5  # samples; longer gaps end a stretch
_BRIDGED_SHARE = 1e-3  # of the samples; a larger share of interpolated ones would lower the noise
_SHAKING = 4.0  # times the quiet level of a block's standard deviation
_JUMP = 10.0  # times the usual step of the mean from block to block
_TURNING = 0.02  # rad/s (1.1 deg/s), mean rate above that of the stillest stretch
AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


@dataclass(frozen=True)
class StillStretch:
    """The samples [first, last) of the longest still stretch, and what was wrong elsewhere."""

    first: int
    last: int
    warnings: tuple[str, ...] = ()


def axis_values(log: ImuLog, name: str) -> Array:
    """Return the values (n,) of `gyro_x` … `accel_z`, rad/s or m/s^2."""
    place = AXES.index(name)
    return (log.gyro if place < 3 else log.accel)[:, place % 3]


def longest_still(
    log: ImuLog,
    window: tuple[float, float] | None = None,
    gyro_range: float | None = None,
    accel_range: float | None = None,
) -> StillStretch:
    """Find the longest stretch of the log (of the window, s) without gap, clipping or motion.

    gyro_range rad/s and accel_range m/s^2: samples at or past them are clipped.

    Raises LogError when the window holds too few samples or no stretch of LEAST samples remains.
    """
    span = log.between(*window) if window else slice(0, len(log.time))
    n = span.stop - span.start
    if n < LEAST:
        where = f"from {show_span(*window)}" if window else "in the log"
        there = (float(log.time[0]), float(log.time[-1]))
        hint = own_clock(window, there) if window else ""
        raise LogError(
            log.path,
            f"{n} samples {where}, which spans {show_span(*there)}{hint}; an Allan "
            f"deviation needs {LEAST} or more",
        )
    gap = _gaps(log, span)
    clipped = _clipped(log, span, gyro_range, accel_range)
    moving, turning = _moving(log, span, gap | clipped)
    first, last = _longest(gap | clipped | moving, turning)
    reasons = []
    for what, flags in (("gaps", gap), ("clipped samples", clipped), ("motion", moving | turning)):
        if flags.any():
            at = log.time[span.start + int(np.argmax(flags))]
            reasons.append(f"{what} ({int(flags.sum())} samples, first at {show_time(at)} s)")
    start, end = log.time[span.start + first], log.time[span.start + max(last, first + 1) - 1]
    if last - first < LEAST:
        raise LogError(
            log.path,
            f"no still stretch of {LEAST} samples or more: {', '.join(reasons)}; the longest is "
            f"{show_span(start, end)}; record the IMU at rest or choose a --window",
        )
    warnings = []
    if reasons:
        warnings.append(
            f"{log.path}: {', '.join(reasons)}: the longest clean stretch was used, "
            f"{show_span(start, end)}, {(last - first) / n:.1%} of the samples"
        )
    return StillStretch(span.start + first, span.start + last, tuple(warnings))


def _gaps(log: ImuLog, span: slice) -> Flags:
    """Flag the samples lost in gaps that are too long, or in all when too many are lost."""
    if log.missing is None or not log.missing[span].any():
        return np.zeros(span.stop - span.start, dtype=bool)
    missing = log.missing[span]
    if missing.mean() > _BRIDGED_SHARE:
        return missing
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]])))
    result = np.zeros(len(missing), dtype=bool)
    for first, last in edges.reshape(-1, 2):
        result[first:last] = last - first > _BRIDGED
    return result


def _clipped(
    log: ImuLog, span: slice, gyro_range: float | None, accel_range: float | None
) -> Flags:
    """Flag clipped samples; seven digits are all that a log in single precision has."""
    result = np.zeros(span.stop - span.start, dtype=bool)
    for values, limit in ((log.gyro, gyro_range), (log.accel, accel_range)):
        for k in range(3) if limit is not None else ():
            column = values[span, k]
            edge = limit * (1.0 - 1e-7) if limit is not None else np.inf
            if max(column.max(), -column.min()) >= edge:
                result |= np.abs(column) >= edge
    return result


def _moving(log: ImuLog, span: slice, spoilt: Flags) -> tuple[Flags, Flags]:
    """Flag the samples of blocks that shake or jump, and of steady stretches that turn.

    Blocks with spoilt samples are not judged.
    """
    n = span.stop - span.start
    size = min(max(10, round(1.0 / log.interval)), n // 10)
    blocks = n // size
    whole = np.flatnonzero(~spoilt[: blocks * size].reshape(blocks, size).any(axis=1))
    moving = np.zeros(blocks, dtype=bool)
    if len(whole) < 3:
        return np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    rates = np.empty((blocks, 3))
    for k, name in enumerate(AXES):
        values = axis_values(log, name)[span][: blocks * size].reshape(blocks, size)
        mean = values.mean(axis=1)
        if k < 3:
            rates[:, k] = mean
        square = np.einsum("ij,ij->i", values, values) / size - mean**2
        shake = np.sqrt(np.maximum(square, 1e-15 * mean**2))[whole]
        # Where the last digit hides the noise, a block shakes by half of that digit or by none.
        quiet = max(float(np.quantile(shake, 0.1)), 0.5 * _last_digit(values[:100]))
        moving[whole] |= shake > _SHAKING * quiet + 1e-12
        step = np.abs(np.diff(mean[whole]))
        # A quiet block of white noise steps by its own scatter at least.
        usual = max(float(np.median(step)), max(float(np.median(shake)), quiet) / np.sqrt(size))
        jump = np.flatnonzero(step > _JUMP * usual + 1e-12)
        moving[whole[jump]] = moving[whole[jump + 1]] = True
    turning = np.zeros(blocks, dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]])))
    runs = edges.reshape(-1, 2)
    if len(runs):
        # A stretch of a second or two may be the turning point of a swing.
        longer = runs[:, 1] - runs[:, 0] >= min(5, int(np.max(runs[:, 1] - runs[:, 0])))
        means = np.array([np.linalg.norm(rates[a:b].mean(axis=0)) for a, b in runs])
        for (a, b), mean in zip(runs, means, strict=True):
            turning[a:b] = mean > means[longer].min() + _TURNING
    last = blocks - 1
    which = np.minimum(np.arange(n) // size, last)
    return moving[which], turning[which]


def _last_digit(values: Array) -> float:
    """Return the smallest step between neighbouring values, 0 when there is none."""
    steps = np.abs(np.diff(values.ravel()))
    return float(steps[steps > 0.0].min()) if np.any(steps > 0.0) else 0.0


def _longest(spoilt: Flags, turning: Flags) -> tuple[int, int]:
    """Return the longest run without a flag, (0, 0) when there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], spoilt | turning, [True]])))
    runs = edges.reshape(-1, 2)
    if not len(runs):
        return 0, 0
    first, last = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return int(first), int(last)
