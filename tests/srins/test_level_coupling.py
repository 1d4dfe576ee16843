"""The level mechanization against a vehicle whose readings follow from vector equations.

The readings are made here from the laws of motion on a rotating ellipsoid, written with cross
products of 3-vectors and integrated in steps of 10 ms; no formula is shared with the mechanization.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rotcli.srins import level_ins
from rotcli.srins.model import Damping

A, E2, W_IE, HZ = 6378137.0, 6.69437999014e-3, 7.292115e-5, 10


def velocity(t):
    """East and north, m/s, and their derivatives: hundreds of metres a second, 0.6 m/s^2."""
    return np.array([0.5 * t - 200.0, 300.0 - 0.6 * t]), np.array([0.5, -0.6])


def radii(latitude):
    w2 = 1.0 - E2 * np.sin(latitude) ** 2
    return A * (1.0 - E2) / w2**1.5, A / np.sqrt(w2)


def rates(latitude, v):
    """Earth rate and transport rate in n, rad/s."""
    R_M, R_N = radii(latitude)
    w_ie = W_IE * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    w_en = np.array([-v[1] / R_M, v[0] / R_N, v[0] * np.tan(latitude) / R_N])
    return w_ie, w_en


def voyage(sign, seconds=900.0, rate=0.1):
    """Return the level readings in s and the true latitude, longitude, azimuth angle at the end.

    The IMU rotates about up at `rate` relative to n; sign: hemisphere.
    """

    def position(t, y):
        R_M, R_N = radii(y[0])
        v = velocity(t)[0]
        return [v[1] / R_M, v[0] / (R_N * np.cos(y[0]))]

    time = (np.arange(int(seconds * HZ)) + 0.5) / HZ  # the middle of each sample
    start = [sign * 0.8, 0.3]
    path = solve_ivp(position, (0.0, seconds), start, "DOP853", rtol=1e-12, dense_output=True)
    gyro, accel = [], []
    for t, latitude in zip(time, path.sol(time)[0], strict=True):
        v, dv = velocity(t)
        w_ie, w_en = rates(latitude, v)
        coriolis = np.cross(2.0 * w_ie + w_en, [*v, 0.0])
        f_n = np.array([*dv, 0.0]) + coriolis + [0.0, 0.0, 9.8]
        c, s = np.cos(rate * t), np.sin(rate * t)
        C_sn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        gyro.append(C_sn @ (w_ie + w_en) + [0.0, 0.0, rate])
        accel.append(C_sn @ f_n)
    gyro, accel = np.array(gyro), np.array(accel)
    for readings in (gyro, accel):  # the mean over a sample is shorter than the value half-way
        readings[:, :2] *= np.sinc(0.5 * rate / HZ / np.pi)
    return gyro, accel, path.sol(seconds)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_east_and_north_are_coupled_with_the_right_signs(sign):
    gyro, accel, end = voyage(sign)
    increments = level_ins.preintegrate_means(gyro, accel, 1.0 / HZ, HZ)
    v0, _ = velocity(0.0)
    start = level_ins.LevelState((1.0, 0.0, 0.0, 0.0), v0, sign * 0.8, 0.3)
    v_ref = np.zeros((2, len(increments)))  # without damping it has no effect
    undamped = Damping(enabled=0.0)
    solution = level_ins.mechanize(increments, start, v_ref, undamped)
    expected, _ = velocity(float(len(increments)))
    # Blocks of 1 s are right to second order. The smallest coupling, half a block's rotation of the
    # level force (1e-4 rad/s 0.5 s 0.6 m/s^2), is 0.05 m/s after 900 s with the wrong sign.
    np.testing.assert_allclose(solution.velocity[:, -1], expected, atol=6e-3)
    metres = 6.4e6 * np.array([solution.latitude[-1] - end[0], solution.longitude[-1] - end[1]])
    assert np.abs(metres).max() < 4.0
