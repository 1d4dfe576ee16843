"""Verdicts on both sides of each guard band (JCGM 106:2012, 8.3)."""

import pytest

from rotcli.models.conformity import Limits, verdict

LIMITS = Limits(-10.0, 20.0, "deg/h", guard=2.0)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        # sigma 0.5, guard 2: the bands are -10 +- 1 and 20 +- 1; their ends are inside.
        (-11.1, "fail"),
        (-10.9, "undecided"),
        (-9.1, "undecided"),
        (-9.0, "pass"),
        (0.0, "pass"),
        (19.0, "pass"),
        (19.1, "undecided"),
        (20.9, "undecided"),
        (21.1, "fail"),
    ],
)
def test_a_band_of_two_sigma_on_either_side_of_a_limit_is_undecided(value, expected):
    assert verdict(value, 0.5, LIMITS) == expected


def test_one_limit_or_no_sigma():
    assert verdict(-1e9, 0.5, Limits(None, 20.0, "deg/h")) == "pass"
    assert verdict(1e9, 0.5, Limits(-10.0, None, "deg/h")) == "pass"
    assert verdict(0.0, None, LIMITS) == "undecided"
    assert verdict(20.0, 0.5, Limits(-10.0, 20.0, "deg/h", guard=0.0)) == "pass"
