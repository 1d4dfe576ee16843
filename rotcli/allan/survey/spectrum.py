"""Find what else is in a still log: low-pass filters, repeated samples, spectral lines.

A power spectral density of segments with a Hann window (Welch, IEEE Trans. Audio 15, 1967), one
axis at a time. White noise that passed a filter has a smaller Allan variance at short cluster
times: the measured shape of the density gives the factor at each of them. A sinusoid of amplitude A
and frequency f adds `A^2 sin^4(pi f tau) / (pi f tau)^2` (IEEE Std 952, C.1.1.6).
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rotcli.allan.survey.interpolated import interpolated_shape, source_rate
from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

Factors = NDArray[np.int64]

_MIN_SEGMENTS = 16  # of a density: each bin then has a relative sigma of 0.25
_MAX_SEGMENT = 1 << 16  # samples: resolves 1.5 mHz at 100 Hz
_MIN_SAMPLES = 4096  # fewer give no density worth a decision
_CHUNK_SEGMENTS = 4  # segments transformed together: 2 MB, which stay in the cache
_FIRST_BIN = 3  # the lowest bins contain the mean and its leakage
_BINS_PER_DECADE = 20
# Density near the highest frequency over that at a fifth of it. White noise has 1, a second-order
# filter at 0.6 of the highest frequency 0.15; 100 bins of 16 segments scatter by 0.03.
_MAX_TOP_RATIO = 0.7
# A line exceeds the median of its neighbours by a factor that white noise exceeds in 1e-4 of the
# logs: chi-squared of 2 x 16 degrees of freedom over 32768 bins.
_LINE_RATIO = 4.5
_NEIGHBOURS = 25  # bins on each side, whose median is the level of a line
_MIN_LEFT_NEIGHBOURS = 4  # bins below the lowest line
_LINE_WIDTH = 2  # bins on each side that a Hann window spreads a line over
_MAX_LINES = 8
# Share of changes of a reading that occur at one phase of a repetition; chance gives 1/repeats.
_MIN_REPEATED_SHARE = 0.95
_MAX_REPEATS = 1000
# Of the variance: a stronger line has second differences of one phase, as interpolation has.
_MAX_LINE_POWER = 0.1
# Below this share of its white noise a cluster time is left out: the factor is known to a tenth of
# its deviation from 1, and the rest is below the sigma of the coefficient.
MIN_WHITE_SHARE = 0.95


@dataclass(frozen=True)
class Line:
    """A sinusoid: frequency (Hz) and amplitude (unit of the readings)."""

    frequency: float
    amplitude: float

    def variance(self, tau: FloatArray) -> FloatArray:
        """Return its Allan variance at cluster times tau (k,), s."""
        x = math.pi * self.frequency * tau
        result: FloatArray = self.amplitude**2 * np.sin(x) ** 4 / x**2
        return result

    def envelope(self, tau: FloatArray) -> FloatArray:
        """Return the largest Allan variance that its phase allows at cluster times (k,), s."""
        x = math.pi * self.frequency * tau
        result: FloatArray = self.amplitude**2 * np.minimum(x**2, x**-2)
        return result


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectral density (k,) at frequencies (k,), Hz, and what it shows.

    density: without lines; measured: with them. cutoff: Hz, where a low-pass filter has halved
    the density; repeats: how often each reading is repeated; plateau: density of the white noise
    before the filter. source_rate: Hz, of readings that were interpolated to the rate of the log.
    """

    frequency: FloatArray
    density: FloatArray
    measured: FloatArray
    lines: tuple[Line, ...] = ()
    cutoff: float | None = None
    plateau: float | None = None
    repeats: int = 1
    source_rate: float | None = None

    def white_share(self, factors: Factors, interval: float) -> FloatArray:
        """Return the share of the white noise's Allan variance (k,) that the filter passes.

        The Allan variance of samples is the integral of the density times
        `2 sin^4(pi f m dt) / (m sin(pi f dt))^2`.
        """
        if self.cutoff is None or self.plateau is None:
            return np.ones(len(factors))
        fine = np.linspace(0.0, 0.5 / interval, 8 * len(self.frequency) + 1)[1:]
        if self.source_rate is not None:
            shape = interpolated_shape(fine, self.source_rate, interval)
        else:
            smooth = np.convolve(self.density, np.ones(5) / 5.0, mode="same")
            shape = np.interp(fine, self.frequency, smooth / self.plateau)
            shape = np.where(fine < self.cutoff / 3.0, 1.0, shape)
        m = factors.astype(float)[:, None]
        kernel = np.sin(math.pi * fine * m * interval)
        kernel *= kernel  # a square of squares: a power of 4 takes five times as long
        kernel *= kernel
        kernel /= np.sin(math.pi * fine * interval) ** 2
        share: FloatArray = (kernel @ shape) / kernel.sum(axis=1)
        return share


