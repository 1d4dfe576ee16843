"""Groups of cells against closed forms of a motion whose acceleration is a straight line."""

import numpy as np
import pytest

from rotcli.models.strapdown.groups import Groups, Motion, follow, group_moments


def test_groups_are_limited_to_2_s_and_20_m():
    assert Groups(4, 0.32, 10).suits(15.0)  # 1.28 s, 19.2 m
    assert not Groups(4, 0.32, 10).suits(16.0)  # 20.5 m
    assert Groups(1, 0.32, 10).suits(60.0)
    assert not Groups(1, 0.32, 10).suits(65.0)
    assert not Groups(8, 0.32, 10).suits(0.0)  # 2.56 s


@pytest.mark.parametrize("size", [1, 4])
def test_the_mean_displacement_of_a_group_is_that_of_the_closed_form(size):
    groups = Groups(size, 0.5, 6 * size)
    T, count = groups.duration, 6
    v0, d0, a0, slope = np.array(
        [[1.0, -2.0, 3.0], [7.0, 5.0, -4.0], [0.3, 0.2, -0.5], [0.4, -0.1, 0.6]]
    )
    start = Motion(v0, d0, np.zeros(3), None, np.zeros((2, 3)))
    t = T * np.arange(count + 1)[:, None]
    change = a0 + slope * (t[:-1] + 0.5 * T)
    mean, v = follow(np.zeros((3, 3, count)), change.T, start, groups)
    # d = d0 + v0 t + a0 t^2/2 + slope t^3/6, integrated once more.
    d = d0 + v0 * t + a0 * t**2 / 2.0 + slope * t**3 / 6.0
    integral = d0 * t + v0 * t**2 / 2.0 + a0 * t**3 / 6.0 + slope * t**4 / 24.0
    np.testing.assert_allclose(mean.T, np.diff(integral, axis=0) / T, rtol=1e-12)
    np.testing.assert_allclose(v.T, np.diff(d, axis=0) / T, rtol=1e-12)


@pytest.mark.parametrize("size", [1, 4])
def test_the_moments_of_a_group_are_those_of_the_closed_form(size):
    groups, T = Groups(size, 0.5, 6 * size), 0.5
    # The acceleration is the line a + b t from the start of each cell on.
    a, b = np.array([0.3, 0.2, -0.5]), np.array([0.4, -0.1, 0.6])

    def moments(a, b, T):
        return np.stack(
            [
                a * T + b * T**2 / 2.0,
                a * T**2 / 2.0 + b * T**3 / 6.0,
                a * T**2 / 6.0 + b * T**3 / 24.0,
            ]
        )

    cells = np.stack([moments(a + b * T * k, b, T) for k in range(6 * size)], axis=2)
    long = groups.duration
    due = np.stack([moments(a + b * long * k, b, long) for k in range(6)], axis=2)
    np.testing.assert_allclose(group_moments(cells, groups), due, rtol=1e-12)
