"""`rotcli triad` on recorded logs, logs by hand, and calibrations of single axes."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from rotcli.models.triad import parameters as p
from rotcli.models.triad.conventions import convert
from rotcli.rig.profile import read_profile
from tests.cli.measure.triad_runs import QUIET, calibrate_triad

_SHARED = Path(os.environ.get("ROTCLI_SHARED", Path(__file__).parents[4] / "shared"))


_XSENS = _SHARED / "data" / "xsens_mti_multiposition.csv"


_PSINS = _SHARED / "data" / "psins_19position" / "x"


def test_three_single_axis_calibrations_merge_into_one(rotcli, tmp_path):
    paths = []
    for axis in "xyz":
        folder = tmp_path / axis
        done = rotcli("simulate", "--imu", "nav440", "--rate", "60", "--axis", axis, "--seed", "5",
                      "--navigation", "0", "-o", folder)  # fmt: skip
        assert done.status == 0, done.err
        out = folder / "c.json"
        done = rotcli("calibrate", folder / "imu.parquet", folder / "table.parquet", "-o", out)
        assert done.status == 0, done.err
        paths.append(out)
    done = rotcli("triad", "--merge", *paths, "-o", tmp_path / "m.json")
    assert done.status == 0, done.err
    doc = json.loads((tmp_path / "m.json").read_text())
    gyro = read_profile("nav440").gyro
    for k, name in enumerate(list(doc["parameters"])[:9]):
        entry = doc["parameters"][name]
        assert abs(entry["value"] - gyro.matrix.ravel()[k] * 1e6) < 5.0 * entry["sigma"]
    assert len(doc["inputs"]) == 6
    done = rotcli("triad", "--merge", paths[0], paths[0], paths[1])
    assert done.status == 1
    assert "do not span space" in done.err


@pytest.mark.skipif(not _XSENS.exists(), reason=f"recorded log {_XSENS} is absent")
def test_the_recorded_log_is_calibrated_by_hand(rotcli, tmp_path):
    done = rotcli("triad", _XSENS, "-o", tmp_path / "x.json")
    assert done.status == 0, done.err
    doc = json.loads((tmp_path / "x.json").read_text())
    assert doc["method"] == "hand-held"
    assert doc["details"]["carried_rms_held_out_deg"] < 0.2
    assert "[site] is missing" in done.err


@pytest.mark.skipif(not _PSINS.exists(), reason=f"set {_PSINS} is absent")
def test_the_published_set_is_within_half_a_ppm(rotcli, tmp_path):
    done = rotcli("triad", _PSINS / "imu.parquet", _PSINS / "table.csv.gz", "--parameters",
                  "N,d,eps", "-o", tmp_path / "p.json")  # fmt: skip
    assert done.status == 0, done.err
    found = json.loads((tmp_path / "p.json").read_text())["parameters"]
    for name, value in (("Kgx", -10.0), ("Kgyx", 145.44), ("Kgzx", 242.41)):
        assert found[name]["value"] == pytest.approx(value, abs=0.5)
    for axis, value in zip("xyz", (-0.1, -0.2, -0.3), strict=True):
        assert found[f"bias_{axis}"]["value"] == pytest.approx(value, abs=0.05)


def test_one_vertical_axis_shows_one_column_the_biases_and_says_what_it_assumes(rotcli, tmp_path):
    (tmp_path / "quiet.toml").write_text(QUIET)
    (tmp_path / "errors.toml").write_text(
        "Kgz = 900\nKgxz = -400\nKgyz = 300\nbias_x = 50\nbias_y = -30\nbias_z = 20\n"
    )
    steps = "".join(f"[[steps]]\ngo = [{a}]\n[[steps]]\nhold = 20\n" for a in (0, 90, 180, 270))
    spin = "[[steps]]\ngo = [0]\n[[steps]]\nspin = 'axis'\nrate = 60\nturns = 5\n"
    (tmp_path / "one.toml").write_text("axes = ['z']\n" + steps + spin)
    names = ("--sequence", tmp_path / "one.toml", "--imu", tmp_path / "quiet.toml")
    done = rotcli("simulate", *names, "--errors", tmp_path / "errors.toml", "-o", tmp_path / "run")
    assert done.status == 0, done.err
    doc, done = calibrate_triad(rotcli, tmp_path / "run")
    assert doc["rank"] == 24
    assert doc["convention"] == "table"
    assert "Zero is assumed" in done.err
    found = doc["parameters"]
    wanted = {"Kgz": 900, "Kgxz": -400, "Kgyz": 300, "bias_x": 50, "bias_y": -30, "bias_z": 20}
    for name, value in wanted.items():
        assert abs(found[name]["value"] - value) < 4.5 * found[name]["sigma"]
    for name in ("Kgx", "Kay", "gsens_zz", "Ka2_z", "clock_accel"):
        assert found[name]["value"] is None
        assert "does not show" in found[name]["reason"]


def test_three_mountings_by_hand_about_a_horizontal_axis_show_both_triads(rotcli, tmp_path):
    (tmp_path / "quiet.toml").write_text(QUIET)
    mounts = ("[[0,1,0],[-1,0,0],[0,0,1]]", "[[0,0,1],[0,1,0],[-1,0,0]]")
    text = "axes = ['x']\n"
    for m in (1, 2, 3):
        text += f"[[steps]]\nmount = {m}\n"
        for a in range(0, 360, 90):
            text += f"[[steps]]\ngo = [{a}]\n[[steps]]\nhold = 10\n"
        text += "[[steps]]\ngo = [0]\n[[steps]]\nspin = 'axis'\nrate = 60\nturns = 4\n"
    text += "".join(f"[[mountings]]\nmount = {m}\n" for m in mounts)
    (tmp_path / "three.toml").write_text(text)
    names = ("--sequence", tmp_path / "three.toml", "--imu", tmp_path / "quiet.toml")
    run = tmp_path / "run"
    done = rotcli("simulate", *names, "--errors", "typical", "--seed", "4", "-o", run)
    assert done.status == 0, done.err
    doc, _ = calibrate_triad(rotcli, run)
    assert doc["convention"] == "accelerometer"
    assert any("rotation of all sensor axes" in d["text"] for d in doc["null_directions"])
    truth = json.loads((run / "truth.json").read_text())["errors"]
    x = np.array([truth[n]["value"] for n in p.names(3)]) * p.unit_factors(3)
    expected = convert(x, "accelerometer").x / p.unit_factors(3)
    for k, name in enumerate(p.NAMES[: p.ACCEL_BIAS.stop]):
        entry = doc["parameters"].get(name)
        if entry and entry["sigma"]:
            assert entry["value"] is not None, name
            assert abs(entry["value"] - expected[k]) < 4.5 * entry["sigma"], name
