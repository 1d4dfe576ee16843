"""The size of an error that the tests of a log find in half of the cases, for the profiles.

`python -m tests.campaigns.power` writes docs/evidence/power.md. The run is that of the papers: a
minute still, a minute at 30 deg/s. Readings are drawn from the noise of a profile; the size is
found by bisection over the share of draws that are found.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rotcli.files.tables.markup import to_markdown
from rotcli.files.tables.model import Column, Table
from rotcli.logs.record import Segment
from rotcli.models.base import FixedBase
from rotcli.models.mean_covariance import SlowNoise, mean_covariance
from rotcli.models.rotation import attitude_matrix
from rotcli.models.sensors import NoiseFigures
from rotcli.models.slow_noise import simulate_slow_noise
from rotcli.rig.profile import read_profile
from rotcli.run.consistency.blocks import EarthHarmonics, SegmentBlocks
from rotcli.run.consistency.goodness import check_fit
from rotcli.run.consistency.harmonics import check_harmonics, residual_harmonics
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.run.consistency.steadiness import check_steadiness
from rotcli.run.evidence.samples import SampleScan
from rotcli.units import DEG, DEG_PER_HOUR

PAGE = Path(__file__).parents[2] / "docs" / "evidence" / "power.md"
Z = np.array([0.0, 0.0, 1.0])
RATE, SECONDS = 30.0 * DEG, 60.0
PARTS, BLOCK, INTERVAL = 12, 0.25, 0.01
BASE = FixedBase(51.08 * DEG, 9.81, attitude_matrix(0.0, 0.0, 0.0))
PROFILES = ("nav440", "mti-g")


@dataclass(frozen=True)
class Noise:
    """White noise (rad/sqrt(s)) and slow noise of one gyro of a profile."""

    white: float
    slow: SlowNoise

    @classmethod
    def of(cls, profile: str) -> "Noise":
        """Return the noise of a profile."""
        figures = NoiseFigures(**read_profile(profile).gyro.noise)
        return cls(figures.white, SlowNoise.from_figures(figures))

    @property
    def triad(self) -> TriadNoise:
        """Three gyros alike."""
        return TriadNoise(np.full(3, self.white), [self.slow] * 3)


def _fit_found(noise: Noise, shape: Callable[[SegmentMeans], np.ndarray]) -> Callable:
    start = np.concatenate(
        [k * (SECONDS + 1.0) + SECONDS / PARTS * np.arange(PARTS) for k in (0, 1)]
    )
    rate = np.repeat([0.0, RATE], PARTS)
    n = len(start)
    run = SegmentMeans(start, start + SECONDS / PARTS, np.zeros((n, 3)), rate, np.zeros((n, n)))
    S = (
        mean_covariance(run.start, run.end, noise.slow)
        + np.eye(n) * noise.white**2 * PARTS / SECONDS
    )
    factor = np.linalg.cholesky(S)

    def found(size: float, seed: int) -> bool:
        z = factor @ np.random.default_rng(seed).standard_normal((n, 3))
        z[:, 0] += size * shape(run)
        drawn = SegmentMeans(run.start, run.end, z, run.rate, run.rate_covariance)
        test = check_fit("imu", drawn, noise.triad, Z, flicker=np.zeros(3), judged=True)
        return any(f.where == "gyro_x" for f in test.findings)

    return found


def _blocks(noise: Noise, seed: int, change: Callable) -> SegmentBlocks:
    """Return a turning segment with noise; change: adds an error to gyro (n, 3) at angles (n,)."""
    rng = np.random.default_rng(seed)
    n = round(SECONDS / BLOCK)
    angle = RATE * BLOCK * (np.arange(n) + 0.5)
    gyro = BASE.w_ie_s(Z, angle) + RATE * Z
    gyro = gyro + noise.white / np.sqrt(BLOCK) * rng.standard_normal((n, 3))
    slow = [simulate_slow_noise(rng, n, BLOCK, noise.slow) for _ in range(3)]
    gyro += np.stack(slow, axis=1)
    change(gyro, angle)
    sinc = np.sinc(RATE * BLOCK / (2.0 * np.pi))
    size = round(BLOCK / INTERVAL)
    segment = Segment(0.0, SECONDS, RATE, RATE * SECONDS)
    return SegmentBlocks(
        segment, 0.0, INTERVAL, size, np.full(n, float(size)), gyro, sinc * np.cos(angle),
        sinc * np.sin(angle), np.zeros(3), np.zeros(3), SampleScan(),
    )  # fmt: skip


def _sine_found(noise: Noise) -> Callable:
    def found(size: float, seed: int) -> bool:
        def add(gyro: np.ndarray, angle: np.ndarray) -> None:
            gyro[:, 0] += size * np.sin(angle)

        segment = [_blocks(noise, seed, add)]
        earth = EarthHarmonics.of(BASE, Z)
        harmonics = residual_harmonics(segment, earth, noise.triad.white, noise.triad.slow)
        return bool(check_harmonics("imu", harmonics, BASE, Z, 0.0))

    return found


def _spike_found(noise: Noise) -> Callable:
    def found(size: float, seed: int) -> bool:
        def add(gyro: np.ndarray, angle: np.ndarray) -> None:
            gyro[len(gyro) // 2, 0] += size

        return bool(check_steadiness("imu", [_blocks(noise, seed, add)]))

    return found


def size_found(found: Callable[[float, int], bool], unit: float, draws: int = 40) -> float:
    """Return the size, in `unit` of rad/s, at which half of the draws are found."""
    low, high = 0.0, 1.0
    while np.mean([found(high * unit, seed) for seed in range(draws)]) < 0.5:
        low, high = high, 2.0 * high
    for _ in range(6):
        middle = 0.5 * (low + high)
        share = np.mean([found(middle * unit, seed) for seed in range(draws)])
        low, high = (middle, high) if share < 0.5 else (low, middle)
    return 0.5 * (low + high)


def sizes(profile: str, draws: int = 40) -> list[tuple[str, float, str]]:
    """Return each test with the size that it finds in half of the draws, and its unit."""
    noise = Noise.of(profile)

    def drift(run: SegmentMeans) -> np.ndarray:
        return np.asarray(run.start / run.end[-1])

    def step(run: SegmentMeans) -> np.ndarray:
        return np.asarray((run.start >= 0.5 * SECONDS) & (run.start < SECONDS), dtype=float)

    per_hour, per_second = (DEG_PER_HOUR, "deg/h"), (DEG, "deg/s")
    tests = (
        ("fit-contradicted: drift over the run", _fit_found(noise, drift), per_hour),
        (
            "fit-contradicted: step in the middle of the still minute",
            _fit_found(noise, step),
            per_hour,
        ),
        ("residual-harmonics: sine once per turn", _sine_found(noise), per_hour),
        ("segment-disturbed: mean over 0.25 s while turning", _spike_found(noise), per_second),
    )
    return [(name, size_found(found, unit[0], draws), unit[1]) for name, found, unit in tests]


def main() -> None:
    """Compute the sizes and write the page."""
    found = [sizes(profile) for profile in PROFILES]
    columns = (Column("test"), *(Column(f"{p}", ".3g") for p in PROFILES), Column("unit"))
    rows = [(a[0], a[1], b[1], a[2]) for a, b in zip(*found, strict=True)]
    table = Table("Size that is found in half of the cases", columns, rows)
    PAGE.write_text(
        "# Power of the tests of a log\n\nComputed by `python -m tests.campaigns.power`: the run "
        "of the papers (a minute still, a minute at 30 deg/s), 40 draws of the profile's noise, "
        "bisection over the size. What the tests are is in "
        "[checks of a calibration](../explanation/calibration-checks.md).\n\n"
        + to_markdown(table)
        + "\n"
    )


if __name__ == "__main__":
    main()
