"""Faults that would otherwise be wrong in silence: a log read otherwise than it was meant."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.checks import check_lag
from rotcli.logs.rig import rig_from_dict
from rotcli.stages.navigate import prepare
from rotcli.stages.simulate import simulate

AXIS = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(("imu", "rate"), [("nav440", 20.0), ("mti-g", -100.0)])
def test_means_read_as_instants_lag_half_a_sample(papers_run, imu, rate):
    made = simulate(papers_run(imu, rate=rate, seed=1, imu={"sampling": "average"}))
    assert check_lag(made.imu, made.table, AXIS) == ()
    (warning,) = check_lag(replace(made.imu, sampling="instant"), made.table, AXIS)
    found, sigma = (
        float(text.split()[0]) for text in warning.split(" table by ")[1].split("(sigma ")
    )
    assert abs(found - 5.0) < 4 * sigma
    assert "means read as instants" in warning


def test_another_clock_is_told_with_its_size(papers_run):
    made = simulate(papers_run("nav440", rate=20.0, seed=1))
    early = replace(made.table, time=made.table.time - 0.03)
    (warning,) = check_lag(made.imu, early, AXIS)
    assert float(warning.split(" table by ")[1].split()[0]) == pytest.approx(30.0, abs=2.0)
    assert "[table] time_offset" in warning


@pytest.mark.parametrize("sampling", ["instant", "average"])
def test_clean_logs_raise_no_alarm(papers_run, sampling):
    for seed in range(100):
        imu = ("mti-g", "nav440")[seed % 2]
        rate = (5.0, -20.0, 60.0, 100.0)[seed // 2 % 4]
        scenario = papers_run(imu, rate=rate, seed=seed, static=20.0, rotation=20.0)
        scenario = replace(scenario, rig=scenario.rig.override({"imu": {"sampling": sampling}}))
        made = simulate(replace(scenario, encoder_step=2e-4 if seed % 3 else 2e-7))
        assert check_lag(made.imu, made.table, AXIS) == (), (imu, rate, seed)


def _prepared(papers_run, change, **rig):
    made = simulate(papers_run("nav440", rate=0.0, rotation=0.0, navigation=5.0, static=5.0))
    held = papers_run().rig.effective()
    stages = {"static": [0.0, 5.0], "navigation": [5.0, 10.0]}
    imu = replace(made.imu, accel=change(made.imu.accel))
    return prepare(imu, None, rig_from_dict({**held, "stages": stages, **rig}), need_static=True)


def test_a_clean_still_log_has_no_warning(papers_run):
    assert _prepared(papers_run, lambda f: f).warnings == ()


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda f: f / 9.80665, r"1\.005 m/s\^2, gravity 9\.8.*in g\? name the unit"),
        (lambda f: f * 0.01, r"increments\? then say \[imu\] sampling"),
        (lambda f: f * 3.0, r"check the unit, and the order"),
        (lambda f: -f, r"gravity is felt 1[78]\d\.\d deg from where \[attitude\] puts it"),
        (lambda f: f[:, [2, 0, 1]], r"felt (89|9[01])\.\d deg .* correct \[imu\] mount"),
    ],
    ids=["g", "increments", "factor", "flipped", "swapped"],
)
def test_gravity_of_the_wrong_size_or_on_the_wrong_axis_is_refused(papers_run, change, expected):
    with pytest.raises(LogError, match=expected):
        _prepared(papers_run, change)


def test_gravity_a_little_off_is_told(papers_run):
    (warning,) = _prepared(papers_run, lambda f: 1.05 * f).warnings
    assert "the mean specific force is 10.35 m/s^2, gravity 9.808 m/s^2: check the unit" in warning
    attitude = {"pitch": 5.0, "roll": 0.0, "azimuth": 0.0}
    (warning,) = _prepared(papers_run, lambda f: f, attitude=attitude).warnings
    assert "gravity is felt 5." in warning or "gravity is felt 4.9" in warning
