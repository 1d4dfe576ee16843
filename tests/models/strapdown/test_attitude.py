"""Attitude of a sensor that turns by more than the range of the series in one sample."""

import numpy as np
from scipy.spatial.transform import Rotation

from rotcli.models import strapdown


def test_steps_of_more_than_half_a_radian_are_the_rotations_of_scipy():
    interval, n = 0.01, 60
    w = np.array([40.0, -30.0, 35.0])  # rad/s: 0.61 rad a sample, against inertial space
    start = strapdown.InitialState(0.9, 0.0, 100.0, np.zeros(3), np.eye(3))
    force = np.zeros((n, 3))
    turning = strapdown.mechanize_log(np.tile(w, (n, 1)), force, interval, start)
    fixed = strapdown.mechanize_log(np.zeros((n, 3)), force, interval, start)
    # Both fall in the same path: they differ by the rotation in the sensor's axes.
    inertial, rotated = (Rotation.from_quat(p.q_ns[[1, 2, 3, 0]].T) for p in (fixed, turning))
    expected = Rotation.from_rotvec(w * interval * np.arange(n)[:, None])
    difference = (inertial.inv() * rotated * expected.inv()).magnitude()
    assert difference.max() < 1e-12
