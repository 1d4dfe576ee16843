"""Table angles between the records."""

import numpy as np

from rotcli.logs.record import TableLog
from rotcli.run.table_angle import angle_at


def test_a_few_times_of_a_long_log_have_the_angles_that_many_times_have():
    rng = np.random.default_rng(1)
    time = np.delete(0.02 * np.arange(20_000), np.arange(7000, 7010)) + 1e-4 * rng.random(19_990)
    angle = np.sin(0.3 * time) + 1e-4 * rng.standard_normal(len(time))
    table = TableLog("table.csv", time, angle, 0.02)
    many = np.linspace(time[0] - 0.01, time[-1] + 0.01, 4000)
    few = np.searchsorted(many, [0.0, 55.5, 140.1, 140.12, 399.9])
    few = np.concatenate([[0], few, [len(many) - 1]])
    np.testing.assert_array_equal(angle_at(table, many[few]), angle_at(table, many)[few])
