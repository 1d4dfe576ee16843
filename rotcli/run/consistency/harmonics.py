"""Test the residuals of turning segments for sines and cosines of the table angle.

The Earth rate appears in a turning gyro as a sine of the table angle; a wrong azimuth, a flipped or
swapped gyro, or sensitivity to gravity leave one in the residuals, once or twice per turn.
"""

from collections.abc import Sequence

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.base import FixedBase
from rotcli.models.mean_covariance import IntervalPairs, SlowNoise
from rotcli.models.numerics.chi_squared import upper_limit
from rotcli.models.rotation import axis_rotation
from rotcli.run.consistency.blocks import EarthHarmonics, SegmentBlocks
from rotcli.run.findings import Finding
from rotcli.units import DEG, DEG_PER_HOUR, FloatArray

FALSE_ALARM = 1e-3  # probability that the test warns of a clean log
_MIN_TURNS = 0.9  # turns: fewer do not separate a sine from a bias
_TREND_TURNS = 2.0  # turns, from which on a curved drift is separated as well
_MIN_BLOCKS_ONCE, _MIN_BLOCKS_TWICE = 2.5, 6.0  # blocks per turn that show once and twice
# Hz, where slow noise that the rig does not state is as large as white noise: that of the profiles
# is at 0.07 (NAV440) and 0.002 (MTi-G), of fibre-optic gyros below 0.01
_CORNER = 0.1
_AZIMUTH_STEP = 0.5 * DEG  # rad, of the search
# of chi-squared that a cause may leave: a tenth of the sines, by noise beyond the rig's figures
_EXPLAINED = 0.01
_MIN_TILT = 1e-9  # of the Earth rate: an axis parallel to it shows no azimuth


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Residual coefficients (4, 3), rad/s: cos, sin, cos 2, sin 2 of the table angle.

    precision: (3, 4, 4), inverse of their covariance for each gyro; zero in the rows and columns of
    twice per turn where the blocks are too long to show it.
    """

    value: FloatArray
    precision: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations (4, 3), rad/s, infinite where the blocks do not show twice."""
        known = self._known
        result = np.full((4, 3), np.inf)
        inverse = np.linalg.inv(self.precision[:, :known, :known])
        result[:known] = np.sqrt(np.einsum("ikk->ki", inverse))
        return result

    @property
    def _known(self) -> int:
        return int(np.count_nonzero(np.diagonal(self.precision[0])))

    @property
    def chi2(self) -> float:
        """Chi-squared of the coefficients, of `dof` degrees of freedom."""
        return self._chi2(self.value)

    @property
    def dof(self) -> int:
        """Number of coefficients that the segments determine."""
        return 3 * self._known

    @property
    def limit(self) -> float:
        """Return the limit of chi-squared, with a false-alarm rate of FALSE_ALARM."""
        return upper_limit(self.dof, FALSE_ALARM)

    def without(self, change: FloatArray) -> float:
        """Return chi-squared after subtracting a change (2, 3) of the first harmonic."""
        rest = self.value.copy()
        rest[:2] -= change
        return self._chi2(rest)

    def _chi2(self, value: FloatArray) -> float:
        return float(np.einsum("ki,ikl,li->", value, self.precision, value))


