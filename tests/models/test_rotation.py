"""Rotations against those of scipy, and against each other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rotcli.models import rotation

ROUNDING = 1e-14  # a few units in the last place of numbers of size 1

angles = st.floats(-3.1, 3.1)
pitches = st.floats(-1.5, 1.5)  # short of the pole, where roll and azimuth merge
units = (
    st.tuples(*[st.floats(-1, 1)] * 3)
    .filter(lambda v: np.linalg.norm(v) > 0.1)
    .map(lambda v: np.array(v) / np.linalg.norm(v))
)


@given(units, angles)
def test_a_rotation_about_an_axis_is_that_of_scipy(axis, angle):
    ours = rotation.axis_rotation(axis, angle)
    np.testing.assert_allclose(ours, Rotation.from_rotvec(axis * angle).as_matrix(), atol=ROUNDING)


@given(units, angles, units)
def test_turning_a_vector_is_multiplying_by_the_matrix(axis, angle, v):
    turned = rotation.rotate_about(axis, np.array([angle]), v[None])
    np.testing.assert_allclose(turned[0], rotation.axis_rotation(axis, angle) @ v, atol=ROUNDING)


def test_a_sum_of_turned_vectors_needs_no_turned_vector():
    rng = np.random.default_rng(0)
    axis, angle = np.array([0.6, 0.0, 0.8]), rng.uniform(-9.0, 9.0, 50)
    v = rng.normal(size=(50, 3))
    expected = rotation.rotate_about(axis, angle, v).sum(axis=0)
    np.testing.assert_allclose(rotation.sum_rotated(axis, angle, v), expected, atol=1e-13)
    expected = rotation.rotate_about(axis, angle, np.tile(v[0], (50, 1))).sum(axis=0)
    np.testing.assert_allclose(rotation.sum_rotated(axis, angle, v[0]), expected, atol=1e-13)


@given(pitches, angles, angles)
def test_the_attitude_matrix_is_azimuth_then_pitch_then_roll(pitch, roll, azimuth):
    # Clockwise azimuth: about -z; then pitch about x, roll about y (models of the aircraft).
    expected = Rotation.from_euler("ZXY", [-azimuth, pitch, roll]).as_matrix()
    ours = rotation.attitude_matrix(pitch, roll, azimuth)
    np.testing.assert_allclose(ours, expected, atol=ROUNDING)


@given(pitches, angles, angles)
def test_euler_angles_come_back_from_matrix_and_from_quaternion(pitch, roll, azimuth):
    C_nb = rotation.attitude_matrix(pitch, roll, azimuth)
    # Near pitch 90 deg roll and azimuth lose digits by 1/cos(pitch) = 14.
    np.testing.assert_allclose(rotation.euler_angles(C_nb), [pitch, roll, azimuth], atol=1e-13)
    q_nb = rotation.quaternion_from_matrix(C_nb)
    found = rotation.euler_angles_of_quaternion(q_nb)
    np.testing.assert_allclose(found, [pitch, roll, azimuth], atol=1e-13)


@given(units, st.floats(0.0, 3.14159))
def test_quaternion_and_matrix_of_a_rotation_vector_agree_with_scipy(axis, angle):
    q = rotation.quaternion_from_vector(axis * angle)
    C = rotation.matrix_from_quaternion(q)
    np.testing.assert_allclose(C, Rotation.from_rotvec(axis * angle).as_matrix(), atol=ROUNDING)
    back = rotation.quaternion_from_matrix(C)
    np.testing.assert_allclose(back * np.sign(back @ q), q, atol=ROUNDING)
    v = np.array([0.3, -1.2, 0.7])
    np.testing.assert_allclose(rotation.rotate(q, v), C @ v, atol=ROUNDING)


@given(units, angles, units, angles)
def test_quaternions_multiply_as_their_matrices_do(axis_1, angle_1, axis_2, angle_2):
    p = rotation.quaternion_from_vector(axis_1 * angle_1)
    q = rotation.quaternion_from_vector(axis_2 * angle_2)
    product = rotation.matrix_from_quaternion(rotation.multiply(p, q))
    matrices = rotation.matrix_from_quaternion(p) @ rotation.matrix_from_quaternion(q)
    np.testing.assert_allclose(product, matrices, atol=ROUNDING)
    undone = rotation.multiply(p, rotation.conjugate(p))
    np.testing.assert_allclose(undone, [1, 0, 0, 0], atol=ROUNDING)


@pytest.mark.parametrize(
    "axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, -1, 0), (0.6, 0, -0.8), (0.48, 0.6, 0.64)]
)
def test_a_turn_after_a_rotation_is_the_product_with_its_quaternion(axis):
    rng = np.random.default_rng(3)
    p, angle = rng.normal(size=(4, 20)), rng.uniform(-9.0, 9.0, 20)
    axis = np.array(axis, dtype=float)
    half = np.stack([np.cos(0.5 * angle), np.sin(0.5 * angle)])
    turn = np.concatenate([half[:1], axis[:, None] * half[1]])
    found = rotation.multiply_by_turn(p, axis, half)
    np.testing.assert_array_equal(found, rotation.multiply(p, turn))


@pytest.mark.parametrize("n", [1, 2, 15, 16, 17, 255, 256, 257, 5000])
def test_the_cumulative_product_equals_the_loop(n):
    rng = np.random.default_rng(n)
    q = rotation.quaternion_from_vector(0.1 * rng.standard_normal((3, n)))
    expected = [q[:, 0]]
    for k in range(1, n):
        expected.append(rotation.multiply(expected[-1], q[:, k]))
    # Rounding of n products, one unit in the last place each at the worst.
    np.testing.assert_allclose(rotation.cumulative_product(q), np.array(expected).T, atol=n * 3e-16)


def test_skew_is_the_cross_product():
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((2, 4, 3))
    product = np.einsum("nij,nj->ni", rotation.skew(a), b)
    np.testing.assert_allclose(product, np.cross(a, b), atol=ROUNDING)


def test_the_cross_product_with_components_first_is_the_cross_product():
    a, b = np.random.default_rng(0).normal(size=(2, 3, 5))
    np.testing.assert_allclose(rotation.cross(a, b), np.cross(a.T, b.T).T, rtol=1e-14)