def survey(segments: Sequence[FloatArray], interval: float) -> Spectrum | None:
    """Return the spectrum of the readings of segments, each (n,), None for too short ones."""
    readings = max(segments, key=len)
    if len(readings) < _MIN_SAMPLES:
        return None
    frequency, density = welch_density(segments, interval)
    lines = find_lines(frequency, density)
    clean = _without_lines(frequency, density, lines)
    cutoff, plateau = find_cutoff(frequency, clean)
    count, rate = repeats(readings), None
    quiet = sum(line.amplitude**2 for line in lines) < _MAX_LINE_POWER * float(np.var(readings))
    if cutoff is not None and count == 1 and quiet:
        rate = source_rate(readings, interval)
    if rate is not None:  # the density at multiples of the rate is zero: its edges are no lines
        lines = tuple(line for line in lines if line.frequency < 0.5 * rate)
    return Spectrum(frequency, clean, density, lines, cutoff, plateau, count, rate)


def welch_density(segments: Sequence[FloatArray], interval: float) -> tuple[FloatArray, FloatArray]:
    """Return frequencies (k,), Hz, and the one-sided density (k,), unit^2/Hz, of segments.

    Windows of the segments' readings, each (n,), overlap by half where there are fewer than 16
    without; their mean is removed. A check: white noise of N has 2 N^2.
    """
    longest = max(len(readings) for readings in segments)
    wanted = 2 * longest // (_MIN_SEGMENTS + 1)
    length = min(_MAX_SEGMENT, 1 << (wanted.bit_length() - 1))
    window = np.hanning(length + 1)[:-1]
    # Windows that overlap double the work; long records have enough without.
    step = length if longest >= _MIN_SEGMENTS * length else length // 2
    total, count = np.zeros(length // 2 + 1), 0
    for readings in segments:
        starts = np.arange(0, len(readings) - length + 1, step)
        for first in range(0, len(starts), _CHUNK_SEGMENTS):
            chunk = np.stack(
                [readings[s : s + length] for s in starts[first : first + _CHUNK_SEGMENTS]]
            )
            chunk -= chunk.mean(axis=1, keepdims=True)
            chunk *= window
            parts = np.fft.rfft(chunk, axis=1).view(float).reshape(len(chunk), -1, 2)
            total += np.einsum("ijk,ijk->j", parts, parts)
        count += len(starts)
    density = 2.0 * interval * total / (count * np.sum(window**2))
    frequency = np.fft.rfftfreq(length, interval)
    kept = slice(_FIRST_BIN, -1)
    return np.asarray(frequency, float)[kept], np.asarray(density, float)[kept]


def find_lines(frequency: FloatArray, density: FloatArray) -> tuple[Line, ...]:
    """Return the sinusoids of a density, strongest first."""
    level = _level(density)
    if level is None:
        return ()
    step = frequency[1] - frequency[0]
    rest = density.copy()
    found: list[Line] = []
    while len(found) < _MAX_LINES:
        k = int(np.argmax(rest / level))
        if rest[k] < _LINE_RATIO * level[k]:
            break
        around = slice(max(0, k - _LINE_WIDTH), k + _LINE_WIDTH + 1)
        excess = np.maximum(density[around] - level[around], 0.0)
        power = float(excess.sum() * step)
        if power <= 0.0:
            break
        centre = float((frequency[around] * excess).sum() / excess.sum())
        found.append(Line(centre, math.sqrt(2.0 * power)))
        rest[around] = 0.0
    return tuple(found)


def _level(density: FloatArray) -> FloatArray | None:
    """Return the density (k,) that the neighbours of each bin show, infinite near the ends.

    The geometric mean of the medians on both sides, so that a slope (flicker noise, a filter) does
    not look like a line.
    """
    count, gap = len(density), _LINE_WIDTH + 1
    if count < 2 * (_NEIGHBOURS + gap):
        return None
    medians = np.median(sliding_window_view(density, _NEIGHBOURS), axis=1)
    left, right = np.full(count, np.inf), np.full(count, np.inf)
    left[_NEIGHBOURS + gap - 1 :] = medians[: count - _NEIGHBOURS - gap + 1]
    right[: count - _NEIGHBOURS - gap + 1] = medians[gap : gap + count - _NEIGHBOURS - gap + 1]
    for k in range(_MIN_LEFT_NEIGHBOURS + gap - 1, _NEIGHBOURS + gap - 1):
        left[k] = np.median(density[: k - gap + 1])
    level: FloatArray = np.sqrt(left * right)
    return level


def _without_lines(
    frequency: FloatArray, density: FloatArray, lines: tuple[Line, ...]
) -> FloatArray:
    """Return the density with the lines replaced by a straight line between their neighbours."""
    inside = np.zeros(len(frequency), dtype=bool)
    for line in lines:
        k = int(np.argmin(np.abs(frequency - line.frequency)))
        inside[max(0, k - _LINE_WIDTH - 1) : k + _LINE_WIDTH + 2] = True
    if not inside.any() or inside.all():
        return density
    return np.where(inside, np.interp(frequency, frequency[~inside], density[~inside]), density)


def find_cutoff(frequency: FloatArray, density: FloatArray) -> tuple[float | None, float | None]:
    """Return the frequency (Hz) that halves the density of a low-pass filter, and the plateau.

    None, None where the density does not fall towards the highest frequency. Flicker noise and
    random walk fall too, but end on the white noise, which is flat.
    """
    highest = frequency[-1]

    def mean(low: float, high: float) -> float:
        chosen = (frequency >= low) & (frequency <= high)
        return float(density[chosen].mean()) if chosen.any() else math.nan

    if not mean(0.7 * highest, 0.97 * highest) < _MAX_TOP_RATIO * mean(
        0.1 * highest, 0.25 * highest
    ):
        return None, None
    edges = np.geomspace(frequency[0], highest, _BINS_PER_DECADE * 4 + 1)
    middles = np.sqrt(edges[1:] * edges[:-1])
    means = np.array([mean(a, b) for a, b in pairwise(edges)])
    known = np.isfinite(means)
    middles, means = middles[known], means[known]
    cutoff = highest
    plateau = math.nan
    for _ in range(60):
        plateau = mean(cutoff / 8.0, cutoff / 3.0)
        above = middles[(means >= 0.5 * plateau) & (middles <= cutoff)]
        if not math.isfinite(plateau) or not above.size:
            break
        if above[-1] >= 0.97 * cutoff:
            break
        cutoff = float(above[-1])
    return (cutoff, plateau) if math.isfinite(plateau) else (None, None)


def repeats(readings: FloatArray) -> int:
    """Return how often each reading is repeated: 10 for a 100 Hz sensor logged at 1 kHz, else 1."""
    changes = np.flatnonzero(np.diff(readings[: 200 * _MAX_REPEATS]) != 0.0)
    if len(changes) < 100:
        return 1
    count = round((changes[-1] - changes[0]) / (len(changes) - 1))
    if not 2 <= count <= _MAX_REPEATS:
        return 1
    phases = np.bincount(changes % count, minlength=count)
    return count if phases.max() >= _MIN_REPEATED_SHARE * len(changes) else 1
