"""Table angles that start again: full turns, encoder counts, ranges such as 327.68 deg."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Share of a turn by which the range of an angle that wraps may exceed it: rounding.
_RANGE_TOLERANCE = 1e-3
_MAX_OUTSIDE = 3  # single records outside the range that are taken for errors of transmission
_MIN_OUTSIDE_JUMP = 0.25  # of a period, on both sides of such a record
_MIN_WRAPS = 2  # jumps of one size that show another period than a turn
_MIN_RATIO = 10.0  # of a jump to the usual largest step
_CHUNK = 1_000_000  # records unwrapped at a time
_POWERS = tuple(float(1 << bits) for bits in range(8, 33))


@dataclass(frozen=True)
class Wrap:
    """How an angle starts again: period (raw units), 0 where it counts on; records to omit."""

    period: float
    outside: tuple[int, ...] = ()
    found: bool = False  # the period is that of the jumps, not a turn


def find_wrap(angle: FloatArray, turn: float) -> Wrap:
    """Return how an angle (n,) starts again; turn: a full turn in its unit."""
    outside = _outside(angle, turn)
    kept = np.delete(angle, outside) if outside else angle
    steps = np.abs(np.diff(kept))
    if not len(steps):
        return Wrap(0.0)
    spread = float(kept.max() - kept.min())
    jumps = steps[steps > 0.5 * spread]
    others = steps[steps <= 0.5 * spread]
    usual = float(np.quantile(others, 0.999)) if len(others) else 0.0
    if len(jumps) >= _MIN_WRAPS and float(jumps.min()) > _MIN_RATIO * max(usual, 1e-12):
        signed = np.diff(kept)
        at = np.flatnonzero(steps > 0.5 * spread)
        before = np.where(at > 0, signed[np.maximum(at - 1, 0)], 0.0)
        periods = np.abs(signed[at] - before)
        period = float(np.median(periods))
        scatter = float(np.abs(periods - period).max())
        tolerance = max(3.0 * usual, 1e-3 * period)
        same_sense = np.all(np.sign(signed[at]) == np.sign(signed[at[0]]))
        if scatter <= tolerance and abs(period - turn) > tolerance and same_sense:
            return Wrap(_snap(period, tolerance), outside, found=True)
    if spread > turn * (1.0 + _RANGE_TOLERANCE):  # counts on: nothing wraps
        return Wrap(0.0, outside if len(outside) else ())
    return Wrap(turn, outside)


def _outside(angle: FloatArray, turn: float) -> tuple[int, ...]:
    """Return single records far outside of the turn that all others are in."""
    low, high = np.partition(angle, [_MAX_OUTSIDE, len(angle) - 1 - _MAX_OUTSIDE])[
        [_MAX_OUTSIDE, len(angle) - 1 - _MAX_OUTSIDE]
    ] if len(angle) > 4 * _MAX_OUTSIDE else (angle.min(), angle.max())  # fmt: skip
    if angle.max() - angle.min() <= turn * (1.0 + _RANGE_TOLERANCE) or high - low > turn:
        return ()
    margin = _MIN_OUTSIDE_JUMP * turn
    far = np.flatnonzero((angle > high + margin) | (angle < low - margin))
    found = []
    for i in far.tolist():
        left = abs(angle[i] - angle[i - 1]) if i > 0 else np.inf
        right = abs(angle[i] - angle[i + 1]) if i + 1 < len(angle) else np.inf
        if min(left, right) > margin:
            found.append(int(i))
    return tuple(found) if len(found) == len(far) <= _MAX_OUTSIDE else ()


def _snap(period: float, tolerance: float) -> float:
    """Return the period as a power of two times a decimal unit, where that is as good.

    >>> _snap(327.64, 0.3), _snap(4095.9, 4.0), _snap(399.99, 0.1)
    (327.68, 4096.0, 400.0)
    """
    for decimals in range(7):
        for power in _POWERS:
            if abs(power / 10**decimals - period) <= tolerance:
                return float(power / 10**decimals)
    rounded = float(f"{period:.3g}")
    return rounded if abs(rounded - period) <= tolerance else float(period)


def unwrap(angle: FloatArray, period: float) -> None:
    """Remove the jumps of periods of an angle (n,), in place."""
    if not period:
        return
    count, last = 0.0, float(angle[0])
    for first in range(0, len(angle), _CHUNK):
        part = angle[first : first + _CHUNK]
        jumps = np.rint(np.diff(part, prepend=last) / period)
        last = float(part[-1])
        jumps[0] += count
        np.cumsum(jumps, out=jumps)
        count = float(jumps[-1])
        part -= period * jumps
