"""`rotcli budget` on the command line: where the sensors come from, formats, errors."""

import hashlib
import json
from pathlib import Path

import pytest

from rotcli.cli.main import main


@pytest.fixture
def rotcli(capsys):
    """Run the command line; return status, standard output and standard error."""

    def run(*args):
        with pytest.raises(SystemExit) as stop:
            main(["budget", *args])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return run


@pytest.fixture
def calibration(tmp_path):
    """A calibration about z at 20 deg/s, made 45 deg north."""

    def write(**changes):
        doc = {
            "kind": "calibration",
            "schema": 1,
            "axis": "z",
            "rate": {"value": 20.0, "sigma": None, "unit": "deg/s"},
            "parameters": {
                name: {"value": value, "sigma": 1.0, "unit": unit}
                for name, value, unit in (
                    ("bias_x", 10.0, "deg/h"),
                    ("bias_y", 20.0, "deg/h"),
                    ("bias_z", 30.0, "deg/h"),
                    ("Kgxz", 400.0, "ppm"),
                    ("Kgyz", 500.0, "ppm"),
                    ("Kgz", 600.0, "ppm"),
                )
            },
            "rig": {"site": {"latitude": 45.0}, "imu": {"angle_random_walk": 0.3}},
            **changes,
        }
        path = tmp_path / "calibration.json"
        path.write_text(json.dumps({k: v for k, v in doc.items() if v is not None}))
        return str(path)

    return write


def read(path):
    return json.loads(path.read_text())


def test_the_help_s_example_runs_and_prints_every_table(rotcli):
    status, out, err = rotcli("--imu", "nav440", "--rate", "10", "--gyro-bias", "0,0,0")
    assert (status, err) == (0, "")
    for title in (
        "Error after one turn at 10",
        "Navigation error after",
        "Error growth over 300 s",
    ):
        assert title in out
    assert "Predicted sigma of a calibration" in out
    assert "Recommended axis: z at 10 deg/s" in out


def test_a_calibration_gives_biases_elements_rate_and_site_and_the_rest_is_said_to_be_zero(
    rotcli, calibration, tmp_path
):
    out = tmp_path / "budget.json"
    path = calibration()
    status, _, err = rotcli("--calibration", path, "-o", str(out))
    assert status == 0
    assert (
        "rotcli: warning: assumed zero, no value given: accel_bias_x, "
        "accel_bias_y, accel_bias_z, Kgx, Kgy, Kgxy, Kgyx, Kgzx, Kgzy (options: --imu"
    ) in err
    assert f"rotcli: {out}: Recommended axis: z at 20 deg/s" in err
    assert "The ranking is incomplete: scale factor and installation about x, y are unknown" in err
    assert "MEMS" not in err
    doc = read(out)
    assert doc["kind"] == "budget"
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    assert doc["sources"] == {"calibration": path, "calibration_sha256": digest}
    values = {name: round(q["value"], 9) for name, q in doc["parameters"].items()}
    assert {name: value for name, value in values.items() if value} == {
        "bias_x": 10.0,
        "bias_y": 20.0,
        "bias_z": 30.0,
        "Kgxz": 400.0,
        "Kgyz": 500.0,
        "Kgz": 600.0,
    }
    assert doc["rate"]["value"] == pytest.approx(20.0)
    assert doc["latitude"]["value"] == pytest.approx(45.0)
    assert doc["noise"]["angle_random_walk"]["value"] == pytest.approx(0.3)


def test_a_calibration_overrides_a_profile_and_options_override_both(rotcli, calibration, tmp_path):
    out = tmp_path / "budget.json"
    status, _, err = rotcli(
        *("--imu", "nav440", "--calibration", calibration(), "-o", str(out), "--rate", "-30"),
        *("--gyro-bias", "1,2,3", "--latitude", "10", "--rate-random-walk", "0.5", "--axis", "z"),
    )
    assert status == 0
    assert "assumed zero" not in err
    assert "calibration at 20 deg/s, budget for -30 deg/s. MEMS gyros are not linear" in err
    doc = read(out)
    parameters = {name: q["value"] for name, q in doc["parameters"].items()}
    assert parameters["bias_z"] == pytest.approx(3.0)
    assert parameters["Kgz"] == pytest.approx(600.0)
    assert parameters["Kgx"] == pytest.approx(900.0)  # the profile's
    assert parameters["accel_bias_z"] == pytest.approx(0.05)
    assert doc["rate"]["value"] == pytest.approx(-30.0)
    assert doc["latitude"]["value"] == pytest.approx(10.0)
    assert doc["noise"]["rate_random_walk"]["value"] == pytest.approx(0.5)
    assert doc["noise"]["angle_random_walk"]["value"] == pytest.approx(0.4)
    assert list(doc["axes"]) == ["z"]
    assert doc["rig"]["imu"]["name"] == "NAV440"


