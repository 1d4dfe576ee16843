from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.rig.rig import rig_from_dict
from rotcli.run.recording import calibration_run, navigation_run
from tests.logs.made_logs import DEG, drifting, imu, table

RIG = rig_from_dict({"stages": {"static": [0, 59], "navigation": [65, 100]}})


def measured(log, seconds):
    """An IMU on the table of a log, that measures its rate about up."""
    still = imu(seconds)
    turned = np.interp(still.time, log.time, np.gradient(log.angle, log.interval))
    return replace(still, gyro=turned[:, None] * np.array([0.0, 0.0, 1.0]))


def test_a_run_is_cut_to_its_window_and_knows_the_table_there():
    log, _ = table([(0, 60), (10, 60)])
    run = navigation_run(measured(log, 119), log, RIG, need_static=True)
    assert (run.window, run.static) == (slice(6500, 10001), slice(0, 5901))
    assert run.rate / DEG == pytest.approx(10.0, rel=1e-9)
    assert run.constant_rate
    angle, rate = run.initial_angle_and_rate()
    assert angle == pytest.approx(float(np.interp(65.0, log.time, log.angle)), abs=1e-9)
    assert rate / DEG == pytest.approx(10.0, rel=1e-6)
    np.testing.assert_allclose(
        run.mean(run.window, lambda log, angle: log.gyro.sum(axis=0)) / DEG,
        [0.0, 0.0, 10.0],
        atol=1e-6,
    )
    assert navigation_run(measured(log, 119), log, RIG, need_static=False).static is None


def test_a_run_without_a_table_is_still():
    run = navigation_run(drifting(0, 120.0), None, RIG, need_static=False)
    assert (run.rate, run.constant_rate, run.initial_angle_and_rate()) == (0.0, True, (0.0, 0.0))
    assert not run.angle(run.window).any()


def test_a_window_of_three_samples_is_refused():
    short = RIG.override({"stages": {"navigation": [65, 65.02]}})
    with pytest.raises(
        LogError, match=r"contains 3 samples, at least 4 are needed; the log covers 0"
    ):
        navigation_run(drifting(0, 120.0), None, short, need_static=False)


def test_the_segments_of_a_calibration_know_what_they_were_named():
    log, _ = table([(0, 60), (10, 60)])
    rig = rig_from_dict({"stages": {"rotation": [65, 100]}})
    both = measured(log, 119)
    found = calibration_run(both, log, rig)
    assert [part.named for part in (*found.static, *found.rotation)] == [None, (65.0, 100.0)]
    found = calibration_run(both, log, rig, [(0.0, 20.0), (30.0, 65.0)])
    assert [part.named for part in found.static] == [(0.0, 20.0), (30.0, 65.0)]
    (cut,) = found.findings
    assert "only 30 to 59.98 s of the segment 30 to 65 s is used" in cut.text


def test_a_calibration_whose_gyros_turn_the_other_way_is_refused():
    log, _ = table([(0, 60), (10, 60)])
    mirrored = measured(replace(log, angle=-log.angle), 119)
    rig = rig_from_dict({})
    with pytest.raises(LogError, match="opposite sense"):
        calibration_run(mirrored, log, rig)
