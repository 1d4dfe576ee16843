"""Leaps of a table angle: what happened is named with its time, and no motion is called a leap."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.record import TableLog
from rotcli.run.evidence.leaps import LEAP, SMALL_LEAP, check_leaps, find_leaps
from rotcli.run.motion import encoder_noise
from rotcli.run.segments import segment_between
from rotcli.units import DEG

TIME = 0.02 * np.arange(6001)
TURNING = 30.0 * DEG * np.clip(TIME - 20.0, 0.0, None)


def words(angle, least=SMALL_LEAP):
    table = TableLog("table", TIME, angle, 0.02)
    return [f.text for f in check_leaps(table, 0.0, 120.0, encoder_noise(table).resolution, least)]


def test_motion_is_no_leap():
    sweep = 100.0 * DEG * np.sin(2.0 * np.pi * TIME / 3.0)
    ramp = 100.0 * DEG * np.clip(TIME - 20.03, 0.0, None)  # within a record
    abrupt = 100.0 * DEG * np.interp(TIME, [20, 20.04, 120], [0, 0.02, 99.98])
    coarse = np.round(TURNING / DEG) * DEG
    noise = 0.02 * DEG * np.random.default_rng(1).standard_normal(len(TIME))
    for angle in (TURNING, sweep, ramp, abrupt, coarse, TURNING + noise, np.zeros_like(TIME)):
        assert words(angle, LEAP) == []
    for angle in (TURNING, coarse, TURNING + noise):
        assert words(angle) == []
    slow = TableLog("table", TIME[::100], TURNING[::100], 2.0)  # ramps within one record
    assert check_leaps(slow, 0.0, 120.0, 0.0, LEAP) == ()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda a: a + 0.2 * DEG * (TIME > 90.0), "the angle leaps by 0.2 deg at 90.02 s"),
        (lambda a: a + 5.0 * DEG * (TIME > 90.0), "the angle leaps by 5 deg at 90.02 s"),
        (lambda a: np.where(TIME == 90.0, a + 1.0 * DEG, a), "1 record is off by 1 deg at 90 s"),
        (
            lambda a: np.where((TIME >= 80.0) & (TIME < 80.1), a - 2.0 * DEG, a),
            "5 records are off by 2 deg at 80 s",
        ),
        (
            lambda a: np.where((TIME >= 80.0) & (TIME < 81.0), 1800.0 * DEG, a),
            "the angle is constant from 80 to 80.98 s, then leaps by 29.4 deg",
        ),
        (
            lambda a: a + 0.4 * DEG * np.floor(a / (2.0 * np.pi)),
            "the angle leaps by 0.4 deg at 32, 44, 56, 68 s and 4 times more",
        ),
    ],
)
def test_a_leap_is_named_with_time_and_size(change, says):
    (text,) = words(change(TURNING.copy()))
    assert says in text
    table = TableLog("table", TIME, change(TURNING.copy()), 0.02)
    if "0.2 deg" not in says and "0.4" not in says:
        with pytest.raises(LogError, match=r"neither still nor turning.*\(.*the angle|\(.*record"):
            segment_between(table, 30.0, 110.0)


def test_a_small_leap_matters_to_a_calibration_only():
    angle = TURNING + 0.2 * DEG * (TIME > 90.0)
    assert find_leaps(TIME, angle, 0.0, SMALL_LEAP)
    assert not find_leaps(TIME, angle, 0.0, LEAP)


def test_a_poor_encoder_is_named_in_the_error():
    angle = TURNING + 0.5 * DEG * np.sin(TURNING)
    with pytest.raises(LogError, match=r"error of 0\.5 deg once per turn: it is eccentric"):
        segment_between(TableLog("table", TIME, angle, 0.02), 30.0, 110.0)


@pytest.mark.parametrize("shift", [0.005, 0.015, -0.019])
def test_a_wrong_stamp_is_a_wrong_angle_with_its_time(shift):
    time = TIME.copy()
    time[4500] += shift  # at 90 s
    table = TableLog("table", time, TURNING, 0.02)
    (found,) = check_leaps(table, 0.0, 120.0, 0.0, SMALL_LEAP)
    assert f"1 record is off by {abs(shift) * 30.0:.3g} deg at {90.0 + shift:g} s" in found.text
    jitter = TIME + 0.004 * np.random.default_rng(1).uniform(-1.0, 1.0, len(TIME))
    assert check_leaps(TableLog("table", jitter, TURNING, 0.02), 0.0, 120.0, 0.0, SMALL_LEAP) == ()


def test_a_wrong_stamp_in_smooth_motion_is_found():
    # No step of the angle differs from its neighbours: only the stamp shows it.
    angle = 300.0 * DEG * np.sin(2.0 * np.pi * TIME / 60.0)
    assert find_leaps(TIME, angle, 0.0, SMALL_LEAP) == []
    time = TIME.copy()
    time[3000] += 0.015  # at 60 s, at the largest rate of 31.4 deg/s
    (leap,) = find_leaps(time, angle, 0.0, SMALL_LEAP)
    assert (leap.records, leap.time) == (1, pytest.approx(60.015))
    assert abs(leap.size) == pytest.approx(0.015 * 300.0 * DEG * 2.0 * np.pi / 60.0, rel=1e-2)
