"""What the IMU itself says of a stretch: whether it is still, or turns with the table."""

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs import plausible
from rotcli.logs.record import ImuSource, Segment, TableLog, in_blocks
from rotcli.units import DEG, show_span, show_time

Array = NDArray[np.float64]

_TURN_ON_BIAS = 1.5 * DEG  # rad/s; the datasheet's 3600 deg/h of the coarser IMU and a half more
_CLEAR_MOTION = 1.0 * DEG  # rad/s, over a second, beyond the mean
_CUT = 1.0  # s; less is a ramp
_CLEAR_FORCE = 1.0  # m/s^2, over a second: a tilt by 6 deg
_WRONG_AXES, _WRONG_TILT = 30.0, 3.0  # deg between felt and expected gravity
_LEAST = np.array(3 * [0.02 * DEG] + 3 * [0.01])  # rad/s, m/s^2: less is nobody's knock
_ENOUGH = 3600.0  # s of a stretch that tell its axis, direction and lag
_CHANNELS = [f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"]


def check_direction(imu: ImuSource, table: TableLog, axis: Array, stretch: Segment) -> None:
    """Compare the mean rate that the gyros feel in a turning stretch with the encoder's.

    axis: (3,) unit vector in the body frame, which the turning sensor keeps. A turn-on bias of
    1.5 deg/s is granted.

    Raises LogError when the IMU turns the other way, about another axis, or at another rate.
    """
    felt_rates = imu.crop(stretch.start, min(stretch.end, stretch.start + _ENOUGH)).gyro
    mean = felt_rates.mean(axis=0)
    along = float(mean @ axis)
    across = float(np.linalg.norm(mean - along * axis))
    rate = stretch.rate
    felt = ", ".join(f"{v / DEG:.4g}" for v in mean)
    seen = (
        f"from {show_span(stretch.start, stretch.end)} the table turns at {rate / DEG:.6g} "
        f"deg/s and the gyros feel ({felt}) deg/s"
    )
    if across > max(abs(along), 0.5 * abs(rate)) and across > 2.0 * _TURN_ON_BIAS:
        what = f"{seen}: about another axis; correct [table] axis or [imu] mount"
        raise LogError(table.path, what)
    off = abs(along - rate)
    if along * rate < 0.0 and off > max(abs(rate), _TURN_ON_BIAS) and abs(along) > 0.5 * abs(rate):
        turned = "the IMU turns the other way than [table] direction says"
        what = f"{seen} along the axis {along / DEG:.4g}: {turned}; set direction = -1"
        what += " (or 1 if it is -1)"
        raise LogError(table.path, what)
    if off > 0.2 * abs(rate) + _TURN_ON_BIAS:
        what = f"{seen}: not the same rate; check the units of both logs and [table] axis"
        raise LogError(table.path, what)


def check_gravity(
    imu: ImuSource, f_b: Array, expected: Array, *, strict: bool = True, level: bool = True
) -> tuple[str, ...]:
    """Compare the mean specific force of a still base, f_b (3,), m/s^2, with what it should be.

    Returns warnings where it is clearly off (a few degrees only if `level`); raises LogError, if
    strict, where units, increments or axes must be mistaken.
    """
    size, g = float(np.linalg.norm(f_b)), float(np.linalg.norm(expected))
    tilt = float(np.arctan2(np.linalg.norm(np.cross(f_b, expected)), f_b @ expected)) / DEG
    felt = f"the mean specific force is {size:.4g} m/s^2, gravity {g:.4g} m/s^2"
    placed = f"gravity is felt {tilt:.1f} deg from where [attitude] puts it"
    faults, warnings = [], []
    if not 0.8 < size / g < 1.25:
        if 0.8 < size < 1.25:
            likely = "in g? name the unit in the header or as [imu] units accel"
        elif 0.8 < size / g / imu.interval < 1.25:
            likely = "increments? then say [imu] sampling"
        else:
            likely = "check the unit, and the order of the columns"
        faults.append(f"{felt}: {likely}")
    elif abs(size / g - 1.0) > 0.03:
        warnings.append(f"{felt}: check the unit")
    if tilt > _WRONG_AXES:
        axes = ", ".join(f"{v:.3g}" for v in f_b)
        advice = "correct [imu] mount, [attitude] or [table] axis"
        faults.append(f"{placed}, ({axes}) m/s^2 in the body's axes: {advice}")
    elif level and tilt > _WRONG_TILT:
        warnings.append(f"{placed}: correct [attitude]")
    if faults and strict:
        raise LogError(imu.path, faults[0])
    return tuple(f"{imu.path}: {text}" for text in (*faults, *warnings))


def check_still_without_table(
    imu: ImuSource, start: float, end: float, static: Segment | None
) -> None:
    """Raise LogError where an IMU without a table log clearly turns between start and end (s).

    Over seconds a still MEMS gyro keeps to what it read in the still stretch within far less
    than a degree a second; without one, no turn-on bias is as large as 10 deg/s.
    """
    inside = imu.between(start, end)
    second = max(1, round(1.0 / imu.interval))
    if inside.stop - inside.start < second:
        return
    rest, limit = np.zeros(3), 10.0 * DEG
    if static is not None:
        rest = imu.crop(static.start, static.end).gyro.mean(axis=0)
        limit = 2.0 * _TURN_ON_BIAS
    for piece in in_blocks(imu.pieces(inside), second):
        count = piece.samples // second
        means = piece.gyro[: count * second].reshape(count, second, 3).mean(axis=1)
        turning = np.linalg.norm(means - rest, axis=1) > limit
        if turning.any():
            first = int(np.argmax(turning))
            felt = ", ".join(f"{v / DEG:.4g}" for v in means[first])
            raise LogError(
                imu.path,
                f"the gyros feel ({felt}) deg/s from {show_time(piece.time[first * second])} s on, "
                "and no table log is given, so the IMU is taken as still; "
                "give the table log as well",
            )


def check_still(imu: ImuSource, stretch: Segment, white: Array | None = None) -> tuple[str, ...]:
    """Look for bumps, knocks and slow motion in a stretch that should be still.

    Means over one second (ten samples at least), half of it apart, are compared with the stretch's
    median and with each other, their scatter with the scatter that is typical of the stretch.
    Gyros that read what none reads at rest are told, too; white: (3,) rad/sqrt(s), the rig's
    angle random walks. Returns warnings.

    Raises LogError for clear motion: 1 deg/s or 1 m/s^2 over a second.
    """
    inside = imu.between(stretch.start, stretch.end)
    half = max(5, round(0.5 / imu.interval))
    if (inside.stop - inside.start) // half < 6:
        return ()
    some = next(imu.pieces(inside))  # of hours, the first minutes tell
    rest = tuple(plausible.check_rest_readings(imu.path, some.gyro, imu.interval, white))
    parts = []
    for piece in in_blocks(imu.pieces(inside), half):
        values = np.concatenate([piece.gyro.T, piece.accel.T])  # (6, n)
        halves = values[:, : piece.samples // half * half].reshape(6, -1, half)
        parts.append((halves.sum(axis=2), halves.var(axis=2)))
    sums, squares = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))

    def moment(halves: int) -> float:
        """Return the time (s) after so many halves of a second."""
        sample = inside.start + halves * half
        return float(imu.times(slice(sample, sample + 1))[0])

    mean = (sums[:, 1:] + sums[:, :-1]) / (2 * half)  # (6, count - 1), over a second each
    centre = np.median(mean, axis=1, keepdims=True)
    sigma = np.sqrt(np.median(squares, axis=1, keepdims=True))
    white = sigma / np.sqrt(2 * half)

    away = np.abs(mean - centre)
    clear = np.array([[_CLEAR_MOTION]] * 3 + [[_CLEAR_FORCE]] * 3)
    place = f"the stretch {show_span(stretch.start, stretch.end)} is not still"
    if (away > np.maximum(clear, 8.0 * white)).any():
        found = _mostly_turning(mean[:3], centre[:3], away[:3])
        if found is not None:
            channel, rate, second = found
            begins = stretch.start if second == 0 else moment(second + 1)
            moved = f"from about {show_time(begins)} s on it turns at {_amount(channel, rate)}"
        else:
            channel, second = divmod(int(np.argmax(away / clear)), away.shape[1])
            at = show_time(moment(second))
            moved = f"near {at} s {_amount(channel, away[channel, second])} beyond its mean"
        raise LogError(imu.path, f"{place}: {moved}; name another under [stages]")

    # Neighbours: drift is slow, a knock is not.
    step = np.abs(mean[:, 2:] - mean[:, :-2])
    typical = np.maximum(1.48 * np.median(step, axis=1, keepdims=True), np.sqrt(2.0) * white)
    knock = step / np.maximum(7.0 * typical, _LEAST[:, None])
    rough = np.sqrt(squares) / np.maximum(sigma * (1.0 + 7.0 / np.sqrt(2 * half)), _LEAST[:, None])
    if max(knock.max(), rough.max()) <= 1.0:
        return rest
    worst = knock if knock.max() >= rough.max() else rough
    channel, second = divmod(int(np.argmax(worst)), worst.shape[1])
    size = step[channel, second] if worst is knock else np.sqrt(squares[channel, second])
    when = moment(second + (2 if worst is knock else 0))
    how = _amount(channel, float(size))
    kind = "a change" if worst is knock else "a scatter"
    return (
        *rest,
        f"{imu.path}: {place}: {kind} of {how} near {show_time(when)} s; was it touched? "
        "leave that part out",
    )


