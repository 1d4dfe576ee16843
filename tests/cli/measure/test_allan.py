"""The command on tiny real files: exit status, what it says, what it writes."""

import json

import numpy as np
import pytest

from rotcli.cli.main import main
from rotcli.files.columns import write_columns
from tests.recorded import write_xsens_still


@pytest.fixture(scope="module")
def xsens(tmp_path_factory):
    """The still part of the recorded Xsens MTi."""
    return write_xsens_still(tmp_path_factory.mktemp("xsens"))


def run(capsys, *args):
    with pytest.raises(SystemExit) as stop:
        main([str(a) for a in args])
    out, err = capsys.readouterr()
    return stop.value.code, out, err


def test_the_still_minute_of_a_real_imu(capsys, tmp_path, xsens):
    path = tmp_path / "allan.json"
    status, out, err = run(capsys, "allan", xsens, "--window", "0.5:51.5", "-o", path)
    assert (status, out) == (0, "")
    assert err.splitlines()[-1].startswith(f"rotcli: {path}: noise of {xsens}, ")
    doc = json.loads(path.read_text())
    for name in ("gyro_x", "gyro_y", "gyro_z"):
        coefficients = doc["axes"][name]["coefficients"]
        assert 1.0 < coefficients["random_walk"]["value"] < 3.0
        assert coefficients["random_walk"]["unit"] == "deg/sqrt(h)"
        # What a minute cannot support: null, a reason and a limit.
        for term in ("bias_instability", "rate_random_walk", "rate_ramp"):
            assert coefficients[term]["value"] is None
            assert coefficients[term]["reason"]
            assert coefficients[term]["upper"] > 0
        assert "record below" in doc["axes"][name]["gauss_markov"]["reason"]
    assert doc["window"]["start_s"] >= 0.49


def test_without_a_file_the_tables_go_to_standard_output(capsys, xsens):
    status, out, _ = run(capsys, "allan", xsens, "--axes", "gyro_z,gyro_x", "--quiet")
    assert status == 0
    assert "gyro_x   N random walk" in out.replace("gyro_x  N", "gyro_x   N")
    assert "gyro_y" not in out
    assert "  < " in out
    assert "Allan deviation (oadev)" in out


def test_the_same_input_gives_the_same_bytes(capsys, tmp_path, xsens):
    files = [tmp_path / name for name in ("a.json", "b.json")]
    for path in files:
        run(capsys, "allan", xsens, "-o", path, "--taus", "octave", "--estimator", "totdev")
    assert files[0].read_bytes() == files[1].read_bytes()
    assert json.loads(files[0].read_text())["estimator"] == "totdev"


def test_plot_and_rig_are_written(capsys, tmp_path, xsens):
    rig, figure = tmp_path / "rig.toml", tmp_path / "a.svg"
    rig.write_text("[imu]\nname = 'x'  # kept\n")
    status, _, err = run(
        capsys, "allan", xsens, "-o", tmp_path / "a.json", "--plot", figure, "--to-rig", rig
    )
    assert status == 0
    assert "angle_random_walk" in rig.read_text()
    assert "# kept" in rig.read_text()
    assert figure.stat().st_size > 10_000
    assert f"{rig}: [imu] angle_random_walk, " in err


def test_a_gap_is_reported_and_the_segments_are_pooled(capsys, tmp_path):
    n = 6000
    values = np.random.default_rng(0).standard_normal((n, 6)) * 1e-3
    values[:, 5] += 9.81
    keep = np.r_[0:2000, 2300:n]
    path = tmp_path / "imu.csv"
    columns = {"time": 0.01 * keep}
    names = [f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"]
    columns |= {name: values[keep, k] for k, name in enumerate(names)}
    write_columns(path, columns)
    status, _, err = run(capsys, "allan", path, "-o", tmp_path / "a.json")
    assert status == 0
    assert "gaps (300 samples, first at 20 s) excluded. 57 s (95.0 %) from 0 to 59.99 s" in err
    doc = json.loads((tmp_path / "a.json").read_text())
    assert doc["samples"] == 5700
    assert any("gaps" in w for w in doc["warnings"])


@pytest.mark.parametrize(
    ("args", "status", "text"),
    [
        (["--window", "10:10.5"], 1, "an Allan deviation needs 100 or more"),
        (["--taus", "0.0333"], 1, "no integer multiple of the sample interval"),
        (["--taus", "40"], 1, "longer than half the record"),
        (["--taus", "some"], 2, "'some' is not octave, decade, all or times in seconds"),
        (["--axes", "gyro_w"], 2, "'gyro_w' must be one of gyro_x"),
        (["--estimator", "hdev"], 2, "hdev"),
        (["--plot", "a.gif"], 2, "not the name of a picture; name it .png"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(capsys, tmp_path, args, status, text, xsens):
    path = tmp_path / "a.json"
    found, out, err = run(capsys, "allan", xsens, "-o", path, "--quiet", *args)
    assert (found, out) == (status, "")
    assert text in err
    assert "Traceback" not in err
    if status == 1:
        assert err.startswith("rotcli: error: ")
        assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