def residual_harmonics(
    segments: Sequence[SegmentBlocks],
    earth: EarthHarmonics,
    white: FloatArray,
    slow: Sequence[SlowNoise],
    steps: Sequence[float] = (),
    *,
    known: bool = True,
) -> Harmonics | None:
    """Return the harmonics in the residuals of the turning segments; None without enough turns.

    steps: s, times of bias steps, which are fitted as well. known: whether the slow noise is that
    of the rig; else flicker noise as large as the white noise at _CORNER is assumed.
    """
    slow = slow if known else _assumed(white)
    precision, total = np.zeros((3, 4, 4)), np.zeros((3, 4))
    for blocks in segments:
        rate = abs(blocks.segment.rate)
        turns = rate * blocks.duration / (2.0 * np.pi)
        per_turn = 2.0 * np.pi / (rate * blocks.size * blocks.interval) if rate else 0.0
        if turns < _MIN_TURNS or per_turn < _MIN_BLOCKS_ONCE:
            continue
        k = 4 if per_turn >= _MIN_BLOCKS_TWICE else 2
        found = _coefficients(blocks, earth, k, steps)
        if found is None:
            continue
        value, weights = found
        covariance = _covariance(blocks, weights, white, slow)
        if not np.all(np.einsum("ikk->ik", covariance) > 0.0):  # a simulation without noise
            return None
        inverse = np.linalg.inv(covariance)
        precision[:, :k, :k] += inverse
        total[:, :k] += np.einsum("ikl,li->ik", inverse, value)
    shown = int(np.count_nonzero(np.diagonal(precision[0])))
    if not shown or not np.all(np.isfinite(precision)):
        return None
    result = np.zeros((4, 3))
    result[:shown] = np.linalg.solve(precision[:, :shown, :shown], total[:, :shown, None])[..., 0].T
    return Harmonics(result, precision)


def _coefficients(
    blocks: SegmentBlocks, earth: EarthHarmonics, count: int, steps: Sequence[float]
) -> tuple[FloatArray, FloatArray] | None:
    """Return the first `count` coefficients (count, 3) of a segment by least squares.

    With their weights (count, n) of the n blocks of full length. The weights sum to zero, for a
    constant is fitted as well; over more than two turns they are free of a curved drift. None
    where there are fewer blocks than unknowns.
    """
    full = blocks.counts == blocks.size
    cos, sin = blocks.cos[full], blocks.sin[full]
    z = blocks.gyro[full] - earth.at(cos, sin)
    time = np.linspace(-1.0, 1.0, len(z))
    trend = [np.ones_like(time)]
    if abs(blocks.segment.rate) * blocks.duration > 2.0 * np.pi * _TREND_TURNS:
        trend += [time, time**2]
    middle = (0.5 * (blocks.edges[1:] + blocks.edges[:-1]))[full]
    later = [(middle > step).astype(float) for step in steps]
    trend += [column for column in later if 0.0 < column.mean() < 1.0]
    sines = [cos, sin, cos**2 - sin**2, 2.0 * cos * sin][:count]
    design = np.column_stack([*sines, *trend])
    if len(design) < design.shape[1]:
        return None
    weights = np.linalg.solve(design.T @ design, design.T)[:count]
    return weights @ z, weights


def _assumed(white: FloatArray) -> list[SlowNoise]:
    """Return flicker noise that equals the white noise (3,) at _CORNER."""
    B = np.sqrt(2.0 * np.pi * _CORNER) * white
    return [SlowNoise(float(b)) for b in B]


def _covariance(
    blocks: SegmentBlocks, weights: FloatArray, white: FloatArray, slow: Sequence[SlowNoise]
) -> FloatArray:
    """Return the covariance (3, m, m) of sums of n equal blocks with weights (m, n), by gyro.

    The noise of the blocks is that of `rotcli.models.mean_covariance`: that of two of them depends
    on their distance alone, so that products with its matrix are convolutions: the sums are
    those of the products of the spectra (Parseval).
    """
    n, length = weights.shape[1], blocks.size * blocks.interval
    start = length * np.arange(n, dtype=float)
    first = np.zeros(1), np.full(1, length)
    pairs = IntervalPairs(start, start + length, first, n * length)
    size = _transform_size(2 * n)
    spectrum = np.fft.rfft(weights, size).view(float)  # real and imaginary parts alternate
    result = np.empty((3, len(weights), len(weights)))
    for i, (density, noise) in enumerate(zip(white, slow, strict=True)):
        by_distance = pairs.covariance(noise)[:, 0]
        by_distance[0] += density**2 / length
        circular = np.zeros(size)
        circular[:n], circular[size - n + 1 :] = by_distance, by_distance[:0:-1]
        density_of = np.fft.rfft(circular).real
        density_of[1:-1] *= 2.0  # negative frequencies
        density_of = np.repeat(density_of, 2)
        for k, row in enumerate(spectrum):
            result[i, k] = spectrum @ (row * density_of) / size
    return result