def _mostly_turning(mean: Array, centre: Array, away: Array) -> tuple[int, float, int] | None:
    """Say where a stretch that turns for the most part begins to: gyro, rate (rad/s), second.

    mean: (3, n) rad/s of each second, away: its distance from the median, centre (3, 1). None
    where the seconds far from the median are those that turn.
    """
    apart = (away > _CLEAR_MOTION).any(axis=0)
    if not apart.any():
        return None
    rest = np.median(mean[:, apart], axis=1, keepdims=True)
    if np.linalg.norm(centre) < np.linalg.norm(rest) + _CLEAR_MOTION:
        return None
    rate = np.abs(centre - rest)[:, 0]
    turns = (np.abs(mean - rest) > _CLEAR_MOTION).any(axis=0)
    return int(np.argmax(rate)), float(rate.max()), int(np.argmax(turns))


def warn_segment_shortened(
    path: str, named: tuple[float, float] | None, stretch: Segment
) -> tuple[str, ...]:
    """Warn where more than a second was cut off a stretch that the user named (s)."""
    if named is None or max(stretch.start - named[0], named[1] - stretch.end) <= _CUT:
        return ()
    does = "turns at one rate" if stretch.rate else "keeps still"
    used = f"only {show_span(stretch.start, stretch.end)} is used"
    return (f"{path}: of the stretch {show_span(*named)} {used}, where the table {does}",)


def warn_not_covered(
    path: str, wanted: tuple[float, float], used: tuple[float, float]
) -> tuple[str, ...]:
    """Warn where more than a second of a span (s) is left out: the other log does not hold it."""
    if max(used[0] - wanted[0], wanted[1] - used[1]) <= _CUT:
        return ()
    why = "where the table log is; give one that covers all, or check [table] time_offset"
    return (f"{path}: of {show_span(*wanted)} only {show_span(*used)} is used, {why}",)


def _amount(channel: int, value: float) -> str:
    name = _CHANNELS[channel]
    return f"{value / DEG:.3g} deg/s in {name}" if channel < 3 else f"{value:.3g} m/s^2 in {name}"
