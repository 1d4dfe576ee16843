"""Increments of blocks against a product of ten thousand small rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rotcli.observe.zupt import increments


def exact(rate, seconds, parts=10_000):
    """Return C (3, 3) from the end to the start of a motion, by the midpoint rule: 1e-9 rad."""
    middle = seconds * (np.arange(parts) + 0.5) / parts
    C = np.eye(3)
    for step in Rotation.from_rotvec(rate(middle) * seconds / parts).as_matrix():
        C = C @ step
    return C


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_rate_that_changes_its_direction_is_coning_by_a_twelfth_of_the_cross_product(sign):
    w0, w1 = np.array([2.0, 0.3, 0.0]), np.array([-0.5, sign * 3.0, 1.0])
    interval = 0.01

    def rate(t):
        return w0 + (w1 - w0) * t[:, None] / interval

    gyro = np.array([[w0, w1]])
    blocks = increments.preintegrate(gyro, np.zeros_like(gyro), interval, 1)
    # The coning angle is h^2 |w0 x w1| / 12 = 5e-5 rad; the next term, (a x b) x b / 240 with
    # a and b the mean and the change of the angle, is 1e-7 rad.
    np.testing.assert_allclose(blocks.C_start_end[0, 0], exact(rate, interval), atol=2e-7)


def test_a_steady_rotation_needs_no_coning():
    w = np.array([[[0.4, -1.0, 2.0]] * 6])
    for averages in (False, True):
        blocks = increments.preintegrate(w, np.zeros_like(w), 0.01, 5, averages)
        expected = Rotation.from_rotvec(0.05 * w[0, 0]).as_matrix()
        np.testing.assert_allclose(blocks.C_start_end[0, 0], expected, atol=1e-14)
