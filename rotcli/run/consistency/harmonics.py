"""Test the residuals of turning segments for sines and cosines of the table angle.

The Earth rate appears in a turning gyro as a sine of the table angle; a wrong azimuth, a flipped or
swapped gyro, or sensitivity to gravity leave one in the residuals, once or twice per turn.
"""

from collections.abc import Sequence

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.base import FixedBase
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.numerics.chi_squared import upper_limit
from rotcli.models.rotation import axis_rotation
from rotcli.run.consistency.blocks import EarthHarmonics, SegmentBlocks
from rotcli.run.findings import Finding
from rotcli.units import DEG, DEG_PER_HOUR, FloatArray

FALSE_ALARM = 1e-3  # probability that the test warns of a clean log
_MIN_TURNS = 0.9  # turns: fewer do not separate a sine from a bias
_TREND_TURNS = 2.0  # turns, from which on a curved drift is separated as well
_MIN_BLOCKS_ONCE, _MIN_BLOCKS_TWICE = 2.5, 6.0  # blocks per turn that show once and twice
_AZIMUTH_STEP = 0.5 * DEG  # rad, of the search
_MIN_TILT = 1e-9  # of the Earth rate: an axis parallel to it shows no azimuth


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Residual coefficients (4, 3), rad/s: cos, sin, cos 2, sin 2 of the table angle; sigma.

    Sigma is infinite where the blocks are too long to show twice per turn.
    """

    value: FloatArray
    sigma: FloatArray

    @property
    def chi2(self) -> float:
        """Sum of the squares over their sigmas: `dof` degrees of freedom."""
        return float(np.sum((self.value / self.sigma) ** 2))

    @property
    def dof(self) -> int:
        """Number of coefficients that the segments determine."""
        return int(np.count_nonzero(np.isfinite(self.sigma)))

    @property
    def limit(self) -> float:
        """Return the limit of chi-squared, with a false-alarm rate of FALSE_ALARM."""
        return upper_limit(self.dof, FALSE_ALARM)

    def without(self, change: FloatArray) -> float:
        """Return chi-squared after subtracting a change (2, 3) of the first harmonic."""
        rest = self.value.copy()
        rest[:2] -= change
        return float(np.sum((rest / self.sigma) ** 2))


def residual_harmonics(
    segments: Sequence[SegmentBlocks],
    earth: EarthHarmonics,
    white: FloatArray,
    slow: Sequence[SlowNoise],
    steps: Sequence[float] = (),
) -> Harmonics | None:
    """Return the harmonics in the residuals of the turning segments; None without enough turns.

    steps: s, times of bias steps, which are fitted as well.
    """
    weights, total = np.zeros((4, 3)), np.zeros((4, 3))
    for blocks in segments:
        rate = abs(blocks.segment.rate)
        turns = rate * blocks.duration / (2.0 * np.pi)
        per_turn = 2.0 * np.pi / (rate * blocks.size * blocks.interval) if rate else 0.0
        if turns < _MIN_TURNS or per_turn < _MIN_BLOCKS_ONCE:
            continue
        orders = 2 if per_turn >= _MIN_BLOCKS_TWICE else 1
        value, normal = _coefficients(blocks, earth, orders, steps)
        frequency = rate / (2.0 * np.pi)
        density = np.array(
            [[_density(white[i], slow[i], n * frequency) for i in range(3)] for n in (1, 1, 2, 2)]
        )
        # Slow noise of periods longer than the segment leaks into the sines: more in few turns.
        variance = density * normal[:, None] * (1.0 + 1.0 / turns)
        if not variance.all():  # a simulation without noise
            return None
        weights += 1.0 / variance
        total += value / variance
    if not weights.any() or not np.all(np.isfinite(weights)):
        return None
    with np.errstate(divide="ignore"):
        sigma = 1.0 / np.sqrt(weights)
    return Harmonics(total / np.where(weights, weights, 1.0), sigma)


def _density(white: float, slow: SlowNoise, frequency: float) -> float:
    """Return the two-sided power spectral density, (rad/s)^2/Hz, at a frequency (Hz)."""
    w = 2.0 * np.pi * frequency
    flicker = slow.bias_instability**2 / w
    walk = (slow.rate_random_walk / w) ** 2
    T = slow.markov_time
    markov = 2.0 * slow.markov_sigma**2 * T / (1.0 + (w * T) ** 2)
    return float(white**2 + flicker + walk + markov)


def _coefficients(
    blocks: SegmentBlocks, earth: EarthHarmonics, orders: int, steps: Sequence[float]
) -> tuple[FloatArray, FloatArray]:
    """Return coefficients (4, 3) of a segment, and their variance (4,) for white noise of 1.

    orders: 2, or 1 for once per turn alone; the variance of the others is infinite.
    """
    z = blocks.gyro - earth.at(blocks.cos, blocks.sin)
    cos2, sin2 = blocks.cos**2 - blocks.sin**2, 2.0 * blocks.cos * blocks.sin
    time = np.linspace(-1.0, 1.0, len(z))
    trend = [np.ones_like(time)]
    if abs(blocks.segment.rate) * blocks.duration > 2.0 * np.pi * _TREND_TURNS:
        trend += [time, time**2]
    middle = 0.5 * (blocks.edges[1:] + blocks.edges[:-1])
    later = [(middle > step).astype(float) for step in steps]
    trend += [column for column in later if 0.0 < column.mean() < 1.0]
    sines = [blocks.cos, blocks.sin, cos2, sin2][: 2 * orders]
    design = np.column_stack([*sines, *trend])
    root = np.sqrt(blocks.counts)[:, None]
    scaled = root * design
    inverse = np.linalg.inv(scaled.T @ scaled)
    solution = inverse @ (scaled.T @ (root * z))
    value, variance, k = np.zeros((4, 3)), np.full(4, np.inf), 2 * orders
    value[:k], variance[:k] = solution[:k], np.diag(inverse)[:k] / blocks.interval
    return value, variance


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
    if lowest <= limit:
        return text
    return "sensitivity to gravity, or a wrong [attitude]"


def _turned(base: FixedBase, u: FloatArray, turn: float) -> FloatArray:
    """Return the Earth harmonics (2, 3) of the base with its azimuth increased by `turn` (rad)."""
    C_nb = axis_rotation(np.array([0.0, 0.0, -1.0]), turn) @ base.C_nb
    earth = EarthHarmonics.of(FixedBase(base.latitude, base.gravity, C_nb), u)
    return np.array([earth.cosine, earth.sine])
