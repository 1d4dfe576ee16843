"""The causes of readings that no signs of the table's axes explain."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import expected_means
from rotcli.rig.rig import rig_from_dict
from rotcli.triad.table.diagnosis import diagnose
from rotcli.triad.table.signs import check_signs
from tests.triad import bench

_TABLE = bench.three_axes()


@cache
def _logged():
    """Return blocks of M5 with errors of 1000 ppm and 100 deg/h, without noise."""
    blocks = bench.blocks(sequences.m5(turns=2))
    x = np.zeros(p.count())
    x[p.N], x[p.M] = 1e-3, -1e-3
    x[p.GYRO_BIAS] = 5e-4
    return replace(blocks, means=expected_means(_TABLE, x, blocks))


def _cause(blocks, table=_TABLE, **settings):
    rig = rig_from_dict({"table": {"axes": ["z", "x", "y"], **settings}})
    check = check_signs(table, blocks)
    assert not check.explained
    return diagnose(table, blocks, check, rig.table)


def _with_readings(change):
    means = _logged().means.copy()
    change(means)
    return replace(_logged(), means=means)


@pytest.mark.parametrize(("channel", "name"), [(1, "gyro_y"), (5, "accel_z")])
def test_a_dead_sensor_is_named(channel, name):
    def kill(means):
        means[channel] = 0.001

    assert _cause(_with_readings(kill)).startswith(f"{name} does not change")


@pytest.mark.parametrize(("axis", "name"), [(1, "2 (column middle)"), (2, "3 (column inner)")])
def test_a_dead_encoder_is_named(axis, name):
    b = _logged()
    parts = [a.copy() for a in (b.angles, b.rates, b.accelerations)]
    for part in parts:
        part[axis] = 0.0
    text = _cause(replace(b, angles=parts[0], rates=parts[1], accelerations=parts[2]))
    assert f"its axis {name} never moves" in text


def test_exchanged_columns_are_put_in_order():
    b, order = _logged(), [0, 2, 1]
    exchanged = replace(
        b, angles=b.angles[order], rates=b.rates[order], accelerations=b.accelerations[order]
    )
    text = _cause(exchanged, columns={"middle": "roll", "inner": "pitch"})
    assert 'columns = { outer = "outer", middle = "pitch", inner = "roll" }' in text


def test_exchanged_axes_are_put_in_order():
    table = replace(_TABLE, axes=_TABLE.axes[[1, 2, 0]])
    expected = "set [table] axes = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]"
    assert expected in _cause(_logged(), table)


def test_a_reversed_sensor_is_named():
    def reverse(means):
        means[0] *= -1.0

    assert _cause(_with_readings(reverse)).startswith("gyro_x is reversed against accel_x")


def test_exchanged_sensors_are_named():
    def exchange(means):
        means[[3, 4]] = means[[4, 3]]

    text = _cause(_with_readings(exchange))
    assert "measures along" in text
    assert "_x" in text
    assert "_y" in text


@pytest.mark.parametrize("lag", [2.5, -7.0])
def test_a_clock_offset_of_seconds_is_measured(lag):
    b = _logged()
    motion = sequences.m5(turns=2).motion()
    inside = (b.time - abs(lag) > 0.0) & (b.time + abs(lag) < motion.duration)
    late = b.part(inside)
    means = np.array([np.interp(late.time - lag, b.time, row) for row in b.means])
    text = _cause(replace(late, means=means), time_offset=1.0)
    offset = float(text.split("time_offset = ")[1])
    assert offset == pytest.approx(1.0 + lag, abs=0.05)


@pytest.mark.parametrize(("axis", "factor", "reading"), [(1, 2.0, "0.5")])
def test_an_encoder_that_counts_another_angle_is_named_with_the_ratio(axis, factor, reading):
    b = _logged()
    parts = [a.copy() for a in (b.angles, b.rates, b.accelerations)]
    for part in parts:
        part[axis] *= factor
    text = _cause(replace(b, angles=parts[0], rates=parts[1], accelerations=parts[2]))
    assert f"where only axis {axis + 1} turns the gyros read {reading} times its rate" in text


def test_readings_of_another_log_leave_the_general_advice():
    rng = np.random.default_rng(1)
    means = _logged().means[:, rng.permutation(len(_logged()))]
    assert "no signs of the table's axes explain" in _cause(replace(_logged(), means=means))
