"""Reduce the segments of a calibration to means of short blocks, in one pass over the samples.

Everything that calibration needs of the samples are means over a quarter of a second: of the
gyros, of the cosine and sine of the table angle (with which the Earth rate in the sensor frame is
`a + b cos + c sin`), and of the specific force.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import ImuLog, ImuSource, Progress, Segment, TableLog, align_chunks
from rotcli.models.base import FixedBase
from rotcli.run.evidence.samples import SampleScan
from rotcli.run.table_angle import angle_at
from rotcli.units import FloatArray

# s: in a block of this length the noise is white: longer than a sensor's internal filter, shorter
# than the times at which flicker noise is as large.
WHITE_NOISE_BLOCK = 0.25
_NEIGHBOURS = 10  # blocks to either side, whose median is the reference: drift is slower
_WINDOWS = 2000  # neighbourhoods whose median is taken at a time: 1 MB
_MIN_BLOCKS = 50  # blocks that determine a variance to 20 %


@dataclass(frozen=True, eq=False)
class EarthHarmonics:
    """Earth rate in the sensor frame at table angle t: `constant + cosine cos t + sine sin t`.

    Each (3,), rad/s. Rotation of w_ie_b by -t about the axis u.
    """

    constant: FloatArray
    cosine: FloatArray
    sine: FloatArray

    @classmethod
    def of(cls, base: FixedBase | None, u: FloatArray) -> "EarthHarmonics":
        """Return the harmonics of a base, zero without one. A vertical axis: no north part."""
        if base is None:
            return cls(np.zeros(3), np.zeros(3), np.zeros(3))
        w = base.w_ie_b
        constant = u * float(u @ w)
        return cls(constant, w - constant, -np.cross(u, w))

    def at(self, cos: FloatArray, sin: FloatArray) -> FloatArray:
        """Return the Earth rate (n, 3), rad/s, for cosines and sines (n,) of the table angle."""
        return self.constant + np.outer(cos, self.cosine) + np.outer(sin, self.sine)


@dataclass(frozen=True, eq=False)
class SegmentBlocks:
    """A segment reduced to blocks of `size` samples; the last block may be shorter.

    start: s, of the first sample's interval; inset: s, from there to the time of its reading:
    a reading at an instant does not show a ramp that ends half a sample before it. counts (k,):
    samples. gyro (k, 3) rad/s, cos, sin (k,): means. within (3,): sum of the squared deviations of
    the gyro samples from their block means. force (3,): mean specific force in b, m/s^2. scan:
    samples that were not measured, or clipped.
    """

    segment: Segment
    start: float
    interval: float
    size: int
    counts: FloatArray
    gyro: FloatArray
    cos: FloatArray
    sin: FloatArray
    within: FloatArray
    force: FloatArray
    scan: SampleScan
    inset: float = 0.0

    @property
    def inner_edges(self) -> FloatArray:
        """Edges (k + 1,), s, the outer ones at the times of the first and the last reading."""
        edges = self.edges
        edges[0] += self.inset
        edges[-1] -= self.inset
        return edges

    @property
    def edges(self) -> FloatArray:
        """Times (k + 1,), s, of the edges of the blocks."""
        samples = np.concatenate([[0.0], np.cumsum(self.counts)])
        return np.asarray(self.start + self.interval * samples)

    @property
    def samples(self) -> float:
        """Number of samples."""
        return float(self.counts.sum())

    @property
    def end(self) -> float:
        """Time (s) of the end of the last sample's interval."""
        return float(self.edges[-1])

    @property
    def duration(self) -> float:
        """Time (s) that the samples represent."""
        return self.samples * self.interval

    @cached_property
    def deviations(self) -> FloatArray | None:
        """Deviations (k, 3), rad/s, of the gyros from the median of the neighbouring blocks.

        A shorter last block is left out. None where the segment has too few blocks.
        """
        gyro = self.gyro[:-1] if self.counts[-1] < self.size else self.gyro
        width = 2 * _NEIGHBOURS + 1
        if len(gyro) < width:
            return None
        padded = np.pad(gyro, ((_NEIGHBOURS, _NEIGHBOURS), (0, 0)), mode="reflect")
        windows = np.lib.stride_tricks.sliding_window_view(padded, width, axis=0)
        reference = np.empty_like(gyro)
        for first in range(0, len(gyro), _WINDOWS):
            part = slice(first, first + _WINDOWS)
            # The middle of an odd count: short rows are sorted five times as fast as halved.
            reference[part] = np.sort(windows[part], axis=-1)[..., _NEIGHBOURS]
        return np.asarray(gyro - reference)

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the mean over the samples of block means (k, ...)."""
        return np.asarray(np.average(values, axis=0, weights=self.counts))


def block_size(imu: ImuSource, segments: list[Segment]) -> int:
    """Return the samples of a block for segments, so that there are enough blocks."""
    total = sum(s.duration for s in segments)
    wanted = round(WHITE_NOISE_BLOCK / imu.interval)
    return max(1, min(wanted, round(total / imu.interval) // _MIN_BLOCKS))


def reduce_segment(
    imu: ImuSource,
    table: TableLog,
    segment: Segment,
    u: FloatArray,
    size: int,
    *,
    gyro_range: float | None = None,
    progress: Progress | None = None,
) -> SegmentBlocks:
    """Reduce a segment to blocks of `size` samples.

    u: (3,) table axis in b. gyro_range: rad/s, at which readings are clipped. progress: receives
    the time (s) reached.
    """
    parts: list[tuple[FloatArray, ...]] = []
    scan = SampleScan(gyro_range)
    within, force, samples = np.zeros(3), np.zeros(3), 0
    start = np.nan
    for log in _aligned(imu, segment, size):
        if np.isnan(start):
            lead = 1.0 if imu.sampling == "average" else 0.5
            start = float(log.time[0]) - lead * imu.interval
        scan.add(log)
        angle = angle_at(table, log.time)
        cos, sin = np.cos(angle), np.sin(angle)
        parts.append(_block_means(log.gyro, cos, sin, size, within))
        force += _force_sum(log.accel, cos, sin, u)
        samples += log.samples
        if progress:
            progress(float(log.time[-1]))
    if not parts:
        empty = np.empty(0)
        parts = [(empty, np.empty((0, 3)), empty, empty)]
    counts, gyro, c, s = (np.concatenate(column) for column in zip(*parts, strict=True))
    return SegmentBlocks(
        segment,
        float(start),
        imu.interval,
        size,
        counts,
        gyro,
        c,
        s,
        within,
        force / max(samples, 1),
        scan,
        0.0 if imu.sampling == "average" else 0.5 * imu.interval,
    )


def reduce_segments(
    imu: ImuSource,
    table: TableLog,
    segments: Sequence[Segment],
    u: FloatArray,
    gyro_range: float | None = None,
    progress: Progress | None = None,
) -> list[SegmentBlocks]:
    """Reduce the segments to blocks, without those that contain none.

    gyro_range: rad/s, beyond which samples are clipped. progress: receives the share done,
    0 to 1.
    """
    size = block_size(imu, list(segments))
    total = sum(s.duration for s in segments)
    done, result = 0.0, []
    for segment in segments:
        part = None
        if progress is not None:
            part = partial(_share, progress, done - segment.start, total)
        result.append(
            reduce_segment(imu, table, segment, u, size, gyro_range=gyro_range, progress=part)
        )
        done += segment.duration
    return [blocks for blocks in result if len(blocks.counts)]


def _share(progress: Progress, before: float, total: float, time: float) -> None:
    progress((before + time) / total)


def halves(b: SegmentBlocks) -> tuple[SegmentBlocks, SegmentBlocks]:
    """Return the two halves of a segment, in full turns of the table where there are any."""
    k = len(b.counts) // 2
    edges = b.edges
    turn = 2.0 * np.pi / abs(b.segment.rate) if b.segment.rate else 0.0
    if turn and edges[k] - edges[0] > turn:
        full = np.floor((edges[k] - edges[0]) / turn) * turn
        k = max(1, int(np.searchsorted(edges, edges[0] + full)))
    k = max(1, min(k, len(b.counts) - 1))
    parts = []
    for span in (slice(0, k), slice(k, len(b.counts))):
        parts.append(
            replace(
                b,
                start=float(edges[span.start]),
                counts=b.counts[span],
                gyro=b.gyro[span],
                cos=b.cos[span],
                sin=b.sin[span],
            )
        )
    return parts[0], parts[1]


def _aligned(imu: ImuSource, segment: Segment, size: int) -> Iterator[ImuLog]:
    return align_chunks(imu.chunks(imu.within(segment.start, segment.end)), size)


def _block_means(
    gyro: FloatArray, cos: FloatArray, sin: FloatArray, size: int, within: FloatArray
) -> tuple[FloatArray, ...]:
    """Return counts, gyro, cosine and sine means of the blocks; add to `within` (3,)."""
    n = len(gyro)
    edges = np.arange(0, n, size)
    counts = np.diff(np.append(edges, n)).astype(float)
    means = np.add.reduceat(gyro, edges, axis=0) / counts[:, None]
    for axis, column in enumerate(gyro.T):
        rest = column - np.repeat(means[:, axis], size)[:n]
        within[axis] += rest @ column
    c = np.add.reduceat(cos, edges) / counts
    s = np.add.reduceat(sin, edges) / counts
    return counts, means, c, s


def _force_sum(f: FloatArray, cos: FloatArray, sin: FloatArray, u: FloatArray) -> FloatArray:
    """Return the sum (3,) of the specific forces f (n, 3) rotated into b about u."""
    by_cos, by_sin, total = cos @ f, sin @ f, f.sum(axis=0)
    return np.asarray(by_cos + np.cross(u, by_sin) + u * float(u @ (total - by_cos)))
