"""Segments of a table log: time intervals in which the table is still or turns at constant rate.

The angle of such a segment is linear in time; ramps and oscillations are not part of one. Which
segments a command uses is decided in `rotcli.run.stages`.
"""

import math
from collections.abc import Iterator

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import Segment, TableLog, epoch_clock_hint
from rotcli.run.evidence.leaps import SMALL_LEAP, describe_leaps, find_leaps
from rotcli.run.findings import CheckError
from rotcli.run.motion import crop_table, encoder_noise, is_still, record_chunks
from rotcli.units import DEG, FloatArray, format_span

MIN_SEGMENT = 5.0  # s: white noise of 0.4 deg/sqrt(h) then has a mean of 10 deg/h
_MIN_NAMED_SHARE = 0.8  # of a named segment must have one rate; the rest may be ramps
_RATE_TOLERANCE = 1e-5 * DEG  # rad/s: rate accuracy of the table in R16 section 4
# s: a constant rate may ripple by this times the rate, in angle; R16's table has 0.2 ms
_RIPPLE = 1e-3
_MAX_RATE_WINDOW = 1.0  # s: two neighbouring windows up to this long are compared
_MIN_RECORDS = 10  # records of a named segment: a line through fewer shows no ramp
_SPACING_RECORDS = 1_000_000  # records whose median spacing is used
_MAX_TRIMS = 8  # times that the ends of a run are trimmed
# times the deviation of a run's middle: a parabola fitted to the middle eight tenths deviates
# 1.84 times as far at the ends
_END_FACTOR = 2.5
# rad: an encoder mounted eccentrically by more is refused; its rate ripples by 0.2 %
MAX_ECCENTRICITY = 0.1 * DEG
_MIN_ECCENTRIC_RECORDS = 50  # records: fewer show no sine
_MIN_ECCENTRIC_TURNS = 1.5  # turns that separate a sine of the angle from a ramp
_ECCENTRICITY_RECORDS = 20_000  # records that a sine is fitted to
# times the resolution: difference of four readings of two windows at 2.25 sigma each
_WINDOW_FACTOR = 4.5


def _constant_rate_runs(
    time: FloatArray, angle: FloatArray, resolution: float, time_jitter: float, min_duration: float
) -> Iterator[tuple[int, int, float]]:
    """Yield (first, last, rate) of the runs of min_duration (s) or more with a straight angle.

    Rates over two neighbouring windows of up to a second must agree; then a line fitted to the
    middle of the run trims the ends that deviate from it.
    """
    spacing = float(np.median(np.diff(time[:_SPACING_RECORDS])))
    w = max(2, round(min(_MAX_RATE_WINDOW, min_duration / 5.0) / spacing))
    if len(time) < 2 * w + 1:
        return
    width = w * spacing
    straight = np.empty(len(time) - 2 * w, dtype=bool)
    for part in record_chunks(slice(0, len(straight))):
        t, a = time[part.start : part.stop + 2 * w], angle[part.start : part.stop + 2 * w]
        rate = (a[w:] - a[:-w]) / (t[w:] - t[:-w])
        moved = (2.0 * time_jitter + _WINDOW_FACTOR * _RIPPLE) * np.abs(rate[:-w])
        allowed = (_WINDOW_FACTOR * resolution + moved) / width
        straight[part] = np.abs(rate[w:] - rate[:-w]) <= allowed
    edges = np.flatnonzero(np.diff(np.concatenate([[False], straight, [False]]).astype(np.int8)))
    for a, b in zip(edges[::2], edges[1::2] + 2 * w, strict=True):
        run = _trim(time, angle, int(a), int(b) - 1, (resolution, time_jitter, min_duration))
        if run is not None:
            yield run


