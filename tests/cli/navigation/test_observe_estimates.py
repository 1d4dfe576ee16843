"""`rotcli observe`: which estimates are reliable, and which of them are saved."""

import json

import numpy as np
import pytest

from tests.cli.navigation.observe_runs import logs, rotcli


@pytest.mark.parametrize("case", ["still", "level z"])
def test_the_tool_itself_says_which_estimates_must_not_be_used(capsys, tmp_path, case):
    rate = "0" if case == "still" else "10"
    simulate = f"simulate --imu mti-g --rate {rate} --static 0 --rotation 0 --navigation 60 --quiet"
    assert rotcli(capsys, *simulate.split(), "-o", tmp_path)[0] == 0
    _, out, _ = rotcli(capsys, "observe", *logs(tmp_path), "-o", "-")
    bad = json.loads(out)["filter"]["not_to_be_used"]
    hidden = {"azimuth", "gyro_bias_z"}
    joint = {"tilt_east", "tilt_north", "accel_bias_x", "accel_bias_y"}
    joint |= {"gyro_bias_x", "gyro_bias_y"} if case == "level z" else set()
    assert hidden | joint <= set(bad)
    assert "accel_bias_z" not in bad
    assert "unobservable with this motion" in bad["gyro_bias_z"]
    assert "observable only in the combination accel_bias_x + g*eps_N" in bad["accel_bias_x"]
    _, out, _ = rotcli(capsys, "observe", *logs(tmp_path))
    assert "no: unobservable with this motion" in out


def test_every_estimate_says_whether_it_is_to_be_used_and_only_those_are_saved(capsys, tmp_path):
    make = "simulate --imu nav440 --pitch 30 --rate 20 --static 0 --rotation 0 --navigation 60"
    assert rotcli(capsys, *make.split(), "--quiet", "-o", tmp_path)[0] == 0
    rig, saved = tmp_path / "rig.toml", tmp_path / "saved.json"
    text = [line for line in rig.read_text().splitlines() if "scale_sigma" not in line]
    rig.write_text("\n".join(text))
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), "--save-calibration", saved)
    assert status == 0
    assert "3000 ppm is assumed" in err
    assert "not saved, unreliable: bias_x, bias_y, bias_z" in err
    rows = [
        line for line in out.splitlines() if line.startswith(("accel_bias_", "gyro_bias_", "Kg"))
    ]
    assert len(rows) == 9
    assert all(" yes" in row or " no: " in row for row in rows)
    read = json.loads(saved.read_text())
    assert set(read["parameters"]) == {f"accel_bias_{a}" for a in "xyz"}
    assert "a single rate does not separate it from Kgz" in read["left_out"]["bias_z"]
    status, _, err = rotcli(
        capsys, "navigate", *logs(tmp_path), "--mode", "partial", "--calibration", saved
    )
    assert status == 0, err
    assert "saved.json: contains no bias_x, bias_y, bias_z: not corrected" in err
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), "--sigma-scale", "0")
    assert status == 0
    assert "Kgz" not in out
    assert "no states of scale factor and installation errors: 1000 ppm" in err


def test_an_estimated_scale_factor_is_saved_and_nothing_at_all_is_refused(capsys, tmp_path):
    scenario, saved = tmp_path / "s.toml", tmp_path / "saved.json"
    legs = "".join(f"[[leg]]\nduration = 40.0\nrate = {rate}\n" for rate in (0.0, 20.0, -20.0))
    scenario.write_text(f'profile = "nav440"\n[attitude]\npitch = 30.0\nroll = 0.0\n{legs}')
    assert rotcli(capsys, "simulate", "--scenario", scenario, "--quiet", "-o", tmp_path)[0] == 0
    rest = ("--sigma-scale", "3000", "--save-calibration", saved, "-o", "-")
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), *rest)
    assert status == 0, err
    read, truth = json.loads(saved.read_text())["parameters"], (-1100.0, 800.0, 1200.0)
    for name, true in zip(("Kgxz", "Kgyz", "Kgz"), truth, strict=True):
        assert read[name]["unit"] == "ppm"
        assert abs(read[name]["value"] - true) < 4.0 * read[name]["sigma"]
        shown = json.loads(out)["filter"]["estimates"][name]
        assert read[name]["value"] == pytest.approx(shown["value"], rel=1e-12)
    before = saved.read_bytes()
    harsh = ("--sigma-measurement", "1e-4", *rest)
    rig = tmp_path / "rig.toml"
    lines = [x for x in rig.read_text().splitlines() if "random_walk" not in x]
    tight = "angle_random_walk = 0.04\nvelocity_random_walk = 0.003"
    rig.write_text("\n".join(lines).replace("[imu]", f"[imu]\n{tight}"))
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), *harsh)
    assert (status, out) == (1, "")
    assert "no bias estimate is reliable; no calibration is written" in err
    assert saved.read_bytes() == before


def test_a_lever_arm_is_estimated_by_name(capsys, tmp_path):
    scenario = tmp_path / "s.toml"
    scenario.write_text(
        'profile = "mti-g"\n[attitude]\npitch = 30.0\nroll = 0.0\nazimuth = 0.0\n'
        '[table]\naxis = "y"\n[imu]\nlever_arm = [0.06, 0.0, -0.04]\n'
        "[[leg]]\nduration = 40.0\nrate = 20.0\n[[leg]]\nduration = 40.0\nrate = 90.0\n"
    )
    assert rotcli(capsys, "simulate", "--scenario", scenario, "--quiet", "-o", tmp_path)[0] == 0
    rig = tmp_path / "rig.toml"
    rig.write_text(rig.read_text().replace("[0.06, 0.0, -0.04]", "[0.0, 0.0, 0.0]"))
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), "--estimate-lever-arm", "-o", "-")
    assert status == 0, err
    found = json.loads(out)["filter"]["estimates"]
    for name, true in (("lever_arm_x", 0.06), ("lever_arm_z", -0.04)):
        assert found[name]["unit"] == "m"
        assert found[name]["value"] == pytest.approx(true, abs=2e-3)
    assert "lever_arm_y" not in found


def test_estimates_do_not_depend_on_how_the_table_counts(capsys, tmp_path):
    found = []
    for direction in ("1", "-1"):
        folder = tmp_path / direction
        make = "simulate --imu ideal --axis y --pitch 30 --rate 20 --static 0 --rotation 0"
        make += f" --navigation 30 --direction {direction} --quiet"
        assert rotcli(capsys, *make.split(), "-o", folder)[0] == 0
        out = rotcli(capsys, "observe", *logs(folder), "-o", "-")[1]
        estimates = json.loads(out)["filter"]["estimates"]
        found.append(
            [estimates[f"{s}_bias_{a}"]["value"] for s in ("accel", "gyro") for a in "xyz"]
        )
    np.testing.assert_allclose(found[0], found[1], atol=1e-3)
    assert np.abs(found[0]).max() < 0.05  # an ideal IMU has no biases: deg/h, m/s^2
