"""Test whether one bias and one straight line explain the log of a calibration.

Each segment is cut into parts of five seconds and more, whose means have the covariance of the
noise figures. Chi-squared of the residuals on all parts tests the fit of each gyro; one column
more (time, square of the rate) tests a cause. Limits have a false-alarm rate of 0.1 % for the
three gyros together.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.logs.record import TableLog
from rotcli.models.mean_covariance import GlsFit, fit_gls
from rotcli.models.numerics.chi_squared import upper_limit
from rotcli.models.numerics.triangular import solve_triangular
from rotcli.run.consistency.blocks import EarthHarmonics, SegmentBlocks
from rotcli.run.consistency.harmonics import Harmonics
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.run.findings import Finding
from rotcli.run.motion import EncoderNoise
from rotcli.run.segments import segment_eccentricity
from rotcli.run.table_angle import angle_at
from rotcli.units import DEG_PER_HOUR, PPM, FloatArray, show_time

FALSE_ALARM = 1e-3  # probability that a test warns of a clean log, all three gyros together
_MIN_PART = 5.0  # s: shorter parts add white noise, not knowledge of slow changes
_MAX_PARTS = 12  # parts of a segment: a step in the middle of one is found with 0.9 of its size
_MAX_ALL_PARTS = 600  # parts in all: their covariance is dense
_SAME_RATE = (
    0.02  # of the largest rate: parts of one segment differ by less, rates of a test by more
)
# of the rate: parts of one segment, whose rates the encoder scatters
_ONE_RATE = 2e-3
_EXPLAINED = 0.5  # of chi-squared above its mean: a column that explains more is named
_DRIFT_PREFERENCE = 0.9  # of the share of the best of many steps, which fits others nearly as well


@dataclass(frozen=True)
class GyroTest:
    """Test of one gyro: chi-squared, degrees of freedom, limit; factor for its sigmas.

    shift: by how much the drift or step that explains the contradiction moves the scale factor or
    installation error (fraction), the bias at the end of the log and its mean over the log (rad/s).
    """

    chi2: float
    dof: int
    limit: float
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def contradicted(self) -> bool:
        """Whether the data contradict the noise figures or the model."""
        return self.chi2 > self.limit

    @property
    def sigma_factor(self) -> float:
        """Factor of all sigmas, 1 where the data agree."""
        return float(np.sqrt(self.chi2 / self.dof)) if self.contradicted else 1.0


@dataclass(frozen=True, eq=False)
class FitTest:
    """Tests of the three gyros, the findings, and the times (s) of bias steps that explain them.

    harmonics: sines of the table angle in the residuals; None where the log does not show them.
    """

    gyros: tuple[GyroTest, ...]
    findings: tuple[Finding, ...]
    steps: tuple[float, ...] = ()
    harmonics: Harmonics | None = None

    @property
    def sigma_factor(self) -> FloatArray:
        """Factors (3,) of the sigmas of the gyros."""
        return np.array([test.sigma_factor for test in self.gyros])

    def enlarged(self, covariance: FloatArray) -> FloatArray:
        """Return a covariance (6, 6) of axis column and biases that contains the contradictions.

        Sigmas are multiplied by the factors; the shift by a drift or step is added, because a
        drift that resembles a scale factor error leaves small residuals.
        """
        factor = np.tile(self.sigma_factor, 2)
        result = covariance * np.outer(factor, factor)
        for i, test in enumerate(self.gyros):
            pair = np.ix_([i, 3 + i], [i, 3 + i])
            result[pair] += np.outer(test.shift[:2], test.shift[:2])
        return np.asarray(result)

    def enlarged_own(self, sigma: FloatArray) -> FloatArray:
        """Return the sigmas (3,) of the biases over the log itself, enlarged in the same manner."""
        return np.hypot(sigma * self.sigma_factor, [test.shift[2] for test in self.gyros])


_NO_SHIFT = (0.0, 0.0, 0.0)


def chi2_limit(dof: int, false_alarm: float = FALSE_ALARM) -> float:
    """Return the limit of chi-squared of one of three gyros; false_alarm: of all three together."""
    return upper_limit(dof, false_alarm / 3.0)


def part_means(
    segments: Sequence[SegmentBlocks],
    table: TableLog,
    earth: EarthHarmonics,
    u: FloatArray,
    encoder: EncoderNoise,
    harmonics: FloatArray | None = None,
) -> SegmentMeans:
    """Return the means of the parts of all segments, rates from the angles at their edges.

    harmonics: (4, 3) residual cos, sin, cos 2, sin 2 of the table angle, rad/s, to be removed.
    """
    most = max(2, min(_MAX_PARTS, _MAX_ALL_PARTS // len(segments)))
    rows: list[tuple[FloatArray, ...]] = []
    encoders = []
    for blocks in segments:
        count = int(np.clip(blocks.duration // _MIN_PART, 1, most))
        first = np.linspace(0, len(blocks.counts), count + 1).astype(np.int64)

        average = partial(_part_average, counts=blocks.counts, first=first)
        edges = blocks.inner_edges[first]
        rate, variance = np.zeros(count), np.zeros((count, count))
        if blocks.segment.rate:
            inside = np.clip(edges, table.time[0], table.time[-1])
            tau = np.diff(inside)
            angle = angle_at(table, inside)
            eccentricity = segment_eccentricity(table, blocks.segment)
            if eccentricity is not None:  # it averages out over full turns, not over parts
                angle = angle - eccentricity.at(angle)
            rate = np.diff(angle) / tau
            sigma = np.hypot(encoder.sigma, encoder.time_sigma * blocks.segment.rate)
            D = (np.eye(count + 1)[1:] - np.eye(count + 1)[:-1]) / tau[:, None]
            variance = sigma**2 * D @ D.T
        rows.append((edges[:-1], edges[1:], rate))
        c, s = blocks.cos, blocks.sin
        z = average(blocks.gyro) - earth.at(average(c), average(s))
        if harmonics is not None and blocks.segment.rate:
            z = z - average(np.column_stack([c, s, c**2 - s**2, 2.0 * c * s])) @ harmonics
        rows[-1] = (*rows[-1], z - np.outer(rate, u))
        encoders.append(variance)
    start, end, rate, z = (np.concatenate(column) for column in zip(*rows, strict=True))
    covariance = np.zeros((len(rate), len(rate)))
    at = 0
    for variance in encoders:
        span = slice(at, at + len(variance))
        covariance[span, span] = variance
        at = span.stop
    return SegmentMeans(start, end, z, rate, covariance)


def _part_average(values: FloatArray, counts: FloatArray, first: NDArray[np.int64]) -> FloatArray:
    """Return the means over parts of block means (k, ...); first: blocks at which parts begin."""
    total = np.add.reduceat(values.T * counts, first[:-1], axis=-1)
    return np.asarray((total / np.add.reduceat(counts, first[:-1])).T)


def check_fit(
    path: str,
    parts: SegmentMeans,
    noise: TriadNoise,
    u: FloatArray,
    *,
    flicker: FloatArray,
    judged: bool,
    scaled: bool = True,
    false_alarm: float = FALSE_ALARM,
) -> FitTest:
    """Test the fit of the three gyros on the parts.

    flicker: (3,) rad/s, bias instability of the rig, for the text. judged: whether the noise
    figures of the rig are known, so that the data can contradict them. scaled: whether the caller
    multiplies its sigmas, for the text. false_alarm: probability, of the three gyros together.
    """
    tests, findings, steps = [], [], []
    single = np.ptp(parts.rate) <= _ONE_RATE * np.abs(parts.rate).max()
    design = parts.design[:, 1:] if single else parts.design  # one rate: no scale factor
    for i, axis in enumerate("xyz"):
        S = noise.covariance(parts, i, u)
        dof = len(parts.rate) - design.shape[1]
        if dof < 1 or not judged or not np.all(np.diag(S) > 0.0):
            tests.append(GyroTest(0.0, 0, np.inf))
            continue
        fit = fit_gls(design, parts.z[:, i], S)
        test = GyroTest(fit.chi2, fit.dof, chi2_limit(fit.dof, false_alarm))
        if test.contradicted:
            cause, step, shift = _cause(parts, fit, test, float(flicker[i]))
            test = replace(test, shift=shift)
            steps += step
            text = (
                f"{path}: gyro_{axis}: {cause} (chi-squared {test.chi2:.4g}, limit "
                f"{test.limit:.4g})"
            )
            if scaled:
                text += f"; its sigmas are multiplied by {test.sigma_factor:.3g}"
                text += " and contain this" if any(test.shift) else ""
            findings.append(
                Finding("fit-contradicted", text, "warning", f"gyro_{axis}", test.chi2, test.limit)
            )
        tests.append(test)
    return FitTest(tuple(tests), tuple(findings), tuple(steps))


def _cause(
    parts: SegmentMeans, fit: GlsFit, test: GyroTest, flicker: float
) -> tuple[str, list[float], tuple[float, float, float]]:
    """Return the cause that explains the residuals of a fit best.

    In words, with the time (s) of a step, and the shift of the estimates as in `GyroTest`.
    """
    middle = 0.5 * (parts.start + parts.end)
    time = (middle - middle.mean()) / max(float(np.ptp(middle)), 1e-9)
    count = len(parts.rate)
    steps = (np.arange(count)[:, None] >= np.arange(1, count)).astype(float)
    largest = float(np.abs(parts.rate).max()) or 1.0
    curve = np.column_stack([parts.rate * np.abs(parts.rate), parts.rate**2]) / largest**2
    gain, size = _explained(fit, np.column_stack([time, steps, curve]))
    share = gain / (test.chi2 - test.dof)
    rates = np.unique(np.round(parts.rate / (largest * _SAME_RATE)))
    curved = float(share[-2:].max()) if len(rates) > 2 else 0.0
    step = 1 + int(np.argmax(share[1:-2])) if count > 1 else 0
    rig = f" (rig: bias instability {flicker / DEG_PER_HOUR:.3g})" if flicker else ""
    if max(curved, float(share[0]), float(share[step])) < _EXPLAINED:
        text = "the segments contradict one bias and one scale factor within the noise figures"
        return text, [], _NO_SHIFT
    if curved >= _DRIFT_PREFERENCE * max(share[0], share[step]):
        ppm = float(np.abs(size[-2:]).max()) / largest / PPM
        text = f"not one straight line over the rates ({ppm:.3g} ppm): see rotcli scale"
        return text, [], _NO_SHIFT
    if share[0] >= _DRIFT_PREFERENCE * share[step]:
        drift = abs(float(size[0])) / DEG_PER_HOUR
        text = f"the bias drifts by {drift:.3g} deg/h over the segments{rig}, probably warm-up"
        return text, [], _shift(fit, time, float(size[0]))
    when = float(parts.start[step])
    change = abs(float(size[step])) / DEG_PER_HOUR
    text = f"the bias changes by {change:.3g} deg/h near {show_time(when)} s{rig}"
    return text, [when], _shift(fit, steps[:, step - 1], float(size[step]))


def _shift(fit: GlsFit, column: FloatArray, size: float) -> tuple[float, float, float]:
    """Return the shift of the estimates by a further column (k,) of a size, as in `GyroTest`."""
    white = solve_triangular(fit.factor, column, lower=True)
    along = np.linalg.lstsq(fit.whitened, white, rcond=None)[0]
    scale = float(along[0]) if len(along) > 1 else 0.0
    bias = float(along[1]) if len(along) > 1 else float(along[0])
    last, mean = float(column[-1]), float(column.mean())
    return -size * scale, size * (last - bias), size * (mean - bias)


def _explained(fit: GlsFit, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return by how much each further column (k, m) reduces chi-squared, and its coefficient."""
    white = solve_triangular(fit.factor, np.column_stack([fit.residual, columns]), lower=True)
    q, _ = np.linalg.qr(fit.whitened)
    residual, more = white[:, 0], white[:, 1:]
    more = more - q @ (q.T @ more)
    square = np.maximum(np.einsum("ij,ij->j", more, more), 1e-300)
    product = residual @ more
    usable = square > 1e-9 * np.einsum("ij,ij->j", white[:, 1:], white[:, 1:])
    gain = np.where(usable, product**2 / square, 0.0)
    return np.asarray(gain), np.asarray(product / square)
