"""Second order of the tilt, fixed height, and p of a run: closed forms and symmetries."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.models.expected.errors import _add_second_order, expected_errors
from rotcli.models.expected.motion import ErrorName
from rotcli.models.expected.statistics import VERTICAL, expected_statistics, run_p_value
from rotcli.models.numerics.remembered import forget
from tests.models.expected.runs import run

HEIGHT, V_UP = ErrorName.HEIGHT, ErrorName.V_UP


def test_a_tilt_variance_that_grows_with_time_has_the_integrals_of_its_powers():
    count, step, g, growth = 400, 0.5, 9.8, 3e-6
    time = step * np.arange(1, count + 1)
    covariance, mean = np.zeros((9, count, count)), np.zeros((count, 9))
    shape = growth * time
    _add_second_order(covariance, mean, shape, np.outer(shape, shape), g, step)
    # -g/2 times the first and second integral of `growth t`: a line is exact by trapezoids.
    np.testing.assert_allclose(mean[:, V_UP], -0.25 * g * growth * time**2, rtol=1e-12)
    # The second integral is that of a parabola: 1 / (4 n^2) off.
    assert mean[-1, HEIGHT] == pytest.approx(-g * growth * time[-1] ** 3 / 12.0, rel=1e-5)
    # g^2/2 times the product of the integrals.
    root = g * growth * time**2 / 2.0
    np.testing.assert_allclose(covariance[V_UP], 0.5 * np.outer(root, root), rtol=1e-12)
    end = g * growth * time[-1] ** 3 / 6.0
    assert covariance[HEIGHT, -1, -1] == pytest.approx(0.5 * end**2, rel=1e-5)


def test_the_second_order_alone_does_not_depend_on_the_mean_of_the_first():
    table, blocks, gyro, accel = run("MTi-G", "conventional", 0.0)
    biased = replace(accel, bias=accel.bias + np.array([0.0, 0.0, 0.01]))
    same = expected_errors(table, blocks, gyro, replace(accel, bias=0.0 * accel.bias))
    other = expected_errors(table, blocks, gyro, biased)
    assert same.second_order[HEIGHT] > 0.0
    assert other.second_order[HEIGHT] == pytest.approx(same.second_order[HEIGHT], rel=1e-9)


@pytest.mark.parametrize("axis", ["x", "z"])
def test_a_fixed_height_leaves_the_horizontal_mean_of_an_axis_column_as_it_is(axis):
    table, blocks, gyro, accel = run("MTi-G", "partial", 30.0, axis)
    free = expected_errors(table, blocks, gyro, accel).mean
    fixed = expected_errors(replace(table, hold_height=True), blocks, gyro, accel).mean
    np.testing.assert_array_equal(fixed[:, [HEIGHT, V_UP]], 0.0)
    for row in (ErrorName.LATITUDE, ErrorName.LONGITUDE, ErrorName.V_NORTH, ErrorName.V_EAST):
        # In a minute and a half the up velocity deflects the horizontal motion by less.
        scale = np.abs(free[:20, row]).max()
        np.testing.assert_allclose(fixed[:20, row], free[:20, row], atol=5e-3 * scale)


def test_p_of_a_run_is_seven_times_the_smallest_and_one_at_most():
    assert run_p_value(np.array([0.5, 0.01, np.nan])) == pytest.approx(0.07)
    assert run_p_value(np.array([0.5, 0.9])) == 1.0
    assert np.isnan(run_p_value(np.array([np.nan])))


def _figures(expected):
    statistics = expected_statistics(expected)
    figures = [expected.mean, expected.covariance, *expected.parts.values(), expected.second_order]
    return [*figures, statistics.rms, statistics.median, statistics.q999]


def test_runs_of_one_plan_share_their_covariance_and_have_the_figures_of_a_run_alone():
    table, blocks, gyro, accel = run("NAV440", "partial", 20.0)
    biased = replace(accel, bias=accel.bias + np.array([0.0, 0.01, 0.02]))
    other = run("NAV440", "full", 20.0)
    alone = []
    for sources in ((table, blocks, gyro, accel), (table, blocks, gyro, biased), other):
        forget()
        alone.append(_figures(expected_errors(*sources)))
    forget()
    third = expected_errors(*other)
    second = expected_errors(table, blocks, gyro, biased)
    first = expected_errors(*run("NAV440", "partial", 20.0))
    assert first.random is second.random
    assert third.random is not second.random
    for found, wanted in zip((first, second, third), alone, strict=True):
        for a, b in zip(_figures(found), wanted, strict=True):
            np.testing.assert_array_equal(a, b)


def test_the_reason_names_the_share_of_the_mean_square_in_percent():
    expected = expected_errors(*run("NAV440", "full", 50.0))
    part = 0.6 * expected.mean_square[:9]
    skewed = expected_statistics(replace(expected, second_order=part))
    text = "60 % of the mean square is of second order in the tilt: skewed"
    assert [bool(reason) for reason in skewed.reasons] == [k in VERTICAL for k in range(11)]
    assert {skewed.reasons[k] for k in VERTICAL} == {text}


def test_covariances_are_symmetric_with_the_second_order():
    table, blocks, gyro, accel = run("MTi-G", "conventional", 20.0)
    covariance = expected_errors(table, blocks, gyro, accel).covariance
    np.testing.assert_allclose(covariance, covariance.swapaxes(1, 2), rtol=1e-9)
