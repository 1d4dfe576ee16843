"""What the IMU itself says of a stretch: whether it is still, or turns with the table."""

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.record import ImuSource, Stretch, TableLog, in_blocks
from rotcli.units import DEG

Array = NDArray[np.float64]

_TURN_ON_BIAS = 1.5 * DEG  # rad/s; the datasheet's 3600 deg/h of the coarser IMU and a half more
_CLEAR_MOTION = 1.0 * DEG  # rad/s, over a second, beyond the mean
_CUT = 1.0  # s; less is a ramp
_CLEAR_FORCE = 1.0  # m/s^2, over a second: a tilt by 6 deg
_WRONG_AXES, _WRONG_TILT = 30.0, 3.0  # deg between felt and expected gravity
_LEAST = np.array(3 * [0.02 * DEG] + 3 * [0.01])  # rad/s, m/s^2: less is nobody's knock
_ENOUGH = 3600.0  # s of a stretch that tell its axis, direction and lag
_CHANNELS = [f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"]


def check_direction(imu: ImuSource, table: TableLog, axis: Array, stretch: Stretch) -> None:
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
    imu: ImuSource, f_b: Array, expected: Array, *, strict: bool = True
) -> tuple[str, ...]:
    """Compare the mean specific force of a still base, f_b (3,), m/s^2, with what it should be.

    Returns warnings where it is clearly off; raises LogError, if strict, where units, increments
    or axes must be mistaken.
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
    elif tilt > _WRONG_TILT:
        warnings.append(f"{placed}: correct [attitude]")
    if faults and strict:
        raise LogError(imu.path, faults[0])
    return tuple(f"{imu.path}: {text}" for text in (*faults, *warnings))


def check_untabled(imu: ImuSource, start: float, end: float, static: Stretch | None) -> None:
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
                f"the gyros feel ({felt}) deg/s from {piece.time[first * second]:.10g} s on, and "
                "no table log is given, so the IMU is taken as still; give the table log as well",
            )


def check_lag(imu: ImuSource, table: TableLog, axis: Array) -> tuple[str, ...]:
    """Look whether the gyros feel a change of the table's rate when the encoder shows it.

    Over tenths of a second the mean rate along the axis (3,) is fitted by the encoder's rate, its
    change and a constant; the share of the change is the lag. Only ramps and sweeps tell it.
    Returns a warning where the lag is above a third of a sample and four of its sigma: means
    read as instants lag by half a sample, other clocks by anything. Of a long log the hour about
    the greatest change is looked at.
    """
    start = float(max(imu.time[0], table.time[0])) + _LAG_BLOCK
    end = float(min(imu.time[-1], table.time[-1])) - _LAG_BLOCK
    block = max(2, round(_LAG_BLOCK / imu.interval))
    if end - start > _ENOUGH:
        start, end = _liveliest(table, start, end, block * imu.interval)
    inside = imu.within(start, end)
    count = (inside.stop - inside.start) // block
    if count < 10:
        return ()
    first = float(imu.times(slice(inside.start, inside.start + 1))[0])
    held = imu.crop(first, first + imu.interval * (count * block - 1))
    felt = (held.gyro @ axis).reshape(count, block).mean(axis=1)
    # The span that the samples of a block speak of: half a sample to either side of an instant.
    lead = 1.0 if imu.sampling == "average" else 0.5
    edges = first + imu.interval * (block * np.arange(count + 1.0) - lead)
    rate = np.diff(np.interp(edges, table.time, table.angle)) / (block * imu.interval)
    change = np.gradient(rate, block * imu.interval)
    steady = np.abs(change) < 0.02 * np.max(np.abs(change))
    if np.max(np.abs(rate)) < _LAG_RATE or steady.all():
        return ()
    # Where nothing changes only scale and bias are told: some of it is enough.
    told = ~steady | (np.cumsum(steady) % max(1, int(steady.sum()) // 500) == 0)
    design = np.column_stack([change, rate, np.ones(count)])[told]
    solution, *_ = np.linalg.lstsq(design, felt[told], rcond=None)
    left = felt[told] - design @ solution
    inverse = np.linalg.inv(design.T @ design)
    sigma = float(np.sqrt(inverse[0, 0] * left @ left / max(1, len(left) - 3)))
    lag = -float(solution[0] / solution[1])
    if abs(lag) < max(imu.interval / 3.0, 4.0 * sigma):
        return ()
    return (
        f"{imu.path}: the gyros follow the table by {lag * 1e3:.2f} ms (sigma "
        f"{sigma * 1e3:.2f} ms, a sample is {imu.interval * 1e3:g} ms): check [imu] sampling "
        "(means read as instants lag by half a sample) and [table] time_offset",
    )


def _liveliest(table: TableLog, start: float, end: float, block: float) -> tuple[float, float]:
    """Return the hour (s) between start and end about the greatest change of the table's rate."""
    greatest, at = -1.0, start
    for first in np.arange(start, end, _ENOUGH):
        edges = np.arange(first, min(first + _ENOUGH + 2.0 * block, end), block)
        if len(edges) > 2:
            near = slice(*np.searchsorted(table.time, [edges[0] - 1.0, edges[-1] + 1.0]))
            change = np.abs(np.diff(np.interp(edges, table.time[near], table.angle[near]), 2))
            if change.max() > greatest:
                greatest, at = float(change.max()), float(edges[int(np.argmax(change))])
    start = min(max(start, at - 0.5 * _ENOUGH), end - _ENOUGH)
    return start, start + _ENOUGH


