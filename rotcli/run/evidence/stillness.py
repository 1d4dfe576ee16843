"""Check that the IMU does not move in segments that are to be still, and that they are complete."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs import plausible
from rotcli.logs.record import ImuSource, Segment, align_chunks
from rotcli.run.evidence.direction import TURN_ON_BIAS
from rotcli.run.findings import Finding
from rotcli.units import DEG, FloatArray, format_span, show_time

_CLEAR_RATE = 1.0 * DEG  # rad/s over a second from the median: in-run biases change by 0.1 deg/s
_CLEAR_FORCE = 1.0  # m/s^2 over a second from the median: a tilt by 6 deg
_MAX_TRIM = 1.0  # s trimmed from a named segment; less is a ramp
# rad/s, m/s^2: a smaller disturbance moves the mean of a minute by less than its white noise
_MIN_DISTURBANCE = np.array(3 * [0.02 * DEG] + 3 * [0.01])
_CLEAR_SIGMAS = 8.0  # of white noise: with 1e6 seconds never by chance
_JUMP_FACTOR = 7.0  # times the typical difference of neighbouring seconds: 1e-11 in normal noise
_VIBRATION_SIGMAS = 7.0  # of the scatter's own sampling error
_UNTABLED_RATE = 10.0 * DEG  # rad/s: no turn-on bias is as large
_NORMAL_MEDIAN = 1.48  # sigma over the median of the absolute value of normal noise
_CHANNELS = [f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"]


def check_still_without_table(
    imu: ImuSource, start: float, end: float, still: Segment | None
) -> tuple[Finding, ...]:
    """Return a finding where an IMU without a table log clearly turns between start and end (s).

    Over seconds a still MEMS gyro keeps its reading of the still segment within far less than a
    degree per second; without one, no turn-on bias is as large as 10 deg/s.
    """
    inside = imu.between(start, end)
    second = max(1, round(1.0 / imu.interval))
    if inside.stop - inside.start < second:
        return ()
    bias, limit = np.zeros(3), _UNTABLED_RATE
    if still is not None:
        bias = imu.crop(still.start, still.end).gyro.mean(axis=0)
        limit = 2.0 * TURN_ON_BIAS
    for chunk in align_chunks(imu.chunks(inside), second):
        count = chunk.samples // second
        means = chunk.gyro[: count * second].reshape(count, second, 3).mean(axis=1)
        turning = np.linalg.norm(means - bias, axis=1) > limit
        if turning.any():
            first = int(np.argmax(turning))
            measured = ", ".join(f"{v / DEG:.4g}" for v in means[first])
            when = show_time(chunk.time[first * second])
            text = (
                f"{imu.path}: the gyros read ({measured}) deg/s from {when} s on, but there is no "
                "table log; add it"
            )
            value = float(np.linalg.norm(means[first] - bias)) / DEG
            return (
                Finding("turning-without-table", text, "warning", "", value, limit / DEG, "deg/s"),
            )
    return ()


@dataclass(frozen=True, eq=False)
class _Halves:
    """Sums (6, k) and variances (6, k) of the channels over blocks of half a second."""

    sums: FloatArray
    variances: FloatArray
    samples: int
    first: int


def _half_seconds(imu: ImuSource, inside: slice) -> _Halves:
    half = max(5, round(0.5 / imu.interval))
    parts = []
    for chunk in align_chunks(imu.chunks(inside), half):
        values = np.concatenate([chunk.gyro.T, chunk.accel.T])  # (6, n)
        blocks = values[:, : chunk.samples // half * half].reshape(6, -1, half)
        total = blocks.sum(axis=2)
        rest = blocks - total[:, :, None] / half
        parts.append((total, np.einsum("ikj,ikj->ik", rest, rest) / half))
    sums, variances = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    return _Halves(sums, variances, half, inside.start)


def check_still(
    imu: ImuSource, segment: Segment, white: FloatArray | None = None
) -> tuple[Finding, ...]:
    """Look for motion and disturbances in a segment that is to be still.

    Means over one second (ten samples at least), half of it apart, are compared with the median of
    the segment and with each other, their scatter with the typical scatter of the segment.
    Implausible readings at rest are reported too; white: (3,) rad/sqrt(s), the rig's angle random
    walks. Codes: `segment-moving` (1 deg/s or 1 m/s^2 over a second), `segment-disturbed`,
    `rest-readings`.
    """
    inside = imu.between(segment.start, segment.end)
    half = max(5, round(0.5 / imu.interval))
    if (inside.stop - inside.start) // half < 6:
        return ()
    first = next(imu.chunks(inside))  # of hours, the first minutes are enough
    where = format_span(segment.start, segment.end)
    rest = tuple(
        Finding("rest-readings", text, where=where)
        for text in plausible.check_rest_readings(imu.path, first.gyro, imu.interval, white)
    )
    halves = _half_seconds(imu, inside)
    moving = _motion(imu, segment, halves)
    if moving:
        return (moving,)
    disturbed = _disturbance(imu, where, halves)
    return (*rest, disturbed) if disturbed else rest


def _time_of(imu: ImuSource, halves: _Halves, count: int) -> float:
    """Return the time (s) after so many halves of a second."""
    sample = halves.first + count * halves.samples
    return float(imu.times(slice(sample, sample + 1))[0])


def _second_means(halves: _Halves) -> tuple[FloatArray, FloatArray]:
    """Return the means (6, k) over seconds, half of one apart, and their white noise (6, 1)."""
    mean = (halves.sums[:, 1:] + halves.sums[:, :-1]) / (2 * halves.samples)
    sigma = np.sqrt(np.median(halves.variances, axis=1, keepdims=True))
    return mean, sigma / np.sqrt(2 * halves.samples)


def _motion(imu: ImuSource, segment: Segment, halves: _Halves) -> Finding | None:
    """Return the finding of clear motion: a second far from the median of the segment."""
    mean, white = _second_means(halves)
    centre = np.median(mean, axis=1, keepdims=True)
    deviation = np.abs(mean - centre)
    clear = np.array([[_CLEAR_RATE]] * 3 + [[_CLEAR_FORCE]] * 3)
    if not (deviation > np.maximum(clear, _CLEAR_SIGMAS * white)).any():
        return None
    where = format_span(segment.start, segment.end)
    turning = _mostly_turning(mean[:3], centre[:3], deviation[:3])
    if turning is not None:
        channel, size, second = turning
        begins = segment.start if second == 0 else _time_of(imu, halves, second + 1)
        moved = f"from about {show_time(begins)} s on it turns at {_amount(channel, size)}"
    else:
        channel, second = divmod(int(np.argmax(deviation / clear)), deviation.shape[1])
        size = float(deviation[channel, second])
        when = show_time(_time_of(imu, halves, second))
        moved = f"{_CHANNELS[channel]} deviates by {_quantity(channel, size)} near {when} s"
    text = f"{imu.path}: segment {where} is not still: {moved}; choose another one under [stages]"
    return _finding("segment-moving", text, where, channel, size, float(clear[channel, 0]))


def _disturbance(imu: ImuSource, where: str, halves: _Halves) -> Finding | None:
    """Return the finding of the largest jump or vibration, if any; drift is slow, a jump is not."""
    mean, white = _second_means(halves)
    step = np.abs(mean[:, 2:] - mean[:, :-2])
    typical = np.median(step, axis=1, keepdims=True)
    typical = np.maximum(_NORMAL_MEDIAN * typical, np.sqrt(2.0) * white)
    jump_limit = np.maximum(_JUMP_FACTOR * typical, _MIN_DISTURBANCE[:, None])
    count = 2 * halves.samples
    sigma = white * np.sqrt(count)
    sampling = 1.0 + _VIBRATION_SIGMAS / np.sqrt(count)
    scatter = np.sqrt(halves.variances)
    # The scatter of filtered readings, whose noise is not white, varies more from part to part.
    centre = np.median(scatter, axis=1, keepdims=True)
    spread = _NORMAL_MEDIAN * np.median(np.abs(scatter - centre), axis=1, keepdims=True)
    vibration_limit = np.maximum(sigma * sampling, centre + _VIBRATION_SIGMAS * spread)
    vibration_limit = np.maximum(vibration_limit, _MIN_DISTURBANCE[:, None])
    jump, vibration = step / jump_limit, scatter / vibration_limit
    if max(jump.max(), vibration.max()) <= 1.0:
        return None
    jumps = jump.max() >= vibration.max()
    worst = jump if jumps else vibration
    channel, second = divmod(int(np.argmax(worst)), worst.shape[1])
    size = float((step if jumps else scatter)[channel, second])
    limit = float((jump_limit if jumps else vibration_limit)[channel, 0])
    when = show_time(_time_of(imu, halves, second + (2 if jumps else 0)))
    change = "changes by" if jumps else "vibrates by"
    text = (
        f"{imu.path}: segment {where} was disturbed near {when} s ({_CHANNELS[channel]} {change} "
        f"{_quantity(channel, size)}); exclude this part"
    )
    return _finding("segment-disturbed", text, where, channel, size, limit)


def _finding(code: str, text: str, where: str, channel: int, value: float, limit: float) -> Finding:
    unit, factor = ("deg/s", DEG) if channel < 3 else ("m/s^2", 1.0)
    place = f"{_CHANNELS[channel]}, {where}"
    return Finding(code, text, "warning", place, value / factor, limit / factor, unit)


def _mostly_turning(
    mean: FloatArray, centre: FloatArray, deviation: FloatArray
) -> tuple[int, float, int] | None:
    """Return gyro, rate (rad/s) and first second of a segment that turns for the most part.

    mean: (3, n) rad/s of each second, deviation: from the median, centre (3, 1). None where the
    seconds far from the median are the ones that turn.
    """
    far = (deviation > _CLEAR_RATE).any(axis=0)
    if not far.any():
        return None
    rest = np.median(mean[:, far], axis=1, keepdims=True)
    if np.linalg.norm(centre) < np.linalg.norm(rest) + _CLEAR_RATE:
        return None
    rate = np.abs(centre - rest)[:, 0]
    turns = (np.abs(mean - rest) > _CLEAR_RATE).any(axis=0)
    return int(np.argmax(rate)), float(rate.max()), int(np.argmax(turns))


def warn_segment_shortened(
    path: str, named: tuple[float, float] | None, segment: Segment
) -> tuple[Finding, ...]:
    """Return a finding where more than a second was trimmed from a named segment (s)."""
    if named is None:
        return ()
    trimmed = max(segment.start - named[0], named[1] - segment.end)
    if trimmed <= _MAX_TRIM:
        return ()
    motion = "turns at constant rate" if segment.rate else "is still"
    used = format_span(segment.start, segment.end)
    text = (
        f"{path}: only {used} of the segment {format_span(*named)} is used; "
        f"there the table {motion}"
    )
    return (Finding("segment-shortened", text, "warning", used, trimmed, _MAX_TRIM, "s"),)


def warn_not_covered(
    path: str, requested: tuple[float, float], used: tuple[float, float]
) -> tuple[Finding, ...]:
    """Return a finding where the table log lacks more than a second of a requested span (s)."""
    missing = max(used[0] - requested[0], requested[1] - used[1])
    if missing <= _MAX_TRIM:
        return ()
    text = (
        f"{path}: only {format_span(*used)} of {format_span(*requested)} is used because the "
        "table log covers no more; check [table] time_offset"
    )
    return (Finding("table-coverage", text, "warning", "", missing, _MAX_TRIM, "s"),)


def _quantity(channel: int, value: float) -> str:
    return f"{value / DEG:.3g} deg/s" if channel < 3 else f"{value:.3g} m/s^2"


def _amount(channel: int, value: float) -> str:
    return f"{_quantity(channel, value)} in {_CHANNELS[channel]}"
