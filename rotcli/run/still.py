"""The stretches of an IMU log in which it stands still, whole and unclipped.

An Allan deviation is of one even, undisturbed record. A sample is excluded when the logger lost it
in a gap too long to bridge, when it is clipped, or when the IMU moves: a block of about a second
is moving when it shakes far more than the log's quiet blocks, or when its mean rate jumps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.logs.record import ImuSource, in_blocks, own_clock
from rotcli.units import show_span, show_time

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST = 100  # samples
_BRIDGED = 5  # samples; longer gaps end a stretch
# Of the samples. The mean of two neighbours in place of a lost sample raises the variance of a sum
# by half a sample: a hundredth raises the deviation by 0.25 %.
_BRIDGED_SHARE = 1e-2
_SHAKING = 4.0  # times the quiet level of a block's standard deviation
_JUMP = 10.0  # times the usual step of the mean from block to block
_TURNING = 0.02  # rad/s (1.1 deg/s), mean rate above that of the stillest stretch


@dataclass(frozen=True)
class StillStretch:
    """The samples [first, last) of the longest still stretch, and what was wrong elsewhere."""

    first: int
    last: int
    warnings: tuple[str, ...] = ()


def longest_still(
    log: ImuSource,
    window: tuple[float, float] | None = None,
    gyro_range: float | None = None,
    accel_range: float | None = None,
) -> StillStretch:
    """Find the longest stretch of the log (of the window, s) without gap, clipping or motion.

    gyro_range rad/s and accel_range m/s^2: samples at or past them are clipped.

    Raises LogError when the window holds too few samples or no stretch of LEAST samples remains.
    """
    span = log.between(*window) if window else slice(0, log.samples)
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
    statistics = _scan(log, span, gyro_range, accel_range)
    gap, clipped = _gaps(statistics.missing), statistics.clipped
    moving, turning = _moving(statistics, n, gap | clipped)
    first, last = _longest(gap | clipped | moving, turning)
    reasons = []
    for what, flags in (("gaps", gap), ("clipped samples", clipped), ("motion", moving | turning)):
        if flags.any():
            at = _time(log, span.start + int(np.argmax(flags)))
            reasons.append(f"{what} ({int(flags.sum())} samples, first at {show_time(at)} s)")
    start = _time(log, span.start + first)
    end = _time(log, span.start + max(last, first + 1) - 1)
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


def _time(log: ImuSource, sample: int) -> float:
    return float(log.times(slice(sample, sample + 1))[0])


@dataclass(frozen=True, eq=False)
class _BlockStatistics:
    """What is kept of the samples of a span: flags (n,); of the axes (6), block by block.

    mean, square (6, blocks): mean and mean square about it; digit (6,): smallest step statistics.
    """

    missing: Flags
    clipped: Flags
    size: int
    mean: Array
    square: Array
    digit: Array


def _scan(
    log: ImuSource, span: slice, gyro_range: float | None, accel_range: float | None
) -> _BlockStatistics:
    """Look at a span piece by piece; seven digits are all that a log in single precision has."""
    n = span.stop - span.start
    size = min(max(10, round(1.0 / log.interval)), n // 10)
    blocks = n // size
    missing, clipped = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    means, squares = np.empty((6, blocks)), np.empty((6, blocks))
    digit: Array | None = None
    at = 0
    for piece in in_blocks(log.pieces(span), size):
        part = slice(at, at + piece.samples)
        whole = piece.samples // size * size
        block = slice(at // size, at // size + whole // size)
        at = part.stop
        if piece.missing is not None:
            missing[part] = piece.missing
        for k, name in enumerate(AXES):
            column = piece.column(name)
            limit = gyro_range if k < 3 else accel_range
            if limit is not None and max(column.max(), -column.min()) >= limit * (1.0 - 1e-7):
                clipped[part] |= np.abs(column) >= limit * (1.0 - 1e-7)
            values = column[:whole].reshape(-1, size)
            mean = values.mean(axis=1)
            square = np.einsum("ij,ij->i", values, values) / size - mean**2
            means[k, block], squares[k, block] = mean, np.maximum(square, 1e-15 * mean**2)
        if digit is None:
            first = (piece.column(name)[:100] for name in AXES)
            digit = np.array([_last_digit(values) for values in first])
    return _BlockStatistics(
        missing, clipped, size, means, squares, np.zeros(6) if digit is None else digit
    )


def _gaps(missing: Flags) -> Flags:
    """Flag the samples lost in gaps that are too long, or in all when too many are lost."""
    if missing.mean() > _BRIDGED_SHARE:
        return missing
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]])))
    result = np.zeros(len(missing), dtype=bool)
    for first, last in edges.reshape(-1, 2):
        result[first:last] = last - first > _BRIDGED
    return result


def _moving(statistics: _BlockStatistics, n: int, excluded: Flags) -> tuple[Flags, Flags]:
    """Flag the samples of blocks that shake or jump, and of steady stretches that turn.

    Blocks with excluded samples are not judged.
    """
    size, blocks = statistics.size, n // statistics.size
    whole = np.flatnonzero(~excluded[: blocks * size].reshape(blocks, size).any(axis=1))
    moving = np.zeros(blocks, dtype=bool)
    if len(whole) < 3:
        return np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    rates = statistics.mean[:3].T
    for mean, square, digit in zip(
        statistics.mean, statistics.square, statistics.digit, strict=True
    ):
        shake = np.sqrt(square)[whole]
        # Where the last digit hides the noise, a block shakes by half of that digit or by none.
        quiet = max(np.quantile(shake, 0.1), 0.5 * float(digit))
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
    # The last block holds what is left over, too.
    lengths = np.full(blocks, size)
    lengths[-1] += n - blocks * size
    return np.repeat(moving, lengths), np.repeat(turning, lengths)


def _last_digit(values: Array) -> float:
    """Return the smallest step between neighbouring values, 0 when there is none."""
    steps = np.abs(np.diff(values.ravel()))
    return float(steps[steps > 0.0].min()) if np.any(steps > 0.0) else 0.0


def _longest(excluded: Flags, turning: Flags) -> tuple[int, int]:
    """Return the longest run without a flag, (0, 0) when there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], excluded | turning, [True]])))
    runs = edges.reshape(-1, 2)
    if not len(runs):
        return 0, 0
    first, last = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return int(first), int(last)
