"""Open IMU logs of any length: short ones in memory, long ones read chunk by chunk.

The first pass over a long log finds every error and the one even clock, as `read_imu` does; after
that any span can be read, as often as needed. The pass keeps the readings of a log of hours; one of
days is decoded again, a Parquet file from the row group where a span begins. A log whose time is
text, starts again or is counted at a rate that the rig does not name is read into memory.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.files.channels import AXES, OPTIONAL
from rotcli.logs import plausible
from rotcli.logs.chunk_values import ChunkValues, KeptValues, NotStreamableError
from rotcli.logs.container.columns import Loaded, Wanted
from rotcli.logs.container.header import MAX_BYTES, Header
from rotcli.logs.container.loading import load_chunks
from rotcli.logs.container.opening import open_log
from rotcli.logs.container.parquet_file import count_rows
from rotcli.logs.describe.imu import describe_imu
from rotcli.logs.describe.layout import Layout
from rotcli.logs.imu import (
    clock_warnings,
    even_log,
    gap_error,
    gap_warnings,
    longest_gap,
    read_imu,
)
from rotcli.logs.readings import check_time_unit, check_times, read_described
from rotcli.logs.record import CHUNK_SAMPLES, ImuLog, ImuSource, Progress, Sampling, joined
from rotcli.logs.scan import ReadingScan, check_stamps_change
from rotcli.logs.timing.clock import StreamingClockFit
from rotcli.logs.timing.counting import RecordCounter
from rotcli.logs.timing.line import SampleClock
from rotcli.logs.timing.record_slots import RecordSlots
from rotcli.logs.timing.resample import fill_gaps, resample
from rotcli.rig.rig import Rig
from rotcli.units import FloatArray

# Samples, values (k, n), which were missing.
Part = tuple[slice, FloatArray, NDArray[np.bool_] | None]

MAX_IN_MEMORY_RECORDS = 2 * CHUNK_SAMPLES  # a log of more is streamed
# Bytes of text logs of that length.
MAX_IN_MEMORY_TEXT = {"csv": 60_000_000, "gzip": 15_000_000, "zstd": 15_000_000}
_LEAD = 8  # records on either side that an interpolation uses


def open_imu(
    path: str | Path,
    rig: Rig,
    *,
    max_gap: int | None = 5,
    table_log: str | Path | None = None,
    progress: Progress | None = None,
    max_bytes: int = MAX_BYTES,
    in_memory_factor: float = 1.0,
    channels: Sequence[str] | None = None,
) -> ImuSource:
    """Return an IMU log, in memory where it is short, else streamed.

    in_memory_factor: times the usual length up to which a log is in memory. The other arguments
    and LogError are those of `read_imu`.
    """
    header = open_log(path, rig.imu, max_bytes)
    layout = describe_imu(header, rig, channels, table_log)
    if _is_long(header, in_memory_factor) and _is_streamable(layout, rig):
        try:
            return StreamedImuLog(header, layout, rig, max_gap=max_gap, progress=progress)
        except NotStreamableError:
            check_stamps_change(header, layout, "imu")
    if rig.imu.accel_log is not None:
        return read_imu(path, rig, max_gap=max_gap, table_log=table_log, max_bytes=max_bytes)
    return even_log(read_described(header, layout, rig, progress), rig, max_gap)


def _is_long(header: Header, factor: float) -> bool:
    if header.kind == "parquet":
        return count_rows(header) > factor * MAX_IN_MEMORY_RECORDS
    if not header.is_text:
        return False
    return Path(header.path).stat().st_size > factor * MAX_IN_MEMORY_TEXT[header.kind]


def _is_streamable(layout: Layout, rig: Rig) -> bool:
    return (
        layout.is_streamable
        and rig.imu.accel_log is None
        and (rig.imu.clock != "count" or layout.time.is_even)
        and all(name in layout.sources for name in AXES)
    )


class StreamedImuLog:
    """An IMU log of any length as an `ImuSource`: evenly sampled, in the sensor frame.

    time: s, the first and the last of the even clock.
    """

    def __init__(
        self,
        header: Header,
        layout: Layout,
        rig: Rig,
        *,
        max_gap: int | None = 5,
        progress: Progress | None = None,
    ) -> None:
        layout.raise_problems()
        self.header, self.layout, self.rig = header, layout, rig
        self.path, self.stamp, self.channels = header.path, header.stamp, AXES
        means = any(source.increments for source in layout.sources.values())
        means |= rig.imu.sampling != "instant"
        self.sampling: Sampling = "average" if means else "instant"
        extras = [channel.name for channel in OPTIONAL if channel.name in layout.sources]
        self._names = [*AXES, *extras]
        self._chunks_of = ChunkValues(layout, self._names)
        self._scan_log(max_gap, progress or (lambda share: None))
        self.warnings = (*layout.notes, *self._scan_warnings)
        self.time = self.times(slice(0, 1)).repeat(2)
        self.time[1:] = self.times(slice(self.samples - 1, self.samples))

    def between(self, start: float, end: float) -> slice:
        """Return the span of the samples whose time lies within [start, end] (s).

        Half a sample of tolerance keeps a sample on the limit.
        """
        return slice(
            self._sample_at(start - 0.5 * self.interval), self._sample_at(end + 0.5 * self.interval)
        )

    def within(self, start: float, end: float) -> slice:
        """Return the span of the samples that speak of [start, end] (s) and of nothing else."""
        kept = self.between(start, end)
        return slice(kept.start + (self.sampling == "average"), kept.stop)

    def _sample_at(self, moment: float) -> int:
        """Return the first sample that is not before a moment (s)."""
        guess = int(np.clip(np.ceil((moment - self._start) / self.interval), 0, self.samples))
        near = slice(max(guess - 1, 0), min(guess + 2, self.samples))
        return near.start + int(np.searchsorted(self.times(near), moment))

    def times(self, span: slice) -> FloatArray:
        """Return the times (k,) of a span, s."""
        return self._start + self.interval * np.arange(span.start, span.stop, dtype=float)

    def crop(self, start: float, end: float) -> ImuLog:
        """Return the samples within [start, end] (s) as a log in memory."""
        span = self.between(start, end)
        if span.stop > span.start:
            parts = self._even(span, self._names, span.stop - span.start)
            return joined(self._log(*part) for part in parts)
        return self._log(span, np.empty((len(self._names), 0)), None)

    def fill(self, out: FloatArray, name: str, span: slice) -> None:
        """Write one axis, or an optional channel, of a span into out (k,), SI or degC."""
        if name not in self._names:
            raise LogError(self.path, f"no column {name}; set [imu] columns {name}")
        for at, values, _ in self._even(span, [name], CHUNK_SAMPLES):
            out[at.start - span.start : at.stop - span.start] = values[0]

    def chunks(self, span: slice) -> Iterator[ImuLog]:
        """Yield the logs of a span that follow one another, about PIECE samples each."""
        for part in self._even(span, self._names, CHUNK_SAMPLES):
            yield self._log(*part)

    def _log(self, at: slice, values: FloatArray, missing: NDArray[np.bool_] | None) -> ImuLog:
        return ImuLog(
            path=self.path,
            time=self.times(at),
            gyro=values[:3].T,
            accel=values[3:6].T,
            interval=self.interval,
            sampling=self.sampling,
            missing=missing,
            rows=self.rows,
            warnings=self.warnings,
            extras=dict(zip(self._names[6:], values[6:], strict=True)),
        )

    def _scan_log(self, max_gap: int | None, progress: Progress) -> None:
        """Read the complete log once: every number finite, the clock, gaps, clipped samples."""
        imu = self.rig.imu
        clock = StreamingClockFit(literal=imu.clock == "stamps")
        source = self.layout.time
        counter = RecordCounter(source.start, source.interval) if source.is_even else None
        scan = ReadingScan(self.layout, imu)
        gaps: list[tuple[float, int]] = []
        last: float | None = None
        columns = list(range(len(self._names)))
        kept = KeptValues.of(self.header, len(columns))
        for loaded, share in load_chunks(self.header, self.layout.wanted, CHUNK_SAMPLES):
            time = counter.times(loaded.rows) if counter else self._chunks_of.times(loaded, last)
            if last is None:
                check_time_unit(self.header, self.layout, time, "imu")
            check_times(loaded, time)
            plausible.check_median_rate(self.path, time)
            for record, lost in clock.add(time):
                i = record - loaded.first
                before = last if i < 0 and last is not None else float(time[max(i, 0)])
                if lost > longest_gap(clock.records, max_gap):
                    span = before, float(time[i + 1])
                    raise gap_error(loaded, i + 1, lost, span, max_gap)
                gaps.append((before, lost))
            room = None if kept is None else kept.room(loaded.rows)
            kept = None if room is None else kept
            values = self._chunks_of.values(loaded, columns, len(source.columns), room)[:6]
            values = self._chunks_of.rates(values, columns[:6], clock.guess)
            scan.add(loaded, time, values)
            last = float(time[-1])
            progress(share)
        self.rows = clock.records
        line, self._literal = (counter.line(), False) if counter else clock.line()
        self._kept = None if self._literal else kept  # literal stamps are read with the readings
        self._start, self.interval = line.start, line.interval
        self._slots = RecordSlots(clock.gaps)
        self.samples = int(line.slots[-1]) + 1
        if self._literal and last is not None:
            self.samples = int((last - self._start) / self.interval + 1e-9) + 1
        plausible.check_rate(self.path, self.interval)
        plausible.check_mixed(self.path, clock.spacing)
        ends = clock.chunk_end_times if self._literal else None
        clock_texts = [*clock_warnings(self.path, line, ends, imu), *gap_warnings(self.path, gaps)]
        self._scan_warnings = scan.warnings(clock_texts)

    def _even(self, span: slice, names: list[str], size: int) -> Iterator[Part]:
        """Yield spans that make up `span`, the channels named (k, n), and what was missing.

        size: samples at a time, of a log whose readings are kept.
        """
        order = self._names
        rotation = np.eye(len(order))  # from the channels of the file to the sensor frame
        if not np.array_equal(self.rig.imu.mount, np.eye(3)):
            rotation[:3, :3] = rotation[3:6, 3:6] = self.rig.imu.mount.T
        wanted = rotation[[order.index(name) for name in names]]
        used = np.flatnonzero(np.any(wanted != 0.0, axis=0))
        wanted = wanted[:, used]
        columns = used.tolist()
        parts = (
            self._literally(span, columns) if self._literal else self._by_line(span, columns, size)
        )
        for at, values, missing in parts:
            kept = slice(max(span.start - at.start, 0), min(span.stop, at.stop) - at.start)
            if kept.stop > kept.start:
                part = values[:, kept]
                part = part if np.array_equal(wanted, np.eye(len(part))) else wanted @ part
                lost = None if missing is None or not missing[kept].any() else missing[kept]
                yield slice(at.start + kept.start, at.start + kept.stop), part, lost
            if at.stop >= span.stop:
                return

    def _record_before(self, sample: int) -> int:
        """Return a record that is some records before a sample."""
        if self._literal:  # its slots are counted, its samples are timed: both run together
            sample = int(sample * (1.0 - 1e-3)) - 10_000
        return self._slots.record_before(sample)

    def _by_line(self, span: slice, columns: list[int], size: int) -> Iterator[Part]:
        """Yield the samples of a log on its even clock, gaps filled, also between chunks."""
        last: tuple[int, FloatArray] | None = None
        for first, values in self._readings(self._record_before(span.start), columns, size):
            values = self._chunks_of.rates(values, columns, self.interval)
            if not self._slots.gaps:
                yield slice(first, first + values.shape[1]), values, None
                continue
            slots = self._slots.of(first, values.shape[1])
            joint = last is not None and slots[0] > last[0] + 1
            if joint and last is not None:
                slots = np.concatenate([[last[0]], slots])
                values = np.concatenate([last[1][:, None], values], axis=1)
            last = int(slots[-1]), values[:, -1].copy()
            line = SampleClock(self._start, self.interval, slots - slots[0], 0.0, 0.0)
            values, missing = fill_gaps(values, line)
            if joint:
                values, missing = values[:, 1:], None if missing is None else missing[1:]
            yield slice(int(slots[0]) + joint, int(slots[-1]) + 1), values, missing

    def _literally(self, span: slice, columns: list[int]) -> Iterator[Part]:
        """Yield the samples of a log whose stamps are taken literally, interpolated."""
        begin = self._record_before(span.start)
        time, values = np.empty(0), np.empty((len(columns), 0))
        slots = np.empty(0, dtype=np.int64)  # as the first pass counted them: where gaps are
        done = 0
        for loaded in self._chunks(begin, columns, with_time=True):
            first = loaded.first
            new = np.empty(loaded.rows)
            counted = self._slots.of(first, loaded.rows)
            loaded.fill(new, 0, self.layout.time.scale[0])
            part = self._chunks_of.values(loaded, columns, 1)
            if not len(time):
                done = 0 if first == 0 else self._sample_at(float(new[_LEAD]))
            before = time[-1:] if len(time) else np.array([new[0] - self.interval])
            steps = np.diff(np.concatenate([before, new]))
            last = slots[-1] if len(slots) else counted[0] - 1
            widths = np.where(np.diff(counted, prepend=last) > 1, self.interval, steps)
            part = self._chunks_of.rates(part, columns, widths)
            time, values = np.concatenate([time, new]), np.concatenate([values, part], axis=1)
            slots = np.concatenate([slots, counted])
            final = first + loaded.rows >= self.rows
            end = self.samples if final else self._sample_at(float(time[-_LEAD]))
            if len(time) < 2 * _LEAD and not final:
                continue
            line = SampleClock(float(time[0]), self.interval, slots - slots[0], 0.0, 0.0)
            at = slice(done, end)
            averages = self.sampling == "average"
            grid = self.times(at)
            _, found, missing = resample(time, values, line, averages=averages, grid=grid)
            yield at, found, missing
            kept = max(int(np.searchsorted(time, grid[-1])) - 2 * _LEAD, 0) if len(grid) else 0
            time, values, slots = time[kept:].copy(), values[:, kept:].copy(), slots[kept:].copy()
            done = end

    def _readings(
        self, first: int, columns: list[int], size: int
    ) -> Iterator[tuple[int, FloatArray]]:
        """Yield records from `first` or before it on: the number of the first, channels (k, n)."""
        if self._kept is not None:
            for at in range(first, self.rows, size):
                yield at, self._kept.between(columns, at, at + size)
            return
        for loaded in self._chunks(first, columns, with_time=False):
            yield loaded.first, self._chunks_of.values(loaded, columns, 0)

    def _chunks(self, first: int, columns: list[int], *, with_time: bool) -> Iterator[Loaded]:
        """Yield channels from the chunk of record `first` on, after the time where wanted."""
        indices = [self._chunks_of.sources[column].column for column in columns]
        if with_time:
            indices.insert(0, self.layout.time.columns[0])
        chunks = load_chunks(self.header, Wanted(tuple(indices)), CHUNK_SAMPLES, first)
        yield from (loaded for loaded, _ in chunks)
