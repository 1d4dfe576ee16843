"""Windows, computed attitude and transitions against scipy's rotations and matrix exponential."""

from math import factorial

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from rotcli.models.expected.motion import (
    Blocks,
    cut_window,
    error_dynamics,
    nominal_motion,
    transitions,
)
from rotcli.units import DEG
from tests.models.expected.runs import GRAVITY, still_table


def test_a_window_is_cut_into_blocks_that_fill_it():
    blocks = cut_window(121.0, 421.0, lambda t: 30.0 * DEG * t, 30.0 * DEG)
    assert blocks.fine > 1
    assert blocks.duration == pytest.approx(300.0)
    np.testing.assert_allclose(blocks.rate, 30.0 * DEG)


def test_the_computed_attitude_turns_about_the_erroneous_axis_from_the_angle_at_the_start():
    table = still_table("x", (20.0, -10.0, 40.0))
    angle = 0.7 + 0.2 * np.arange(7)
    column = np.array([1e-3, -2e-2, 3e-2])
    found = nominal_motion(table, Blocks(0.0, 1.0, 3, 1, angle), column)
    first = Rotation.from_matrix(table.C_nb) * Rotation.from_rotvec(angle[0] * table.axis)
    turned = Rotation.from_rotvec((angle - angle[0])[:, None] * (table.axis + column))
    np.testing.assert_allclose(found.C_ns, (first * turned).as_matrix(), atol=1e-14)


def test_transitions_are_those_of_the_matrix_exponential():
    table, length = still_table(), 10.0
    blocks = Blocks(0.0, length, 3, 2, np.zeros(13))
    found = transitions(table, blocks, nominal_motion(table, blocks, np.zeros(3)))
    F = error_dynamics(table, np.array([0.0, 0.0, GRAVITY]))
    # The series of half a block omits (F h)^5: 5e-7 a block, in m a rad.
    for m in range(4):
        np.testing.assert_allclose(found.from_start[m], expm(F * 2 * m * length), atol=3e-6)
    for k in range(6):
        np.testing.assert_allclose(found.to_start[k], expm(-F * (k + 0.5) * length), atol=3e-6)


def test_half_a_long_block_has_four_terms_of_the_exponential():
    table, length = still_table(), 40.0
    blocks = Blocks(0.0, length, 3, 2, np.zeros(13))
    found = transitions(table, blocks, nominal_motion(table, blocks, np.zeros(3))).to_start[0]
    X = -0.5 * length * error_dynamics(table, np.array([0.0, 0.0, GRAVITY]))
    powers = [np.linalg.matrix_power(X, k) / factorial(k) for k in range(5)]
    np.testing.assert_allclose(found, sum(powers), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(("duration", "length"), [(285.0, 1.0), (10_260.0, 10_260.0 / 2052)])
def test_blocks_of_a_still_window_last_a_second_or_its_2000th_part(duration, length):
    blocks = cut_window(0.0, duration, np.zeros_like, 0.0)
    assert blocks.length == pytest.approx(length)


@pytest.mark.parametrize("rate", [10.0, 30.0, 50.0, 72.0, 90.0, 100.0])
def test_coarse_steps_are_as_far_from_half_turns_as_57_to_67_of_them_can_be(rate):
    blocks = cut_window(0.0, 300.0, lambda t: rate * DEG * t, rate * DEG)
    far = {m: abs(np.sin(rate * DEG * 300.0 / m)) for m in range(57, 68)}
    assert far[blocks.coarse] == pytest.approx(max(far.values()), rel=1e-9)
