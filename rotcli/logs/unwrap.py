"""Table angles that start again: full turns, encoder counts, ranges such as 327.68 deg."""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

IndexArray = NDArray[np.int64]

# Share of a turn by which the range of an angle that wraps may exceed it: rounding.
_RANGE_TOLERANCE = 1e-3
_MAX_OUTSIDE = 3  # single records outside the range that are taken for errors of transmission
_MAX_OUTSIDE_SHARE = 1e-3  # of a log, likewise
_MIN_SPIKE = 0.01  # of a turn, on both sides of such a record
_MIN_END_SPIKE = 0.25  # of a turn, for a first or last record with one neighbour
_MIN_RATIO = 4.0  # of a jump to the usual largest step: ten records in a turn
_MIN_AGREEING = 0.8  # share of the jumps that must have one size and sense
_PERIOD_TOLERANCE = 1e-3  # share of the period
_CHUNK = 100_000  # records unwrapped at a time
_SAMPLED = 100_000  # records, evenly spread, that show what is usual in a longer log
_POWERS = tuple(float(1 << bits) for bits in range(8, 33))


@dataclass(frozen=True)
class Wrap:
    """How an angle starts again: period (raw units), 0 where it counts on; records to omit.

    found: the period is that of the jumps, not a turn. beyond: records outside of the turn in
    which most others are, though the angle starts again after a turn: the encoder has slipped.
    """

    period: float
    outside: tuple[int, ...] = ()
    found: bool = False
    beyond: tuple[int, ...] = ()


def find_wrap(time: FloatArray, angle: FloatArray, turn: float) -> Wrap:
    """Return how an angle (n,) at times (n,), s, starts again; turn: a full turn in its unit."""
    spread = float(angle.max() - angle.min()) if len(angle) else 0.0
    if len(angle) > 1 and _largest_step(angle) <= min(_MIN_SPIKE * turn, 0.5 * spread):
        return Wrap(turn if spread <= turn * (1.0 + _RANGE_TOLERANCE) else 0.0)  # no jump
    spikes = _spikes(angle, turn)
    outside = _outside(angle, spikes, turn)
    kept = np.delete(angle, outside) if outside else angle
    if len(kept) < 2:
        return Wrap(0.0, outside)
    calm = np.delete(angle, spikes) if len(spikes) else angle
    calm_time = np.delete(time, spikes) if len(spikes) else time
    period = _other_period(calm, calm_time, turn)
    if period:
        return Wrap(period, outside_records(angle, period), found=True)
    if float(kept.max() - kept.min()) <= turn * (1.0 + _RANGE_TOLERANCE):
        return Wrap(turn, outside)
    if _starts_again(calm, calm_time, turn):
        return Wrap(turn, outside, beyond=_beyond(angle, outside, turn))
    return Wrap(0.0, outside)  # counts on: nothing wraps


def outside_records(angle: FloatArray, period: float) -> tuple[int, ...]:
    """Return single records of an angle (n,) outside of the period that all others are in."""
    return _outside(angle, _spikes(angle, period), period)


