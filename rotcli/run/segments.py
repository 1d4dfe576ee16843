"""Stretches of a table's log: still, turning at one rate; its angle between the records.

The angle is linear in time where the table is still or turns evenly; ramps and sweeps are not.
Which of the stretches serve calibration and navigation is told in `run_stages`.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.record import Segment, TableLog, own_clock
from rotcli.units import DEG, show_span

Array = NDArray[np.float64]

_ENOUGH = 1_000_000  # records
_PART = 250_000  # records
OTHERWISE = "under [stages], or by --static, --rotation, --window"  # where stretches are named
_BESIDE = 8  # records beside those asked for: more than an interpolation takes
_NAMED_SHARE = 0.8  # of a named stretch; the rest may be ramps
_RATE_ACCURACY = 1e-5 * DEG  # rad/s; of the table in R16 section 4
_STILL_RATE = 1e-4 * DEG  # rad/s; a fortieth of the Earth's
_STILL = 0.01 * DEG  # rad moved in a whole stretch
_FLOOR = 1e-3 * DEG  # rad: a servo's hunting about its place
_RIPPLE = 1e-3  # s: an even rate may wander by this times the rate, in angle


def angle_at(table: TableLog, time: Array) -> Array:
    """Return the table angle (n,), rad, at times (n,), s.

    Six-point Lagrange interpolation between the logged angles, fewer where the log has fewer;
    straight lines across drop-outs; past the log's ends, by one table interval at most, the
    cubic through the last four.

    Raises LogError when they reach farther.
    """
    t, angle = table.time, table.angle
    low, high = float(time[0]), float(time[-1])
    if low < t[0] - table.interval or high > t[-1] + table.interval:
        what = (
            f"the table log spans {show_span(t[0], t[-1])} but its angle is needed from "
            f"{show_span(low, high)}; a table log that ends early or starts late, or another "
            "clock: check [table] time_offset, or narrow the window"
        )
        raise LogError(table.path, what)
    near = slice(
        max(int(np.searchsorted(t, low)) - _BESIDE, 0), int(np.searchsorted(t, high)) + _BESIDE
    )
    t, angle = t[near], angle[near]
    result = _through(t, angle, time, 6)
    after = np.searchsorted(t, time)
    dropped = np.append(np.append(False, np.diff(t) > 2.5 * table.interval), False)[after]
    if dropped.any():
        result[dropped] = np.interp(time[dropped], t, angle)
    outside = (time < t[0]) | (time > t[-1])
    if outside.any():  # six points would amplify the encoder's resolution ninefold
        result[outside] = _through(t, angle, time[outside], 4)
    return result


def _through(t: Array, angle: Array, time: Array, count: int) -> Array:
    """Interpolate by the polynomial through the `count` logged angles nearest to each time."""
    count = min(count, len(t))
    first = np.clip(np.searchsorted(t, time) - count // 2, 0, len(t) - count)
    # Newton's divided differences, once per record: no digits are lost after many turns.
    divided = [angle]
    for k in range(1, count):
        divided.append(np.diff(divided[-1]) / (t[k:] - t[:-k]))
    result = np.zeros(len(time))
    for k in reversed(range(1, count)):
        result += divided[k][first]
        result *= time - t[first + (k - 1)]
    result += angle[first]
    return result


def _encoder_noise(table: TableLog) -> tuple[float, float]:
    """Return the encoder's angle resolution (rad) and the jitter of its time stamps (s).

    Fourth differences hold the noise and next to nothing of the motion; second differences are
    multiples of the encoder's step.
    """
    angle_resolution = _FLOOR
    if len(table.angle) > 8:
        table = _sample(table)
        second = np.abs(np.diff(table.angle, 2))
        fourth = np.abs(np.diff(table.angle, 4))
        real = second[second > 1e-9]
        step = float(real.min()) if real.size else 0.0
        angle_resolution += 0.5 * step + 4.0 * 1.48 / np.sqrt(70.0) * float(np.median(fourth))
        if step > 1.0 * DEG:  # no second difference but those of kinks
            angle_resolution = _FLOOR
        time_jitter = np.quantile(np.abs(np.diff(table.time, 2)), 0.95)
    else:
        time_jitter = 0.0
    return angle_resolution, time_jitter


def _sample(table: TableLog) -> TableLog:
    """Return the first million records: five hours tell an encoder's noise."""
    return replace(table, time=table.time[:_ENOUGH], angle=table.angle[:_ENOUGH])


