"""Advice from evidence: wrong set-ups and disturbed logs are named with their cause and time."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rotcli.observe.document import unreliable_estimates
from rotcli.observe.observability import TableMotion, analyse
from rotcli.observe.zupt import Options, filter_log
from rotcli.observe.zupt.checks.explanation import Evidence
from rotcli.observe.zupt.consistency import nis_verdict
from rotcli.observe.zupt.model import build_update_model
from rotcli.observe.zupt.updates import preintegrate_updates
from rotcli.observe.zupt.velocity_noise import velocity_sigma
from rotcli.units import DEG
from tests.observe.zupt_runs import FIGURES, simulated

from .zupt_truth import DT, perfect, sensors, settings, staircase

LEGS = ((20.0, 0.0), (40.0, 90.0))


def codes(result):
    return {finding.code for finding in result.findings}


def changed(imu, gyro=None, accel=None):
    return replace(
        imu, gyro=imu.gyro if gyro is None else gyro, accel=imu.accel if accel is None else accel
    )


def test_a_missing_lever_arm_is_named_and_the_attitude_is_not():
    arm = {"lever_arm": [0.0, 0.2, 0.0]}
    imu, table, rig, _ = simulated("x", 0.0, legs=LEGS, imu={**FIGURES, **arm})
    wrong = rig.override({"imu": {"lever_arm": [0.0, 0.0, 0.0]}})
    result = filter_log(imu, table, wrong, Options())
    assert codes(result) == {"lever-arm"}
    assert result.explanation.cause == "lever arm"
    np.testing.assert_allclose(result.explanation.lever_arm, [0.0, 0.2, 0.0], atol=2e-3)
    (text,) = [text for text in result.warnings if "lever_arm" in text]
    assert "with (0.000, 0.2" in text
    assert not any("correct [attitude]" in text for text in result.warnings)
    motion = TableMotion((1.0, 0.0, 0.0), 90.0 * DEG)
    assert set(unreliable_estimates(result, analyse(motion)).values()) == {
        "the accelerometers contradict the lever arm"
    }
    estimated = filter_log(imu, table, wrong, Options(estimate_lever_arm=True))
    assert not codes(estimated)
    assert estimated.estimates.values[-1, 12] == pytest.approx(0.2, abs=4e-3)


def test_a_lever_arm_of_the_rig_that_is_not_there_is_named():
    imu, table, rig, _ = simulated("x", 0.0, legs=LEGS)
    result = filter_log(
        imu, table, rig.override({"imu": {"lever_arm": [0.0, 0.5, 0.0]}}), Options()
    )
    assert codes(result) == {"lever-arm"}
    np.testing.assert_allclose(result.explanation.lever_arm, [0.0, -0.5, 0.0], atol=2e-3)


def test_accelerometer_scale_errors_are_named_and_the_attitude_is_not():
    imu, table, rig, _ = simulated("y", 0.0, legs=((20.0, 0.0), (60.0, 45.0)))
    result = filter_log(
        changed(imu, accel=imu.accel * [1.007, 1.0, 1.021]), table, rig, Options(scale=3e-3)
    )
    assert codes(result) == {"accelerometer-scale"}
    x, y, z = result.explanation.scale_errors
    # 0.1 % of g is the noise of the profile's turn-on biases over the rotation.
    np.testing.assert_allclose([x, z], [0.007, 0.021], atol=1e-3)
    assert np.isnan(y)  # perpendicular to gravity all the time
    (text,) = result.warnings
    assert "scale factor errors (x 0.7" in text
    assert "not [attitude]; calibrate the accelerometers" in text


@pytest.mark.parametrize("axis", ["y", "z"])
def test_a_wrong_attitude_is_named(axis):
    imu, table, rig, _ = simulated(axis, 10.0, legs=((20.0, 0.0), (60.0, 30.0)))
    result = filter_log(
        imu, table, rig.override({"attitude": {"pitch": 11.0}}), Options(scale=3e-3)
    )
    assert codes(result) == {"attitude-offset"}
    assert result.explanation.tilt == pytest.approx(1.0 * DEG, abs=0.1 * DEG)
    (text,) = result.warnings
    assert "deg off [attitude]; the estimated attitude is used; correct [attitude]" in text


def test_a_still_table_does_not_distinguish_the_causes_and_lists_them():
    s = settings("still")
    evidence = Evidence(s, DT)
    accel = np.tile(s.gravity * s.C_nb[2] + [0.2, 0.0, 0.0], (1000, 1))
    evidence.add(accel, np.zeros(1000), 1)
    assert evidence.explain().cause == "unknown"


@pytest.mark.parametrize("jitter", [0.0, 1e-3, 5e-3])
def test_the_velocity_noise_is_that_of_the_table(jitter):
    rng = np.random.default_rng(6)
    s = settings("y30")
    theta, rate, acceleration = staircase((0, 20), (40, 280))
    log = perfect(s.C_nb, s.axis, theta, rate, (0.1, 0.0, 0.1), acceleration)
    gyro, accel, _, _ = sensors(rng, log)
    model = build_update_model(theta, DT, s)
    dv_n = preintegrate_updates(model, gyro, accel).dv_n
    dv_n = dv_n + np.diff(jitter * rng.normal(size=(len(dv_n) + 1, 3)), axis=0)
    found = velocity_sigma(dv_n, theta[:: s.samples], s, model.tau)
    if jitter:
        # Two sigmas of the estimate are subtracted; the white noise is 6e-4 m/s.
        assert found == pytest.approx(jitter, rel=0.2)
    else:
        assert found == pytest.approx(0.1 * 0.002 * np.sqrt(0.1))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("axis", "rate"), [("z", 10.0), ("y", 60.0), ("x", 0.0)])
def test_a_clean_log_has_no_finding_and_consistent_innovations(axis, rate, seed):
    imu, table, rig, _ = simulated(axis, 0.0, legs=((30.0, 0.0), (60.0, rate)), seed=seed)
    result = filter_log(imu, table, rig, Options(scale=2e-3))
    assert result.findings == ()
    assert result.measured_noise
    assert result.nis_verdict == "consistent"


# Sample, channel, size (rad/s or m/s^2), samples: each lasts for 10 ms a sample.
SPIKES = {
    "one gyro sample about up": (("gyro", 2), 3.0, 1, "jump"),
    "a gyro perpendicular to the axis": (("gyro", 0), 1.0, 10, "disturbance"),
    "one accelerometer sample": (("accel", 0), 50.0, 1, "disturbance"),
}


@pytest.mark.parametrize("name", SPIKES)
def test_a_spike_is_reported_with_its_time(name):
    (sensor, axis), size, samples, code = SPIKES[name]
    imu, table, rig, _ = simulated("z", 0.0, legs=((20.0, 0.0), (60.0, 30.0)))
    readings = getattr(imu, sensor).copy()
    readings[5000 : 5000 + samples, axis] += size
    result = filter_log(changed(imu, **{sensor: readings}), table, rig, Options(scale=2e-3))
    (finding,) = [f for f in result.findings if f.code == code]
    assert float(finding.where.split()[0]) == pytest.approx(float(imu.time[5000]), abs=0.3)


def test_a_step_of_a_gyro_bias_and_rows_of_zeros_are_reported():
    imu, table, rig, _ = simulated("z", 0.0, legs=((20.0, 0.0), (60.0, 30.0)))
    gyro, accel = imu.gyro.copy(), imu.accel.copy()
    gyro[5000:, 0] += 2000.0 * DEG / 3600.0
    result = filter_log(changed(imu, gyro=gyro), table, rig, Options(scale=2e-3))
    assert "disturbance" in codes(result)
    gyro, accel = imu.gyro.copy(), imu.accel.copy()
    gyro[5000], accel[5000] = 0.0, 0.0
    result = filter_log(changed(imu, gyro, accel), table, rig, Options(scale=2e-3))
    assert result.nis_verdict == "inconsistent"
    assert "do not use any estimate" in result.warnings[-1]


def test_a_gyro_rate_that_is_not_that_of_the_table_is_reported():
    imu, table, rig, _ = simulated("z", 0.0, legs=((20.0, 0.0), (60.0, 30.0)))
    gyro = imu.gyro * [1.0, 1.0, 1.03]
    result = filter_log(changed(imu, gyro=gyro), table, rig, Options(scale=2e-3))
    (finding,) = [f for f in result.findings if f.code == "gyro-scale"]
    # The profile's scale error and the drift of its bias are up to 0.5 %.
    assert finding.value == pytest.approx(0.03, abs=5e-3)
    numbers = r"differs from the table rate by (\S+) %, (\S+) times .* \((\S+) ppm\)"
    percent, times, ppm = map(float, re.search(numbers, finding.text).groups())
    assert (percent, times) == pytest.approx((3.0, 15.0), rel=0.17)  # of 0.2 %
    assert ppm == 2000.0


@pytest.mark.parametrize(
    ("channel", "factor"), [("gyro_x", 1 / 57.3), ("gyro_y", 57.3), ("accel_x", 1 / 9.81)]
)
def test_a_channel_in_another_unit_is_reported_by_its_noise(channel, factor):
    imu, table, rig, _ = simulated("z", 0.0, legs=((20.0, 0.0), (40.0, 30.0)))
    sensor, axis = channel.split("_")
    readings = getattr(imu, sensor).copy()
    readings[:, "xyz".index(axis)] *= factor
    result = filter_log(changed(imu, **{sensor: readings}), table, rig, Options(scale=2e-3))
    (text,) = [text for text in result.warnings if "noise of" in text]
    assert channel in text


def test_the_verdict_allows_for_noise_figures_that_are_known_to_five_percent():
    assert nis_verdict(2.75, (2.95, 3.05)) == "consistent"
    assert nis_verdict(2.6, (2.95, 3.05)) == "conservative"
    assert nis_verdict(2.3, (2.5, 3.5)) == "consistent"


@pytest.mark.parametrize("model", ["simplified", "full"])
def test_the_advice_names_weak_states_or_omits_the_clause(model):
    advice = analyse(TableMotion(model=model)).advice
    assert "rely on ." not in advice
    assert advice.endswith("azimuth error and vertical gyro bias are unobservable.")
