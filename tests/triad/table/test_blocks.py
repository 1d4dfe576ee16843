"""Angles of a table log in blocks and steps, against polynomials and motions in closed form."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from rotcli.models.rotation import axis_rotation
from rotcli.models.triad.blocks import node_offset
from rotcli.triad.table import steps as steps_module
from rotcli.triad.table.reduction import (
    ImuClock,
    Layout,
    Samples,
    TableLog,
    block_means,
    table_blocks,
)
from rotcli.triad.table.signs import Pattern, _fit
from rotcli.triad.table.steps import Steps, encoder_noise, find_steps, fit_cubics
from rotcli.units import DEG


def test_cubics_are_least_squares_polynomials_and_their_misfit_is_that_of_the_worst_axis():
    rng = np.random.default_rng(1)
    time = 0.02 * np.arange(100)
    angles = 1e3 + rng.standard_normal((100, 2)) * [1.0, 0.1]
    low, high = np.array([0, 30, 60]), np.array([20, 37, 95])
    middle, half = np.array([0.2, 0.66, 1.5]), np.array([0.2, 0.07, 0.4])
    cubics, misfit = fit_cubics(time, angles, middle, half, low, high)
    for k in range(3):
        at = slice(low[k], high[k])
        left = []
        for axis in range(2):
            window = [middle[k] - half[k], middle[k] + half[k]]
            fit = Polynomial.fit(time[at], angles[at, axis], 3, domain=window)
            np.testing.assert_allclose(cubics[:, axis, k], fit.coef, rtol=1e-8, atol=1e-8)
            left.append(np.abs(fit(time[at]) - angles[at, axis]).max())
        assert left[0] > left[1]
        assert misfit[k] == pytest.approx(max(left), rel=1e-7)


def test_blocks_of_a_slow_oscillation_have_its_angles_rates_and_accelerations():
    w, amplitude = 2.0 * np.pi / 4.0, 20.0 * DEG
    time = 0.02 * np.arange(1001)
    table = TableLog(time, amplitude * np.sin(w * time)[:, None])
    steps = Steps(np.zeros(1), time[-1:], np.array([False]), np.array([amplitude * w]))
    clock, count = ImuClock(0.005, 0.01), np.full(70, 25)
    layout = Layout(100 + 25 * np.arange(70), count, np.zeros(70, dtype=np.int64))
    blocks, sound = table_blocks(clock, table, steps, layout, np.zeros(70, dtype=np.int64))
    middle = 0.005 + 0.01 * (layout.first + 12.0)
    np.testing.assert_allclose(blocks.time, middle)
    nodes = middle + node_offset(count, 0.01) * np.array([[0.0], [-1.0], [1.0]])
    # What a cubic leaves of a sine over a quarter of a second: (0.125 w)^4 / 24 is 6e-5 of it,
    # with twelve times that over (0.125 s)^2 in the acceleration.
    phase = w * nodes
    for found, expected, atol in (
        (blocks.angles[0], amplitude * np.sin(phase), 1e-5),
        (blocks.rates[0], amplitude * w * np.cos(phase), 1e-3),
        (blocks.accelerations[0], -amplitude * w**2 * np.sin(phase), 0.02),
    ):
        np.testing.assert_allclose(found, expected, atol=atol * np.abs(expected).max())
    assert sound.all()


def test_means_and_variances_of_blocks_do_not_depend_on_the_chunks():
    rng = np.random.default_rng(3)
    values = rng.standard_normal((400, 6)) * np.arange(1.0, 7.0)
    values += 50.0 * np.linspace(-1.0, 1.0, 400)[:, None] ** 2  # no third difference
    layout = Layout(np.array([10, 60, 250]), np.array([50, 150, 120]), np.zeros(3, dtype=np.int64))
    one, variance = block_means([Samples(0, values)], layout)
    parts = [Samples(k, values[k : k + 90]) for k in range(0, 400, 90)]
    split, _ = block_means(parts, layout)
    for k in range(3):
        at = slice(layout.first[k], layout.first[k] + layout.count[k])
        np.testing.assert_allclose(one[:, k], values[at].mean(axis=0), rtol=1e-12)
        third = np.diff(values[at], n=3, axis=0)
        np.testing.assert_allclose(variance[:, k], np.mean(third**2, axis=0) / 20.0, rtol=1e-9)
    np.testing.assert_allclose(split, one, rtol=1e-12)


@pytest.mark.parametrize("share", [0.998, 1.002])
@pytest.mark.parametrize("baseline", [2, 4, 7])
def test_the_baseline_is_the_shortest_in_which_six_sigma_are_less_than_a_jump(baseline, share):
    # An encoder that reads too much and too little in turn has third differences of 8 errors.
    dt, jump = 0.02, 1.0 * DEG
    sigma = share**2 * jump * (baseline * dt) ** 2 / (6.0 * np.sqrt(20.0))
    count, kink = 1000, 500
    time = dt * np.arange(count)
    angle = 100.0 * DEG * time + 0.5 * 600.0 * DEG * np.maximum(time - time[kink], 0.0) ** 2
    angle += np.sqrt(20.0) * sigma / 8.0 * (-1.0) ** np.arange(count)
    assert encoder_noise(angle[:, None], time) == pytest.approx(sigma, rel=1e-6)
    steps = find_steps(time, angle[:, None])
    L = baseline + (share > 1.0)
    # A kink by 600 jumps shows in all differences that contain it: two baselines to either side.
    assert steps.end[0] == pytest.approx(time[kink - 2 * L])
    assert steps.start[1] == pytest.approx(time[kink + 2 * L])


@pytest.mark.parametrize("size", [23, 64, 500])
def test_steps_do_not_depend_on_the_chunks_in_which_they_are_searched(size, monkeypatch):
    time = 0.02 * np.arange(1500)
    rate = np.interp(time, 1.5 * np.arange(21), DEG * np.tile([0.0, 0.0, 40.0, -10.0, 0.0], 5)[:21])
    angle = np.cumsum(rate)[:, None] * 0.02
    angle += 1e-6 * DEG * np.random.default_rng(1).standard_normal((1500, 1))
    expected = find_steps(time, angle)
    # Rest and three ramps of 1.5 s, five and four times; rest joins rest of 1.5 s.
    assert (len(expected.start), expected.still.sum()) == (17, 5)
    monkeypatch.setattr(steps_module, "_CHUNK", size)
    found = find_steps(time, angle)
    for name in ("start", "end", "still", "peak_rate"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def test_the_rotation_between_two_sets_of_vectors_leaves_the_squares_of_its_residuals():
    rng = np.random.default_rng(7)
    model = rng.standard_normal((3, 50))
    true = axis_rotation(np.array([0.6, 0.0, 0.8]), 0.7)
    R, left = _fit(true @ model, model)
    np.testing.assert_allclose(R, true, atol=1e-12)
    assert left == pytest.approx(0.0, abs=1e-12)
    reading = true @ model + 0.1 * rng.standard_normal((3, 50))
    R, left = _fit(reading, model)
    assert left == pytest.approx(np.sum((reading - R @ model) ** 2), rel=1e-9)
    for axis in np.eye(3):  # it is the best rotation
        for angle in (-1e-3, 1e-3):
            assert np.sum((reading - axis_rotation(axis, angle) @ R @ model) ** 2) > left
    R, _ = _fit(-model, model)  # a reflection is no rotation
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_the_angle_of_a_mounting_is_that_of_its_rotation():
    rotations = [axis_rotation(np.array([0.0, 0.6, 0.8]), a) for a in (0.0, 0.3, 3.0)]
    angles = Pattern((1,), 0.0, np.array(rotations)).angles
    np.testing.assert_allclose(angles, [0.0, 0.3, 3.0], atol=1e-7)