def _constant_rate_runs(
    time: Array, angle: Array, angle_resolution: float, time_jitter: float, least: float
) -> Iterator[tuple[int, int, float]]:
    """Yield (first, last, rate) of the runs of at least `least` s in which the angle is straight.

    Rates over two neighbouring windows of up to a second must agree; then a line fitted to the
    run's middle cuts off what bends away at its ends.
    """
    spacing = float(np.median(np.diff(time[:_ENOUGH])))
    w = max(2, round(min(1.0, least / 5.0) / spacing))
    if len(time) < 2 * w + 1:
        return
    width = w * spacing
    even = np.empty(len(time) - 2 * w, dtype=bool)
    for part in _parts(slice(0, len(even))):
        t, a = time[part.start : part.stop + 2 * w], angle[part.start : part.stop + 2 * w]
        rate = (a[w:] - a[:-w]) / (t[w:] - t[:-w])
        allowed = (
            4.5 * angle_resolution + (2.0 * time_jitter + 4.5 * _RIPPLE) * np.abs(rate[:-w])
        ) / width
        even[part] = np.abs(rate[w:] - rate[:-w]) <= allowed
    edges = np.flatnonzero(np.diff(np.concatenate([[False], even, [False]]).astype(np.int8)))
    for a, b in zip(edges[::2], edges[1::2] + 2 * w, strict=True):
        first, last = int(a), int(b) - 1
        for _ in range(8):
            if time[last] - time[first] < least:
                break
            margin = (last - first) // 10
            core = slice(first + margin, last - margin + 1)
            line = _line(time, angle, core)
            slope = line[2]
            # What the middle shows is the table's own wander; much more at the ends is a
            # ramp (a parabola fitted over eight tenths strays 1.84 times as far at its ends).
            wander = max(float(_off(time[p], angle[p], line).max()) for p in _parts(core))
            allowed = (time_jitter + _RIPPLE) * abs(slope)
            allowed += _RATE_ACCURACY * float(time[last] - time[first])
            most = 2.0 * angle_resolution + min(2.5 * wander, allowed)
            run = slice(first, last + 1)
            bent = np.concatenate([_off(time[p], angle[p], line) > most for p in _parts(run)])
            if not bent.any():
                yield first, last, _line(time, angle, run)[2]
                break
            limits = np.flatnonzero(np.concatenate([[True], bent, [True]]))
            longest = int(np.argmax(np.diff(limits)))
            first, last = first + int(limits[longest]), first + int(limits[longest + 1]) - 2


def _line(time: Array, angle: Array, span: slice) -> tuple[float, float, float]:
    """Return the mean time and angle of a span and the slope of the line fitted to them."""
    x0, y0, n = float(time[span.start]), float(angle[span.start]), span.stop - span.start
    mean_x = sum(float((time[p] - x0).sum()) for p in _parts(span)) / n
    mean_y = sum(float((angle[p] - y0).sum()) for p in _parts(span)) / n
    xx = xy = 0.0
    for part in _parts(span):
        x = time[part] - x0 - mean_x
        xx += float(x @ x)
        xy += float(x @ (angle[part] - y0))
    return x0 + mean_x, y0 + mean_y, xy / xx


def _off(time: Array, angle: Array, line: tuple[float, float, float]) -> Array:
    """Return the distance (n,), rad, of angles from a line of `_line`."""
    mean_time, mean_angle, slope = line
    off = angle - mean_angle
    off -= slope * (time - mean_time)
    return np.abs(off, out=off)


def _parts(span: slice) -> Iterator[slice]:
    """Yield the slices that make up a span of records, so that a step needs little memory."""
    for first in range(span.start, span.stop, _PART):
        yield slice(first, min(first + _PART, span.stop))


