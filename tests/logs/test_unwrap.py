"""How an angle starts again: turns, counters, records outside of the range."""

import numpy as np
import pytest

from rotcli.logs.unwrap import Wrap, find_wrap, outside_records, unwrap

TIME = 0.01 * np.arange(5000)
TURNING = 5.0 + 30.0 * TIME  # deg, 1500 deg in all


@pytest.mark.parametrize(
    ("angle", "wrap"),
    [
        (TURNING % 360.0, Wrap(360.0)),
        (-TURNING % 360.0, Wrap(360.0)),
        ((TURNING + 180.0) % 360.0 - 180.0, Wrap(360.0)),
        (TURNING, Wrap(0.0)),
        (30.0 * np.sin(TIME), Wrap(360.0)),
        (np.where(TIME < 25.0, 10.0, 100.0), Wrap(360.0)),  # a jump, but less than a turn
        (TURNING % 327.68, Wrap(327.68, found=True)),
        (np.zeros(0), Wrap(0.0)),
    ],
)
def test_the_period_is_that_of_the_jumps(angle, wrap):
    time = TIME[: len(angle)]
    assert find_wrap(time, angle, 360.0) == wrap


@pytest.mark.parametrize("lost", [0, 40])
def test_the_jumps_are_removed_across_lost_records(lost):
    kept = np.delete(np.arange(5000), np.arange(1190, 1190 + lost))
    angle = (TURNING % 327.68)[kept]
    wrap = find_wrap(TIME[kept], angle, 360.0)
    assert wrap == Wrap(327.68, found=True)
    unwrap(angle, wrap.period)
    np.testing.assert_allclose(angle - angle[0], (TURNING - TURNING[0])[kept], atol=1e-9)


def test_a_record_within_the_range_is_not_outside_of_it():
    angle = TURNING % 360.0
    angle[700] = 4711.0
    highest = np.delete(angle, 700).max()
    angle[[900, 1000]] = highest - 0.01, highest - 0.01  # single records as well, but inside
    assert outside_records(angle, 360.0) == (700,)
    assert find_wrap(TIME, angle, 360.0) == Wrap(360.0, (700,))
    angle[700] = -50.0
    assert outside_records(angle, 360.0) == (700,)


def test_records_beyond_the_turn_of_most_others_are_named():
    slipped = np.where(TIME < 45.0, TURNING % 360.0, TURNING % 360.0 + 8.0)
    wrap = find_wrap(TIME, slipped, 360.0)
    assert wrap.period == 360.0
    assert not wrap.found
    assert all(slipped[list(wrap.beyond)] >= 360.0 - 0.36)
    assert len(wrap.beyond) == np.count_nonzero(slipped >= slipped.min() + 360.0 - 0.36)