def _trim(
    time: FloatArray, angle: FloatArray, first: int, last: int, limits: tuple[float, float, float]
) -> tuple[int, int, float] | None:
    """Trim the ends of a run that deviate from its middle; None where too little remains.

    limits: angle resolution (rad), time jitter (s), minimal duration (s).
    """
    resolution, time_jitter, min_duration = limits
    for _ in range(_MAX_TRIMS):
        if time[last] - time[first] < min_duration:
            return None
        margin = (last - first) // 10
        core = slice(first + margin, last - margin + 1)
        line = _fit_line(time, angle, core)
        eccentricity = encoder_eccentricity(time[core], angle[core], line)
        if eccentricity is not None:
            angle = angle.copy()
            angle[first : last + 1] -= eccentricity.at(angle[first : last + 1])
            line = _fit_line(time, angle, core)
        middle = max(float(_distance(time[p], angle[p], line).max()) for p in record_chunks(core))
        allowed = (time_jitter + _RIPPLE) * abs(line[2])
        allowed += _RATE_TOLERANCE * float(time[last] - time[first])
        limit = 2.0 * resolution + min(_END_FACTOR * middle, allowed)
        run = slice(first, last + 1)
        bent = np.concatenate(
            [_distance(time[p], angle[p], line) > limit for p in record_chunks(run)]
        )
        if not bent.any():
            return first, last, _fit_line(time, angle, run)[2]
        ends = np.flatnonzero(np.concatenate([[True], bent, [True]]))
        longest = int(np.argmax(np.diff(ends)))
        first, last = first + int(ends[longest]), first + int(ends[longest + 1]) - 2
    return None


@dataclass(frozen=True)
class Eccentricity:
    """Error of an encoder once per turn: `cosine cos(angle) + sine sin(angle)`, rad."""

    cosine: float
    sine: float

    @property
    def amplitude(self) -> float:
        """Amplitude, rad."""
        return math.hypot(self.cosine, self.sine)

    def at(self, angle: FloatArray) -> FloatArray:
        """Return the error (n,), rad, at angles (n,), rad."""
        return np.asarray(self.cosine * np.cos(angle) + self.sine * np.sin(angle))


def encoder_eccentricity(
    time: FloatArray, angle: FloatArray, line: tuple[float, float, float]
) -> Eccentricity | None:
    """Return the eccentricity of an encoder that turns at constant rate, if there is one.

    line: of `_fit_line`. None for less than two turns, and where a sine does not explain most of
    the deviation from the line, or is too large for an encoder.
    """
    found = _fit_eccentricity(time, angle, line)
    return None if found is None or found.amplitude > MAX_ECCENTRICITY else found


