"""Parts of the long-run calibration, each against its closed form."""

import numpy as np
import pytest
from scipy.stats import chi2

from rotcli.logs.record import ImuLog, ReferenceLog, TableLog
from rotcli.srins import estimate, navigate
from rotcli.srins.level_ins import LevelSolution
from rotcli.srins.model import Damping
from rotcli.srins.navigate import SrinsRun, gnss_differences
from rotcli.units import DEG


def test_innovations_are_compared_with_their_covariance():
    rng = np.random.default_rng(2)
    root = rng.standard_normal((50, 4, 4)) + 3.0 * np.eye(4)
    S = root @ root.swapaxes(1, 2)
    v = rng.standard_normal((50, 4))
    used = np.ones((50, 4), dtype=bool)
    used[:10, 2] = False
    found = estimate._consistency(v, S, used, slice(0, 4))
    squares = sum(v[k] @ np.linalg.solve(S[k], v[k]) for k in range(10, 50))
    assert found.ratio == pytest.approx(squares / 160.0)
    np.testing.assert_allclose(found.bounds, chi2.ppf([0.025, 0.975], 160) / 160.0, rtol=1e-2)
    assert found.count == 160
    part = estimate._consistency(v, S, used, slice(1, 3))
    squares = sum(v[k, 1:3] @ np.linalg.solve(S[k, 1:3, 1:3], v[k, 1:3]) for k in range(10, 50))
    assert (part.ratio, part.count) == (pytest.approx(squares / 80.0), 80)
    nothing = estimate._consistency(v, S, np.zeros_like(used), slice(0, 4))
    assert (nothing.ratio, nothing.count, nothing.consistent) == (1.0, 0, True)


@pytest.mark.parametrize(
    ("ratio", "consistent"), [(0.895, False), (0.905, True), (1.095, True), (1.105, False)]
)
def test_a_tenth_from_one_is_consistent_beyond_a_narrow_band(ratio, consistent):
    assert estimate.Consistency(ratio, (0.99, 1.01), 10**5).consistent == consistent
    assert estimate.Consistency(ratio, (0.8, 1.2), 100).consistent


@pytest.mark.parametrize("block", [0.01, 0.5, 1.0])
def test_a_maneuver_begins_where_the_mean_acceleration_over_ten_seconds_is_not_a_cruise(block):
    time = block * np.arange(round(400.0 / block) + 1)
    # 5 s with 0.1 m/s^2, then with as much the other direction a minute and a half later.
    gained = np.clip(time - 100.0, 0.0, 5.0) - np.clip(time - 190.0, 0.0, 5.0)
    velocity = np.stack([2.0 + 0.06 * gained, -1.0 + 0.08 * gained])
    starts, largest = estimate.find_maneuvers(velocity, block)
    # The mean over ten seconds exceeds 0.02 m/s^2 once 2 s have passed.
    assert starts == pytest.approx([102.0, 192.0], abs=1.01 * block)
    assert largest == pytest.approx(0.05)
    cruise = np.stack([2.0 + 0.0199 * time, np.zeros_like(time)])
    assert estimate.find_maneuvers(cruise, block)[0].size == 0
    assert estimate.find_maneuvers(velocity[:, :2], 20.0) == (pytest.approx(np.zeros(0)), 0.0)


def test_the_mean_of_the_differences_of_a_step_counts_epochs():
    rng = np.random.default_rng(5)
    epochs = np.array([1, 0, 2, 1, 1, 0, 0, 0, 0, 3])
    sums = rng.standard_normal((4, 10)) * (epochs > 0)
    u = rng.standard_normal((4, 11))
    zero = np.zeros(11)
    solution = LevelSolution(np.zeros((2, 11)), zero, zero, u, np.zeros((4, 11)))
    z = estimate.step_measurements(solution, sums, epochs, 3, damping=True)
    assert z.shape == (3, 8)
    for k, count in enumerate((3, 2, 1)):
        np.testing.assert_allclose(z[k, :4], sums[:, 3 * k : 3 * k + 3].sum(axis=1) / count)
        np.testing.assert_array_equal(z[k, 4:], u[:, 3 * k + 3])


def test_the_errors_of_uncalibrated_sensors_are_shares_of_the_earth_rate():
    W, L = 7.292115e-5, 0.8
    assert estimate.uncalibrated_drift_error(L, 1e-4, -2e-4) == pytest.approx(
        W * (1e-4 * np.sin(L) + 2e-4 * np.cos(L))
    )
    theta = np.array([0.0, 0.0, 0.0, np.pi])  # mean cosine of one half
    assert estimate.uncalibrated_level_error(L, -1e-4, theta) == pytest.approx(
        2.0 * W * 1e-4 * np.cos(L)
    )


@pytest.mark.parametrize("averages", [True, False])
@pytest.mark.parametrize("size", [7, 1000])
def test_the_blocks_of_a_log_begin_with_its_first_sample_on_its_own_clock(averages, size):
    # 20 Hz, nominally; 207 intervals at a constant rate about up are ten blocks of a second.
    interval, n = 0.05, 207 if averages else 208
    time = 5000.0 + interval * np.arange(n)
    gyro, accel = np.zeros((n, 3)), np.zeros((n, 3))
    gyro[:, 2], accel[:, 2] = 0.1, 9.8
    pieces = [
        ImuLog("imu", time[k : k + size], gyro[k : k + size], accel[k : k + size], interval)
        for k in range(0, n, size)
    ]
    found, start = navigate.preintegrate_log(pieces, averages=averages)
    assert start == pytest.approx(5000.0 - interval * averages)
    assert (len(found), found.duration) == (10, pytest.approx(1.0))
    np.testing.assert_allclose(found.heading_increment, 0.1)
    np.testing.assert_allclose(found.dv, np.tile([[0.0], [0.0], [9.8]], 10), atol=1e-12)
    np.testing.assert_array_equal(found.level_rotation, 0.0)


