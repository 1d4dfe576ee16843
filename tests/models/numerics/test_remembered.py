"""Results that are kept: same bits, same result; nothing else is taken for the same."""

from dataclasses import dataclass

import numpy as np
import pytest

from rotcli.models.numerics.remembered import exact_key, remembered


@dataclass(frozen=True, eq=False)
class _Plan:
    rate: float
    angle: np.ndarray


def _counted():
    calls = []

    @remembered(2)
    def scaled(plan, factor):
        """Return the scaled angle."""
        calls.append(factor)
        return {"angle": factor * plan.angle}

    return scaled, calls


def test_the_same_values_in_other_objects_are_computed_once():
    scaled, calls = _counted()
    first = scaled(_Plan(1.0, np.arange(3.0)), 2.0)
    assert scaled(_Plan(1.0, np.arange(3.0)), 2.0) is first
    assert calls == [2.0]
    np.testing.assert_array_equal(first["angle"], [0.0, 2.0, 4.0])
    assert scaled.__doc__ == "Return the scaled angle."


def test_a_result_is_read_only_and_arguments_stay_writeable():
    scaled, _ = _counted()
    plan = _Plan(1.0, np.arange(3.0))
    with pytest.raises(ValueError, match="read-only"):
        scaled(plan, 2.0)["angle"][0] = 1.0
    plan.angle[0] = 7.0
    assert scaled(plan, 2.0)["angle"][0] == 14.0  # a changed argument is another one


def test_a_last_bit_and_a_sign_of_zero_make_another_call():
    scaled, calls = _counted()
    for factor in (1.0, np.nextafter(1.0, 2.0), 0.0, -0.0):
        scaled(_Plan(1.0, np.ones(1)), float(factor))
    assert len(calls) == 4
    assert np.signbit(scaled(_Plan(1.0, np.ones(1)), -0.0)["angle"][0])


def test_no_more_results_are_kept_than_asked_for():
    scaled, calls = _counted()
    for factor in (1.0, 2.0, 3.0, 1.0):
        scaled(_Plan(1.0, np.ones(1)), factor)
    assert calls == [1.0, 2.0, 3.0, 1.0]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1.0, 1),
        (True, 1),
        (np.zeros(4), np.zeros((2, 2))),
        (np.zeros(2), np.zeros(2, dtype=np.float32)),
        ((1.0, 2.0), (1.0, (2.0,))),
        ("1", 1),
        (None, False),
        (_Plan(0.0, np.ones(2)), (0.0, np.ones(2))),
    ],
)
def test_values_of_other_kinds_have_other_keys(one, other):
    assert exact_key(one) != exact_key(other)


def test_objects_without_an_exact_key_are_refused():
    with pytest.raises(TypeError, match="set has no exact key"):
        exact_key({1.0})
