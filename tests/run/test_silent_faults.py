"""Faults that would otherwise be wrong in silence: a log read otherwise than it was meant."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.record import ImuLog, TableLog
from rotcli.navigate.place import prepare
from rotcli.rig.rig import TableSettings, rig_from_dict
from rotcli.run.alignment.checks import check_lag
from rotcli.run.alignment.lag import find_lag
from rotcli.run.checks import judge
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG

AXIS = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(("imu", "rate"), [("nav440", 20.0), ("mti-g", -100.0)])
def test_means_read_as_instants_lag_half_a_sample(papers_run, imu, rate):
    made = simulate(papers_run(imu, rate=rate, seed=1, imu={"sampling": "average"}))
    assert check_lag(made.imu, made.table, AXIS) == ()
    (finding,) = check_lag(replace(made.imu, sampling="instant"), made.table, AXIS)
    sigma = float(finding.text.split("(sigma ")[1].split()[0])
    assert finding.code == "clock-lag"
    assert abs(finding.value - 5.0) < 4 * sigma
    assert 'probably means; set [imu] sampling = "average"' in finding.text


def test_another_clock_is_reported_with_its_size_and_the_offset_to_set(papers_run):
    made = simulate(papers_run("nav440", rate=20.0, seed=1))
    for lag, how in ((0.03, "lags"), (-0.03, "leads")):
        other = replace(made.table, time=made.table.time - lag)
        (finding,) = check_lag(made.imu, other, AXIS, settings=TableSettings(time_offset=1.5))
        assert f"the gyro log {how} the table log by " in finding.text
        assert finding.value == pytest.approx(1e3 * lag, abs=2.0)  # ms; sigma 0.4
        offset = float(finding.text.split("set [table] time_offset = ")[1])
        assert offset == pytest.approx(1.5 + lag, abs=2e-3)
        with pytest.raises(LogError, match=rf"the gyro log {how} the table .*time_offset = 1\."):
            judge("calibrate", [finding])
    # Less than two samples spoils no calibration.
    late = check_lag(made.imu, replace(made.table, time=made.table.time - 0.01), AXIS)
    assert [f.severity for f in judge("calibrate", late)] == ["warning"]


@pytest.mark.parametrize(
    ("imu", "rate"),
    [
        ("nav440", -100.0),
        ("mti-g", 10.0),
        pytest.param("nav440", 10.0, marks=pytest.mark.campaign),
    ],
)
def test_the_error_of_a_lag_is_as_large_as_its_sigma(papers_run, imu, rate):
    lags = (0.005, 0.03, 0.3, 1.75, -0.3)
    z = []
    for seed in range(50):
        scenario = papers_run(imu, rate=rate, seed=seed, static=20.0, rotation=20.0)
        made = simulate(replace(scenario, encoder_step=2e-4 if seed % 2 else 2e-7))
        for lag in lags:
            found = find_lag(made.imu, replace(made.table, time=made.table.time - lag), AXIS)
            z.append((found.lag - lag) / found.sigma)
    z = np.reshape(z, (50, len(lags)))
    # 50 draws: the mean square of unit normals lies in 0.5 to 1.6 (99.7 %), their mean in +-0.42.
    assert np.all((z**2).mean(axis=0) < 1.6)
    assert np.all((z**2).mean(axis=0) > 0.5)
    assert np.all(np.abs(z.mean(axis=0)) < 0.45)


@pytest.mark.parametrize("lag", [0.0, 0.005, 0.3, -2.2])
def test_the_lag_of_a_sweep_is_found(lag):
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 60.0, 0.01)
    rate, period = 50.0 * DEG, 10.0
    rates = np.zeros((len(time), 3))
    rates[:, 2] = rate * np.cos(2 * np.pi * time / period) + 1e-3 * rng.normal(size=len(time))
    imu = ImuLog("imu", time, rates, np.zeros_like(rates), 0.01)
    stamps = np.arange(-3.0, 63.0, 0.02)
    angle = rate * period / (2 * np.pi) * np.sin(2 * np.pi * stamps / period)
    found = find_lag(imu, TableLog("table", stamps - lag, angle, 0.02), AXIS)
    assert abs(found.lag - lag) < max(4 * found.sigma, 1e-5)


def test_a_table_at_one_rate_and_another_motion_report_no_lag():
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 60.0, 0.01)
    rates = 1e-3 * rng.normal(size=(len(time), 3)) + [0.0, 0.0, 20.0 * DEG]
    imu = ImuLog("imu", time, rates, np.zeros_like(rates), 0.01)
    steady = TableLog("table", time, 20.0 * DEG * time, 0.01)
    assert check_lag(imu, steady, AXIS) == ()
    grain = TableLog("table", time, np.round(20.0 * DEG * time, 4), 0.01)
    assert check_lag(imu, grain, AXIS) == ()
    other = TableLog("table", time, 1e-2 * np.cumsum(rng.normal(size=len(time))), 0.01)
    assert check_lag(imu, other, AXIS) == ()


@pytest.mark.parametrize("sampling", ["instant", "average"])
def test_clean_logs_raise_no_alarm(papers_run, sampling):
    for seed in range(24):
        imu = ("mti-g", "nav440")[seed % 2]
        rate = (5.0, -20.0, 60.0, 100.0)[seed // 2 % 4]
        scenario = papers_run(imu, rate=rate, seed=seed, static=20.0, rotation=20.0)
        scenario = replace(scenario, rig=scenario.rig.override({"imu": {"sampling": sampling}}))
        made = simulate(replace(scenario, encoder_step=2e-4 if seed % 3 else 2e-7))
        assert check_lag(made.imu, made.table, AXIS) == (), (imu, rate, seed)


def _prepared(papers_run, change, **rig):
    made = simulate(papers_run("nav440", rate=0.0, rotation=0.0, navigation=5.0, static=5.0))
    stored = papers_run().rig.effective()
    stages = {"static": [0.0, 5.0], "navigation": [5.0, 10.0]}
    imu = replace(made.imu, accel=change(made.imu.accel))
    run, _ = prepare(
        imu, None, rig_from_dict({**stored, "stages": stages, **rig}), need_static=True
    )
    return run


def test_a_clean_still_log_has_no_warning(papers_run):
    assert _prepared(papers_run, lambda f: f).warnings == ()


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda f: f / 9.80665, r"1\.005 m/s\^2, gravity 9\.8.*in g\? set the unit"),
        (lambda f: f * 0.01, r"increments\? set \[imu\] sampling"),
        (lambda f: f * 3.0, r"check the unit, and the order"),
        (lambda f: -f, r"gravity is 1[78]\d\.\d deg from .*report gravity, not specific force"),
        (
            lambda f: f[:, [2, 0, 1]],
            r"gravity is (89|9[01])\.\d deg .* check \[attitude\], \[imu\] mount",
        ),
    ],
    ids=["g", "increments", "factor", "flipped", "swapped"],
)
def test_gravity_of_the_wrong_size_or_on_the_wrong_axis_is_refused(papers_run, change, expected):
    with pytest.raises(LogError, match=expected):
        _prepared(papers_run, change)


def test_gravity_a_little_off_is_reported(papers_run):
    (warning,) = _prepared(papers_run, lambda f: 1.05 * f).warnings
    assert "the mean specific force is 10.35 m/s^2, gravity 9.808 m/s^2: check the unit" in warning
    attitude = {"pitch": 5.0, "roll": 0.0, "azimuth": 0.0}
    (warning,) = _prepared(papers_run, lambda f: f, attitude=attitude).warnings
    assert "gravity is 5." in warning or "gravity is 4.9" in warning