def max_angle_deviation(
    table: TableLog, start: float, end: float, angle: float, rate: float
) -> float:
    """Return how far (rad) the table strays from `angle` at the start and one rate, to the end."""
    first, last = np.searchsorted(table.time, [start, end])
    far = 0.0
    for part in _parts(slice(int(first), int(last))):
        far = max(far, float(_off(table.time[part], table.angle[part], (start, angle, rate)).max()))
    return far


def find_segments(table: TableLog, *, least: float = 5.0) -> list[Segment]:
    """Return the stretches of at least `least` s in which the table is still or turns evenly.

    In order of time, ramps left out; the rate is that of a straight line through the whole
    stretch. A sweeping table has none.
    """
    angle_resolution, time_jitter = _encoder_noise(table)
    stretches: list[Segment] = []
    t = table.time
    for first, last, rate in _constant_rate_runs(
        t, table.angle, angle_resolution, time_jitter, least
    ):
        # One record of distance to a ramp, so that no IMU sample reaches into it.
        first += 1 if first > 0 else 0
        last -= 1 if last < len(t) - 1 else 0
        start, end = float(t[first]), float(t[last])
        if stretches and start < stretches[-1].end:  # a kink below the encoder's resolution
            before = stretches[-1]
            middle = 0.5 * (start + before.end)
            stretches[-1] = _stretch(before.start, middle, before.rate, angle_resolution)
            start = middle
        stretches.append(_stretch(start, end, rate, angle_resolution))
    return stretches


def _stretch(start: float, end: float, rate: float, angle_resolution: float) -> Segment:
    angle = rate * (end - start)
    if abs(angle) <= max(_STILL, 2.0 * angle_resolution) or abs(rate) <= _STILL_RATE:
        return Segment(start, end)
    return Segment(start, end, rate, angle)


def segment_between(table: TableLog, start: float, end: float) -> Segment:
    """Return the stretch named by its limits (s), ramps at its ends cut off.

    Raises LogError when it lies outside the log or the table neither keeps still nor turns at
    one rate in it.
    """
    t = table.time
    check_inside(table.path, "the table log", (start, end), (float(t[0]), float(t[-1])))
    inside = slice(int(np.searchsorted(t, start - 1e-9)), int(np.searchsorted(t, end + 1e-9)))
    time, angle = t[inside], table.angle[inside]
    if len(time) < 10:
        what = f"only {len(time)} records from {show_span(start, end)}; name a longer stretch, "
        what += "or the unit of its stamps"
        raise LogError(table.path, what)
    angle_resolution, time_jitter = _encoder_noise(table)
    least = _NAMED_SHARE * float(time[-1] - time[0])
    runs = list(_constant_rate_runs(time, angle, angle_resolution, time_jitter, least))
    if not runs:
        step = max(1, len(time) // 20)
        rates = (angle[step:] - angle[:-step]) / (time[step:] - time[:-step]) / DEG
        what = (
            f"the table neither keeps still nor turns at one rate from {show_span(start, end)}: "
            f"it moves through {np.ptp(angle) / DEG:.6g} deg at {rates.min():.6g} to "
            f"{rates.max():.6g} deg/s; name another {OTHERWISE}"
        )
        raise LogError(table.path, what)
    first, last, rate = max(runs, key=lambda run: run[1] - run[0])
    begins = start if first == 0 else float(time[first + 1])
    ends = end if last == len(time) - 1 else float(time[last - 1])
    return _stretch(begins, ends, rate, angle_resolution)


def check_inside(
    path: str, what: str, wanted: tuple[float, float], there: tuple[float, float]
) -> None:
    """Raise LogError where a stretch that was named (s) lies outside what is there (s)."""
    slack = 0.1  # s: a log may end a few samples before the round number
    if wanted[0] < there[0] - slack or wanted[1] > there[1] + slack:
        raise LogError(
            path,
            f"the stretch {show_span(*wanted)} lies outside {what}, which spans "
            f"{show_span(*there)}{own_clock(wanted, there)}; name another {OTHERWISE}",
        )
