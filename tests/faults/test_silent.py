"""Faults cause a finding, clean logs cause none."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotcli.logs.imu import read_imu
from rotcli.logs.plausible import check_axes, check_rest_readings, check_table_gaps
from rotcli.rig.rig import read_rig
from tests.campaigns.faults import silent, voyage
from tests.recorded import XSENS_COMPLETE_RIG, write_xsens_still

DEG = np.pi / 180


@pytest.fixture
def call(rotcli):
    """Return a function that runs a command line in this process."""

    def run(args):
        done = rotcli(*args)
        return SimpleNamespace(returncode=done.status, stderr=done.err)

    return run


@pytest.mark.parametrize(("name", "command"), silent.CASES)
def test_a_fault_causes_a_finding(name, command, call, tmp_path):
    seed = silent.CASES.index((name, command)) % 2  # Parquet and CSV in turn
    assert silent.judge(name, command, seed, tmp_path, call) is None


def test_a_run_without_the_fault_is_not_said_to_have_it(call, tmp_path):
    fault = silent.FAULTS["a still segment touched"]
    silent.FAULTS["nothing"] = silent.Fault(lambda run, rng: None, fault.says)
    try:
        for command in fault.says:
            warning = silent.judge("nothing", command, 1, tmp_path / command, call)
            assert warning is not None
    finally:
        del silent.FAULTS["nothing"]


def test_a_fault_of_a_voyage_causes_a_finding_and_a_clean_one_none(call, tmp_path):
    scenario = tmp_path / "voyage.toml"
    scenario.write_text("scenario = 'srins'\nseed = 1\nduration = 0.6\nrate = 5.0\n")
    assert (
        call(["srins", "simulate", "--scenario", scenario, "-o", tmp_path / "sea"]).returncode == 0
    )
    warning = {name: voyage.judge(name, tmp_path / "sea", call) for name in voyage.FAULTS}
    assert {name: text for name, text in warning.items() if text} == {}


# Seeds in groups of five: each kind of log; `make faults` takes 200.
@pytest.mark.parametrize("first", [0, pytest.param(5, marks=pytest.mark.campaign)])
def test_clean_logs_raise_no_alarm(first, call, tmp_path):
    for seed in range(first, first + 5):
        assert silent.alarms(seed, tmp_path / str(seed), call) == [], seed


def test_the_real_recording_raises_no_alarm(rotcli, tmp_path):
    recording = write_xsens_still(tmp_path)
    log = read_imu(recording, read_rig(tmp_path / "rig.toml"))
    assert log.warnings == ()
    assert check_rest_readings("log", log.gyro, log.interval) == []
    # No command has anything to add. The gyros'
    # uncalibrated biases are 0.6 deg/s and more, the sigmas of `observe` by default 0.14.
    rig = tmp_path / "complete.toml"
    rig.write_text(XSENS_COMPLETE_RIG)
    for line in (
        ["allan", recording],
        ["navigate", recording, "--static", "0.5:30.5", "--window", "30.5:50.5"],
        ["observe", recording, "--window", "0.5:50.5", "--sigma-gyro", "10000"],
        ["convert", recording, "-o", tmp_path / "x.parquet", "--quiet"],
    ):
        done = rotcli(*line, "--rig", rig)
        assert (done.status, done.err) == (0, "")


def test_a_log_without_noise_and_one_of_many_levels_are_left_alone():
    time = 0.01 * np.arange(3000)
    assert check_axes("log", time, np.zeros((6, 3000))) == []
    rng = np.random.default_rng(1)
    # The coarsest sound digitisation: the noise is three steps wide, 20 levels or more.
    assert check_axes("log", time, np.round(3.0 * rng.normal(size=(6, 3000)))) == []


def test_the_longest_run_of_one_value_is_found_wherever_it_lies():
    rng = np.random.default_rng(2)
    time = 0.01 * np.arange(2000)
    for start in (0, 1, 777, 1940):
        values = rng.normal(size=(6, 2000))
        values[4, start : start + 60] = values[4, start]
        (warning,) = check_axes("log", time, values)
        end = start + 59
        assert (
            f"accel_y is constant ({values[4, start]:.6g}) from {time[start]:.6g} to "
            f"{time[end]:.6g}" in warning
        )
        values[4, start + 45 :] += 1.0  # a run of 45 is none
        assert check_axes("log", time, values) == []


def test_a_table_too_slow_for_its_turns_causes_a_warning():
    time = 0.5 * np.arange(40)
    (warning,) = check_table_gaps("t", time, 300 * DEG * time, 0.5)
    assert "changes by 150 deg within 0.5 s" in warning
    assert "log the table faster" in warning
    assert check_table_gaps("t", time, 10 * DEG * time, 0.5) == []
