"""What is wrong in silence is told, and what is right raises no alarm."""

from types import SimpleNamespace

import numpy as np
import pytest

from faults import silent
from rotcli.logs.files import read_imu
from rotcli.logs.plausible import check_axes, check_drop_outs, check_rest
from rotcli.logs.rig import read_rig
from tests.cli.conftest import FIXTURES
from tests.cli.conftest import rotcli as rotcli  # the fixture

DEG = np.pi / 180


@pytest.fixture
def call(rotcli):
    """Return a function that runs a command line in this process."""

    def run(args):
        done = rotcli(*args)
        return SimpleNamespace(returncode=done.status, stderr=done.err)

    return run


@pytest.mark.parametrize("name", silent.FAULTS)
def test_a_fault_is_told(name, call, tmp_path):
    assert silent.judge(name, 1, tmp_path, call) is None


@pytest.mark.parametrize("first", range(0, 20, 5))
def test_clean_logs_raise_no_alarm(first, call, tmp_path):
    for seed in range(first, first + 5):
        assert silent.alarms(seed, tmp_path / str(seed), call) == [], seed


def test_the_real_recording_raises_no_alarm():
    log = read_imu(FIXTURES / "xsens_still.csv", read_rig(FIXTURES / "xsens_rig.toml"))
    told = [w for w in log.warnings if "jitter" not in w]
    assert told == []
    assert check_rest("log", log.gyro, log.interval) == []


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
        (told,) = check_axes("log", time, values)
        end = start + 59
        assert (
            f"accel_y holds {values[4, start]:.6g} from {time[start]:.6g} to {time[end]:.6g}"
            in told
        )
        values[4, start + 45 :] += 1.0  # a run of 45 is none
        assert check_axes("log", time, values) == []


def test_a_table_too_slow_for_its_turns_is_told():
    time = 0.5 * np.arange(40)
    (told,) = check_drop_outs("t", time, 300 * DEG * time)
    assert "steps by 150 deg within 0.5 s" in told
    assert "log the table faster" in told
    assert check_drop_outs("t", time, 10 * DEG * time) == []