def _sample(values: FloatArray) -> FloatArray:
    """Return every k-th of many values (n,), all of a few."""
    return values[:: max(1, len(values) // _SAMPLED)]


def _sampled_steps(values: FloatArray) -> FloatArray:
    """Return `_sample` of the steps between many values (n,), without the others."""
    every = max(1, (len(values) - 1) // _SAMPLED)
    return np.asarray(values[1::every] - values[:-1:every])


def _largest_step(angle: FloatArray) -> float:
    steps = np.diff(angle)
    return float(max(steps.max(), -steps.min()))


def _spikes(angle: FloatArray, turn: float) -> IndexArray:
    """Return single records far from both neighbours, which agree with each other."""
    if len(angle) < 3:
        return np.empty(0, dtype=np.int64)
    steps = np.diff(angle)
    size = np.abs(steps)
    # The unit, and with it the turn, may be unknown: the usual steps count as well.
    margin = max(_MIN_SPIKE * turn, _MIN_RATIO * float(np.quantile(_sample(size), 0.9)))
    far = np.flatnonzero(size > margin)
    before = far[:-1][np.diff(far) == 1]  # the step to a record, of those with two far steps
    across = steps[before] + steps[before + 1]
    across -= turn * np.rint(across / turn)
    single = (before + 1)[np.abs(across) < margin].tolist()
    last, least = len(steps), max(margin, _MIN_END_SPIKE * turn)
    first_alone = size[0] > least and 1 not in single[:1]
    last_alone = size[-1] > least and last - 1 not in single[-1:]
    spikes = [*([0] if first_alone else []), *single, *([last] if last_alone else [])]
    return np.array(spikes, dtype=np.int64)


def _outside(angle: FloatArray, spikes: IndexArray, turn: float) -> tuple[int, ...]:
    """Return those of the spikes that are outside of the range of all other records."""
    if not len(spikes) or angle.max() - angle.min() <= turn * (1.0 + _RANGE_TOLERANCE):
        return ()
    others = np.delete(angle, spikes)
    if not len(others):
        return ()
    slack = _RANGE_TOLERANCE * turn
    values = angle[spikes]
    found = spikes[(values > others.max() + slack) | (values < others.min() - slack)]
    limit = max(_MAX_OUTSIDE, int(_MAX_OUTSIDE_SHARE * len(angle)))
    return tuple(found.tolist()) if len(found) <= limit else ()


def _per_interval(steps: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the steps (n,) per sampling interval, and their lengths in intervals.

    These are 1, and more where records are lost.
    """
    distances = np.diff(time)
    interval = float(np.median(_sample(distances))) if len(distances) else 0.0
    if interval <= 0.0 or distances.max() < 1.5 * interval:
        return steps, np.broadcast_to(1.0, steps.shape)
    spans = np.maximum(np.rint(distances / interval), 1.0)
    return steps / spans, spans


def _sizes(
    steps: FloatArray, moved: FloatArray, spans: FloatArray, at: IndexArray
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return jumps less the motion around them, that motion, the other steps and their scatter.

    moved, spans: of `_per_interval`; the last two are per sampling interval.
    """
    others = np.delete(moved, at)
    change = np.abs(_sampled_steps(others))
    scatter = float(np.quantile(change, 0.99)) if len(change) else 0.0
    sides = np.stack([np.clip(at + shift, 0, len(steps) - 1) for shift in (-1, 1)])
    quiet = np.ones(len(steps), dtype=bool)  # another jump is no motion
    quiet[at] = False
    quiet = quiet[sides]
    motion = np.sum(moved[sides] * quiet, axis=0) / np.maximum(quiet.sum(axis=0), 1)
    motion *= spans[at]
    return steps[at] - motion, motion, others, scatter


def _other_period(angle: FloatArray, time: FloatArray, turn: float) -> float:
    """Return the period of an angle that starts again after something else than a turn, or 0."""
    steps = np.diff(angle)
    spread = float(angle.max() - angle.min()) if len(angle) else 0.0
    at = np.flatnonzero(np.abs(steps) > 0.5 * spread)
    if not len(at):
        return 0.0
    moved, spans = _per_interval(steps, time)
    sizes, motion, others, scatter = _sizes(steps, moved, spans, at)
    usual = float(np.quantile(np.abs(_sample(others)), 0.999)) if len(others) else 0.0
    if float(np.abs(steps[at]).min()) <= _MIN_RATIO * max(usual, 1e-12):
        return 0.0
    period = float(np.median(np.abs(sizes)))
    # Motion that starts or ends at the jump is known to half a step.
    unsteady = max(3.0 * scatter, 0.5 * usual)
    tolerance = max(unsteady * float(np.median(spans[at])), _PERIOD_TOLERANCE * period)
    if abs(period - turn) <= tolerance:
        return 0.0
    limits = np.maximum(unsteady * spans[at], _PERIOD_TOLERANCE * period)
    agreeing = np.abs(np.abs(sizes) - period) <= limits
    against = np.count_nonzero(motion * sizes < 0.0)
    snapped = _snap(period, tolerance)
    # The range of a counter is known; another needs jumps against the sense of motion.
    opposed = against >= _MIN_AGREEING * len(at)
    if np.mean(agreeing) >= _MIN_AGREEING and (opposed or _is_counter_range(snapped)):
        return snapped
    return 0.0


def _starts_again(angle: FloatArray, time: FloatArray, turn: float) -> bool:
    """Return whether the jumps of an angle are those of a turn, against the sense of motion."""
    steps = np.diff(angle)
    at = np.flatnonzero(np.abs(steps) > 0.5 * turn)
    if not len(at):
        return False
    moved, spans = _per_interval(steps, time)
    sizes, motion, _, scatter = _sizes(steps, moved, spans, at)
    tolerance = np.maximum(3.0 * scatter * spans[at], _PERIOD_TOLERANCE * turn)
    fitting = (np.abs(np.abs(sizes) - turn) <= tolerance) & (motion * sizes <= 0.0)
    return bool(np.mean(fitting) >= _MIN_AGREEING)


def _beyond(angle: FloatArray, outside: tuple[int, ...], turn: float) -> tuple[int, ...]:
    """Return the records outside of the one turn, from the lowest or highest, of most records."""
    kept = np.ones(len(angle), dtype=bool)
    kept[list(outside)] = False
    low, high = float(angle[kept].min()), float(angle[kept].max())
    slack = _RANGE_TOLERANCE * turn
    above = kept & (angle >= low + turn - slack)
    below = kept & (angle <= high - turn + slack)
    fewer = above if np.count_nonzero(above) <= np.count_nonzero(below) else below
    return tuple(np.flatnonzero(fewer).tolist())


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


def _is_counter_range(period: float) -> bool:
    return any(power / 10**decimals == period for decimals in range(7) for power in _POWERS)


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
