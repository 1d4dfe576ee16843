"""Block means over three nodes."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import (
    RAMP,
    STILL,
    TURN,
    blocks_of_motion,
    expected_means,
    node_offset,
    node_weight,
)
from rotcli.models.triad.sensor import readings
from tests.triad import bench


@pytest.mark.parametrize("count", [3, 4, 15, 50])
def test_three_nodes_average_every_polynomial_to_degree_five(count):
    t = (np.arange(count) - 0.5 * (count - 1)) * 0.01
    n = np.array([count])
    x, w = node_offset(n, 0.01)[0], node_weight(n)[0]
    for degree in range(6):
        nodes = (1 - 2 * w) * (0.0**degree) + w * (x**degree + (-x) ** degree)
        assert nodes == pytest.approx(np.mean(t**degree), abs=1e-16, rel=1e-12)


def test_block_means_agree_with_the_means_of_all_samples():
    sequence, nominal = sequences.m5(), bench.three_axes()
    x = bench.spot_parameters()
    motion, blocks = sequence.motion(), bench.blocks(sequence)
    found = expected_means(nominal, x, blocks)
    moving = np.flatnonzero(blocks.kind != STILL)[::37]
    for k in moving:
        n = blocks.count[k]
        t = blocks.time[k] + (np.arange(n) - 0.5 * (n - 1)) / bench.RATE
        means = readings(nominal, x, *motion.at(t)).mean(axis=1)
        assert np.abs(found[:3, k] - means[:3]).max() < 2e-8  # rad/s
        assert np.abs(found[3:, k] - means[3:]).max() < 5e-6  # m/s^2


def test_a_sequence_that_starts_later_has_the_same_blocks_later():
    motion = sequences.s1().motion()
    first = blocks_of_motion(motion, bench.RATE)
    later = blocks_of_motion(replace(motion, start=motion.start + 100.0), bench.RATE)
    np.testing.assert_array_equal(later.count, first.count)
    np.testing.assert_allclose(later.time, first.time + 100.0, rtol=1e-13)


def test_blocks_cover_the_sequence_but_for_the_cuts():
    motion = sequences.s1().motion()
    blocks = bench.blocks(sequences.s1())
    cut = 0.12 * len(motion.angle)
    assert blocks.count.sum() / bench.RATE == pytest.approx(motion.duration - cut, abs=12.0)
    assert {STILL, TURN, RAMP} == set(blocks.kind.tolist())


def test_moving_blocks_are_short():
    blocks = bench.blocks(sequences.s1())
    moving = blocks.kind != STILL
    assert blocks.count[moving].max() <= 51
    turned = np.abs(blocks.rates[:, 0]).max(axis=0) * blocks.count / bench.RATE
    assert np.rad2deg(turned[moving]).max() < 17.0


def test_parts_of_blocks_join_again():
    blocks = bench.blocks(sequences.m5())
    parts = list(blocks.chunks(100))
    assert sum(len(b) for b in parts) == len(blocks)
    assert parts[0].angles.shape[-1] == 100
    assert p.count() == 60
