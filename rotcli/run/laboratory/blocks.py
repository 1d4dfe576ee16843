"""Reduce a recording to blocks: means of the readings over segments of one rate.

The true rate (table rate and Earth rate) is removed from the gyros, gravity from the
accelerometers of still blocks. Logs of any length are read chunk by chunk.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.logs.record import ImuLog, ImuSource, Progress, Segment, TableLog
from rotcli.logs.temperature import TemperatureLog
from rotcli.models import rotation
from rotcli.models.base import FixedBase
from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.mean_covariance import MAX_INTERVALS
from rotcli.models.sensors import NoiseFigures
from rotcli.rig.rig import ImuSettings, Rig
from rotcli.run.segments import find_segments, segment_between
from rotcli.run.table_angle import angle_at
from rotcli.units import FloatArray, format_span

MAX_BLOCKS = 1000  # that segments are divided into: a covariance of 8 MB per channel
MIN_SEGMENT = 5.0  # s; less is a ramp or a pause
_MIN_SAMPLES = 5  # of a block
TEMPERATURE_BLOCK = 60.0  # s: at 1 degC/min a block spans 1 degC


@dataclass(frozen=True, eq=False)
class Reduced:
    """Blocks of the gyros, and of the accelerometers in still blocks (None without attitude)."""

    gyro: Blocks
    accel: Blocks | None


def rate_segments(imu: ImuSource, table: TableLog | None, rig: Rig) -> list[Segment]:
    """Return the segments of constant rate in time order: those of the rig, else all found.

    Without a table log [stages] static is still, by default the complete log. Raises LogError
    where there is none.
    """
    span = float(imu.time[0]), float(imu.time[-1])
    if table is None:
        start, end = rig.stages.static or span
        if start < span[0] - imu.interval or end > span[1] + imu.interval:
            what = f"the segment {format_span(start, end)} is outside the log, {format_span(*span)}"
            raise LogError(imu.path, f"{what}; correct [stages] static")
        return [Segment(max(start, span[0]), min(end, span[1]))]
    named = [pair for pair in (rig.stages.static,) if pair is not None] + list(rig.stages.rotation)
    if rig.stages.rotation:
        found = [segment_between(table, *pair) for pair in named]
    else:
        found = find_segments(table, min_duration=MIN_SEGMENT)
    low, high = max(span[0], float(table.time[0])), min(span[1], float(table.time[-1]))
    clipped = []
    for s in sorted(found, key=lambda s: s.start):
        start, end = max(s.start, low), min(s.end, high)
        if end - start >= MIN_SEGMENT:
            clipped.append(Segment(start, end, s.rate, s.rate * (end - start)))
    if not clipped:
        what = f"the table is never still or at constant rate for {MIN_SEGMENT:g} s or more"
        raise LogError(table.path, f"{what}; check that this is the log of the table")
    return clipped


def split_segments(segments: Sequence[Segment], length: float | None) -> list[Segment]:
    """Return the segments cut into equal blocks of about `length` s (None: as they are).

    At most 1000 blocks (their covariance is dense): longer blocks in longer logs. Raises
    ValueError for more than 2000 segments.
    """
    if len(segments) > MAX_INTERVALS:
        raise ValueError(f"{len(segments)} segments; at most {MAX_INTERVALS} can be analysed")
    if length is None:
        return list(segments)
    while True:
        counts = [max(1, round((s.end - s.start) / length)) for s in segments]
        if sum(counts) <= max(MAX_BLOCKS, len(segments)):
            break
        length *= 1.05 * sum(counts) / MAX_BLOCKS
    blocks = []
    for segment, count in zip(segments, counts, strict=True):
        edges = np.linspace(segment.start, segment.end, count + 1)
        blocks += [
            Segment(float(a), float(b), segment.rate, segment.rate * float(b - a))
            for a, b in pairwise(edges)
        ]
    return blocks


def reduce_blocks(
    imu: ImuSource,
    table: TableLog | None,
    segments: Sequence[Segment],
    *,
    axis: FloatArray,
    base: FixedBase | None,
    temperature: TemperatureLog | None = None,
    progress: Progress | None = None,
) -> Reduced:
    """Return the blocks of the segments (one block each).

    axis: (3,) u in b (and s). base: None leaves Earth rate in the readings, and accelerometers
    out. Raises LogError for a segment of fewer than 5 samples.
    """
    spans = [imu.within(segment.start, segment.end) for segment in segments]
    for segment, span in zip(segments, spans, strict=True):
        if span.stop - span.start < _MIN_SAMPLES:
            count, where = max(span.stop - span.start, 0), format_span(segment.start, segment.end)
            raise LogError(imu.path, f"{count} samples from {where}; {_MIN_SAMPLES} are needed")
    gyro, accel = np.zeros((len(segments), 3)), np.zeros((len(segments), 3))
    for chunk, position, first, last in _chunks(imu, spans):
        for k in range(first, last):
            part = slice(max(spans[k].start - position, 0), spans[k].stop - position)
            readings = chunk.gyro[part], chunk.accel[part], chunk.time[part]
            sums = _sums(*readings, table, segments[k].rate * axis, axis, base)
            gyro[k] += sums[0]
            accel[k] += sums[1]
        if progress:
            progress(last / len(segments))
    count = np.array([span.stop - span.start for span in spans], dtype=float)[:, None]
    gyro, accel = gyro / count, accel / count
    start = np.array([s.start for s in segments])
    end = np.array([s.end for s in segments])
    rate = np.array([s.rate for s in segments])
    celsius = heating = None
    if temperature is not None:
        celsius = _mean_temperature(temperature, start, end)
        heating = temperature.slope(start, end)
    still = rate == 0.0
    return Reduced(
        Blocks(start, end, rate, gyro, celsius, heating),
        None
        if base is None or not np.any(still)
        else Blocks(
            start[still],
            end[still],
            rate[still],
            accel[still],
            None if celsius is None else celsius[still],
            None if heating is None else heating[still],
        ),
    )


def _chunks(imu: ImuSource, spans: Sequence[slice]) -> Iterator[tuple[ImuLog, int, int, int]]:
    """Yield chunks of the log in one pass: chunk, its first sample, the spans first to last."""
    position, first = spans[0].start, 0
    for chunk in imu.chunks(slice(position, max(span.stop for span in spans))):
        stop = position + len(chunk.time)
        while first < len(spans) and spans[first].stop <= position:
            first += 1
        last = first
        while last < len(spans) and spans[last].start < stop:
            last += 1
        yield chunk, position, first, last
        position = stop


def _sums(
    gyro: FloatArray,
    accel: FloatArray,
    time: FloatArray,
    table: TableLog | None,
    rate: FloatArray,
    axis: FloatArray,
    base: FixedBase | None,
) -> tuple[FloatArray, FloatArray]:
    """Return the sums (3,) of gyro and accelerometer readings minus their true values."""
    count = len(time)
    total, force = gyro.sum(axis=0) - count * rate, accel.sum(axis=0)
    if base is None or not count:
        return total, force
    if table is None:
        return total - count * base.w_ie_b, force - count * base.specific_force
    angle = angle_at(table, time)
    total = total - base.w_ie_s(axis, angle).sum(axis=0)
    expected = np.broadcast_to(base.specific_force, (count, 3))
    return total, force - rotation.rotate_about(axis, -angle, expected).sum(axis=0)


def _mean_temperature(
    temperature: TemperatureLog, start: FloatArray, end: FloatArray
) -> FloatArray:
    """Return the mean temperature (k,), degC, over intervals: 11 points each."""
    share = (np.arange(11) + 0.5) / 11.0
    points = start[:, None] + share * (end - start)[:, None]
    return np.asarray(temperature.at(points.ravel()).reshape(points.shape).mean(axis=1))


def gyro_figures(imu: ImuSettings) -> tuple[NoiseFigures, NoiseFigures, NoiseFigures] | None:
    """Return the noise of the three gyros, SI; None where the rig has no angle random walk."""
    white = imu.figure("angle_random_walk")
    names = {
        "bias_instability": "bias_instability",
        "rate_random_walk": "rate_random_walk",
        "markov_sigma": "gauss_markov_gyro_sigma",
        "markov_time": "gauss_markov_gyro_time",
    }
    return None if white is None else _figures(imu, white, names)


def accel_figures(imu: ImuSettings) -> tuple[NoiseFigures, NoiseFigures, NoiseFigures] | None:
    """Return the noise of the three accelerometers, SI; None without velocity random walk."""
    white = imu.figure("velocity_random_walk")
    names = {
        "bias_instability": "accel_bias_instability",
        "markov_sigma": "gauss_markov_accel_sigma",
        "markov_time": "gauss_markov_accel_time",
    }
    return None if white is None else _figures(imu, white, names)


def _figures(
    imu: ImuSettings, white: FloatArray, names: dict[str, str]
) -> tuple[NoiseFigures, NoiseFigures, NoiseFigures]:
    """Return the noise figures of three axes from the rig's keys."""
    present = {ours: imu.figure(key) for ours, key in names.items()}
    known = {ours: values for ours, values in present.items() if values is not None}
    if "markov_sigma" not in known or "markov_time" not in known:
        known = {n: v for n, v in known.items() if not n.startswith("markov")}
    x, y, z = (
        NoiseFigures(white=float(white[i]), **{name: float(v[i]) for name, v in known.items()})
        for i in range(3)
    )
    return x, y, z
