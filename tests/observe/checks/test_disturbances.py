"""Where a log is disturbed: place, size and limit of jumps and of large innovations."""

import numpy as np
import pytest
from scipy import stats

from rotcli.models.numerics.chi_squared import upper_limit
from rotcli.observe.zupt.checks.disturbances import (
    MIN_JUMP,
    InnovationWindows,
    RelativeRotation,
)

TAU = 0.1
SIZE = 50  # updates in a window of 5 s


def windows(nis):
    found = InnovationWindows(TAU)
    for part in np.array_split(nis, 7):  # the pieces do not end with the windows
        found.add(part)
    return found.largest()


def test_the_largest_window_is_named_with_its_largest_innovation():
    nis = np.full(20 * SIZE, 3.0)
    nis[7 * SIZE : 8 * SIZE] = 12.0
    nis[7 * SIZE + 12] = 15.0
    found = windows(nis)
    assert found.time == pytest.approx((7 * SIZE + 13) * TAU)
    assert found.ratio == pytest.approx((12.0 * 49 + 15.0) / 50 / 3.0)
    # Half as much again as a quantile of 1e-9 of the mean of 150 squares.
    quantile = upper_limit(3 * SIZE, stats.norm.sf(6.0)) / (3 * SIZE)
    assert found.limit == pytest.approx(1.5 * quantile, rel=2e-3)


def test_usual_innovations_and_those_of_the_start_are_no_disturbance():
    rng = np.random.default_rng(1)
    nis = rng.chisquare(3, 40 * SIZE)
    assert windows(nis) is None
    nis[:SIZE] = 50.0  # the filter converges
    assert windows(nis) is None
    assert windows(np.full(3 * SIZE, 3.0)) is None


def test_a_jump_is_named_with_time_size_and_limit():
    rng = np.random.default_rng(2)
    angles = np.cumsum(1e-5 * rng.standard_normal(600))
    rotation = RelativeRotation(TAU)
    rotation.add(np.full(600, 0.01), angles)
    assert rotation.largest() is None
    angles[400:] += 0.02
    noisy = RelativeRotation(TAU)
    noisy.add(np.full(600, 0.01), angles)
    found = noisy.largest()
    assert found.time == pytest.approx(400 * TAU)
    assert found.size == pytest.approx(0.02, abs=1e-4)
    assert found.limit == MIN_JUMP
    coarse = RelativeRotation(TAU)
    coarse.add(np.full(600, 0.01), angles + 5e-3 * rng.standard_normal(600))
    assert coarse.largest() is None  # 8 sigma of the difference of two are 57 mrad


def test_the_scale_error_is_the_slope_over_the_tables_rotation():
    rng = np.random.default_rng(3)
    table = TAU * rng.uniform(-1.0, 1.0, 1000)
    rotation = RelativeRotation(TAU)
    relative = 2e-3 * table + 5e-6 * rng.standard_normal(1000) + 1e-4
    for part in (slice(0, 300), slice(300, 1000)):
        rotation.add(table[part], relative[part])
    assert rotation.scale_error() == pytest.approx(np.polyfit(table, relative, 1)[0], rel=1e-9)
    steady = RelativeRotation(TAU)
    steady.add(np.full(100, 0.1), np.zeros(100))
    assert steady.scale_error() is None