def check_still(imu: ImuSource, stretch: Stretch) -> tuple[str, ...]:
    """Look for bumps, knocks and slow motion in a stretch that should be still.

    Means over one second (ten samples at least), half of it apart, are compared with the stretch's
    median and with each other, their scatter with the scatter that is typical of the stretch.
    Returns warnings.

    Raises LogError for clear motion: 1 deg/s or 1 m/s^2 over a second.
    """
    inside = imu.between(stretch.start, stretch.end)
    half = max(5, round(0.5 / imu.interval))
    if (inside.stop - inside.start) // half < 6:
        return ()
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
        channel, second = np.unravel_index(int(np.argmax(away / clear)), away.shape)
        moved = _amount(int(channel), float(away[channel, second]))
        when = moment(int(second))
        what = f"{place}: near {when:.6g} s {moved} beyond its mean; name another under [stages]"
        raise LogError(imu.path, what)

    # Neighbours: drift is slow, a knock is not.
    step = np.abs(mean[:, 2:] - mean[:, :-2])
    typical = np.maximum(1.48 * np.median(step, axis=1, keepdims=True), np.sqrt(2.0) * white)
    knock = step / np.maximum(7.0 * typical, _LEAST[:, None])
    rough = np.sqrt(squares) / np.maximum(sigma * (1.0 + 7.0 / np.sqrt(2 * half)), _LEAST[:, None])
    if max(knock.max(), rough.max()) <= 1.0:
        return ()
    worst = knock if knock.max() >= rough.max() else rough
    channel, second = divmod(int(np.argmax(worst)), worst.shape[1])
    size = step[channel, second] if worst is knock else np.sqrt(squares[channel, second])
    when = moment(int(second) + (2 if worst is knock else 0))
    how = _amount(int(channel), float(size))
    kind = "a change" if worst is knock else "a scatter"
    return (f"{imu.path}: {place}: {kind} of {how} near {show_time(when)} s; was it touched?",)


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


def check_cut(path: str, named: tuple[float, float] | None, stretch: Stretch) -> tuple[str, ...]:
    """Warn where more than a second was cut off a stretch that the user named (s)."""
    if named is None or max(stretch.start - named[0], named[1] - stretch.end) <= _CUT:
        return ()
    does = "turns at one rate" if stretch.rate else "keeps still"
    used = f"only {show_span(stretch.start, stretch.end)} is used"
    return (f"{path}: of the stretch {show_span(*named)} {used}, where the table {does}",)


def _amount(channel: int, value: float) -> str:
    name = _CHANNELS[channel]
    return f"{value / DEG:.3g} deg/s in {name}" if channel < 3 else f"{value:.3g} m/s^2 in {name}"