def _fit_eccentricity(
    time: FloatArray, angle: FloatArray, line: tuple[float, float, float]
) -> Eccentricity | None:
    """Return the eccentricity of any size; None as `encoder_eccentricity`."""
    if abs(angle[-1] - angle[0]) < _MIN_ECCENTRIC_TURNS * 2.0 * np.pi:
        return None
    step = max(1, len(time) // _ECCENTRICITY_RECORDS)
    t, a = time[::step], angle[::step]
    rest = a - line[1] - line[2] * (t - line[0])
    design = np.column_stack([np.cos(a), np.sin(a), np.ones_like(t), t - line[0]])
    solution, *_ = np.linalg.lstsq(design, rest, rcond=None)
    found = Eccentricity(float(solution[0]), float(solution[1]))
    left = float(np.std(rest - design @ solution))
    return None if left > 0.5 * float(np.std(rest)) else found


def segment_eccentricity(table: TableLog, segment: Segment) -> Eccentricity | None:
    """Return the eccentricity of the encoder in a segment at constant rate, if there is one."""
    part = crop_table(table, segment.start, segment.end)
    if len(part.time) < _MIN_ECCENTRIC_RECORDS:
        return None
    line = float(part.time.mean()), float(part.angle.mean()), segment.rate
    return encoder_eccentricity(part.time, part.angle, line)


def _fit_line(time: FloatArray, angle: FloatArray, span: slice) -> tuple[float, float, float]:
    """Return the mean time and angle of a span and the slope of the line fitted to them."""
    x0, y0, n = float(time[span.start]), float(angle[span.start]), span.stop - span.start
    mean_x = sum(float((time[p] - x0).sum()) for p in record_chunks(span)) / n
    mean_y = sum(float((angle[p] - y0).sum()) for p in record_chunks(span)) / n
    xx = xy = 0.0
    for part in record_chunks(span):
        x = time[part] - x0 - mean_x
        xx += float(x @ x)
        xy += float(x @ (angle[part] - y0))
    return x0 + mean_x, y0 + mean_y, xy / xx


def _distance(time: FloatArray, angle: FloatArray, line: tuple[float, float, float]) -> FloatArray:
    """Return the distance (n,), rad, of angles from a line of `_fit_line`."""
    mean_time, mean_angle, slope = line
    distance = angle - mean_angle
    distance -= slope * (time - mean_time)
    return np.abs(distance, out=distance)


def find_segments(table: TableLog, *, min_duration: float = MIN_SEGMENT) -> list[Segment]:
    """Return the segments of min_duration (s) or more in which the table is still or turning.

    In order of time, without ramps; the rate is that of a straight line through the segment. An
    oscillating table has none.
    """
    noise = encoder_noise(table)
    found: list[Segment] = []
    t = table.time
    runs = _constant_rate_runs(t, table.angle, noise.resolution, noise.time_jitter, min_duration)
    for first, last, rate in runs:
        # One record of distance to a ramp, so that no IMU sample reaches into it.
        first += 1 if first > 0 else 0
        last -= 1 if last < len(t) - 1 else 0
        start, end = float(t[first]), float(t[last])
        if found and start < found[-1].end:  # a kink below the encoder's resolution
            before = found[-1]
            middle = 0.5 * (start + before.end)
            found[-1] = make_segment(before.start, middle, before.rate, noise.resolution)
            start = middle
        found.append(make_segment(start, end, rate, noise.resolution))
    return found


def make_segment(start: float, end: float, rate: float, resolution: float) -> Segment:
    """Return the segment [start, end] (s) of a fitted rate (rad/s), still by the one rule."""
    angle = rate * (end - start)
    if is_still(angle, end - start, resolution):
        return Segment(start, end)
    return Segment(start, end, rate, angle)


def segment_between(table: TableLog, start: float, end: float) -> Segment:
    """Return the segment with the given limits (s), ramps at its ends trimmed.

    Raises CheckError if it lies outside the log or the table is neither still nor turning at
    constant rate in it.
    """
    t = table.time
    check_inside(table.path, "the table log", (start, end), (float(t[0]), float(t[-1])))
    inside = slice(int(np.searchsorted(t, start - 1e-9)), int(np.searchsorted(t, end + 1e-9)))
    time, angle = t[inside], table.angle[inside]
    span = format_span(start, end)
    if len(time) < _MIN_RECORDS:
        message = f"segment {span}: only {len(time)} records; use a longer segment, or set the "
        raise CheckError(table.path, "segment-records", message + "unit of the time stamps")
    noise = encoder_noise(table)
    min_duration = _MIN_NAMED_SHARE * float(time[-1] - time[0])
    runs = list(_constant_rate_runs(time, angle, noise.resolution, noise.time_jitter, min_duration))
    if not runs:
        step = max(1, len(time) // 20)
        rates = (angle[step:] - angle[:-step]) / (time[step:] - time[:-step]) / DEG
        cause = _cause_of_unsteadiness(time, angle, noise.resolution)
        raise CheckError(
            table.path,
            "segment-rate",
            f"segment {span}: the table is neither still nor turning at constant rate: it moves "
            f"through {np.ptp(angle) / DEG:.6g} deg at {rates.min():.6g} to {rates.max():.6g} "
            f"deg/s{cause}; choose another one under [stages]",
        )
    first, last, rate = max(runs, key=lambda run: run[1] - run[0])
    begins = start if first == 0 else float(time[first + 1])
    ends = end if last == len(time) - 1 else float(time[last - 1])
    return make_segment(begins, ends, rate, noise.resolution)


def _cause_of_unsteadiness(time: FloatArray, angle: FloatArray, resolution: float) -> str:
    """Return in words what makes a table angle unsteady: leaps, or an eccentric encoder."""
    leaps = find_leaps(time, angle, resolution, SMALL_LEAP)
    if leaps:
        return f" ({describe_leaps(leaps)})"
    line = _fit_line(time, angle, slice(0, len(time)))
    found = _fit_eccentricity(time, angle, line)
    if found is None:
        return ""
    return (
        f" (the encoder has an error of {found.amplitude / DEG:.3g} deg once per turn: it is "
        "eccentric)"
    )


def check_inside(
    path: str, log: str, requested: tuple[float, float], present: tuple[float, float]
) -> None:
    """Raise CheckError if a requested segment (s) lies outside the log (s)."""
    slack = 0.1  # s: a log may end a few samples before the round number
    if requested[0] < present[0] - slack or requested[1] > present[1] + slack:
        raise CheckError(
            path,
            "segment-outside",
            f"segment {format_span(*requested)} is outside {log} ({format_span(*present)})"
            f"{epoch_clock_hint(requested, present)}; choose another one under [stages]",
        )
