"""The warning of an unaided height beyond its limit, against the closed form of its growth."""

import re

import numpy as np
import pytest

from rotcli.models.sensors import TriadErrors
from rotcli.navigate.estimate import Summary, navigate

from .test_estimate import NONE, _run


def fall(papers_run, laboratory, bias, seconds=180.0):
    """Return the statistics of a run with a vertical accelerometer bias (m/s^2), and its errors."""
    run = _run(papers_run(rate=0.0, rotation=0.0, navigation=seconds), laboratory)
    found = navigate(*run, NONE, TriadErrors(bias=np.array([0.0, 0.0, bias])), mode="partial")
    statistics = Summary("partial", 0.0)
    statistics.add(found)
    return statistics, found


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_height_beyond_ten_kilometres_is_reported_with_its_time(papers_run, laboratory, sign):
    statistics, found = fall(papers_run, laboratory, sign)
    # h'' = b + (2 g / R) h: h = b (cosh(w t) - 1) / w^2 with w^2 = 2 g / R.
    w = np.sqrt(2.0 * 9.81 / 6.371e6)
    passed = np.arccosh(1.0 + 1e4 * w * w) / w
    (text,) = statistics.warnings
    times = [float(number) for number in re.findall(r"([\d.]+) s\b", text)]
    # R is that of a sphere and falling at 140 m/s adds Coriolis force: 0.3 s of 141.
    assert times == [pytest.approx(found.time[0] + passed, abs=0.5)]


def test_a_height_within_ten_kilometres_is_not_reported(papers_run, laboratory):
    statistics, found = fall(papers_run, laboratory, 0.5)
    assert 5e3 < np.abs(found.errors[:, 2]).max() < 1e4
    assert statistics.warnings == ()