def test_a_rig_gives_site_attitude_and_noise(rotcli, tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(
        "[site]\nlatitude = 30.0\ngravity = 9.79\n[attitude]\npitch = 0.0\nroll = 0.0\n"
        "azimuth = 90.0\n[imu]\nangle_random_walk = [0.3, 0.3, 0.6]\n"
    )
    out = tmp_path / "budget.json"
    figures = ("--accel-bias", "0.01,0,0", "--gyro-scale", "1,2,3")
    more = ("--gyro-bias", "0,0,0", "--gyro-installation", "1,2,3,4,5,6")
    status, _, err = rotcli("--rig", str(rig), *figures, *more, "-o", str(out))
    assert status == 0
    assert "warning" not in err
    doc = read(out)
    assert doc["gravity"]["value"] == 9.79
    # The root mean square of the axes.
    assert doc["noise"]["angle_random_walk"]["value"] == pytest.approx(0.3 * 2**0.5)
    # Facing east, the body's x points south: 0.01 x 36 s.
    left = doc["axes"]["x"]["accelerometer_bias"]["closed_form"]
    assert left["north_mps"] == pytest.approx(-0.36)
    names = {"Kgxy": 1, "Kgxz": 2, "Kgyx": 3, "Kgyz": 4, "Kgzx": 5, "Kgzy": 6}
    for name, value in names.items():
        assert doc["parameters"][name]["value"] == pytest.approx(value)


def test_a_mtig_profile_is_in_the_papers_laboratory_by_default(rotcli, tmp_path):
    out = tmp_path / "budget.json"
    assert rotcli("--imu", "mti-g", "-o", str(out), "--quiet")[0] == 0
    doc = read(out)
    assert doc["latitude"]["value"] == pytest.approx(51.08)
    assert doc["rate"]["value"] == pytest.approx(10.0)
    assert doc["calibration"]["best"]["time_s"] == pytest.approx(119.9, abs=0.1)


def test_without_any_noise_figure_that_is_said(rotcli):
    status, out, err = rotcli("--accel-bias", "0.01,0,0")
    assert status == 0
    assert "no angle random walk: the calibration's sigmas contain no white noise" in err
    assert "Predicted sigma" not in out


@pytest.mark.parametrize(
    ("suffix", "start"),
    [("md", "### Error after"), ("tex", "% Needs"), ("csv", "table,unit,"), ("txt", "Err")],
)
def test_the_output_s_suffix_chooses_the_format(rotcli, tmp_path, suffix, start):
    out = tmp_path / f"budget.{suffix}"
    status, printed, err = rotcli("--imu", "nav440", "-o", str(out), "--quiet")
    assert (status, printed, err) == (0, "", "")
    assert out.read_text().startswith(start)


def test_a_dash_is_json_on_standard_output(rotcli):
    status, out, _ = rotcli("--imu", "nav440", "-o", "-")
    assert status == 0
    assert json.loads(out)["kind"] == "budget"


def test_a_report_takes_a_budget(rotcli, tmp_path, capsys):
    out = tmp_path / "budget.json"
    rotcli("--imu", "nav440", "-o", str(out), "--quiet")
    with pytest.raises(SystemExit) as stop:
        main(["report", str(out)])
    assert stop.value.code == 0
    assert "Error after one turn at 10 deg/s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("args", "text"),
    [
        ([], "no sensor errors: use --imu, --calibration, or figures such as --gyro-bias"),
        (["--imu", "nav440", "--rate", "0"], "--rate must not be 0"),
        (["--imu", "nav440", "--rate", "nan"], "'nan' is not a number from"),
        (["--gyro-bias", "1,2"], "'1,2' is not 3 numbers with commas"),
        (["--gyro-scale", "1,2,inf"], "'1,2,inf' is not 3 numbers with commas"),
        (["--gyro-installation", "1,2,3"], "'1,2,3' is not 6 numbers with commas"),
        (["--accel-bias", "a,b,c"], "'a,b,c' is not 3 numbers with commas"),
        (["--imu", "nav440", "--axis", "w"], "'w' is not one of 'x', 'y', 'z'"),
        (["--imu", "nav440", "--duration", "0"], "'--duration'"),
        (["--imu", "nav440", "--angle-random-walk", "-1"], "'--angle-random-walk'"),
    ],
)
def test_a_wrong_command_line_exits_with_2_and_says_why(rotcli, args, text):
    status, out, err = rotcli(*args)
    assert (status, out) == (2, "")
    assert text in err


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"kind": "navigation"}, "contains a result of kind navigation; a calibration is needed"),
        ({"rate": None, "segments": [{"rate_dps": 5.0}]}, "rate.value: None is not a number"),
        (
            {"rate": {"value": 0.0, "unit": "deg/s"}, "segments": [{"rate_dps": 5.0}]},
            "--rate must not be 0",
        ),
        ({"parameters": {}}, "is not a number"),
        ({"rig": {"site": {"latitude": 95.0}}}, "latitude"),
        ({"rig": [1]}, "rig: not a table of sections; calibrate again, or give a rig"),
    ],
)
def test_a_calibration_that_cannot_be_used_is_refused_by_name(rotcli, calibration, changes, text):
    status, out, err = rotcli("--calibration", calibration(**changes))
    assert status in (1, 2)
    assert out == ""
    assert text in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("args", "text"),
    [
        (["--imu", "none.toml"], "none.toml: not an installed IMU profile"),
        (["--calibration", "none.json"], "none.json: cannot be read"),
        (["--imu", "nav440", "--rig", "none.toml"], "none.toml: cannot be read"),
        (["--imu", "nav440", "-o", "/nowhere/budget.json"], "/nowhere/budget.json: cannot be"),
    ],
)
def test_files_at_fault_exit_with_1_and_one_line(rotcli, args, text):
    status, out, err = rotcli(*args)
    assert (status, out) == (1, "")
    assert err.startswith("rotcli: error: ") or "rotcli: warning: " in err
    assert text in err


def test_the_errors_within_the_turn_are_printed_and_drawn_on_request(rotcli, tmp_path):
    picture = tmp_path / "within.png"
    status, out, err = rotcli("--imu", "nav440", "--within-turn", "--plot", str(picture))
    assert (status, err) == (0, "")
    assert "Errors of the sensors in East, North, Up within one turn at 10 deg/s" in out
    assert "This is contradicted:" in out
    assert picture.stat().st_size > 50_000
    _, out, _ = rotcli("--imu", "nav440")
    assert "within one turn" not in out