def _transform_size(least: int) -> int:
    """Return an even size of small factors: the transform of another may take ten times as long.

    >>> [_transform_size(n) for n in (6, 17, 1_380_002)]
    [6, 20, 1572864]
    """
    return min(m << max(1, (-(-least // m) - 1).bit_length()) for m in (1, 3, 5))


def check_harmonics(
    path: str,
    harmonics: Harmonics | None,
    base: FixedBase | None,
    u: FloatArray,
    azimuth: float,
    suffix: str = "",
) -> tuple[Finding, ...]:
    """Return the finding of residuals that vary with the table angle, and their likely cause.

    azimuth: rad, of the rig. suffix: what it means for the result, added to the text.
    """
    if harmonics is None or base is None:
        return ()
    limit = harmonics.limit
    if harmonics.chi2 <= limit:
        return ()
    ratio = np.abs(harmonics.value) / harmonics.sigma
    k, i = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    order = "once" if k < 2 else "twice"
    size = float(np.hypot(*harmonics.value[(k // 2) * 2 : (k // 2) * 2 + 2, i]))
    text = (
        f"{path}: the residuals of gyro_{'xyz'[i]} vary {order} per turn of the table by "
        f"{size / DEG_PER_HOUR:.4g} deg/h ({ratio.max():.0f} sigma): "
        f"{_cause(harmonics, base, u, azimuth, limit)}{suffix}"
    )
    where = f"gyro_{'xyz'[i]}"
    return (Finding("residual-harmonics", text, "warning", where, harmonics.chi2, limit),)


def _cause(
    harmonics: Harmonics, base: FixedBase, u: FloatArray, azimuth: float, limit: float
) -> str:
    """Return the cause that makes the residuals consistent, in words."""
    earth = EarthHarmonics.of(base, u)
    now = np.array([earth.cosine, earth.sine])
    candidates = []
    turns = np.arange(-np.pi, np.pi, _AZIMUTH_STEP)
    chi2 = [harmonics.without(_turned(base, u, turn) - now) for turn in turns]
    best = float(turns[int(np.argmin(chi2))])
    turns = best + _AZIMUTH_STEP * np.linspace(-1.0, 1.0, 101)
    chi2 = [harmonics.without(_turned(base, u, turn) - now) for turn in turns]
    best = int(np.argmin(chi2))
    degrees = np.rad2deg(azimuth + turns[best])
    degrees = (degrees + 180.0) % 360.0 - 180.0
    candidates.append((chi2[best], f"[attitude] azimuth = {degrees:.1f} deg would cancel them"))
    for i, axis in enumerate("xyz"):
        flipped = now.copy()
        flipped[:, i] *= -1.0
        candidates.append((harmonics.without(flipped - now), f"gyro_{axis} has the wrong sign"))
        zero = now.copy()
        zero[:, i] = 0.0
        text = f"gyro_{axis} does not measure the Earth rate (wrong unit or scale)"
        candidates.append((harmonics.without(zero - now), text))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        swapped = now.copy()
        swapped[:, [i, j]] = now[:, [j, i]]
        text = f"gyro_{'xyz'[i]} and gyro_{'xyz'[j]} are exchanged"
        candidates.append((harmonics.without(swapped - now), text))
    lowest, text = min(candidates)
    if lowest <= max(limit, _EXPLAINED * harmonics.chi2):
        return text
    return "sensitivity to gravity, or a wrong [attitude]"


def _turned(base: FixedBase, u: FloatArray, turn: float) -> FloatArray:
    """Return the Earth harmonics (2, 3) of the base with its azimuth increased by `turn` (rad)."""
    C_nb = axis_rotation(np.array([0.0, 0.0, -1.0]), turn) @ base.C_nb
    earth = EarthHarmonics.of(FixedBase(base.latitude, base.gravity, C_nb), u)
    return np.array([earth.cosine, earth.sine])
