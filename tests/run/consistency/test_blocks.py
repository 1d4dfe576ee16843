"""Blocks of a segment against scipy's median filter and sums by hand."""

import numpy as np
import pytest
from scipy.ndimage import median_filter

from rotcli.logs.record import ImuLog, Segment, TableLog
from rotcli.models.base import FixedBase
from rotcli.models.rotation import attitude_matrix, rotate_about
from rotcli.run.consistency.blocks import (
    EarthHarmonics,
    SegmentBlocks,
    block_size,
    halves,
    reduce_segment,
)
from rotcli.run.evidence.samples import SampleScan

DEG = np.pi / 180
Z = np.array([0.0, 0.0, 1.0])


def segment_blocks(counts, gyro, rate=0.0, size=100):
    """Blocks of one second at 100 Hz from 5 s on; cosine and sine are the block's number."""
    counts = np.asarray(counts, dtype=float)
    number = np.arange(len(counts), dtype=float)
    end = 5.0 + counts.sum() / 100.0
    return SegmentBlocks(
        Segment(5.0, end, rate, rate * (end - 5.0)), 5.0, 0.01, size, counts, gyro,
        number, -number, np.zeros(3), np.zeros(3), SampleScan(),
    )  # fmt: skip


def test_deviations_are_those_from_a_running_median_of_21_blocks():
    gyro = np.random.default_rng(1).standard_normal((40, 3))
    expected = gyro - median_filter(gyro, size=(21, 1), mode="mirror")
    np.testing.assert_array_equal(segment_blocks([100] * 40, gyro).deviations, expected)
    # A last block of 60 samples is omitted; 21 blocks are enough, 20 are not.
    short = segment_blocks([100] * 40 + [60], np.vstack([gyro, [[9.0, 9.0, 9.0]]]))
    np.testing.assert_array_equal(short.deviations, expected)
    assert segment_blocks([100] * 21, gyro[:21]).deviations is not None
    assert segment_blocks([100] * 20, gyro[:20]).deviations is None


@pytest.mark.parametrize(
    ("rate", "first"),
    [
        (0.0, 15),
        (30.0 * DEG, 12),  # a turn takes 12 s: one full turn in the first half of 30 s
        (-30.0 * DEG, 12),
        (90.0 * DEG, 12),  # three turns of 4 s
        (20.0 * DEG, 15),  # a turn takes 18 s: none fits
    ],
)
def test_a_segment_is_halved_at_a_full_turn_of_the_table(rate, first):
    b = segment_blocks([100] * 30, np.arange(90.0).reshape(30, 3), rate)
    one, other = halves(b)
    assert (len(one.counts), len(other.counts)) == (first, 30 - first)
    assert (one.start, other.start) == (5.0, pytest.approx(5.0 + first))
    for name in ("gyro", "cos", "sin"):
        both = np.concatenate([getattr(one, name), getattr(other, name)])
        np.testing.assert_array_equal(both, getattr(b, name))


def test_means_are_weighted_by_the_samples():
    b = segment_blocks([100, 100, 50], np.zeros((3, 3)))
    assert b.mean(np.array([1.0, 2.0, 4.0])) == pytest.approx((1.0 + 2.0 + 0.5 * 4.0) / 2.5)
    assert (b.duration, b.end) == pytest.approx((2.5, 7.5))
    np.testing.assert_allclose(b.edges, [5.0, 6.0, 7.0, 7.5])


def run(samples=250, rate=40.0 * DEG, sampling="instant"):
    rng = np.random.default_rng(2)
    time = 0.01 * np.arange(samples)
    gyro, accel = rng.standard_normal((samples, 3)), rng.standard_normal((samples, 3)) + 9.0
    imu = ImuLog("imu.csv", time, gyro, accel, 0.01, sampling=sampling)
    angles = np.arange(-1.0, 0.01 * samples + 1.0, 0.02)
    return imu, TableLog("table.csv", angles, rate * angles, 0.02)


def test_a_reduced_segment_contains_the_means_of_its_samples():
    imu, table = run()
    b = reduce_segment(imu, table, Segment(0.0, 2.5, 40.0 * DEG, 1.0), Z, 100)
    angle = 40.0 * DEG * imu.time
    spans = [slice(0, 100), slice(100, 200), slice(200, 250)]
    np.testing.assert_array_equal(b.counts, [100, 100, 50])
    for k, span in enumerate(spans):
        np.testing.assert_allclose(b.gyro[k], imu.gyro[span].mean(axis=0), rtol=1e-12)
        assert b.cos[k] == pytest.approx(np.cos(angle[span]).mean(), rel=1e-9)
        assert b.sin[k] == pytest.approx(np.sin(angle[span]).mean(), rel=1e-9)
    squares = sum(len(imu.gyro[s]) * imu.gyro[s].var(axis=0) for s in spans)
    np.testing.assert_allclose(b.within, squares, rtol=1e-12)
    force = rotate_about(Z, angle, imu.accel).mean(axis=0)
    np.testing.assert_allclose(b.force, force, rtol=1e-9)
    # A reading at an instant represents half an interval to either side.
    assert (b.start, b.inset) == pytest.approx((-0.005, 0.005))


def test_earth_rate_by_harmonics_is_that_of_the_rotated_base():
    base = FixedBase(0.9, 9.81, attitude_matrix(0.2, -0.1, 0.7))
    angle = np.linspace(0.0, 6.0, 7)
    u = np.array([0.6, 0.0, 0.8])
    rate = EarthHarmonics.of(base, u).at(np.cos(angle), np.sin(angle))
    np.testing.assert_allclose(rate, base.w_ie_s(u, angle), atol=1e-19)


@pytest.mark.parametrize(("seconds", "samples"), [(60.0, 25), (10.0, 20), (0.3, 1)])
def test_blocks_last_a_quarter_of_a_second_or_a_fiftieth_of_the_segments(seconds, samples):
    imu, _ = run()
    assert block_size(imu, [Segment(0.0, seconds, 0.0, 0.0)]) == samples