def run(time, velocity=0.0, latitude=0.7, longitude=0.1):
    one = np.ones_like(time)
    turn = np.zeros((4, len(time)))
    turn[0] = 1.0
    values = velocity * np.ones((2, len(time))), latitude * one, longitude * one
    solution = LevelSolution(*values, np.zeros((4, len(time))), turn)
    return SrinsRun(time, float(time[1] - time[0]), solution, Damping())


def test_differences_to_gnss_count_for_the_nearest_end_of_a_block():
    time = 10.0 + 0.5 * np.arange(21)
    one = run(time, velocity=np.linspace(0.0, 2.0, 21), longitude=-3.14)
    # Before the first half block; at 10.3, 10.7 and 12.0 s; up to half a block after the end.
    at = np.array([10.0, 10.2, 10.3, 10.7, 12.0, 20.1, 20.3])
    values = {
        "v_east": np.full(7, 0.5),
        "v_north": np.full(7, -0.5),
        "latitude": np.full(7, 0.6),
        "longitude": np.full(7, 3.14),
    }
    sums, epochs = gnss_differences(one, ReferenceLog("gnss", at, values, 7))
    expected = np.zeros(20)
    expected[[0, 3, 19]] = [2, 1, 1]
    np.testing.assert_array_equal(epochs, expected)
    velocity = np.zeros(20)
    velocity[[0, 3, 19]] = [0.2 * 0.3 + 0.2 * 0.7, 0.4, 2.0]
    np.testing.assert_allclose(sums[0], velocity - 0.5 * epochs, atol=1e-12)
    np.testing.assert_allclose(sums[1], velocity + 0.5 * epochs, atol=1e-12)
    np.testing.assert_allclose(sums[2], 0.1 * epochs, atol=1e-12)
    # The longitudes lie on either side of 180 deg.
    np.testing.assert_allclose(sums[3], (2.0 * np.pi - 6.28) * epochs, atol=1e-12)


def test_a_run_since_a_moment_begins_at_the_nearest_edge():
    time = 100.0 + 2.0 * np.arange(50)
    one = run(time, velocity=time)
    for moment, first in ((100.0, 0), (150.9, 25), (151.1, 26), (0.0, 0), (1e6, 49)):
        part = one.since(moment)
        np.testing.assert_array_equal(part.time, time[first:])
        np.testing.assert_array_equal(part.solution.velocity[0], time[first:])
        assert part.solution.q_ns.shape == (4, 50 - first)


@pytest.mark.parametrize(
    ("turned", "says"),
    [
        (np.linspace(0.0, 2.9 * DEG, 5000), None),
        (np.linspace(0.0, -3.1 * DEG, 5000), "differ by 3.1 deg: the vehicle turned"),
        (np.append(np.zeros(3600), np.linspace(0.0, 4.0, 1400)), "differ by 229.2 deg"),
    ],
)
def test_a_heading_that_differs_from_the_table_is_a_turn_of_the_vehicle(turned, says):
    table = TableLog("table", np.arange(2.0), np.zeros(2), 1.0)
    found = navigate._heading(turned, table)
    assert len(found) == (says is not None)
    assert says is None or says in found[0]


def test_gaps_of_the_speed_reference_are_beyond_ten_seconds_or_three_intervals():
    def log(*steps):
        time = np.concatenate([[0.0], np.cumsum(steps)])
        return ReferenceLog("speed", time, {}, len(time))

    assert navigate._speed_gaps(log(*[1.0] * 20, 10.0, *[1.0] * 20)) == []
    (text,) = navigate._speed_gaps(log(*[1.0] * 20, 10.5, *[1.0] * 20, 11.6, *[1.0] * 20))
    assert "2 gaps in the speed reference, longest 12 s from 50 s" in text
    assert navigate._speed_gaps(log(*[5.0] * 20, 14.9, *[5.0] * 20)) == []
    (text,) = navigate._speed_gaps(log(*[5.0] * 20, 15.1, *[5.0] * 20))
    assert "1 gap in the speed reference, longest 15 s from 100 s" in text


def test_gaps_of_gnss_are_named_with_their_times():
    epochs = np.ones(100, dtype=np.int64)
    epochs[20:32] = 0
    (text,) = estimate._gaps(epochs, 2.0, 1000.0)
    # Epochs at the ends of blocks: the last one before is at 1040 s, the next one at 1066 s.
    assert text == "GNSS reference missing from 1042 s (24 s)"
    epochs = np.ones(100, dtype=np.int64)
    epochs[20:24] = 0
    assert estimate._gaps(epochs, 2.0, 0.0) == []  # five blocks, of ten seconds
    (text,) = estimate._gaps(np.zeros(5, dtype=np.int64), 2.0, 0.0)
    assert "no GNSS epoch" in text
