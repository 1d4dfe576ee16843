"""An IMU log too long to hold: looked through once at the door, then had a piece at a time.

The first pass finds every fault and the one even clock of the whole, as `read_imu` does; after
that any span can be asked for, as often as wanted. A Parquet file is entered at the row group
where a span begins. A log that is short, or in a format that counts its time, is held instead.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotcli.logs import plausible
from rotcli.logs.clock import Line, LongLine, resample, spread
from rotcli.logs.columns import Loaded, load_batches, parquet_rows
from rotcli.logs.formats import layout_of
from rotcli.logs.header import MAX_BYTES, Header, open_log
from rotcli.logs.imu import clipping, clock_warnings, gap_warnings, longest_gap, read_imu, too_long
from rotcli.logs.readings import (
    READING_LIMITS,
    check_size,
    check_time_unit,
    check_times,
    counts_time,
    imu_columns,
    read_times,
)
from rotcli.logs.record import PIECE, ImuLog, ImuSource, Progress, Sampling, joined
from rotcli.rig.formats import AXES
from rotcli.rig.rig import Rig

Array = NDArray[np.float64]

LONG = 2 * PIECE  # records; a log of more is not held
LONG_TEXT = {"csv": 60_000_000, "gzip": 15_000_000, "zstd": 15_000_000}  # bytes of the same
_LEAD = 8  # records on either side that feed an interpolation


def open_imu(
    path: str | Path,
    rig: Rig,
    *,
    max_gap: int | None = 5,
    table_log: str | Path | None = None,
    progress: Progress | None = None,
    max_bytes: int = MAX_BYTES,
    held: float = 1.0,
) -> ImuSource:
    """Return an IMU log to be had in pieces: held where it is short, else a stream.

    table_log: the file read as that, for messages. progress: told how much (0 to 1) of a long
    log is looked through. max_bytes: that may be read at most. held: times the usual length up
    to which a log is held. Raises LogError as `read_imu` does.
    """
    header = open_log(path, layout_of(rig.imu).dialect, max_bytes)
    if _is_long(header, held) and not counts_time(header, rig):
        return ImuStream(
            path, rig, max_gap=max_gap, table_log=table_log, progress=progress, max_bytes=max_bytes
        )
    return read_imu(
        path, rig, max_gap=max_gap, table_log=table_log, progress=progress, max_bytes=max_bytes
    )


def _is_long(header: Header, held: float) -> bool:
    if header.kind == "parquet":
        return parquet_rows(header) > held * LONG
    return Path(header.path).stat().st_size > held * LONG_TEXT[header.kind]


class ImuStream:
    """An IMU log of any length as an `ImuSource`: evenly sampled, in the sensor frame.

    time: s, the first and the last of the even clock.
    """

    def __init__(
        self,
        path: str | Path,
        rig: Rig,
        *,
        max_gap: int | None = 5,
        table_log: str | Path | None = None,
        progress: Progress | None = None,
        max_bytes: int = MAX_BYTES,
    ) -> None:
        self.header = open_log(path, layout_of(rig.imu).dialect, max_bytes)
        self.stamp = self.header.stamp
        self.path = self.header.path
        self.rig = rig
        self.sampling: Sampling = "instant" if rig.imu.sampling == "instant" else "average"
        units: list[str] = []
        self._wanted, self._scales = imu_columns(self.header, rig, units, table_log)
        self._survey(max_gap, progress or (lambda share: None))
        self.warnings = (*units, *self._told)
        self.time = self.times(slice(0, 1)).repeat(2)
        self.time[1:] = self.times(slice(self.samples - 1, self.samples))

    def between(self, start: float, end: float) -> slice:
        """Return the span of the samples whose time lies within [start, end] (s).

        Half a sample of tolerance keeps a sample that stands on the limit.
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

    def times(self, span: slice) -> Array:
        """Return the times (k,) of a span, s."""
        return self._start + self.interval * np.arange(span.start, span.stop, dtype=float)

    def crop(self, start: float, end: float) -> ImuLog:
        """Return the samples within [start, end] (s) as a log that is held."""
        span = self.between(start, end)
        if span.stop > span.start:
            return joined(self.pieces(span))
        return self._log(span, np.empty((6, 0)), None)

    def fill(self, out: Array, name: str, span: slice) -> None:
        """Write one axis, `gyro_x` … `accel_z`, of a span into out (k,), rad/s or m/s^2."""
        for at, values, _ in self._even(span, [name]):
            out[at.start - span.start : at.stop - span.start] = values[0]

    def pieces(self, span: slice) -> Iterator[ImuLog]:
        """Yield the logs of a span that follow one another, about PIECE samples each."""
        names = [f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"]
        for at, values, missing in self._even(span, names):
            yield self._log(at, values, missing)

    def _log(self, at: slice, values: Array, missing: NDArray[np.bool_] | None) -> ImuLog:
        return ImuLog(
            path=self.path,
            time=self.times(at),
            gyro=values[:3].T,
            accel=values[3:].T,
            interval=self.interval,
            sampling=self.sampling,
            missing=missing,
            rows=self.rows,
            warnings=self.warnings,
        )

    def _survey(self, max_gap: int | None, progress: Progress) -> None:
        """Look through the whole log: every number finite, the clock, gaps, clipped samples."""
        imu = self.rig.imu
        clock, counts = LongLine(literal=imu.clock == "stamps"), clipping(imu)
        gaps: list[tuple[float, int]] = []
        odd: dict[str, str] = {}
        last: float | None = None
        for loaded, share in load_batches(self.header, self._wanted, PIECE):
            time = read_times(loaded, self._scales[0], last)
            if last is None:
                unit = layout_of(imu).units.get("time")
                check_time_unit(self.header, self._wanted[0], time, unit, "imu")
            check_times(loaded, time)
            plausible.check_median_rate(self.path, time)
            known = len(clock.gaps)
            clock.add(time)
            for record, lost in clock.gaps[known:]:
                i = record - loaded.first
                before = last if i < 0 and last is not None else float(time[max(i, 0)])
                if lost > longest_gap(clock.records, max_gap):
                    span = before, float(time[i + 1])
                    raise too_long(loaded, i + 1, lost, span, max_gap)
                gaps.append((before, lost))
            values = self._rates(loaded, range(1, 7), time, clock.guess)
            check_size(loaded, values, AXES, READING_LIMITS)
            for count, part in zip(counts, (values[:3], values[3:]), strict=True):
                count.add(time, part)
            for text in plausible.check_axes(self.path, time, values):
                axis = text.removeprefix(f"{self.path}: ").partition(" ")[0]
                odd.setdefault(axis, text)  # an axis is told of once
            last = float(time[-1])
            progress(share)
        self.rows = clock.records
        line, self._literal = clock.line()
        self._start, self.interval = line.start, line.interval
        # Where each gap ends: the record after it, and its slot on the even clock.
        records = np.array([r + 1 for r, _ in clock.gaps], dtype=np.int64)
        self._lost = np.concatenate([[0], np.cumsum([n for _, n in clock.gaps])]).astype(np.int64)
        self._resume = records
        self.samples = int(line.index[-1]) + 1
        if self._literal and last is not None:
            self.samples = int((last - self._start) / self.interval + 1e-9) + 1
        plausible.check_rate(self.path, self.interval)
        told = list(odd.values())
        if imu.clock == "regular":
            told += clock_warnings(self.path, line, clock.worst if self._literal else None)
        told += gap_warnings(self.path, gaps)
        self._told = (*told, *(t for count in counts for t in count.warnings(self.path)))

    def _rates(self, loaded: Loaded, columns: range | list[int], time: Array, dt: float) -> Array:
        """Return loaded columns (k, n) in SI; increments of one interval become mean rates."""
        values = np.empty((len(columns), loaded.rows))
        for row, column in zip(values, columns, strict=True):
            loaded.fill(row, column, self._scales[column])
        if self.rig.imu.sampling == "increment":
            values /= dt
        return values

    def _slots(self, first: int, count: int) -> NDArray[np.int64]:
        """Return the slots on the even clock of `count` records from record `first` on."""
        records = np.arange(first, first + count)
        return records + self._lost[np.searchsorted(self._resume, records, side="right")]

    def _even(
        self, span: slice, names: list[str]
    ) -> Iterator[tuple[slice, Array, NDArray[np.bool_] | None]]:
        """Yield spans that make up `span`, the axes named (k, n) there, and what was missing."""
        mount = self.rig.imu.mount
        identity = np.array_equal(mount, np.eye(3))
        turns = np.zeros((6, 6))  # from the file's axes to the sensor frame
        turns[:3, :3] = turns[3:, 3:] = np.eye(3) if identity else mount.T
        order = [("gyro" if k < 3 else "accel") + "_" + "xyz"[k % 3] for k in range(6)]
        turn = turns[[order.index(name) for name in names]]
        used = np.flatnonzero(np.any(turn != 0.0, axis=0))
        turn = turn[:, used]
        even = self._literally if self._literal else self._by_line
        for at, values, missing in even(span, [int(k) + 1 for k in used]):
            kept = slice(max(span.start - at.start, 0), min(span.stop, at.stop) - at.start)
            if kept.stop > kept.start:
                part = values[:, kept]
                part = part if np.array_equal(turn, np.eye(len(part))) else turn @ part
                lost = None if missing is None or not missing[kept].any() else missing[kept]
                yield slice(at.start + kept.start, at.start + kept.stop), part, lost
            if at.stop >= span.stop:
                return

    def _record_before(self, sample: int) -> int:
        """Return a record that is some records before a sample."""
        if self._literal:  # its slots are counted, its samples are timed: both run together
            sample = int(sample * (1.0 - 1e-3)) - 10_000
        after = self._resume + self._lost[1:]
        lost = int(self._lost[np.searchsorted(after, sample, side="right")])
        longest = int(np.diff(self._lost).max(initial=0))
        return max(sample - lost - longest - 1, 0)

    def _by_line(
        self, span: slice, columns: list[int]
    ) -> Iterator[tuple[slice, Array, NDArray[np.bool_] | None]]:
        """Yield the samples of a log on its straight line, gaps bridged, also between batches."""
        last: tuple[int, Array] | None = None
        for loaded, first in self._batches(self._record_before(span.start), columns):
            values = self._filled(loaded, columns)
            if self.rig.imu.sampling == "increment":
                values /= self.interval
            slots = self._slots(first, loaded.rows)
            joint = last is not None and slots[0] > last[0] + 1
            if joint and last is not None:
                slots = np.concatenate([[last[0]], slots])
                values = np.concatenate([last[1][:, None], values], axis=1)
            last = int(slots[-1]), values[:, -1].copy()
            line = Line(self._start, self.interval, slots - slots[0], 0.0, 0.0)
            values, missing = spread(values, line)
            if joint:
                values, missing = values[:, 1:], None if missing is None else missing[1:]
            yield slice(int(slots[0]) + joint, int(slots[-1]) + 1), values, missing

    def _literally(
        self, span: slice, columns: list[int]
    ) -> Iterator[tuple[slice, Array, NDArray[np.bool_] | None]]:
        """Yield the samples of a log whose stamps are taken literally, interpolated."""
        begin = self._record_before(span.start)
        time, values = np.empty(0), np.empty((len(columns), 0))
        slots = np.empty(0, dtype=np.int64)  # as the first pass counted them: where gaps are
        done = 0
        for loaded, first in self._batches(begin, [0, *columns]):
            new = np.empty(loaded.rows)
            counted = self._slots(first, loaded.rows)
            loaded.fill(new, 0, self._scales[0])
            part = self._filled(loaded, columns, 1)
            if not len(time):
                done = 0 if first == 0 else self._sample_at(float(new[_LEAD]))
            before = time[-1:] if len(time) else np.array([new[0] - self.interval])
            if self.rig.imu.sampling == "increment":
                steps = np.diff(np.concatenate([before, new]))
                last = slots[-1] if len(slots) else counted[0] - 1
                part /= np.where(np.diff(counted, prepend=last) > 1, self.interval, steps)
            time, values = np.concatenate([time, new]), np.concatenate([values, part], axis=1)
            slots = np.concatenate([slots, counted])
            final = first + loaded.rows >= self.rows
            end = self.samples if final else self._sample_at(float(time[-_LEAD]))
            if len(time) < 2 * _LEAD and not final:
                continue
            line = Line(float(time[0]), self.interval, slots - slots[0], 0.0, 0.0)
            at = slice(done, end)
            averages = self.sampling == "average"
            grid = self.times(at)
            _, found, missing = resample(time, values, line, averages=averages, grid=grid)
            yield at, found, missing
            kept = max(int(np.searchsorted(time, grid[-1])) - 2 * _LEAD, 0) if len(grid) else 0
            time, values, slots = time[kept:].copy(), values[:, kept:].copy(), slots[kept:].copy()
            done = end

    def _filled(self, loaded: Loaded, columns: list[int], first: int = 0) -> Array:
        values = np.empty((len(columns), loaded.rows))
        for i, column in enumerate(columns):
            loaded.fill(values[i], first + i, self._scales[column])
        return values

    def _batches(self, first: int, columns: list[int]) -> Iterator[tuple[Loaded, int]]:
        """Yield the columns (0: time) from the batch of record `first` on, and its first record."""
        wanted = [self._wanted[column] for column in columns]
        for loaded, _ in load_batches(self.header, wanted, PIECE, first):
            yield loaded, loaded.first
