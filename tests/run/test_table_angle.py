"""Table angle between records: a polynomial is returned as it is, and a caller may change it."""

import numpy as np

from rotcli.logs.record import TableLog
from rotcli.run.table_angle import angle_at


def _table(angle):
    return TableLog("t", 0.02 * np.arange(len(angle)), angle, 0.02, rows=len(angle))


def test_many_angles_are_those_of_the_motion_also_when_they_are_asked_for_again():
    table = _table((0.02 * np.arange(1000)) ** 3)
    time = np.linspace(1.0, 19.0, 5000)
    first = angle_at(table, time)
    np.testing.assert_allclose(first, time**3, rtol=1e-11)
    expected = first.copy()
    first *= 2.0  # the caller's own
    np.testing.assert_array_equal(angle_at(table, time), expected)
    time += 0.001
    np.testing.assert_allclose(angle_at(table, time), time**3, rtol=1e-11)


def test_another_table_with_the_same_times_has_its_own_angles():
    time = np.linspace(1.0, 19.0, 5000)
    np.testing.assert_allclose(angle_at(_table(0.02 * np.arange(1000)), time), time, rtol=1e-12)
    other = angle_at(_table(0.04 * np.arange(1000)), time)
    np.testing.assert_allclose(other, 2.0 * time, rtol=1e-12)


def test_a_table_that_does_not_turn_has_one_angle_also_across_a_gap_and_before_its_start():
    table = _table(np.full(1000, 1.5))
    table.time[500:] += 5.0
    np.testing.assert_array_equal(angle_at(table, np.linspace(-0.01, 25.0, 101)), 1.5)
