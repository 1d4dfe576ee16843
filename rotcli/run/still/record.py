"""The still record of an IMU log: its clean segments, with what was excluded between them.

A sample is excluded when the logger lost it in a gap that is too long to interpolate, when it is
clipped, when it repeats an earlier part of the log, when it is a spike that dominates its second,
or when the IMU moves. An Allan deviation pools the squares of all segments.
"""

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.logs.record import ImuSource, epoch_clock_hint
from rotcli.run.findings import Finding
from rotcli.run.still.copies import find_copies
from rotcli.run.still.motion import SHAKING, find_motion, quiet_levels
from rotcli.run.still.scan import BlockStatistics, runs, scan
from rotcli.run.still.spikes import Spikes, find_spikes
from rotcli.units import DEG, format_span, show_time

Flags = NDArray[np.bool_]
Index = NDArray[np.int64]

MIN_SAMPLES = 100
_MAX_GAP = 5  # samples; a longer gap splits the log
# Of the samples. The expected deviation of interpolated white noise is known (the fit takes it
# into account); of more, isolated gaps meet each other.
_MAX_INTERPOLATED = 0.05
_MAX_SEGMENTS = 500  # the longest ones: more cost time and know only short cluster times


@dataclass(frozen=True, eq=False)
class StillRecord:
    """The segments of a log, slices of its samples in order, and the faults that were found.

    spikes: samples (k,) of the log to interpolate, by axis. interpolated: samples (k,) of the log
    that the reader interpolated inside the segments. share: of the samples that is used.
    """

    segments: tuple[slice, ...]
    share: float = 1.0
    spikes: Mapping[str, Index] = field(default_factory=dict)
    interpolated: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    findings: tuple[Finding, ...] = ()

    @property
    def first(self) -> int:
        """First sample of the record."""
        return int(self.segments[0].start)

    @property
    def last(self) -> int:
        """One after the last sample of the record."""
        return int(self.segments[-1].stop)

    @property
    def lengths(self) -> tuple[int, ...]:
        """Samples of each segment."""
        return tuple(segment.stop - segment.start for segment in self.segments)

    def gap_lengths(self, axis: str) -> Index:
        """Return the lengths (k,) of the interpolated runs of an axis, in samples."""
        both = np.union1d(self.interpolated, self.spikes.get(axis, self.interpolated[:0]))
        if not len(both):
            return np.zeros(0, dtype=np.int64)
        edges = np.flatnonzero(np.diff(both) > 1)
        bounds = np.concatenate([[-1], edges, [len(both) - 1]])
        return np.diff(bounds)


def still_record(
    log: ImuSource,
    window: tuple[float, float] | None = None,
    gyro_range: float | None = None,
    accel_range: float | None = None,
    *,
    despike: bool = False,
) -> StillRecord:
    """Return the clean segments of a log, or of a window (s) of it.

    gyro_range rad/s and accel_range m/s^2: samples at or past them are clipped. despike: spikes
    are interpolated; else those that dominate a second split the log.

    Raises LogError when the window has too few samples or no segment of MIN_SAMPLES remains.
    """
    span = _span(log, window)
    n = span.stop - span.start
    statistics = scan(log, span, gyro_range, accel_range)
    spikes, cleaned, zeros = find_spikes(log, span, statistics)
    removed, split = _spike_flags(statistics, spikes, n, despike=despike)
    gap = _gaps(statistics.missing)
    copied = find_copies(log, span, statistics)
    disturbed = gap | statistics.clipped | split
    moving, turning = find_motion(cleaned, n, disturbed)
    causes = {
        "gaps": gap,
        "clipped samples": statistics.clipped,
        "spikes": split,
        "repeated samples": copied,
        "motion": moving | turning,
    }
    excluded = disturbed | copied | moving | turning
    segments = _segments(excluded, span)
    reasons = _reasons(log, span, causes)
    if not segments:
        raise LogError(
            log.path,
            f"no still segment of {MIN_SAMPLES} samples; excluded: {', '.join(reasons)}. "
            "Record the IMU at rest or choose another window",
            code="no-still-record",
        )
    used = sum(s.stop - s.start for s in segments)
    inside = _inside(segments, span)
    found = (
        *_spike_findings(log, span, spikes, zeros, removed, split),
        *_copy_findings(log, span, copied),
        *_used_finding(log, segments, reasons, used / n),
    )
    return StillRecord(
        segments,
        used / n,
        {name: span.start + np.flatnonzero(flags & inside) for name, flags in removed.items()},
        span.start + np.flatnonzero(statistics.missing & inside),
        found,
    )


def _span(log: ImuSource, window: tuple[float, float] | None) -> slice:
    span = log.between(*window) if window else slice(0, log.samples)
    n = span.stop - span.start
    if n < MIN_SAMPLES:
        where = f"from {format_span(*window)}" if window else "in the log"
        there = (float(log.time[0]), float(log.time[-1]))
        hint = epoch_clock_hint(window, there) if window else ""
        raise LogError(
            log.path,
            f"{n} samples {where}, which spans {format_span(*there)}{hint}; an Allan "
            f"deviation needs {MIN_SAMPLES} or more",
        )
    return span


