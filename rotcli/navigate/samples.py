"""Samples of a window that no sensor measured: repeated, interpolated, frozen, or all zero.

Six readings of a sensor with noise never repeat bit for bit over several samples, and never lie
on a straight line. Runs of MIN_RUN samples count; rows of zeros count from one.
A quantised log repeats single rows by chance, with probability 7e-4 where each channel repeats in
0.3; five in a row at one distance then have 1e-16 a pair of places.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rotcli.logs.record import ImuLog
from rotcli.run.findings import Finding
from rotcli.units import FloatArray, show_span, show_time

MIN_RUN = 5  # samples
# A line between two readings has second differences of rounding; noise has this much more.
_LINE_SHARE = 1e-3
MAX_SAMPLES = 1_000_000  # of a window that is searched: 100 MB, 0.3 s
_MAX_SHOWN = 4
_MIN_NOISY = 3  # channels with noise, that a search for repeated samples makes sense
_MIN_NOISE_RATIO = 0.3  # of third to second differences
# Odd 64-bit constants of a multiplicative hash (Knuth, TAOCP 3, 6.4), one a channel.
_MULTIPLIERS = np.array(
    [
        0x9E3779B97F4A7C15,
        0xC2B2AE3D27D4EB4F,
        0x165667B19E3779F9,
        0xD6E8FEB86659FD93,
        0xA0761D6478BD642F,
        0xE7037ED1A0B428DB,
    ],
    dtype=np.uint64,
)


@dataclass
class SampleScan:
    """Collects the samples of a window, chunk by chunk, and names those that were not measured."""

    time: list[FloatArray] = field(default_factory=list)
    rows: list[NDArray[np.uint64]] = field(default_factory=list)
    line: list[NDArray[np.bool_]] = field(default_factory=list)
    zero: list[NDArray[np.bool_]] = field(default_factory=list)
    known: list[NDArray[np.bool_]] = field(default_factory=list)
    _before: FloatArray = field(default_factory=lambda: np.empty((0, 6)))
    _typical: FloatArray | None = None

    def add(self, chunk: ImuLog) -> None:
        """Take the chunk that follows."""
        values = np.concatenate([chunk.gyro, chunk.accel], axis=1)
        n = len(values)
        self.time.append(chunk.time)
        bits = np.ascontiguousarray(values).view(np.uint64).reshape(n, 6)
        with np.errstate(over="ignore"):
            self.rows.append((bits * _MULTIPLIERS).sum(axis=1, dtype=np.uint64))
        self.zero.append(np.asarray(~values.any(axis=1)))
        joined = np.concatenate([self._before, values])
        second = np.abs(joined[2:] - 2.0 * joined[1:-1] + joined[:-2])
        if self._typical is None:
            self._typical = _typical_noise(second)
        noisy = self._typical > 0.0
        straight = np.zeros(len(second), dtype=bool)
        if noisy.sum() >= _MIN_NOISY:
            straight = (second[:, noisy] <= _LINE_SHARE * self._typical[noisy]).all(axis=1)
        self.line.append(np.concatenate([np.zeros(n - len(straight), dtype=bool), straight]))
        missing = chunk.missing
        self.known.append(np.zeros(n, dtype=bool) if missing is None else np.asarray(missing))
        self._before = joined[-2:]

    def findings(self, path: str) -> list[Finding]:
        """Return what was not measured, with its times; gaps that are known do not count."""
        if not self.time:
            return []
        time = np.concatenate(self.time)
        known = np.concatenate(self.known)
        zero = np.concatenate(self.zero)
        found = []
        if zero.any():
            found.append(_finding(path, "are zero in all channels", _spans(zero, time, 1)))
        line = np.concatenate(self.line) & ~known & ~zero
        spans = _spans(line, time, MIN_RUN)
        if spans:
            found.append(_finding(path, "lie on a straight line in all channels", spans))
        noisy = 0 if self._typical is None else int((self._typical > 0.0).sum())
        if noisy >= _MIN_NOISY:
            found += self._repeated(path, time, known | zero)
        return found

    def _repeated(self, path: str, time: FloatArray, known: NDArray[np.bool_]) -> list[Finding]:
        """Return the finding of samples that repeat earlier ones bit for bit."""
        rows = np.concatenate(self.rows)
        order = np.argsort(rows, kind="stable")
        same = rows[order[1:]] == rows[order[:-1]]
        distance = np.zeros(len(rows), dtype=np.int64)
        distance[order[1:][same]] = order[1:][same] - order[:-1][same]
        distance[known] = 0
        runs = _constant_runs(distance, MIN_RUN)
        if not runs:
            return []
        texts, count = [], 0
        for start, stop in runs:
            count += stop - start
            earlier = time[start - distance[start]]
            texts.append(f"{_span(time[start], time[stop - 1])} (as from {show_time(earlier)} s)")
        return [_made(path, count, "repeat earlier ones bit for bit", texts)]


def _typical_noise(second: FloatArray) -> FloatArray:
    """Return the median second difference (6,) of channels with noise, 0 of those without.

    Of white noise the differences of second differences are 1.8 times as large, of a smooth
    signal without noise far smaller.
    """
    if len(second) < 2 * MIN_RUN:
        return np.zeros(6)
    typical = np.median(second, axis=0)
    third = np.median(np.abs(np.diff(second, axis=0)), axis=0)
    return np.where(third > _MIN_NOISE_RATIO * typical, typical, 0.0)


def _spans(flags: NDArray[np.bool_], time: FloatArray, least: int) -> list[tuple[int, str]]:
    """Return length and times of the runs of at least `least` flagged samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [
        (int(stop - start), _span(time[start], time[stop - 1]))
        for start, stop in zip(edges[::2], edges[1::2], strict=True)
        if stop - start >= least
    ]


def _constant_runs(values: NDArray[np.int64], least: int) -> list[tuple[int, int]]:
    """Return start and stop of the runs of one value other than 0, of at least `least` samples."""
    changes = np.flatnonzero(np.diff(values)) + 1
    edges = np.concatenate([[0], changes, [len(values)]])
    return [
        (int(start), int(stop))
        for start, stop in pairwise(edges)
        if values[start] and stop - start >= least
    ]


def _span(start: float, end: float) -> str:
    return f"{show_time(start)} s" if start == end else show_span(start, end)


def _finding(path: str, what: str, spans: list[tuple[int, str]]) -> Finding:
    return _made(path, sum(count for count, _ in spans), what, [text for _, text in spans])


def _made(path: str, count: int, what: str, spans: list[str]) -> Finding:
    """Return the finding of samples that were not measured."""
    shown = ", ".join(spans[:_MAX_SHOWN]) + (", …" if len(spans) > _MAX_SHOWN else "")
    noun = "sample" if count == 1 else "samples"
    verb = what if count > 1 else what.replace("are ", "is ", 1).replace("lie", "lies", 1)
    text = (
        f"{path}: {count} {noun} of the window {verb}: {shown}. They were not measured; check the "
        "logger or exclude this part"
    )
    return Finding("samples-not-measured", text, where="imu", value=float(count), limit=0.0)
