"""Scenarios, profiles and options that make no log: exit status, one line."""

import pytest


@pytest.mark.parametrize(
    ("args", "status", "expected"),
    [
        ([], 2, "--imu and --rate are needed"),
        (["--imu", "mti-x", "--rate", "1"], 1, "mti-x: not an installed IMU profile (ideal, mti-g"),
        (["--imu", "ideal", "--rate", "1", "--axis", "1,2"], 2, "is not three numbers"),
        (["--imu", "ideal", "--rate", "1", "--axis", "w"], 2, "--axis: 'w' is not allowed"),
        (["--imu", "ideal", "--rate", "1", "--axis", "0,0,0"], 2, "has no direction"),
        (["--imu", "ideal", "--rate", "nan"], 2, "'nan' is not a number from -1e+09 to 1e+09"),
        (["--imu", "ideal", "--rate", "1e999"], 2, "is not a number from"),
        (["--imu", "ideal", "--rate", "1", "--ramp", "-1"], 2, "'-1' is not a number from 0 to"),
        (["--imu", "ideal", "--rate", "1", "--latitude", "99"], 2, "--latitude: 99.0 is"),
        (["--scenario", "no.toml"], 1, "no.toml: cannot be read"),
        (["--scenario", "no.toml", "--rate", "5"], 2, "--rate: the legs come from --scenario"),
        (
            [*("--imu", "ideal", "--rate", "0"), *("--static", "0"), *("--navigation", "0")],
            2,
            "the total duration is 0 s",
        ),
    ],
)
def test_simulate_refuses_what_makes_no_log(rotcli, tmp_path, args, status, expected):
    outcome = rotcli("simulate", *args, "-o", tmp_path / "run")
    assert outcome.status == status
    assert expected in outcome.err
    assert not (tmp_path / "run").exists()


SCENARIOS = {
    "not TOML": ("leg = [", "not a TOML file"),
    "no profile": ("seed = 1", "profile: missing"),
    "no leg": ('profile = "ideal"', "leg: missing"),
    "no duration": ('profile = "ideal"\n[[leg]]\nrate = 1', "[[leg]] 1 duration: missing"),
    "unknown key": (
        'profile = "ideal"\n[[leg]]\nduraton = 1',
        "duraton: unknown key; similar: duration",
    ),
    "bad stage": ('profile = "ideal"\n[[leg]]\nduration = 1\nstage = "spin"', "stage: 'spin'"),
    "NUL in a name": (
        'profile = "a\\u0000"\n[[leg]]\nduration = 1',
        "profile: 'a\\x00' is neither an installed profile nor a file name",
    ),
    "bad seed": ('profile = "ideal"\nseed = -1\n[[leg]]\nduration = 1', "seed: -1"),
}


@pytest.mark.parametrize("fault", SCENARIOS)
def test_a_faulty_scenario_is_named(rotcli, tmp_path, fault):
    text, expected = SCENARIOS[fault]
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    outcome = rotcli("simulate", "--scenario", path, "-o", tmp_path / "run")
    assert outcome.status == 1
    assert f"{path}: " in outcome.err
    assert expected in outcome.err


PROFILES = {
    "unknown key": ("[gyro]\nbais = [1, 2, 3]", "[gyro] bais: unknown key; similar: bias"),
    "two numbers": ("[gyro]\nbias = [1, 2]", "is not a list of 3 numbers"),
    "negative": ("[gyro]\nangle_random_walk = -1", "is out of range; allowed: 0 to 10000"),
    "text": ('[accel]\nrange = "big"', "'big' is not a number"),
    "pair": ("[gyro]\ninstallation = { xx = 1 }", "installation xx: unknown key"),
}


@pytest.mark.parametrize("fault", PROFILES)
def test_a_faulty_profile_is_named(rotcli, tmp_path, fault):
    text, expected = PROFILES[fault]
    path = tmp_path / "imu.toml"
    path.write_text(text)
    outcome = rotcli("simulate", "--imu", path, "--rate", "1", "-o", tmp_path / "run")
    assert outcome.status == 1
    assert expected in outcome.err


def test_simulate_reports_of_a_rate_beyond_the_gyros(rotcli, tmp_path):
    legs = ["--static", "1", "--rotation", "2", "--navigation", "1"]
    args = ["--imu", "nav440", "--rate", "410", *legs, "-o", tmp_path / "run"]
    outcome = rotcli("simulate", *args)
    assert outcome.status == 0
    assert "samples are clipped at the gyro range of NAV440, 400 deg/s" in outcome.err
