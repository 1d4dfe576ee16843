"""Segments are pooled: against plain sums over second differences, and by simulation."""

import numpy as np
import pytest

from rotcli.allan.deviation import averaging_factors, overlapping_variance, phase_from_rate
from rotcli.allan.pooled import (
    interpolation_gain,
    pooled_freedom,
    pooled_second_difference,
    pooled_variance,
)

LENGTHS = (900, 300, 2400)
FACTORS = np.array([1, 2, 5, 40, 149, 150, 151, 700])


def segments(rng, lengths=LENGTHS):
    return [phase_from_rate(rng.standard_normal(n) + k, 0.1) for k, n in enumerate(lengths)]


def test_the_pooled_variance_is_the_mean_square_of_all_second_differences():
    phases = segments(np.random.default_rng(1))
    for m, variance, mean in zip(
        FACTORS,
        pooled_variance(phases, FACTORS, 0.1),
        pooled_second_difference(phases, FACTORS),
        strict=True,
    ):
        every = np.concatenate([p[2 * m :] - 2 * p[m:-m] + p[: -2 * m] for p in phases])
        # Sums of some thousand terms: rounding.
        assert variance == pytest.approx(np.mean(every**2) / (2 * (m * 0.1) ** 2), rel=1e-10)
        assert mean == pytest.approx(every.mean(), rel=1e-7, abs=1e-10)


def test_one_segment_is_not_touched():
    phase = phase_from_rate(np.random.default_rng(2).standard_normal(500), 0.1)
    factors = averaging_factors(500, None, 0.1)
    direct = overlapping_variance(phase, factors, 0.1)
    assert np.array_equal(pooled_variance([phase], factors, 0.1), direct)


def test_a_step_between_segments_does_not_matter():
    rng = np.random.default_rng(3)
    rates = [rng.standard_normal(800) for _ in range(3)]
    plain = pooled_variance([phase_from_rate(r, 0.1) for r in rates], FACTORS[:5], 0.1)
    moved = [phase_from_rate(r + 1e3 * k, 0.1) for k, r in enumerate(rates)]
    assert pooled_variance(moved, FACTORS[:5], 0.1) == pytest.approx(plain, rel=1e-9)


@pytest.mark.parametrize("m", [5, 40, 120])
def test_the_pooled_freedom_is_that_of_simulated_variances(m):
    """2 mean^2 / variance over 600 records of white noise."""
    rng = np.random.default_rng(m)
    factors = np.array([m])
    values = [pooled_variance(segments(rng), factors, 0.1)[0] for _ in range(600)]
    simulated = 2.0 * np.mean(values) ** 2 / np.var(values)
    expected = pooled_freedom("oadev", 0, m, tuple(n + 1 for n in LENGTHS))
    # The variance of 600 values is known to 6 %.
    assert simulated == pytest.approx(expected, rel=0.2)
    assert np.mean(values) == pytest.approx(1.0 / m, rel=4 * np.sqrt(2 / expected / 600))


def test_other_estimators_use_the_longest_segment():
    one = pooled_freedom("mdev", 0, 10, (2401,))
    assert pooled_freedom("mdev", 0, 10, (901, 301, 2401)) == one


@pytest.mark.parametrize("gap", [1, 2, 5])
def test_the_gain_of_interpolation_is_that_of_simulated_gaps(gap):
    rng = np.random.default_rng(gap)
    n, spacing = 240_000, 20 * gap
    starts = np.arange(spacing, n - spacing, spacing)
    lost = (starts[:, None] + np.arange(gap)).ravel()
    there = np.setdiff1d(np.arange(n), lost)
    factors = np.array([1, 2, 3, 5, 10, 30, 100, 400])
    ratio = []
    for _ in range(12):
        rate = rng.standard_normal(n)
        holed = rate.copy()
        holed[lost] = np.interp(lost, there, rate[there])
        pair = [overlapping_variance(phase_from_rate(r, 1.0), factors, 1.0) for r in (holed, rate)]
        ratio.append(pair[0] / pair[1])
    expected = interpolation_gain(factors, np.full(len(starts), gap), n)
    spread = np.std(ratio, axis=0) / np.sqrt(len(ratio))
    assert np.all(np.abs(np.mean(ratio, axis=0) - expected) < 5 * spread + 2e-4)


def test_one_lost_sample_adds_one_and_a_half_to_long_clusters():
    gain = interpolation_gain(np.array([1, 100_000]), np.array([1]), 1000)
    assert gain - 1.0 == pytest.approx([-1.5e-3, 1.5e-3], rel=0.02)
    gap = interpolation_gain(np.array([100_000]), np.array([5]), 1000)
    # g + g^2/2, the ends of a cluster of 200 left out.
    assert gap - 1.0 == pytest.approx([17.5e-3], rel=0.1)