def _spike_flags(
    statistics: BlockStatistics, spikes: Mapping[str, Spikes], n: int, *, despike: bool
) -> tuple[dict[str, Flags], Flags]:
    """Return the flags (n,) of spikes to interpolate, by axis, and of those that split the log."""
    split = np.zeros(n, dtype=bool)
    removed: dict[str, Flags] = {}
    quiet = quiet_levels(statistics, np.ones(statistics.blocks, dtype=bool))
    for name, found in spikes.items():
        flags = np.zeros(n, dtype=bool)
        flags[found.samples] = True
        if despike:
            removed[name] = flags
            continue
        k = AXES.index(name)
        shakes = np.sqrt(statistics.square[k]) > SHAKING * quiet[k] + 1e-12
        inside = found.samples[shakes[found.samples // statistics.size]]
        split[inside] = True
    return removed, split


def _gaps(missing: Flags) -> Flags:
    """Flag the samples lost in gaps that are too long, or in all when too many are lost."""
    if missing.mean() > _MAX_INTERPOLATED:
        return missing
    result = np.zeros(len(missing), dtype=bool)
    for first, last in runs(missing):
        result[first:last] = last - first > _MAX_GAP
    return result


def _segments(excluded: Flags, span: slice) -> tuple[slice, ...]:
    """Return the runs without a flag that are long enough, the longest ones in order."""
    found = runs(~excluded)
    lengths = found[:, 1] - found[:, 0]
    order = np.argsort(-lengths, kind="stable")[:_MAX_SEGMENTS]
    kept = found[np.sort(order[lengths[order] >= MIN_SAMPLES])]
    return tuple(slice(span.start + int(a), span.start + int(b)) for a, b in kept)


def _inside(segments: tuple[slice, ...], span: slice) -> Flags:
    inside = np.zeros(span.stop - span.start, dtype=bool)
    for segment in segments:
        inside[segment.start - span.start : segment.stop - span.start] = True
    return inside


def _time(log: ImuSource, sample: int) -> float:
    return float(log.times(slice(sample, sample + 1))[0])


def _reasons(log: ImuSource, span: slice, causes: Mapping[str, Flags]) -> list[str]:
    found = []
    for cause, flags in causes.items():
        if flags.any():
            at = show_time(_time(log, span.start + int(np.argmax(flags))))
            found.append(f"{cause} ({int(flags.sum())} samples, first at {at} s)")
    return found


def _used_finding(
    log: ImuSource, segments: tuple[slice, ...], reasons: list[str], share: float
) -> tuple[Finding, ...]:
    """Return the finding about excluded samples: how much of the log is used."""
    if not reasons:
        return ()
    start, end = _time(log, segments[0].start), _time(log, segments[-1].stop - 1)
    seconds = sum(s.stop - s.start for s in segments) * log.interval
    count = len(segments)
    pooled = f", {count} segments whose squares are pooled" if count > 1 else ""
    text = (
        f"{log.path}: {', '.join(reasons)} excluded. {seconds:.6g} s ({100.0 * share:.1f} %) from "
        f"{format_span(start, end)} are used{pooled}"
    )
    where = format_span(start, end)
    return (Finding("excluded-samples", text, "warning", where, 100.0 * share, 100.0, "%"),)


def _copy_findings(log: ImuSource, span: slice, copied: Flags) -> tuple[Finding, ...]:
    count = int(copied.sum())
    if not count:
        return ()
    at = show_time(_time(log, span.start + int(np.argmax(copied))))
    text = (
        f"{log.path}: {count} rows repeat earlier rows in all readings, the first at {at} s. They "
        "are excluded; check the logger"
    )
    return (Finding("copied-rows", text, "warning", f"{at} s", float(count), 0.0),)


def _spike_findings(
    log: ImuSource,
    span: slice,
    spikes: Mapping[str, Spikes],
    zeros: Flags,
    removed: Mapping[str, Flags],
    split: Flags,
) -> tuple[Finding, ...]:
    """Return a finding for the spikes of each axis, and one for rows of zeros."""
    found: list[Finding] = []
    if zeros.any():
        count = int(zeros.sum())
        at = show_time(_time(log, span.start + int(np.argmax(zeros))))
        text = (
            f"{log.path}: {count} row{'s' * (count > 1)} of zeros, first at {at} s; check the "
            "logger"
        )
        found.append(Finding("zero-rows", text, "warning", f"{at} s", float(count), 0.0))
    for name, spike in spikes.items():
        if zeros[spike.samples].all():
            continue
        found.append(_spike_finding(log, span, name, spike, removed.get(name), split))
    return tuple(found)


def _spike_finding(
    log: ImuSource, span: slice, name: str, spike: Spikes, removed: Flags | None, split: Flags
) -> Finding:
    count, largest = len(spike.samples), int(np.argmax(np.abs(spike.sigmas)))
    at = show_time(_time(log, span.start + int(spike.samples[largest])))
    unit, size = ("deg/s", DEG) if name.startswith("gyro") else ("m/s^2", 1.0)
    value = spike.sigmas[largest] * spike.sigma / size
    kept = spike.sigmas[~split[spike.samples]]
    rise = float(np.sqrt(1.0 + kept @ kept / (span.stop - span.start)) - 1.0)
    if removed is not None:
        reaction = "It is interpolated" if count == 1 else "They are interpolated"
    elif rise > 1e-3:
        reaction = f"They increase the white noise by {100.0 * rise:.2g} %; remove them"
    else:
        reaction = "The largest split the log; remove them"
    text = (
        f"{log.path}: {name}: {count} spike{'s' * (count > 1)}, the largest {value:.3g} {unit} "
        f"({abs(spike.sigmas[largest]):.0f} sigma) at {at} s. {reaction}"
    )
    return Finding("spikes", text, "warning", f"{name}, {at} s", float(count), 0.0)
