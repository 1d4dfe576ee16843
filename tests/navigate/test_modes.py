"""What each mode removes of the readings, and what is said of a calibration that does not fit."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import ResultError
from rotcli.navigate import modes
from rotcli.navigate.place import prepare
from rotcli.run.correction import Correction
from rotcli.simulate.estimate import simulate

DEG = np.pi / 180


@pytest.fixture(scope="module")
def turning(papers_run):
    scenario = papers_run(rate=20.0, static=10.0, rotation=20.0, navigation=10.0)
    made = simulate(scenario)
    stages = {"static": [0.0, 10.0], "navigation": [35.0, 40.0]}
    rig = scenario.rig.override({"stages": stages})
    return prepare(made.imu, made.table, rig, need_static=True)


def correction(rate=20.0, axis=(0.0, 0.0, 1.0)):
    return Correction(
        path="c.json",
        imu=None,
        axis=np.array(axis),
        rates=(rate * DEG,),
        gyro_bias=np.zeros(3),
        gyro_column=np.zeros(3),
        accel_bias=np.array([0.01, 0.0, 0.0]),
    )


def test_each_mode_removes_its_own(turning):
    run, place = turning
    found = {
        mode: modes.removed(run, place.base, mode, correction(), None, static_named=False)
        for mode in ("conventional", "partial", "full")
    }
    assert found["conventional"].accel is None
    assert found["conventional"].warnings == (
        "the table turns in the window: not a conventional run",
    )
    for mode in ("partial", "full"):
        assert found[mode].warnings == ()
        assert found[mode].accel.bias.tolist() == [0.01, 0.0, 0.0]


def test_a_calibration_of_another_rate_is_refused_or_a_warning(turning):
    run, place = turning
    assert modes.rate_mismatch(run, None, allowed=False) is None
    assert modes.rate_mismatch(run, correction(), allowed=False) is None
    with pytest.raises(ResultError, match="calibrate at that rate"):
        modes.rate_mismatch(run, correction(rate=30.0), allowed=False)
    warnings = modes.rate_mismatch(run, correction(rate=30.0), allowed=True)
    removed = modes.removed(run, place.base, "partial", correction(), warnings, static_named=False)
    assert removed.warnings == (warnings,)
    assert "made at 30 deg/s, but in the window the table turns at 20 deg/s" in warnings


def test_a_calibration_made_standing_still_is_for_a_still_table():
    axis = np.array([0.0, 0.0, 1.0])
    still = replace(correction(), rates=())
    assert still.check_applies(axis, 0.0, constant_rate=True) is None
    warnings = still.check_applies(axis, 0.2, constant_rate=True)
    assert warnings == "c.json: made on a still table, but in the window navigated the table turns"
