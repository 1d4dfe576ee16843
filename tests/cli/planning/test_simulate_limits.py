"""Scenarios that no machine plays are refused in one line, and nothing is written."""

import pytest

LEG = 'profile = "nav440"\n[[leg]]\n'


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            ("--rate", 10, "--navigation", "1e15"),
            "'--navigation': '1e15' is not a number from 0 to",
        ),
        (("--rate", "1e308"), "'--rate': '1e308' is not a number from -1e+09 to 1e+09"),
        (("--rate", 10, "--ramp", "1e9"), "--ramp: 1000000000.0 is out of range"),
        (("--rate", 10, "--encoder-step", "1e9"), "--encoder-step: 1000000000.0 is out of range"),
    ],
)
def test_an_option_out_of_range_is_a_usage_error(rotcli, tmp_path, options, text):
    done = rotcli("simulate", "--imu", "nav440", *options, "-o", tmp_path / "q")
    assert done.status == 2
    assert text in done.err.replace("1000000000000000.0", "1e+15")
    assert not (tmp_path / "q").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('profile = "../../etc/passwd"\n[[leg]]\nduration = 20\n', "neither an installed profile"),
        ('profile = ".."\n[[leg]]\nduration = 20\n', "neither an installed profile"),
        ('profile = "/etc/passwd"\n[[leg]]\nduration = 20\n', "neither an installed profile"),
        (f"{LEG}duration = 1e12\n", "[[leg]] 1 duration: 1000000000000.0 is out of range"),
        (f"{LEG}duration = 1e-9\n", "[[leg]] 1 duration: 1e-09 s is shorter than one sample"),
        (f"{LEG}duration = 20\nrate = 1e9\n", "[[leg]] 1 rate: 1000000000.0 is out of range"),
        (f"{LEG}duration = 9e6\n", "GB of memory, this machine has"),
    ],
)
def test_a_scenario_out_of_range_is_one_line(rotcli, tmp_path, text, said):
    scenario = tmp_path / "s.toml"
    scenario.write_text(text)
    done = rotcli("simulate", "--scenario", scenario, "-o", tmp_path / "q")
    assert (done.status, done.out, done.err.count("\n")) == (1, "", 1)
    assert said in done.err
    assert not (tmp_path / "q").exists()


def test_a_sequence_too_long_for_the_memory_is_one_line(rotcli, tmp_path):
    steps = "[[steps]]\nhold = 1e6\n" * 100
    (tmp_path / "s.toml").write_text(f'axes = ["z"]\n{steps}')
    args = ("--sequence", tmp_path / "s.toml", "--imu", "nav440", "-o", tmp_path / "q")
    done = rotcli("simulate", *args)
    assert done.status == 1
    assert "GB of memory, this machine has" in done.err
    assert done.err.count("\n") == 1
